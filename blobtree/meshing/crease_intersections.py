"""Intersections of smooth branches on the surface: Newton's method onto creases and corners.

Dual contouring (Ju et al. 2002) and extended marching cubes (Kobbelt et al. 2001) estimate the position of a
crease from the tangent planes at edge crossings. Here the branches are known and continue beyond the crease
(`crease_branches`). Each step moves to the intersection of their tangent planes, and a few steps converge.

Sets of branches are given as bits: bit k of `members` stands for branch k.
"""

from typing import Any

import warp as wp

from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.crease_branches import branch_at
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

MAX_BRANCHES = 4
"""Most branches that meet in one cell; a generic corner has three."""

NEWTON_STEPS = 12

CONVERGED_STEP = 2e-3
"""Length of the last step, in cells, at which an intersection is found."""

CELL_MARGIN = 0.01
"""Distance from its cell, in cells, up to which a vertex counts as inside."""

MAX_CREASE_DISTANCE = 12.0
"""Largest distance of a crease from its cell, in cells: thin wedges end beyond the cells that they cross."""

MIN_SINE = 0.03
"""Sine of the smallest angle (2°) between branches that makes a crease."""

FAILED = 1e9
"""The last step if there is no intersection."""

References: Any = wp.types.matrix(shape=(MAX_BRANCHES, 3), dtype=wp.float32)
"""For each branch a point at which it is active."""


@wp.func
def reference_of(references: References, k: wp.int32) -> wp.vec3:
    """Return the point at which branch k is active."""
    return wp.vec3(references[k, 0], references[k, 1], references[k, 2])


@wp.func
def member_count(members: wp.int32) -> wp.int32:
    """Return the number of branches in a set."""
    total = int(0)
    for k in range(MAX_BRANCHES):
        total += (members >> k) & 1
    return total


@wp.func
def branch_plane(
    x: wp.vec3, references: References, k: wp.int32, cell: wp.float32, tape: Texels, span: wp.vec2i
) -> wp.vec4:
    """Return (unit normal, signed distance up to `cell`) of branch k's tangent plane; 0 where it is flat."""
    branch = branch_at(x, reference_of(references, k), tape, span)
    gradient = wp.vec3(branch[3], branch[4], branch[5])
    steepness = wp.length(gradient)
    if steepness == 0.0:
        return wp.vec4()
    normal = gradient / steepness
    return wp.vec4(normal[0], normal[1], normal[2], wp.clamp((ISO - branch[2]) / steepness, -cell, cell))


@wp.func
def crossing_step(first: wp.vec4, second: wp.vec4) -> wp.vec4:
    """Return the shortest step onto two planes (unit normal, distance), and 1, or 0 if they are parallel."""
    n = wp.vec3(first[0], first[1], first[2])
    m = wp.vec3(second[0], second[1], second[2])
    cosine = wp.dot(n, m)
    determinant = 1.0 - cosine * cosine
    if determinant < MIN_SINE * MIN_SINE:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    along_n = (first[3] - cosine * second[3]) / determinant
    along_m = (second[3] - cosine * first[3]) / determinant
    step = n * along_n + m * along_m
    return wp.vec4(step[0], step[1], step[2], 1.0)


@wp.func
def corner_step(squares: wp.mat33, pulls: wp.vec3) -> wp.vec4:
    """Return the least-squares step onto three planes or more, and 1, or 0 if they have no common point."""
    if wp.determinant(squares) < MIN_SINE * MIN_SINE * MIN_SINE:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    step = wp.inverse(squares) * pulls
    return wp.vec4(step[0], step[1], step[2], 1.0)


@wp.func
def gauss_newton_step(
    x: wp.vec3,
    references: References,
    members: wp.int32,
    axis: wp.int32,
    plane: wp.float32,
    cell: wp.float32,
    tape: Texels,
    span: wp.vec2i,
) -> wp.vec4:
    """Return the step from x onto the tangent planes of the members, and 1; 0 if the planes give no step.

    If `axis` is not negative, the plane x[axis] = plane is one more of them.
    """
    squares = wp.mat33()
    pulls = wp.vec3()
    first = wp.vec4()
    second = wp.vec4()
    rows = int(0)
    for k in range(MAX_BRANCHES + 1):
        row = wp.vec4()
        used = bool(False)
        if k == MAX_BRANCHES:
            if axis >= 0:
                row[axis] = 1.0
                row[3] = plane - x[axis]
                used = True
        elif ((members >> k) & 1) == 1:
            row = branch_plane(x, references, k, cell, tape, span)
            if row[0] == 0.0 and row[1] == 0.0 and row[2] == 0.0:
                return wp.vec4(0.0, 0.0, 0.0, 0.0)
            used = True
        if used:
            normal = wp.vec3(row[0], row[1], row[2])
            squares += wp.outer(normal, normal)
            pulls += normal * row[3]
            first = second
            second = row
            rows += 1
    if rows == 1:
        return wp.vec4(pulls[0], pulls[1], pulls[2], 1.0)
    if rows == 2:
        return crossing_step(first, second)
    return corner_step(squares, pulls)


@wp.func
def intersect_branches(
    start: wp.vec3,
    references: References,
    members: wp.int32,
    axis: wp.int32,
    plane: wp.float32,
    cell: wp.float32,
    tape: Texels,
    span: wp.vec2i,
) -> wp.vec4:
    """Return the point near `start` where the members meet on the surface, and the last step in cells.

    Gauss–Newton takes the shortest way, so a point does not slide along its crease. If `axis` is not
    negative, the point lies on the plane x[axis] = plane too. The step is FAILED if there is no such point.
    """
    x = start
    length = float(FAILED)
    for _step in range(NEWTON_STEPS):
        step = gauss_newton_step(x, references, members, axis, plane, cell, tape, span)
        if step[3] == 0.0:
            return wp.vec4(x[0], x[1], x[2], FAILED)
        move = wp.vec3(step[0], step[1], step[2])
        length = wp.length(move) / cell
        if length > 1.0:
            move = move / length
        x += move
        if length <= 0.01 * CONVERGED_STEP:
            break
    return wp.vec4(x[0], x[1], x[2], length)


@wp.func
def distance_outside(x: wp.vec3, low: wp.vec3, cell: wp.float32, axis: wp.int32) -> wp.float32:
    """Return how far, in cells, x lies outside its cell along an axis, negative on the lower side."""
    t = (x[axis] - low[axis]) / cell
    return t - wp.clamp(t, -CELL_MARGIN, 1.0 + CELL_MARGIN)


@wp.func
def inside_cell(x: wp.vec3, low: wp.vec3, cell: wp.float32) -> wp.bool:
    """Return True if x lies in the cell, up to CELL_MARGIN."""
    outside = wp.abs(distance_outside(x, low, cell, 0)) + wp.abs(distance_outside(x, low, cell, 1))
    return outside + wp.abs(distance_outside(x, low, cell, 2)) == 0.0


@wp.func
def intersect_in_cell(
    start: wp.vec3,
    references: References,
    members: wp.int32,
    low: wp.vec3,
    cell: wp.float32,
    tape: Texels,
    span: wp.vec2i,
) -> wp.vec4:
    """Return an intersection of the members: in the cell, else for a crease on its faces, else near it."""
    best = intersect_branches(start, references, members, -1, 0.0, cell, tape, span)
    x = wp.vec3(best[0], best[1], best[2])
    if best[3] > CONVERGED_STEP or inside_cell(x, low, cell):
        return best
    for axis in range(3):
        outside = distance_outside(x, low, cell, axis)
        if outside != 0.0 and member_count(members) < 3:
            plane = low[axis]
            if outside > 0.0:
                plane += cell
            y = intersect_branches(x, references, members, axis, plane, cell, tape, span)
            if y[3] <= CONVERGED_STEP and inside_cell(wp.vec3(y[0], y[1], y[2]), low, cell):
                return y
    for axis in range(3):
        if wp.abs(distance_outside(x, low, cell, axis)) > MAX_CREASE_DISTANCE:
            return wp.vec4(x[0], x[1], x[2], FAILED)
    return best


@wp.func
def mean_normal(
    x: wp.vec3, references: References, members: wp.int32, tape: Texels, span: wp.vec2i
) -> wp.vec3:
    """Return the outward mean of the members' unit normals at x."""
    total = wp.vec3()
    for k in range(MAX_BRANCHES):
        if ((members >> k) & 1) == 1:
            branch = branch_at(x, reference_of(references, k), tape, span)
            total -= wp.normalize(wp.vec3(branch[3], branch[4], branch[5]))
    return wp.normalize(total)


@wp.func
def crease_tangent(
    x: wp.vec3, references: References, members: wp.int32, tape: Texels, span: wp.vec2i
) -> wp.vec3:
    """Return the unit direction of the crease of two branches at x."""
    first = wp.vec3()
    second = wp.vec3()
    for k in range(MAX_BRANCHES):
        if ((members >> k) & 1) == 1:
            branch = branch_at(x, reference_of(references, k), tape, span)
            first = second
            second = wp.vec3(branch[3], branch[4], branch[5])
    return wp.normalize(wp.cross(first, second))
