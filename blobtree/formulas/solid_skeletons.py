"""Solid skeletons: the cylinder. `formulas.skeletons` states what a skeleton is, and has the box."""

import warp as wp

from blobtree.declare.registry import library_rows
from blobtree.formulas.skeletons import Skeleton, min_influence_of_one
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})


@wp.func
def beside_axis(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the way across from the axis to q, and the distance of q along the axis from its start."""
    start = tape[at]
    end = tape[at + 1]
    axis = wp.normalize(wp.vec3(end[0], end[1], end[2]))
    w = q - wp.vec3(start[0], start[1], start[2])
    x = wp.dot(w, axis)
    c = w - axis * x
    return wp.vec4(c[0], c[1], c[2], x)


@wp.func
def depth_in_cylinder(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the distance from side and ends, below 0 outside."""
    end = tape[at + 1]
    length = wp.length(wp.vec3(end[0], end[1], end[2]))
    place = beside_axis(q, tape, at)
    across = wp.length(wp.vec3(place[0], place[1], place[2]))
    return wp.min(wp.min(place[3], length - place[3]), end[3] - across)


@wp.func
def closest_on_cylinder(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (start of the axis, influence); tape[at + 1] = (end − start, radius of the cylinder)."""
    start = tape[at]
    end = tape[at + 1]
    ab = wp.vec3(end[0], end[1], end[2])
    length = wp.length(ab)
    place = beside_axis(q, tape, at)
    c = wp.vec3(place[0], place[1], place[2])
    across = wp.length(c)
    if across > end[3]:
        c *= end[3] / across
    elif place[3] >= 0.0 and place[3] <= length:
        return wp.vec4(q[0], q[1], q[2], start[3])
    c += wp.normalize(ab) * wp.clamp(place[3], 0.0, length)
    return wp.vec4(start[0] + c[0], start[1] + c[1], start[2] + c[2], start[3])


CYLINDER = Skeleton(
    "cylinder",
    closest_on_cylinder,
    min_influence_of_one,
    parameters=2,
    convex=True,
    depth=depth_in_cylinder,
)

library_rows(
    CYLINDER,
)
