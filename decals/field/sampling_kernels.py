"""Warp kernels of `evaluate`: owner, image coordinates, field and colour at points."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.mapping import in_image
from decals.field.ownership import NO_OWNER, contact_at, owner_at, owner_below, uv_at
from decals.field.receivers import fade_at
from decals.index.lookup import IndexedDecals, next_number_below
from decals.record import OPAQUE_ALPHA, RECORD, rank_of

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def texel(x: wp.int32, y: wp.int32, extent: wp.vec3i, texels: wp.array(dtype=wp.vec4)) -> wp.vec4:
    """Return a texel of an image with extent (first texel, width, height), clamped to its edge."""
    return texels[extent[0] + wp.clamp(y, 0, extent[2] - 1) * extent[1] + wp.clamp(x, 0, extent[1] - 1)]


@wp.func
def image_at(uv: wp.vec2, extent: wp.vec3i, texels: wp.array(dtype=wp.vec4)) -> wp.vec4:
    """Return the bilinear colour of an image, premultiplied and linear; its first row is at v = 1."""
    x = uv[0] * float(extent[1]) - 0.5
    y = (1.0 - uv[1]) * float(extent[2]) - 0.5
    i = int(wp.floor(x))
    j = int(wp.floor(y))
    upper = wp.lerp(texel(i, j, extent, texels), texel(i + 1, j, extent, texels), x - wp.floor(x))
    lower = wp.lerp(texel(i, j + 1, extent, texels), texel(i + 1, j + 1, extent, texels), x - wp.floor(x))
    return wp.lerp(upper, lower, y - wp.floor(y))


@wp.func
def decal_color(
    q: wp.vec3,
    n_q: wp.vec3,
    decal: wp.int32,
    uv: wp.vec2,
    index: IndexedDecals,
    extents: wp.array(dtype=wp.vec3i),
    texels: wp.array(dtype=wp.vec4),
) -> wp.vec4:
    """Return the premultiplied linear colour of one decal: image or white, times tint, opacity, fades."""
    if not in_image(uv):
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    image = int(index.records[RECORD * decal + 2][3])
    tint = index.records[RECORD * decal + 3]
    opacity = tint[3] * fade_at(q, n_q, decal, index)
    color = wp.vec4(1.0, 1.0, 1.0, 1.0)
    if image >= 0:
        color = image_at(uv, extents[image], texels)
    return opacity * wp.cw_mul(color, wp.vec4(tint[0], tint[1], tint[2], 1.0))


@wp.func
def image_point(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.vec3:
    """Return (u, v, E): image coordinates of q in its owner, and the complement of the owner's field."""
    pushed = contact_at(q, n_q, owner, contact, index)
    uv = uv_at(q, n_q, owner, pushed, index)
    return wp.vec3(uv[0], uv[1], pushed[0])


@wp.kernel
def sample_points(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
):
    """Write the topmost decal at each point, its image coordinates and field; no owner leaves zeros."""
    i = first + wp.tid()
    n_q = wp.normalize(normals[i])
    owner = owner_at(points[i], n_q, contact, index)
    owners[i] = owner
    if owner != NO_OWNER:
        image = image_point(points[i], n_q, owner, contact, index)
        uv[i] = wp.vec2(image[0], image[1])
        fields[i] = 1.0 - image[2]


@wp.func
def color_at(
    q: wp.vec3,
    n_q: wp.vec3,
    topmost: wp.int32,
    topmost_uv: wp.vec2,
    is_known: wp.bool,
    contact: wp.int32,
    index: IndexedDecals,
    extents: wp.array(dtype=wp.vec3i),
    texels: wp.array(dtype=wp.vec4),
) -> wp.vec4:
    """Return the colour of all decals at q, from the topmost down, whose image coordinates may be known."""
    owner = wp.int32(topmost)
    known = wp.bool(is_known)
    color = wp.vec4(0.0, 0.0, 0.0, 0.0)
    while owner != NO_OWNER and color[3] < OPAQUE_ALPHA:
        place = topmost_uv
        if not known:
            image = image_point(q, n_q, owner, contact, index)
            place = wp.vec2(image[0], image[1])
        color += (1.0 - color[3]) * decal_color(q, n_q, owner, place, index, extents, texels)
        if not index.layered:
            break
        known = False
        rank = rank_of(owner, index.records)
        number = next_number_below(owner, index.records)
        owner = owner_below(q, n_q, rank, number, contact, index)
    return color


@wp.kernel
def color_points(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    extents: wp.array(dtype=wp.vec3i),
    texels: wp.array(dtype=wp.vec4),
    colors: wp.array(dtype=wp.vec4),
):
    """Write the colour of all decals at each point, from the topmost down; premultiplied linear.

    The topmost ones and their image coordinates are those of `sample_points`, or found if there are none.
    """
    i = first + wp.tid()
    n_q = wp.normalize(normals[i])
    known = owners.shape[0] > 0
    owner = wp.int32(NO_OWNER)
    place = wp.vec2(0.0, 0.0)
    if known:
        owner = owners[i]
        place = uv[i]
    else:
        owner = owner_at(points[i], n_q, contact, index)
    colors[i] = color_at(points[i], n_q, owner, place, known, contact, index, extents, texels)
