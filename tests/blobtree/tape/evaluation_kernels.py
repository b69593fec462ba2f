"""A Warp kernel of projections, which the product computes within other kernels alone."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.evaluate_kernels import project_to_surface
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)


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
