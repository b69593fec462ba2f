"""Solid skeletons: the cylinder. `formulas.skeletons` states what a skeleton is, and has the box."""

import warp as wp

from blobtree.formulas.skeletons import Skeleton, min_influence_of_one
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})


@wp.func
def closest_on_cylinder(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (start of the axis, influence); tape[at + 1] = (end − start, radius of the cylinder)."""
    start = tape[at]
    end = tape[at + 1]
    ab = wp.vec3(end[0], end[1], end[2])
    axis = wp.normalize(ab)
    w = q - wp.vec3(start[0], start[1], start[2])
    x = wp.dot(w, axis)
    c = w - axis * x
    if x >= 0.0 and x <= wp.length(ab) and wp.length(c) <= end[3]:
        return wp.vec4(q[0], q[1], q[2], start[3])
    if wp.length(c) > end[3]:
        c = wp.normalize(c) * end[3]
    c += axis * wp.clamp(x, 0.0, wp.length(ab))
    return wp.vec4(start[0] + c[0], start[1] + c[1], start[2] + c[2], start[3])


@wp.func
def depth_in_cylinder(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the distance from side and ends, below 0 outside."""
    start = tape[at]
    end = tape[at + 1]
    ab = wp.vec3(end[0], end[1], end[2])
    axis = wp.normalize(ab)
    w = q - wp.vec3(start[0], start[1], start[2])
    x = wp.dot(w, axis)
    return wp.min(wp.min(x, wp.length(ab) - x), end[3] - wp.length(w - axis * x))


CYLINDER = Skeleton(
    "cylinder",
    closest_on_cylinder,
    min_influence_of_one,
    parameters=2,
    convex=True,
    depth=depth_in_cylinder,
)

SOLID_SKELETONS = (CYLINDER,)
