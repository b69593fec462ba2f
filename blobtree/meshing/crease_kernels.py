"""Kernels that move vertices onto creases and corners, and choose the diagonals of the quads beside them."""

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, child_offset, grid_point
from blobtree.cells.grid import CHILDREN
from blobtree.device import KERNEL_OPTIONS
from blobtree.meshing.crease_branches import has_choice
from blobtree.meshing.crease_intersections import mean_normal
from blobtree.meshing.crease_sheets import CornerValues, cell_corner, gather_sheets, without_duplicates
from blobtree.meshing.crease_visibility import member_count, visible_intersection
from blobtree.meshing.dual_kernels import CellPatches, sample_index
from blobtree.meshing.local_field import distance_at
from blobtree.meshing.vertex_kernels import VertexArrays
from blobtree.tape.interpreter import field_color, field_value

wp.set_module_options(KERNEL_OPTIONS)

SMOOTH_VERTEX = 1
"""Sheet count of a vertex in a smooth patch."""

UNRESOLVED_VERTEX = 0
"""Sheet count of a vertex whose patch has several sheets without an intersection nearby."""


@wp.kernel
def find_choices(
    first: wp.int32,
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    choosing: wp.array(dtype=wp.uint8),
) -> None:
    """Write 1 for each block whose tape has an operator with kinks, 0 for the others."""
    i = first + wp.tid()
    choosing[i] = wp.uint8(0)
    if has_choice(tape, spans[i]):
        choosing[i] = wp.uint8(1)


@wp.kernel
def move_onto_creases(
    first: wp.int32,
    cells: CellBlocks,
    choosing: wp.array(dtype=wp.uint8),
    patches: CellPatches,
    patch_count: wp.array(dtype=wp.int8),
    vertices: VertexArrays,
    sheet_counts: wp.array(dtype=wp.uint8),
) -> None:
    """Move the vertices of a cell's patches onto the crease or the corner that the patch contains."""
    i = first + wp.tid()
    block = i // CHILDREN
    row = int(patches.rows[i])
    if choosing[block] == wp.uint8(0) or int(patch_count[row]) == 0:
        return
    span = cells.spans[block]
    tape = cells.tape
    offset = child_offset(i % CHILDREN)
    lowest = sample_index(cells.base + cells.blocks[block], offset[0], offset[1], offset[2])
    low = grid_point(lowest, cells.corner, cells.cell)
    values = CornerValues()
    for c in range(8):
        values[c] = field_value(cell_corner(low, cells.cell, c), tape, span)
    for patch in range(int(patch_count[row])):
        sheets = gather_sheets(patch, row, patches.patch_of_edge, low, cells.cell, values, tape, span)
        if sheets.count >= 2:
            sheets = without_duplicates(sheets, cells.cell, tape, span)
        vertex = patches.vertex_starts[block] + int(patches.offsets[i]) + patch
        intersection = visible_intersection(sheets, low, cells, span)
        if intersection.members > 0:
            p = intersection.position
            color = field_color(p, tape, span)
            vertices.positions[vertex] = p
            vertices.normals[vertex] = mean_normal(
                p, intersection.references, intersection.members, tape, span
            )
            vertices.colors[vertex] = wp.vec3(color[1], color[2], color[3])
        number = member_count(intersection.members)
        if number == 1 and sheets.count > 1:
            number = UNRESOLVED_VERTEX
        sheet_counts[vertex] = wp.uint8(number)


@wp.kernel
def turn_diagonals(
    first: wp.int32,
    cells: CellBlocks,
    positions: wp.array(dtype=wp.vec3),
    sheet_counts: wp.array(dtype=wp.uint8),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """Split quads with a vertex on a crease along the diagonal whose midpoint lies nearer to the surface."""
    i = first + wp.tid()
    quad = wp.vec4i(faces[2 * i][0], faces[2 * i][1], faces[2 * i][2], faces[2 * i + 1][2])
    sharp = bool(False)
    for k in range(4):
        if sheet_counts[quad[k]] > wp.uint8(SMOOTH_VERTEX):
            sharp = True
    if not sharp:
        return
    ac = 0.5 * (positions[quad[0]] + positions[quad[2]])
    bd = 0.5 * (positions[quad[1]] + positions[quad[3]])
    if distance_at(bd, cells) < distance_at(ac, cells):
        faces[2 * i] = wp.vec3i(quad[1], quad[2], quad[3])
        faces[2 * i + 1] = wp.vec3i(quad[1], quad[3], quad[0])
