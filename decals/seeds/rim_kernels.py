"""Warp kernels of open rims: which of them a particle is near, and its image beyond one."""

# mypy: disable-error-code="call-overload,attr-defined"
# (Warp declares neither arithmetic of vectors nor the numbers of its queries)

import warp as wp

wp.set_module_options({"enable_backward": False})

WALLS = 2
"""Rims that one particle may be near, as in a corner or on a narrow strip."""

OTHERWISE = 0.5
"""Cosine below which another rim counts beside the nearest."""

ON_RIM = 1e-3
"""Within so many spacings of a rim, inward is where its face lies."""

BESIDE = 0.5
"""A rim is near along the surface, and not above it, if that much of the way lies in the tangent plane."""


@wp.func
def from_segment(p: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Offset of a point from the closest point of a segment."""
    way = b - a
    along = wp.clamp(wp.dot(p - a, way) / wp.max(wp.length_sq(way), 1.0e-30), 0.0, 1.0)
    return p - (a + along * way)


@wp.func
def inward_of(offset: wp.vec3, inward: wp.vec3, normal: wp.vec3, size: wp.float32) -> wp.vec3:
    """Unit tangent from a rim toward a point; zero where the rim does not bound the surface around it."""
    away = offset
    if wp.length(offset) < ON_RIM * size:
        away = inward
    length = wp.length(away)
    away -= normal * wp.dot(normal, away)
    if wp.length(away) < BESIDE * length or wp.dot(away, inward) <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return wp.normalize(away)


@wp.kernel
def find_walls(
    first: wp.int32,
    tree: wp.uint64,
    starts: wp.array(dtype=wp.vec3),
    ends: wp.array(dtype=wp.vec3),
    inwards: wp.array(dtype=wp.vec3),
    rim_normals: wp.array(dtype=wp.vec3),
    rim_owners: wp.array(dtype=wp.int32),
    reach: wp.float32,
    facing_limit: wp.float32,
    places: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    owners: wp.array(dtype=wp.int32),
    wanted: wp.array(dtype=wp.int32),
    wall_points: wp.array(dtype=wp.vec3),
    wall_normals: wp.array(dtype=wp.vec3),
) -> None:
    """The nearest rims of each place, on its own surface, as planes that face it; zero normals for none."""
    i = first + wp.tid()
    p = places[i]
    n = normals[i]
    r = reach * sizes[i]
    known = wp.vec3(0.0, 0.0, 0.0)
    straight = wp.vec3(0.0, 0.0, 0.0)
    k = int(0)
    for w in range(WALLS):
        least = float(r)
        point = wp.vec3(0.0, 0.0, 0.0)
        facing = wp.vec3(0.0, 0.0, 0.0)
        inward = wp.vec3(0.0, 0.0, 0.0)
        if wanted[i] == 1:
            query = wp.bvh_query_aabb(tree, p - wp.vec3(r, r, r), p + wp.vec3(r, r, r))
            while wp.bvh_query_next(query, k):
                offset = from_segment(p, starts[k], ends[k])
                if rim_owners[k] == owners[i] and wp.length(offset) < least:
                    away = inward_of(offset, inwards[k], n, sizes[i])
                    faces = wp.length_sq(away) > 0.0 and wp.dot(n, rim_normals[k]) > facing_limit
                    other = wp.max(wp.dot(away, known), wp.dot(inwards[k], straight)) < OTHERWISE
                    if faces and (w == 0 or other):
                        least = wp.length(offset)
                        point = p - offset
                        facing = away
                        inward = inwards[k]
        wall_points[WALLS * i + w] = point
        wall_normals[WALLS * i + w] = facing
        known = facing
        straight = inward


@wp.func
def mirrored(q: wp.vec3, point: wp.vec3, normal: wp.vec3) -> wp.vec3:
    """A point's image beyond a wall; what lies beyond it already is its own."""
    return q - 2.0 * wp.max(wp.dot(q - point, normal), 0.0) * normal
