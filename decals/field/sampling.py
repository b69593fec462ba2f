"""The decal pass over points in place of pixels: owner, image coordinates, field and colour."""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.field.mapping import in_image
from decals.field.ownership import NOBODY, complement_at, owner_at, owner_below, uv_at
from decals.field.stack import number_below
from decals.records import RECORD, rank_of

wp.set_module_options({"enable_backward": False})

OPAQUE = 0.9999
"""Decals under so much alpha are not looked for."""


@wp.func
def texel(x: wp.int32, y: wp.int32, place: wp.vec3i, texels: wp.array(dtype=wp.vec4)) -> wp.vec4:
    """Texel of an image of (first texel, width, height), clamped to its edge."""
    return texels[place[0] + wp.clamp(y, 0, place[2] - 1) * place[1] + wp.clamp(x, 0, place[1] - 1)]


@wp.func
def image_at(uv: wp.vec2, place: wp.vec3i, texels: wp.array(dtype=wp.vec4)) -> wp.vec4:
    """Bilinear colour of an image, premultiplied and linear, whose first row is at v = 1."""
    x = uv[0] * float(place[1]) - 0.5
    y = (1.0 - uv[1]) * float(place[2]) - 0.5
    i = int(wp.floor(x))
    j = int(wp.floor(y))
    upper = wp.lerp(texel(i, j, place, texels), texel(i + 1, j, place, texels), x - wp.floor(x))
    lower = wp.lerp(texel(i, j + 1, place, texels), texel(i + 1, j + 1, place, texels), x - wp.floor(x))
    return wp.lerp(upper, lower, y - wp.floor(y))


@wp.func
def decal_color(
    decal: wp.int32,
    uv: wp.vec2,
    decals: wp.array(dtype=wp.vec4),
    places: wp.array(dtype=wp.vec3i),
    texels: wp.array(dtype=wp.vec4),
) -> wp.vec4:
    """Premultiplied linear colour of one decal: its image, or white, times its tint and opacity."""
    if not in_image(uv):
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    image = int(decals[RECORD * decal + 2][3])
    tint = decals[RECORD * decal + 3]
    color = wp.vec4(1.0, 1.0, 1.0, 1.0)
    if image >= 0:
        color = image_at(uv, places[image], texels)
    return tint[3] * wp.cw_mul(color, wp.vec4(tint[0], tint[1], tint[2], 1.0))


@wp.kernel
def sample_points(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    mapping: wp.int32,
    contact: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
):
    """Topmost decal, its image coordinates and deformed field at each point; zeros where nobody owns it."""
    i = wp.tid()
    q = points[i]
    n_q = wp.normalize(normals[i])
    owner = owner_at(q, n_q, contact, layered, decals, level_count, levels, table, mask, ids)
    owners[i] = owner
    if owner != NOBODY:
        complement = complement_at(
            q, n_q, owner, contact, layered, decals, level_count, levels, table, mask, ids
        )
        uv[i] = uv_at(q, n_q, owner, complement, mapping, decals)
        fields[i] = 1.0 - complement


@wp.kernel
def color_points(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    mapping: wp.int32,
    contact: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    places: wp.array(dtype=wp.vec3i),
    texels: wp.array(dtype=wp.vec4),
    colors: wp.array(dtype=wp.vec4),
):
    """All decals at each point over each other, from the topmost (owners) down; premultiplied linear."""
    i = wp.tid()
    q = points[i]
    n_q = wp.normalize(normals[i])
    owner = owners[i]
    color = wp.vec4(0.0, 0.0, 0.0, 0.0)
    while owner != NOBODY and color[3] < OPAQUE:
        complement = complement_at(
            q, n_q, owner, contact, layered, decals, level_count, levels, table, mask, ids
        )
        uv = uv_at(q, n_q, owner, complement, mapping, decals)
        color += (1.0 - color[3]) * decal_color(owner, uv, decals, places, texels)
        if not layered:
            break
        rank = rank_of(owner, decals)
        number = number_below(owner, decals)
        owner = owner_below(
            q, n_q, rank, number, contact, layered, decals, level_count, levels, table, mask, ids
        )
    colors[i] = color
