"""Warp kernels of `evaluate`: owner, image coordinates, field, colour, height and materials at points."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.mapping import in_image, roll_step
from decals.field.ownership import NO_OWNER, contact_at, owner_at, owner_below, uv_at
from decals.field.receivers import opacity_at
from decals.index.lookup import IndexedDecals, next_number_below
from decals.record import OPAQUE_ALPHA, RECORD, rank_of, visible_radius, xyz

wp.set_module_options(KERNEL_OPTIONS)


COLORS, SURFACES, NORMALS, EMISSIONS = range(4)
"""Layers of `ImageTexels`."""


@wp.struct
class ImageTexels:
    """Images on a device.

    Attributes
    ----------
    extents
        First texel, width and height of each image.
    layers
        Texels times alpha, of one or more layers; the first row of an image is at v = 1. COLORS: linear
        colour and alpha. SURFACES: roughness, metalness, occlusion, and height in radii. NORMALS: x, y and z
        in tangent space, and 0. EMISSIONS: light that is shed, and 1 in images with maps.
    """

    extents: wp.array(dtype=wp.vec3i)
    layers: wp.array2d(dtype=wp.vec4)


@wp.struct
class ImageSums:
    """Sums over all decals at each point, by the part that is seen of each; arrays may be empty.

    Attributes
    ----------
    color
        Premultiplied linear colour.
    surface
        Sums of SURFACES, with heights in model units.
    normal
        Sum of unit normals.
    emission
        Sums of EMISSIONS.
    """

    color: wp.array(dtype=wp.vec4)
    surface: wp.array(dtype=wp.vec4)
    normal: wp.array(dtype=wp.vec3)
    emission: wp.array(dtype=wp.vec4)


@wp.func
def corners_at(x: wp.float32, y: wp.float32, extent: wp.vec3i) -> wp.vec4i:
    """Return the four texels around a place of an image, clamped to its edge, the upper row first."""
    left = wp.clamp(int(wp.floor(x)), 0, extent[1] - 1)
    right = wp.clamp(int(wp.floor(x)) + 1, 0, extent[1] - 1)
    upper = extent[0] + wp.clamp(int(wp.floor(y)), 0, extent[2] - 1) * extent[1]
    lower = extent[0] + wp.clamp(int(wp.floor(y)) + 1, 0, extent[2] - 1) * extent[1]
    return wp.vec4i(upper + left, upper + right, lower + left, lower + right)


@wp.func
def bilinear(
    corners: wp.vec4i, x: wp.float32, y: wp.float32, layer: wp.int32, layers: wp.array2d(dtype=wp.vec4)
) -> wp.vec4:
    """Return the mean of four texels at a place with the fractions x and y between them."""
    upper = wp.lerp(layers[layer, corners[0]], layers[layer, corners[1]], x)
    return wp.lerp(upper, wp.lerp(layers[layer, corners[2]], layers[layer, corners[3]], x), y)


@wp.func
def image_point(
    q: wp.vec3, n_q: wp.vec3, owner: wp.int32, contact: wp.int32, index: IndexedDecals
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
        place = image_point(points[i], n_q, owner, contact, index)
        uv[i] = wp.vec2(place[0], place[1])
        fields[i] = 1.0 - place[2]


@wp.func
def write_sums(
    i: wp.int32,
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
    images: ImageTexels,
    sums: ImageSums,
):
    """Write what `sample_points` writes, unless these arrays are empty, and the sums over all decals.

    A decal without image is white, and adds nothing to other layers.
    """
    topmost = owner_at(q, n_q, contact, index)
    owner = wp.int32(topmost)
    place = wp.vec3(0.0, 0.0, 0.0)
    if owner != NO_OWNER:
        place = image_point(q, n_q, owner, contact, index)
    if owners.shape[0] > 0:
        owners[i] = owner
        if owner != NO_OWNER:
            uv[i] = wp.vec2(place[0], place[1])
            fields[i] = 1.0 - place[2]
    color = wp.vec4(0.0, 0.0, 0.0, 0.0)
    surface = wp.vec4(0.0, 0.0, 0.0, 0.0)
    emission = wp.vec4(0.0, 0.0, 0.0, 0.0)
    along = wp.vec3(0.0, 0.0, 0.0)
    across = wp.vec3(0.0, 0.0, 0.0)
    upright = wp.float32(0.0)
    while owner != NO_OWNER and color[3] < OPAQUE_ALPHA:
        at = wp.vec2(place[0], place[1])
        if in_image(at):
            left = 1.0 - color[3]
            axis = index.records[RECORD * owner + 2]
            tint = index.records[RECORD * owner + 3]
            opacity = opacity_at(q, n_q, owner, index)
            texel = wp.vec4(1.0, 1.0, 1.0, 1.0)
            if axis[3] >= 0.0:
                extent = images.extents[int(axis[3])]
                x = at[0] * float(extent[1]) - 0.5
                y = (1.0 - at[1]) * float(extent[2]) - 0.5
                corners = corners_at(x, y, extent)
                x = x - wp.floor(x)
                y = y - wp.floor(y)
                for layer in range(images.layers.shape[0]):
                    value = bilinear(corners, x, y, layer, images.layers)
                    if layer == COLORS:
                        texel = value
                    elif layer == SURFACES:
                        radius = visible_radius(owner, index.records)
                        surface += left * (opacity * wp.cw_mul(value, wp.vec4(1.0, 1.0, 1.0, radius)))
                    elif layer == NORMALS:
                        facing = xyz(index.records[RECORD * owner + 1])
                        along += left * (opacity * (value[0] * xyz(axis)))
                        across += left * (opacity * (value[1] * wp.cross(facing, xyz(axis))))
                        upright += left * (opacity * value[2])
                    else:
                        emission += left * (opacity * value)
            color += left * (opacity * wp.cw_mul(texel, wp.vec4(tint[0], tint[1], tint[2], 1.0)))
        if not index.layered:
            break
        rank = rank_of(owner, index.records)
        number = next_number_below(owner, index.records)
        owner = owner_below(q, n_q, rank, number, contact, index)
        if owner != NO_OWNER:
            place = image_point(q, n_q, owner, contact, index)
    sums.color[i] = color
    if sums.surface.shape[0] > 0:
        sums.surface[i] = surface
    if sums.normal.shape[0] > 0 and topmost != NO_OWNER:
        facing = xyz(index.records[RECORD * topmost + 1])
        sums.normal[i] = roll_step(along + across, facing, n_q) + upright * n_q
        sums.emission[i] = emission


@wp.kernel
def sample_images(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
    images: ImageTexels,
    sums: ImageSums,
):
    """Write what `sample_points` writes, unless these arrays are empty, and the sums over all decals."""
    i = first + wp.tid()
    n_q = wp.normalize(normals[i])
    write_sums(i, points[i], n_q, contact, index, owners, uv, fields, images, sums)
