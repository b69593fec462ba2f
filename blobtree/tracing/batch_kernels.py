"""Rays through many models; a file of its own, because most programs trace one model at a time."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tracing.ray_kernels import RayCells, trace_ray

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def trace_rays_of_models(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    numbers: wp.array(dtype=wp.int32),
    models: wp.array(dtype=RayCells),
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
) -> None:
    """Write what `trace_rays` writes; each ray has the number of its model."""
    i = first + wp.tid()
    direction = wp.normalize(directions[i])
    hit = trace_ray(origins[i], direction, 0.0, models[numbers[i]])
    t = hit[0]
    if t < 0.0:
        t = wp.inf
    distances[i] = t
    spans[i] = wp.vec2i(int(hit[1]), int(hit[2]))
