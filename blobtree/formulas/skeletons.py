"""Skeletons: the closest point of a skeleton to a point in space.

A skeleton is one typed function `(q, tape, at) -> vec4(closest point, radius of influence there)` that reads
its parameters from `tape[at:]`. Mesher, tracer, particles and shaders take it from this one table.
The field of a primitive is g(|q − closest| / influence). Because the closest point minimises that ratio, its
own motion does not enter the gradient (envelope theorem), so gradients are exact; and the ratio changes by at
most 1 / min_influence per unit, `min_influence(tape, at)` being the smallest influence anywhere on the
skeleton.
"""

import math

import warp as wp

from blobtree.declare.skeleton import PLATE_CELLS, TUBE_CELLS, Skeleton
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
def closest_on_point(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence)."""
    return tape[at]


@wp.func
def closest_on_segment(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (start, influence); tape[at + 1] = (end − start, 1 / length² or 0)."""
    start = tape[at]
    axis = tape[at + 1]
    a = wp.vec3(start[0], start[1], start[2])
    ab = wp.vec3(axis[0], axis[1], axis[2])
    t = wp.clamp(wp.dot(q - a, ab) * axis[3], 0.0, 1.0)
    c = a + ab * t
    return wp.vec4(c[0], c[1], c[2], start[3])


@wp.func
def closest_on_cone(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (start, influence there); tape[at + 1] = (end − start, influence at the end).

    With x along the axis and y beside it, (y² + (x − τ)²) / (s₀ + kτ)² is least at τ = x + k y² / (s₀ + k x);
    behind the apex, where s₀ + k x ≤ 0, at the thicker end.
    """
    start = tape[at]
    end = tape[at + 1]
    ab = wp.vec3(end[0], end[1], end[2])
    length = wp.length(ab)
    t = float(0.0)
    if length > 0.0:
        axis = wp.normalize(ab)
        w = q - wp.vec3(start[0], start[1], start[2])
        x = wp.dot(axis, w)
        beside = w - axis * x
        k = (end[3] - start[3]) / length
        s = start[3] + k * x
        if s > 0.0:
            t = wp.clamp((x + k * wp.dot(beside, beside) / s) / length, 0.0, 1.0)
        elif k > 0.0:
            t = 1.0
    elif end[3] > start[3]:
        t = 1.0
    return wp.vec4(
        start[0] + t * end[0],
        start[1] + t * end[1],
        start[2] + t * end[2],
        start[3] + t * (end[3] - start[3]),
    )


@wp.func
def closest_on_circle(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence); tape[at + 1] = (unit axis, radius of the circle)."""
    center = tape[at]
    axis = tape[at + 1]
    n = wp.vec3(axis[0], axis[1], axis[2])
    w = q - wp.vec3(center[0], center[1], center[2])
    flat = w - n * wp.dot(w, n)
    if wp.length(flat) <= 1.0e-6 * wp.length(w):
        flat = wp.cross(n, wp.vec3(0.0, 1.0, 0.0))
        if wp.abs(n[0]) < 0.6:
            flat = wp.cross(n, wp.vec3(1.0, 0.0, 0.0))
    c = wp.normalize(flat) * axis[3]
    return wp.vec4(center[0] + c[0], center[1] + c[1], center[2] + c[2], center[3])


@wp.func
def closest_on_disc(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence); tape[at + 1] = (unit axis, radius of the disc)."""
    center = tape[at]
    axis = tape[at + 1]
    n = wp.vec3(axis[0], axis[1], axis[2])
    w = q - wp.vec3(center[0], center[1], center[2])
    c = w - n * wp.dot(w, n)
    if wp.length(c) > axis[3]:
        c = wp.normalize(c) * axis[3]
    return wp.vec4(center[0] + c[0], center[1] + c[1], center[2] + c[2], center[3])


@wp.func
def closest_on_box(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence); tape[at + 1] = (lengths along the axes, 0)."""
    center = tape[at]
    size = tape[at + 1]
    return wp.vec4(
        wp.clamp(q[0], center[0] - 0.5 * size[0], center[0] + 0.5 * size[0]),
        wp.clamp(q[1], center[1] - 0.5 * size[1], center[1] + 0.5 * size[1]),
        wp.clamp(q[2], center[2] - 0.5 * size[2], center[2] + 0.5 * size[2]),
        center[3],
    )


@wp.func
def depth_in_box(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the distance from the faces, below 0 outside."""
    center = tape[at]
    size = tape[at + 1]
    return wp.min(
        wp.min(
            0.5 * size[0] - wp.abs(q[0] - center[0]),
            0.5 * size[1] - wp.abs(q[1] - center[1]),
        ),
        0.5 * size[2] - wp.abs(q[2] - center[2]),
    )


@wp.func
def min_influence_of_one(tape: Texels, at: wp.int32) -> wp.float32:
    """Return the influence radius of a skeleton that has one."""
    return tape[at][3]


@wp.func
def min_influence_of_cone(tape: Texels, at: wp.int32) -> wp.float32:
    """Return the influence radius at the thinner end."""
    return wp.min(tape[at][3], tape[at + 1][3])


@wp.func
def clearance_of_cone(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the distance from the axis."""
    start = tape[at]
    end = tape[at + 1]
    a = wp.vec3(start[0], start[1], start[2])
    return distance_to_segment(q, a, a + wp.vec3(end[0], end[1], end[2]))


@wp.func
def influence_near_cone(tape: Texels, at: wp.int32, q: wp.vec3, c: wp.vec4) -> wp.float32:
    """Return `influence_near` of a cone."""
    return influence_near(q, c, min_influence_of_cone(tape, at), clearance_of_cone(q, tape, at))


@wp.func
def distance_to_segment(q: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.float32:
    """Return the distance of q from the line from a to b."""
    way = b - a
    t = wp.clamp(wp.dot(q - a, way) / wp.max(wp.dot(way, way), TINY), 0.0, 1.0)
    return wp.length(q - a - way * t)


@wp.func
def influence_near(q: wp.vec3, c: wp.vec4, smallest: wp.float32, clearance: wp.float32) -> wp.float32:
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


POINT = Skeleton("point", closest_on_point, min_influence_of_one, parameters=1, convex=True)
SEGMENT = Skeleton(
    "segment", closest_on_segment, min_influence_of_one, parameters=2, convex=True, cells=TUBE_CELLS
)
CONE = Skeleton(
    "cone",
    closest_on_cone,
    min_influence_of_cone,
    parameters=2,
    own_influence_near=influence_near_cone,
    cells=TUBE_CELLS,
)
CIRCLE = Skeleton("circle", closest_on_circle, min_influence_of_one, parameters=2, cells=TUBE_CELLS)
DISC = Skeleton("disc", closest_on_disc, min_influence_of_one, parameters=2, convex=True, cells=PLATE_CELLS)
BOX = Skeleton(
    "box",
    closest_on_box,
    min_influence_of_one,
    parameters=2,
    folds_maps=False,
    convex=True,
    depth=depth_in_box,
)

SKELETONS = (POINT, SEGMENT, CONE, CIRCLE, DISC, BOX)
"""Every kind; its index here is its code on the tape."""
