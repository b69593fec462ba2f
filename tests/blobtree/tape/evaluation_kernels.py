"""Warp kernels of slope bounds and projections, which the product computes within other kernels alone."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.evaluate_kernels import project_to_surface
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


@wp.kernel
def project_points(
    points: wp.array(dtype=wp.vec3),
    longest_step: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
) -> None:
    """Write the projection of each point onto the surface, and the outward unit normal there."""
    i = wp.tid()
    p, f = project_to_surface(points[i], longest_step, tape, span)
    positions[i] = p
    normals[i] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
