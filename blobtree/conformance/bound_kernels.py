"""A Warp kernel of slope bounds, which other kernels compute within themselves alone."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.interpreter import field_bound
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def evaluate_bounds(
    points: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    reach: wp.array(dtype=wp.float32),
    tape: Texels,
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec3),
) -> None:
    """Write `field_bound` at each point."""
    i = wp.tid()
    out[i] = field_bound(points[i], directions[i], reach[i], tape, span)
