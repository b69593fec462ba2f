"""Who owns a surface point, how its neighbours deform it there, and where in its image the point falls.

The whole decal pass in three calls, for every backend: `owner_at`, then `complement_at`, then `uv_at`. Their
arrays are those of `Decals.packed` and of the index, in its order (`DeviceIndex.arguments`).
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.contact import (
    NOWHERE,
    REACH,
    add_push,
    contact_complement,
    contact_push,
    contact_uv,
    field_complement,
    rim_distance,
)
from decals.lookup import cell_range
from decals.mapping import surface_offset, tangent_coordinates

wp.set_module_options({"enable_backward": False})

REACH_SQUARED = REACH * REACH

NOBODY = -1
"""Owner of a point outside all rims."""


@wp.func
def xyz(v: wp.vec4) -> wp.vec3:
    """First three components."""
    return wp.vec3(v[0], v[1], v[2])


@wp.func
def complement_of(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.float32:
    """Complement e of a decal's field at q; NOWHERE where it is out of reach or faces away."""
    ball = decals[3 * decal]
    w = q - xyz(ball)
    z = wp.dot(w, w) / (ball[3] * ball[3])
    if z >= REACH_SQUARED:
        return NOWHERE
    facing = decals[3 * decal + 1]
    if wp.dot(xyz(facing), n_q) <= facing[3]:
        return NOWHERE
    return field_complement(z)


@wp.func
def owner_at(
    q: wp.vec3,
    n_q: wp.vec3,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.int32),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Decal of highest field at q, the lowest number among equals; NOBODY outside all rims."""
    owner = wp.int32(NOBODY)
    least = wp.float32(0.5)
    for level in range(level_count):
        span = cell_range(q, level, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            e = complement_of(q, n_q, ids[j], decals)
            if e < least or (e == least and (owner < 0 or ids[j] < owner)):
                least = e
                owner = ids[j]
    return owner


@wp.func
def complement_at(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.int32),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.float32:
    """E = 1 − F of the owner at q, pushed by all its neighbours (paper, equation 5)."""
    least = complement_of(q, n_q, owner, decals)
    push = wp.float32(0.0)
    for level in range(level_count):
        span = cell_range(q, level, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            if ids[j] != owner:
                push = add_push(push, contact_push(complement_of(q, n_q, ids[j], decals), least))
    return contact_complement(least, push)


@wp.func
def uv_at(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    complement: wp.float32,
    mapping: wp.int32,
    decals: wp.array(dtype=wp.vec4),
) -> wp.vec2:
    """Image coordinates in the owner's image, in [0, 1]², with ½ at its centre."""
    centre = xyz(decals[3 * owner])
    normal = xyz(decals[3 * owner + 1])
    tangent = xyz(decals[3 * owner + 2])
    offset = surface_offset(q - centre, normal, n_q, mapping)
    return contact_uv(tangent_coordinates(offset, normal, tangent), rim_distance(complement))


@wp.kernel
def sample_points(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    mapping: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.int32),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
):
    """Owner, image coordinates and deformed field of each point; zeros where nobody owns it."""
    i = wp.tid()
    q = points[i]
    n_q = wp.normalize(normals[i])
    owner = owner_at(q, n_q, decals, level_count, levels, table, mask, ids)
    owners[i] = owner
    if owner != NOBODY:
        complement = complement_at(q, n_q, owner, decals, level_count, levels, table, mask, ids)
        uv[i] = uv_at(q, n_q, owner, complement, mapping, decals)
        fields[i] = 1.0 - complement
