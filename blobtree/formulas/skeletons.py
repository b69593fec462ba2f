"""Functions that formulas of skeletons share: distances, and influence radii around a point."""

import math

import warp as wp

from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

JOINT_YIELD = 3e-6
"""Part of the influence by which a skeleton is weaker at a joint than the one that goes on there.

The joint is not the closest point where the next skeleton has a closer one, but float32 may not show it in
the distances: a closest point at a distance of 3e-4 along the skeleton has the same one.
"""

INFLUENCE_MARGIN = wp.constant(1.0 - 1e-5)
"""Lowers bounds on influences, for rounding and joints."""

TINY = wp.constant(1e-30)
"""Divides numbers that may be 0."""

HALF_DIAGONAL = math.sqrt(3.0)
"""Distance from a cube's centre to its corners, in half sides."""


@wp.func
def least_influence_at_joints(tape: Texels, at: wp.int32) -> wp.float32:
    """Return the influence radius of a skeleton at its joints, which starts the tape there."""
    return tape[at][3] * (1.0 - JOINT_YIELD)


@wp.func
def distance_to_segment(q: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.float32:
    """Return the distance of q from the line from a to b."""
    way = b - a
    t = wp.clamp(wp.dot(q - a, way) / wp.max(wp.dot(way, way), TINY), 0.0, 1.0)
    return wp.length(q - a - way * t)


@wp.func
def influence_bound(q: wp.vec3, c: wp.vec4, smallest: wp.float32, clearance: wp.float32) -> wp.float32:
    """Return s such that u = |q − closest| / influence changes by at most 1 / s per unit away from q.

    c is the closest point to q. Where no point of the skeleton is nearer than `clearance`, all ratios at a
    distance r from q are at least u (1 − r / clearance), and the least is at most u + r / influence at c.
    """
    if clearance <= 0.0:
        return smallest
    u = wp.length(q - wp.vec3(c[0], c[1], c[2])) / c[3]
    return wp.max(smallest, wp.min(clearance / wp.max(u, TINY), c[3]) * INFLUENCE_MARGIN)


@wp.func
def squared_distances_to_ball(
    center: wp.vec3, radius: wp.float32, c: wp.vec4, min_influence: wp.float32, depth: wp.float32
) -> wp.vec2:
    """Bounds on (|x − skeleton| / influence)² over a ball.

    c and `depth` are the skeleton's answers at its center, `depth` 0 or less outside a solid one.
    """
    distance = wp.length(center - wp.vec3(c[0], c[1], c[2])) / c[3]
    nearest = wp.max(distance - radius / min_influence, 0.0)
    farthest = distance + wp.max(radius - wp.max(depth, 0.0), 0.0) / min_influence
    return wp.vec2(nearest * nearest, farthest * farthest)


@wp.func
def box_to_point(center: wp.vec3, half: wp.float32, tape: Texels, at: wp.int32) -> wp.vec2:
    """Exact bounds on (|x − point| / influence)² over the cube center ± half."""
    point = tape[at]
    nearest = float(0.0)
    farthest = float(0.0)
    for axis in range(3):
        gap = wp.abs(center[axis] - point[axis])
        near = wp.max(gap - half, 0.0)
        nearest += near * near
        farthest += (gap + half) * (gap + half)
    return wp.vec2(nearest, farthest) / (point[3] * point[3])
