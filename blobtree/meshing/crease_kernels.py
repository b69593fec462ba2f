"""Kernels that move vertices onto creases and corners, and choose the diagonals of the quads beside them.

A vertex moves to the intersection of its patch's sheets that is visible on the surface, and in its cell.
"""

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, child_offset, grid_point
from blobtree.cells.grid import CHILDREN
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.crease_branches import branch_at, has_choice
from blobtree.meshing.crease_intersections import (
    CONVERGED_STEP,
    FAILED,
    MAX_BRANCHES,
    References,
    crease_tangent,
    distance_outside,
    inside_cell,
    intersect_in_cell,
    mean_normal,
    member_count,
    reference_of,
)
from blobtree.meshing.crease_sheets import (
    CornerValues,
    Sheets,
    cell_corner,
    continues,
    gather_sheets,
    row_of,
    without_duplicates,
)
from blobtree.meshing.distance_kernels import distance_at, value_at
from blobtree.meshing.dual_kernels import CellPatches, sample_index
from blobtree.meshing.vertex_kernels import VertexArrays
from blobtree.tape.interpreter import field_color, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

SMOOTH_VERTEX = 1
"""Sheet count of a vertex in a smooth patch."""

UNRESOLVED_VERTEX = 0
"""Sheet count of a vertex whose patch has several sheets without an intersection nearby."""

MAX_HIDDEN_DISTANCE = 0.002
"""Distance of an intersection to the surface, in cells, from which another branch hides it."""

PROBE_DISTANCE = 0.1
"""Distance from an intersection, in cells, of the points at which its branches are tested."""

MAX_ACTIVE_DISTANCE = 1e-3
"""Distance of a branch to the surface at such a point, in cells, up to which the branch is active."""

_MEMBER_SETS = (15, 14, 13, 11, 7, 12, 10, 9, 6, 5, 3, 8, 4, 2, 1)
"""Sets of branches as bits, larger ones first: corners before creases, creases before single sheets."""

_MEMBER_SET = wp.types.vector(length=len(_MEMBER_SETS), dtype=wp.int32)(*_MEMBER_SETS)


@wp.struct
class Intersection:
    """A point where branches meet."""

    members: wp.int32
    """The branches that meet, as bits; 0 if there is no intersection."""
    position: wp.vec3
    references: References
    """A point of each branch, members or not."""


@wp.func
def is_active(
    x: wp.vec3, references: References, members: wp.int32, k: wp.int32, cells: CellBlocks, span: wp.vec2i
) -> wp.bool:
    """Return True if branch k is the surface at some point beside x, where the members meet.

    The points lie on the branch's tangent plane: one on either side of a crease, twelve around a corner.
    """
    branch = branch_at(x, reference_of(references, k), cells.tape, span)
    normal = wp.normalize(wp.vec3(branch[3], branch[4], branch[5]))
    u = wp.normalize(wp.cross(normal, wp.vec3(normal[1], normal[2], -normal[0])))
    directions = int(12)
    if member_count(members) == 2:
        directions = 2
        u = wp.normalize(wp.cross(normal, crease_tangent(x, references, members, cells.tape, span)))
    v = wp.cross(normal, u)
    for number in range(directions):
        angle = 2.0 * wp.pi * float(number) / float(directions)
        y = x + (u * wp.cos(angle) + v * wp.sin(angle)) * (PROBE_DISTANCE * cells.cell)
        probe = branch_at(y, reference_of(references, k), cells.tape, span)
        steepness = wp.length(wp.vec3(probe[3], probe[4], probe[5]))
        if wp.abs(value_at(y, cells) - probe[2]) <= MAX_ACTIVE_DISTANCE * cells.cell * steepness:
            return True
    return False


@wp.func
def all_active(
    x: wp.vec3, references: References, members: wp.int32, cells: CellBlocks, span: wp.vec2i
) -> wp.bool:
    """Return True if each of the members is the surface at some point beside x."""
    if member_count(members) == 1:
        return True
    for k in range(MAX_BRANCHES):
        if ((members >> k) & 1) == 1:  # noqa: SIM102  (Warp evaluates both sides of `and`)
            if not is_active(x, references, members, k, cells, span):
                return False
    return True


@wp.func
def belongs_to_cell(x: wp.vec3, low: wp.vec3, cells: CellBlocks) -> wp.bool:
    """Return True if a corner at x belongs to this cell.

    It does inside the cell, and in a neighbour without crossed edges whose nearest face is this cell's.
    """
    if inside_cell(x, low, cells.cell):
        return True
    neighbour = low
    depth = float(0.0)
    axes = int(0)
    for axis in range(3):
        outside = distance_outside(x, low, cells.cell, axis)
        if outside != 0.0:
            axes += 1
            depth = wp.abs(outside)
            neighbour[axis] = neighbour[axis] + wp.sign(outside) * cells.cell
    if axes > 1 or depth > 0.5:
        return False
    for axis in range(3):
        t = (x[axis] - neighbour[axis]) / cells.cell
        if wp.min(t, 1.0 - t) < depth - MAX_HIDDEN_DISTANCE:
            return False
    inside = int(0)
    for corner in range(8):
        if value_at(cell_corner(neighbour, cells.cell, corner), cells) >= ISO:
            inside += 1
    return inside == 0 or inside == 8


@wp.func
def end_of_crease(crease: Intersection, low: wp.vec3, cells: CellBlocks, span: wp.vec2i) -> wp.vec4:
    """Return a point in the cell, on a crease's tangent, where no member is active, and 1; or 0 if none.

    Before such a point the crease ends in a corner, where it meets another branch.
    """
    x = crease.position
    cell = cells.cell
    tangent = crease_tangent(x, crease.references, crease.members, cells.tape, span)
    for side in range(2):
        direction = tangent * (1.0 - 2.0 * float(side))
        distance = float(2.0) * cell
        for axis in range(3):
            if direction[axis] > 0.0:
                distance = wp.min(distance, (low[axis] + cell - x[axis]) / direction[axis])
            elif direction[axis] < 0.0:
                distance = wp.min(distance, (low[axis] - x[axis]) / direction[axis])
        y = x + direction * distance
        active = bool(distance <= 0.0)
        for k in range(MAX_BRANCHES):
            member = ((crease.members >> k) & 1) == 1
            if member and continues(reference_of(crease.references, k), y, cell, cells.tape, span):
                active = True
        if not active:
            return wp.vec4(y[0], y[1], y[2], 1.0)
    return wp.vec4()


@wp.func
def visible_intersection(sheets: Sheets, low: wp.vec3, cells: CellBlocks, span: wp.vec2i) -> Intersection:
    """Return the intersection of most sheets on the surface; of several, the one nearest to their middle.

    A branch without edge crossings is added if it hides all intersections or ends the crease. A single sheet
    gives the point in its middle, and so do several sheets without an intersection.
    """
    best = Intersection()
    middle = wp.vec3()
    for k in range(sheets.count):
        middle += row_of(sheets.sums, k) / float(sheets.hits[k] * sheets.count)
        best.references[k] = row_of(sheets.references, k)
    count = sheets.count
    nearest = float(FAILED)
    added = wp.vec4()  # a point of a branch without edge crossings, and 1
    for attempt in range(2):
        for m in range(wp.static(len(_MEMBER_SETS))):
            members = _MEMBER_SET[m]
            number = member_count(members)
            allowed = number > 1 or sheets.count == 1 or attempt == 1
            if allowed and members < (1 << count) and number >= member_count(best.members):
                x = intersect_in_cell(middle, best.references, members, low, cells.cell, cells.tape, span)
                p = wp.vec3(x[0], x[1], x[2])
                better = number > member_count(best.members) or wp.length(p - middle) < nearest
                if x[3] <= CONVERGED_STEP and better and (number < 3 or belongs_to_cell(p, low, cells)):
                    if distance_at(p, cells) > MAX_HIDDEN_DISTANCE:
                        added = wp.vec4(x[0], x[1], x[2], 1.0)
                    elif all_active(p, best.references, members, cells, span):
                        nearest = wp.length(p - middle)
                        best.members = members
                        best.position = p
        if attempt == 0:
            if member_count(best.members) == 2:
                added = end_of_crease(best, low, cells, span)
            if best.members > 0 and (added[3] == 0.0 or member_count(best.members) != 2):
                break
            if added[3] > 0.0 and count < MAX_BRANCHES:
                best.references[count] = wp.vec3(added[0], added[1], added[2])
                count += 1
    return best


@wp.kernel
def find_choices(
    first: wp.int32, spans: wp.array(dtype=wp.vec2i), tape: Texels, choosing: wp.array(dtype=wp.uint8)
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
