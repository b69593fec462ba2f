# mypy: disable-error-code="attr-defined"
"""Kernels that measure distances to a triangle mesh."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def measure_distances(
    first: wp.int32,
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    farthest: wp.float32,
    solid: wp.bool,
    distances: wp.array(dtype=wp.float32),
) -> None:
    """Write the distance of each point from the mesh; below 0 inside a closed one if `solid`."""
    i = first + wp.tid()
    p = points[i]
    if solid:
        found = wp.mesh_query_point_sign_winding_number(mesh, p, farthest)
        if found.result:
            c = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
            distances[i] = found.sign * wp.length(p - c)
        else:
            distances[i] = farthest
    else:
        near = wp.mesh_query_point_no_sign(mesh, p, farthest)
        distances[i] = farthest
        if near.result:
            distances[i] = wp.length(p - wp.mesh_eval_position(mesh, near.face, near.u, near.v))
