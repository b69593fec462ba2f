"""Where smooth branches of a field meet on the surface: Newton's method onto creases and corners.

Dual contouring (Ju et al. 2002) and the extended marching cubes (Kobbelt et al. 2001) guess the place of a
crease from planes through edge crossings. Here the branches themselves are known and can be continued beyond
the crease (`branches`), so each step meets their tangent planes, and a few steps find the place exactly.
"""

from typing import Any

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.branches import branch_at
from blobtree.tapes.evaluate import field_gradient

wp.set_module_options(KERNEL_OPTIONS)

MOST_BRANCHES = 4
"""Branches that may meet in one cell; a generic corner has three."""

NEWTON_STEPS = 12

ARRIVED = 2e-3
"""Length of the last step, in cells, at which branches meet."""

ROOM = 0.01
"""How far outside its cell, in cells, a vertex lies as good as inside."""

FARTHEST = 2.0
"""How far outside a cell, in cells, its crease may lie: thin wedges end beyond the cells that they cross."""

SMALLEST_SINE = 0.03
"""Of the angle between branches: below 2° there is no crease to speak of."""

FAILED = 1e9

References: Any = wp.types.matrix(shape=(MOST_BRANCHES, 3), dtype=wp.float32)
"""For every branch a point at which it is active."""


@wp.func
def reference_of(references: References, k: wp.int32) -> wp.vec3:
    """The point that stands for a branch."""
    return wp.vec3(references[k, 0], references[k, 1], references[k, 2])


@wp.func
def crossing_step(first: wp.vec3, second: wp.vec3, gap_first: wp.float32, gap_second: wp.float32) -> wp.vec4:
    """The shortest step onto two planes of unit normals at these distances, and whether they cross at all."""
    cosine = wp.dot(first, second)
    determinant = 1.0 - cosine * cosine
    if determinant < SMALLEST_SINE * SMALLEST_SINE:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    along_first = (gap_first - cosine * gap_second) / determinant
    along_second = (gap_second - cosine * gap_first) / determinant
    step = first * along_first + second * along_second
    return wp.vec4(step[0], step[1], step[2], 1.0)


@wp.func
def corner_step(squares: wp.mat33, pulls: wp.vec3) -> wp.vec4:
    """The step onto three planes or more, by least squares, and whether they meet in a point at all."""
    if wp.determinant(squares) < SMALLEST_SINE * SMALLEST_SINE * SMALLEST_SINE:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    step = wp.inverse(squares) * pulls
    return wp.vec4(step[0], step[1], step[2], 1.0)


@wp.func
def meet(
    start: wp.vec3,
    references: References,
    members: wp.int32,
    axis: wp.int32,
    plane: wp.float32,
    cell: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.vec4:
    """The point near `start` where the branches among `members` meet, and the last step's length in cells.

    Gauss–Newton, which goes the shortest way: onto a crease it does not slide along it. With an `axis` from 0
    the point is to lie on the plane x[axis] = plane as well.
    """
    x = start
    length = float(FAILED)
    for _step in range(NEWTON_STEPS):
        squares = wp.mat33()
        pulls = wp.vec3()
        first = wp.vec3()
        second = wp.vec3()
        gap_first = float(0.0)
        gap_second = float(0.0)
        rows = int(0)
        for k in range(MOST_BRANCHES + 1):
            normal = wp.vec3()
            gap = float(0.0)
            used = bool(False)
            if k == MOST_BRANCHES:
                if axis >= 0:
                    normal[axis] = 1.0
                    gap = plane - x[axis]
                    used = True
            elif ((members >> k) & 1) == 1:
                branch = branch_at(x, reference_of(references, k), tape, span)
                gradient = wp.vec3(branch[3], branch[4], branch[5])
                steepness = wp.length(gradient)
                if steepness == 0.0:
                    return wp.vec4(x[0], x[1], x[2], FAILED)
                normal = gradient / steepness
                gap = wp.clamp((ISO - branch[2]) / steepness, -cell, cell)
                used = True
            if used:
                squares += wp.outer(normal, normal)
                pulls += normal * gap
                first = second
                gap_first = gap_second
                second = normal
                gap_second = gap
                rows += 1
        step = wp.vec4()
        if rows == 1:
            step = wp.vec4(pulls[0], pulls[1], pulls[2], 1.0)
        elif rows == 2:
            step = crossing_step(first, second, gap_first, gap_second)
        else:
            step = corner_step(squares, pulls)
        if step[3] == 0.0:
            return wp.vec4(x[0], x[1], x[2], FAILED)
        move = wp.vec3(step[0], step[1], step[2])
        length = wp.length(move) / cell
        if length > 1.0:
            move = move / length
        x += move
        if length <= 0.01 * ARRIVED:
            break
    return wp.vec4(x[0], x[1], x[2], length)


@wp.func
def outside_by(x: wp.vec3, low: wp.vec3, cell: wp.float32, axis: wp.int32) -> wp.float32:
    """How far, in cells, x lies outside the cell along an axis: below 0 on the lower side."""
    place = (x[axis] - low[axis]) / cell
    return place - wp.clamp(place, -ROOM, 1.0 + ROOM)


@wp.func
def inside_cell(x: wp.vec3, low: wp.vec3, cell: wp.float32) -> wp.bool:
    """Whether x lies in the cell or as good as."""
    outside = wp.abs(outside_by(x, low, cell, 0)) + wp.abs(outside_by(x, low, cell, 1))
    return outside + wp.abs(outside_by(x, low, cell, 2)) == 0.0


@wp.func
def meet_in_cell(
    start: wp.vec3,
    references: References,
    members: wp.int32,
    low: wp.vec3,
    cell: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.vec4:
    """A meeting of branches: in the cell, else where the crease enters through a face, else near the cell."""
    best = meet(start, references, members, -1, 0.0, cell, tape, span)
    x = wp.vec3(best[0], best[1], best[2])
    if best[3] > ARRIVED or inside_cell(x, low, cell):
        return best
    for axis in range(3):
        outside = outside_by(x, low, cell, axis)
        if outside != 0.0:
            plane = low[axis]
            if outside > 0.0:
                plane += cell
            found = meet(x, references, members, axis, plane, cell, tape, span)
            if found[3] <= ARRIVED and inside_cell(wp.vec3(found[0], found[1], found[2]), low, cell):
                return found
    for axis in range(3):
        if wp.abs(outside_by(x, low, cell, axis)) > FARTHEST:
            return wp.vec4(x[0], x[1], x[2], FAILED)
    return best


@wp.func
def distance_to_surface(x: wp.vec3, tape: wp.array(dtype=wp.vec4), span: wp.vec2i) -> wp.float32:
    """To first order; large where the field is flat."""
    f = field_gradient(x, tape, span)
    steepness = wp.length(wp.vec3(f[1], f[2], f[3]))
    if steepness == 0.0:
        return FAILED
    return wp.abs(f[0] - ISO) / steepness


@wp.func
def mean_normal(
    x: wp.vec3, references: References, members: wp.int32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
) -> wp.vec3:
    """Outward mean of the branches' unit normals at x."""
    total = wp.vec3()
    for k in range(MOST_BRANCHES):
        if ((members >> k) & 1) == 1:
            branch = branch_at(x, reference_of(references, k), tape, span)
            total -= wp.normalize(wp.vec3(branch[3], branch[4], branch[5]))
    return wp.normalize(total)


@wp.func
def crease_tangent(
    x: wp.vec3, references: References, members: wp.int32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
) -> wp.vec3:
    """Unit direction of the crease of two branches at x."""
    first = wp.vec3()
    second = wp.vec3()
    for k in range(MOST_BRANCHES):
        if ((members >> k) & 1) == 1:
            branch = branch_at(x, reference_of(references, k), tape, span)
            first = second
            second = wp.vec3(branch[3], branch[4], branch[5])
    return wp.normalize(wp.cross(first, second))
