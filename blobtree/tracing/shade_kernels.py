"""Normals and colours where rays hit the surface; a file of its own compiles beside that of `trace_rays`."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.interpreter import field_color, field_gradient
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def shade_hits(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
    tape: Texels,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    colors: wp.array(dtype=wp.vec3),
) -> None:
    """Write the position, the outward unit normal and the colour of each hit."""
    i = first + wp.tid()
    if wp.isfinite(distances[i]):
        position = origins[i] + wp.normalize(directions[i]) * distances[i]
        gradient = field_gradient(position, tape, spans[i])
        color = field_color(position, tape, spans[i])
        positions[i] = position
        normals[i] = -wp.normalize(wp.vec3(gradient[1], gradient[2], gradient[3]))
        colors[i] = wp.vec3(color[1], color[2], color[3])
