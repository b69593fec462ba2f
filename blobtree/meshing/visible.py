"""Which of the meetings of a patch's branches its vertex goes to: on the surface, real, and this cell's."""

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.branches import branch_at
from blobtree.meshing.meeting import (
    ARRIVED,
    FAILED,
    MOST_BRANCHES,
    References,
    crease_tangent,
    distance_to_surface,
    inside_cell,
    meet_in_cell,
    outside_by,
    reference_of,
)
from blobtree.meshing.sheets import Sheets, cell_corner, explains, row_of
from blobtree.sparse.blocks import find_block
from blobtree.sparse.grid import BRANCHING
from blobtree.tapes.evaluate import field_value

wp.set_module_options(KERNEL_OPTIONS)

ON_SURFACE = 0.01
"""How far from the surface, in cells, branches may meet without being hidden behind another one."""

BESIDE = 0.1
"""How far beside a crease, in cells, its branches are to be found on the surface."""

ACTIVE = 1e-3
"""Distance from a branch to the surface beside a crease, in cells, up to which it is the surface."""

_MEETINGS = (15, 14, 13, 11, 7, 12, 10, 9, 6, 5, 3, 8, 4, 2, 1)
"""Sets of branches as bits, larger ones first: a corner comes before creases, a crease before one sheet."""

_MEETING = wp.types.vector(length=len(_MEETINGS), dtype=wp.int32)(*_MEETINGS)


@wp.struct
class Cells:
    """The cells of a surface: blocks with their pruned tapes, and the whole tape for what lies in none."""

    blocks: wp.array(dtype=wp.vec3i)
    keys: wp.array(dtype=wp.int64)
    spans: wp.array(dtype=wp.vec2i)
    tape: wp.array(dtype=wp.vec4)
    base: wp.vec3i
    corner: wp.vec3
    cell: wp.float32
    whole: wp.array(dtype=wp.vec4)


@wp.struct
class Meeting:
    """Where branches meet: which ones as bits, 0 where none were found to, and the branches."""

    members: wp.int32
    place: wp.vec3
    references: References


@wp.func
def bits(number: wp.int32) -> wp.int32:
    """How many of the lowest MOST_BRANCHES bits are set."""
    total = int(0)
    for k in range(MOST_BRANCHES):
        total += (number >> k) & 1
    return total


@wp.func
def block_at(p: wp.vec3, cells: Cells) -> wp.int32:
    """The block that p lies in, −1 where there is none."""
    place = (p - cells.corner) / (cells.cell * float(BRANCHING))
    block = wp.vec3i(int(wp.floor(place[0])), int(wp.floor(place[1])), int(wp.floor(place[2])))
    return find_block(block - cells.base, cells.keys)


@wp.func
def gap_at(p: wp.vec3, cells: Cells) -> wp.float32:
    """Distance of p to the surface in cells, by the tape of its block or, where there is none, the whole."""
    block = block_at(p, cells)
    if block < 0:
        return distance_to_surface(p, cells.whole, wp.vec2i(0, cells.whole.shape[0])) / cells.cell
    return distance_to_surface(p, cells.tape, cells.spans[block]) / cells.cell


@wp.func
def value_at(p: wp.vec3, cells: Cells) -> wp.float32:
    """Field at p, likewise."""
    block = block_at(p, cells)
    if block < 0:
        return field_value(p, cells.whole, wp.vec2i(0, cells.whole.shape[0]))
    return field_value(p, cells.tape, cells.spans[block])


@wp.func
def is_active(
    x: wp.vec3, references: References, members: wp.int32, k: wp.int32, cells: Cells, span: wp.vec2i
) -> wp.bool:
    """Whether branch k is the surface somewhere beside the place x where the members meet.

    Beside a crease there are two ways to go on its tangent plane; around a corner twelve are tried.
    """
    branch = branch_at(x, reference_of(references, k), cells.tape, span)
    normal = wp.normalize(wp.vec3(branch[3], branch[4], branch[5]))
    u = wp.normalize(wp.cross(normal, wp.vec3(normal[1], normal[2], -normal[0])))
    ways = int(12)
    if bits(members) == 2:
        ways = 2
        u = wp.normalize(wp.cross(normal, crease_tangent(x, references, members, cells.tape, span)))
    v = wp.cross(normal, u)
    for way in range(ways):
        angle = 2.0 * wp.pi * float(way) / float(ways)
        y = x + (u * wp.cos(angle) + v * wp.sin(angle)) * (BESIDE * cells.cell)
        there = branch_at(y, reference_of(references, k), cells.tape, span)
        steepness = wp.length(wp.vec3(there[3], there[4], there[5]))
        if wp.abs(value_at(y, cells) - there[2]) <= ACTIVE * cells.cell * steepness:
            return True
    return False


@wp.func
def all_active(
    x: wp.vec3, references: References, members: wp.int32, cells: Cells, span: wp.vec2i
) -> wp.bool:
    """Whether every one of the branches that meet in x is the surface beside it."""
    if bits(members) == 1:
        return True
    for k in range(MOST_BRANCHES):
        if ((members >> k) & 1) == 1:  # noqa: SIM102  (Warp evaluates both sides of `and`)
            if not is_active(x, references, members, k, cells, span):
                return False
    return True


@wp.func
def is_ours(x: wp.vec3, low: wp.vec3, cells: Cells) -> wp.bool:
    """Whether a corner at x is this cell's: inside it, or behind its face in a cell that the surface misses.

    Of such a cell's neighbours the one whose face is nearest takes the corner.
    """
    if inside_cell(x, low, cells.cell):
        return True
    neighbour = low
    depth = float(0.0)
    axes = int(0)
    for axis in range(3):
        outside = outside_by(x, low, cells.cell, axis)
        if outside != 0.0:
            axes += 1
            depth = wp.abs(outside)
            neighbour[axis] = neighbour[axis] + wp.sign(outside) * cells.cell
    if axes > 1 or depth > 0.5:
        return False
    for axis in range(3):
        place = (x[axis] - neighbour[axis]) / cells.cell
        if wp.min(place, 1.0 - place) < depth - ON_SURFACE:
            return False
    inside = int(0)
    for corner in range(8):
        if value_at(cell_corner(neighbour, cells.cell, corner), cells) >= ISO:
            inside += 1
    return inside == 0 or inside == 8


@wp.func
def newcomer_along(meeting: Meeting, low: wp.vec3, cells: Cells, span: wp.vec2i) -> wp.vec4:
    """A point in the cell, on a crease's tangent, where neither of its branches is active; and whether any.

    There the crease has ended in a corner.
    """
    x = meeting.place
    cell = cells.cell
    tangent = crease_tangent(x, meeting.references, meeting.members, cells.tape, span)
    for side in range(2):
        way = tangent * (1.0 - 2.0 * float(side))
        reach = float(2.0) * cell
        for axis in range(3):
            if way[axis] > 0.0:
                reach = wp.min(reach, (low[axis] + cell - x[axis]) / way[axis])
            elif way[axis] < 0.0:
                reach = wp.min(reach, (low[axis] - x[axis]) / way[axis])
        y = x + way * reach
        active = bool(reach <= 0.0)
        for k in range(MOST_BRANCHES):
            member = ((meeting.members >> k) & 1) == 1
            if member and explains(reference_of(meeting.references, k), y, cell, cells.tape, span):
                active = True
        if not active:
            return wp.vec4(y[0], y[1], y[2], 1.0)
    return wp.vec4()


@wp.func
def meet_visibly(sheets: Sheets, low: wp.vec3, cells: Cells, span: wp.vec2i) -> Meeting:
    """The meeting of most sheets, of several the one nearest to their middle, that lies on the surface.

    A branch that no crossing lies on joins in where it hides all meetings, or ends the crease. One sheet is a
    place in its middle, and several come down to one where nothing else is found.
    """
    meeting = Meeting()
    start = wp.vec3()
    for k in range(sheets.count):
        start += row_of(sheets.sums, k) / float(sheets.hits[k] * sheets.count)
        meeting.references[k] = row_of(sheets.references, k)
    count = sheets.count
    nearest = float(FAILED)
    newcomer = wp.vec4()
    for attempt in range(2):
        for m in range(wp.static(len(_MEETINGS))):
            members = _MEETING[m]
            number = bits(members)
            allowed = number > 1 or sheets.count == 1 or attempt == 1
            if allowed and members < (1 << count) and number >= bits(meeting.members):
                x = meet_in_cell(start, meeting.references, members, low, cells.cell, cells.tape, span)
                p = wp.vec3(x[0], x[1], x[2])
                better = number > bits(meeting.members) or wp.length(p - start) < nearest
                if x[3] <= ARRIVED and better and (number < 3 or is_ours(p, low, cells)):
                    if gap_at(p, cells) > ON_SURFACE:
                        newcomer = wp.vec4(x[0], x[1], x[2], 1.0)
                    elif all_active(p, meeting.references, members, cells, span):
                        nearest = wp.length(p - start)
                        meeting.members = members
                        meeting.place = p
        if attempt == 0:
            if bits(meeting.members) == 2:
                newcomer = newcomer_along(meeting, low, cells, span)
            if meeting.members > 0 and (newcomer[3] == 0.0 or bits(meeting.members) != 2):
                break
            if newcomer[3] > 0.0 and count < MOST_BRANCHES:
                meeting.references[count] = wp.vec3(newcomer[0], newcomer[1], newcomer[2])
                count += 1
    return meeting
