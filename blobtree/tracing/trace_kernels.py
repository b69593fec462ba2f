"""Kernels of `trace`."""

import warp as wp

from blobtree.device import KERNEL_OPTIONS
from blobtree.tape.interpreter import field_color, field_gradient
from blobtree.tracing.rays import RayCells, trace_ray

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def trace_rays(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    cells: RayCells,
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
) -> None:
    """Write the distance to each ray's first hit, inf for a miss, and the span of the tape at the hit."""
    i = first + wp.tid()
    direction = wp.normalize(directions[i])
    hit = trace_ray(origins[i], direction, cells)
    t = hit[0]
    if t < 0.0:
        t = wp.inf
    distances[i] = t
    spans[i] = wp.vec2i(int(hit[1]), int(hit[2]))


@wp.kernel
def shade_hits(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
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
