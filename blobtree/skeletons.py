"""Skeletons: for a point in space, the point of the skeleton that acts on it.

A skeleton is one typed function `(q, tape, at) -> vec4(closest point, radius of influence there)` that reads
its parameters from `tape[at:]`; polygonizer, tracer, particles and shaders all have it from this one table.
The field of a primitive is g(|q − closest| / influence). Because the closest point minimises that ratio, its
own motion does not enter the gradient (envelope theorem), so gradients are exact.
"""

from dataclasses import dataclass

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def closest_on_point(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence)."""
    return tape[at]


@wp.func
def closest_on_segment(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """tape[at] = (start, influence); tape[at + 1] = (end − start, 1 / length² or 0)."""
    start = tape[at]
    axis = tape[at + 1]
    a = wp.vec3(start[0], start[1], start[2])
    ab = wp.vec3(axis[0], axis[1], axis[2])
    t = wp.clamp(wp.dot(q - a, ab) * axis[3], 0.0, 1.0)
    c = a + ab * t
    return wp.vec4(c[0], c[1], c[2], start[3])


@dataclass(frozen=True)
class Skeleton:
    """One row of the table: how a kind is called, computed and stored."""

    name: str
    closest: wp.Function
    parameters: int
    """Texels (vec4) that the parameters take on the tape."""


POINT = Skeleton("point", closest_on_point, parameters=1)
SEGMENT = Skeleton("segment", closest_on_segment, parameters=2)

SKELETONS = (POINT, SEGMENT)
"""Every kind; its place here is its code on the tape."""
