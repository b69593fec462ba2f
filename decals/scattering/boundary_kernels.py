"""Warp kernels of open boundaries: the mirror planes of points near them."""

# mypy: disable-error-code="call-overload,attr-defined"
# (Warp declares neither arithmetic of vectors nor the numbers of its queries)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.scattering.search_kernels import MirrorPlanes, Particles

wp.set_module_options(KERNEL_OPTIONS)

PLANES_PER_POINT = 2
"""Mirror planes of one point at most, as in a corner or on a narrow strip."""

MAX_SECOND_COSINE = 0.5
"""Cosine between two planes below which the second counts beside the nearest."""

ON_BOUNDARY = 1e-3
"""Distance from a boundary, in spacings, below which the plane's normal points into the boundary's face."""

MIN_TANGENTIAL_SHARE = 0.5
"""Least tangential share of the offset from a boundary; less means that the boundary lies above the point."""


@wp.struct
class BoundarySegments:
    """Straight pieces of boundaries, in a bounding volume hierarchy."""

    tree: wp.uint64
    starts: wp.array(dtype=wp.vec3)
    ends: wp.array(dtype=wp.vec3)
    inward: wp.array(dtype=wp.vec3)
    """Unit directions into the adjacent face, at right angles to the segment."""
    normals: wp.array(dtype=wp.vec3)
    """Normals of the adjacent faces."""
    surface_ids: wp.array(dtype=wp.int32)


@wp.func
def offset_from_segment(p: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return the offset of a point from the closest point of a segment."""
    edge = b - a
    along = wp.clamp(wp.dot(p - a, edge) / wp.max(wp.length_sq(edge), 1.0e-30), 0.0, 1.0)
    return p - (a + along * edge)


@wp.func
def plane_normal(offset: wp.vec3, inward: wp.vec3, normal: wp.vec3, size: wp.float32) -> wp.vec3:
    """Return the unit tangent from a boundary toward a point, or zero if it does not bound the surface there.

    `normal` is the surface's normal at the point, `inward` the direction into the boundary's face.
    """
    away = offset
    if wp.length(offset) < ON_BOUNDARY * size:
        away = inward
    length = wp.length(away)
    away -= normal * wp.dot(normal, away)
    if wp.length(away) < MIN_TANGENTIAL_SHARE * length or wp.dot(away, inward) <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return wp.normalize(away)


@wp.kernel
def find_mirror_planes(
    first: wp.int32,
    segments: BoundarySegments,
    reach: wp.float32,
    facing_limit: wp.float32,
    points: Particles,
    surface_ids: wp.array(dtype=wp.int32),
    enabled: wp.array(dtype=wp.int32),
    mirrors: MirrorPlanes,
) -> None:
    """Find the nearest boundaries of each point on its own surface, as planes that face the point.

    Only boundaries within `reach` spacings count, and points that are `enabled` (1). Missing planes get a
    zero normal.
    """
    i = first + wp.tid()
    p = points.positions[i]
    n = points.normals[i]
    r = reach * points.sizes[i]
    first_normal = wp.vec3(0.0, 0.0, 0.0)
    first_inward = wp.vec3(0.0, 0.0, 0.0)
    k = int(0)
    for w in range(PLANES_PER_POINT):
        least = float(r)
        point = wp.vec3(0.0, 0.0, 0.0)
        normal = wp.vec3(0.0, 0.0, 0.0)
        inward = wp.vec3(0.0, 0.0, 0.0)
        if enabled[i] == 1:
            query = wp.bvh_query_aabb(segments.tree, p - wp.vec3(r, r, r), p + wp.vec3(r, r, r))
            while wp.bvh_query_next(query, k):
                offset = offset_from_segment(p, segments.starts[k], segments.ends[k])
                if segments.surface_ids[k] == surface_ids[i] and wp.length(offset) < least:
                    away = plane_normal(offset, segments.inward[k], n, points.sizes[i])
                    bounds = wp.length_sq(away) > 0.0 and wp.dot(n, segments.normals[k]) > facing_limit
                    cosine = wp.max(wp.dot(away, first_normal), wp.dot(segments.inward[k], first_inward))
                    if bounds and (w == 0 or cosine < MAX_SECOND_COSINE):
                        least = wp.length(offset)
                        point = p - offset
                        normal = away
                        inward = segments.inward[k]
        mirrors.points[PLANES_PER_POINT * i + w] = point
        mirrors.normals[PLANES_PER_POINT * i + w] = normal
        first_normal = normal
        first_inward = inward
