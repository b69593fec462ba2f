"""Warp kernels that ask a triangle mesh: closest point, first hit of a ray, inside or not."""

# mypy: disable-error-code="attr-defined"
# (Warp does not declare the fields of its query results)

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def closest_points(
    first: wp.int32,
    mesh: wp.uint64,
    face_normals: wp.array(dtype=wp.vec3),
    points: wp.array(dtype=wp.vec3),
    reaches: wp.array(dtype=wp.float32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
) -> None:
    """Closest point of the mesh to each point, and the normal of the face that it lies on."""
    i = first + wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, points[i], reaches[i])
    if query.result:
        positions[i] = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        normals[i] = face_normals[query.face]


@wp.kernel
def first_hits(
    first: wp.int32,
    mesh: wp.uint64,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    distances: wp.array(dtype=wp.float32),
) -> None:
    """Distance along each unit direction to the first face, of either side; infinity for a miss."""
    i = first + wp.tid()
    query = wp.mesh_query_ray(mesh, origins[i], directions[i], wp.inf)
    if query.result:
        distances[i] = query.t
    else:
        distances[i] = wp.inf


@wp.kernel
def inside_flags(
    first: wp.int32,
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    reach: wp.float32,
    flags: wp.array(dtype=wp.int32),
) -> None:
    """1 where the winding number of the mesh around the point is above one half."""
    i = first + wp.tid()
    query = wp.mesh_query_point_sign_winding_number(mesh, points[i], reach)
    if query.result and query.sign < 0.0:
        flags[i] = 1
    else:
        flags[i] = 0
