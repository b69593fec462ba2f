"""Warp kernels of queries of a triangle mesh: closest point, first hit of a ray, containment."""

# mypy: disable-error-code="attr-defined"
# (Warp does not declare the fields of its query results)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def closest_points(
    first: wp.int32,
    mesh: wp.uint64,
    face_normals: wp.array(dtype=wp.vec3),
    center: wp.vec3,
    radius: wp.float32,
    points: wp.array(dtype=wp.vec3),
    reaches: wp.array(dtype=wp.float32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
) -> None:
    """Write the closest point of the mesh to each point, and the normal of its face.

    The search radius is `reaches` at first, then one that includes the ball around the mesh.
    """
    i = first + wp.tid()
    p = points[i]
    near = wp.mesh_query_point_no_sign(mesh, p, reaches[i])
    if near.result:
        positions[i] = wp.mesh_eval_position(mesh, near.face, near.u, near.v)
        normals[i] = face_normals[near.face]
    else:
        far = wp.mesh_query_point_no_sign(mesh, p, 1.01 * (wp.length(p - center) + radius))
        if far.result:
            positions[i] = wp.mesh_eval_position(mesh, far.face, far.u, far.v)
            normals[i] = face_normals[far.face]


@wp.kernel
def closest_faces(
    first: wp.int32,
    mesh: wp.uint64,
    center: wp.vec3,
    radius: wp.float32,
    points: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.int32),
    weights: wp.array(dtype=wp.vec2),
) -> None:
    """Write the face of the closest point of the mesh, and the weights of its first two corners there."""
    i = first + wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, points[i], 1.01 * (wp.length(points[i] - center) + radius))
    if query.result:
        faces[i] = query.face
        weights[i] = wp.vec2(query.u, query.v)


@wp.kernel
def first_hits(
    first: wp.int32,
    mesh: wp.uint64,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    distances: wp.array(dtype=wp.float32),
) -> None:
    """Write the distance along each unit direction to the first face, of either side; infinity for a miss."""
    i = first + wp.tid()
    query = wp.mesh_query_ray(mesh, origins[i], directions[i], wp.inf)
    if query.result:
        distances[i] = query.t
    else:
        distances[i] = wp.inf


@wp.kernel
def mark_inside(
    first: wp.int32,
    mesh: wp.uint64,
    low: wp.vec3,
    high: wp.vec3,
    points: wp.array(dtype=wp.vec3),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """Write 1 where the winding number of the mesh around the point is above one half."""
    i = first + wp.tid()
    p = points[i]
    if wp.min(p, low) == low and wp.max(p, high) == high:
        query = wp.mesh_query_point_sign_winding_number(mesh, p, 2.0 * wp.length(high - low))
        if query.result and query.sign < 0.0:
            flags[i] = 1


@wp.kernel
def mark_within(
    first: wp.int32,
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    reach: wp.float32,
    margin: wp.float32,
    sides: wp.array(dtype=wp.int32),
) -> None:
    """Write 1 for points that the mesh winds around, −1 for others, and leave those closer than a margin."""
    i = first + wp.tid()
    query = wp.mesh_query_point_sign_winding_number(mesh, points[i], reach)
    if query.result:
        closest = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        if wp.length(closest - points[i]) > margin:
            if query.sign < 0.0:
                sides[i] = 1
            else:
                sides[i] = -1
