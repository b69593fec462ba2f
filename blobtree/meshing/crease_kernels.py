"""Kernels that take vertices onto creases and corners, and turn the diagonals of the quads beside them."""

import warp as wp

from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.branches import has_choice
from blobtree.meshing.dual import corner_place
from blobtree.meshing.meeting import mean_normal
from blobtree.meshing.sheets import CornerValues, cell_corner, gather_sheets, without_doubles
from blobtree.meshing.visible import Cells, bits, gap_at, meet_visibly
from blobtree.sparse.blocks import child_place, grid_point
from blobtree.sparse.grid import CHILDREN
from blobtree.tapes.evaluate import field_color, field_value

wp.set_module_options(KERNEL_OPTIONS)

SMOOTH = 1
UNMET = 0
"""What a vertex counts as: in a smooth patch, or in one whose branches were not found to meet; from two
upwards the number of branches that meet in it."""


@wp.kernel
def find_choices(
    first: wp.int32,
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    choosing: wp.array(dtype=wp.uint8),
) -> None:
    """Which blocks' tapes have operators with kinks."""
    i = first + wp.tid()
    choosing[i] = wp.uint8(0)
    if has_choice(tape, spans[i]):
        choosing[i] = wp.uint8(1)


@wp.kernel
def place_on_creases(
    first: wp.int32,
    cells: Cells,
    choosing: wp.array(dtype=wp.uint8),
    rows: wp.array(dtype=wp.int16),
    patch_count: wp.array(dtype=wp.int8),
    patch_of_edge: wp.array(dtype=wp.int8),
    offsets: wp.array(dtype=wp.uint8),
    vertex_starts: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    colors: wp.array(dtype=wp.vec3),
    meetings: wp.array(dtype=wp.uint8),
) -> None:
    """Take the vertices of a cell's patches that hold a crease or a corner onto it."""
    i = first + wp.tid()
    block = i // CHILDREN
    row = int(rows[i])
    if choosing[block] == wp.uint8(0) or int(patch_count[row]) == 0:
        return
    span = cells.spans[block]
    tape = cells.tape
    place = child_place(i % CHILDREN)
    lowest = corner_place(cells.base + cells.blocks[block], place[0], place[1], place[2])
    low = grid_point(lowest, cells.corner, cells.cell)
    values = CornerValues()
    for c in range(8):
        values[c] = field_value(cell_corner(low, cells.cell, c), tape, span)
    for patch in range(int(patch_count[row])):
        sheets = gather_sheets(patch, row, patch_of_edge, low, cells.cell, values, tape, span)
        if sheets.count >= 2:
            sheets = without_doubles(sheets, cells.cell, tape, span)
        vertex = vertex_starts[block] + int(offsets[i]) + patch
        meeting = meet_visibly(sheets, low, cells, span)
        if meeting.members > 0:
            p = meeting.place
            color = field_color(p, tape, span)
            positions[vertex] = p
            normals[vertex] = mean_normal(p, meeting.references, meeting.members, tape, span)
            colors[vertex] = wp.vec3(color[1], color[2], color[3])
        number = bits(meeting.members)
        if number == 1 and sheets.count > 1:
            number = UNMET
        meetings[vertex] = wp.uint8(number)


@wp.kernel
def turn_diagonals(
    first: wp.int32,
    cells: Cells,
    positions: wp.array(dtype=wp.vec3),
    meetings: wp.array(dtype=wp.uint8),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """Split quads with a vertex on a crease along the diagonal whose middle lies nearer to the surface."""
    i = first + wp.tid()
    quad = wp.vec4i(faces[2 * i][0], faces[2 * i][1], faces[2 * i][2], faces[2 * i + 1][2])
    sharp = bool(False)
    for k in range(4):
        if meetings[quad[k]] > wp.uint8(SMOOTH):
            sharp = True
    if not sharp:
        return
    here = 0.5 * (positions[quad[0]] + positions[quad[2]])
    there = 0.5 * (positions[quad[1]] + positions[quad[3]])
    if gap_at(there, cells) < gap_at(here, cells):
        faces[2 * i] = wp.vec3i(quad[1], quad[2], quad[3])
        faces[2 * i + 1] = wp.vec3i(quad[1], quad[3], quad[0])
