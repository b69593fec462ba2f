"""Maps of materials on unwrapped meshes, as glTF's metallic-roughness model has them."""

from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float32Array, UInt8Array
from decals.baking.unwrapped import Unwrapped
from decals.field.image_texels import MaterialSamples
from decals.images.texels import encode_srgb

ROUGHNESS = 0.7
"""Roughness of surface without material, about that of the studio light's highlight."""

FLAT = 128, 128, 255
SRGB = (*[True] * 3, *[False] * 6, *[True] * 3)
"""True for channels that are sRGB: base colour, normal, occlusion with roughness and metalness, emission."""


@dataclass(frozen=True, eq=False)
class Maps:
    """Textures ``uint8[h, w, 3]`` of a material; None for those that are the same everywhere.

    Attributes
    ----------
    color : uint8[h, w, 3]
        Base colour, sRGB.
    normal : uint8[h, w, 3], optional
        Normals in tangent space, y up.
    surface : uint8[h, w, 3], optional
        Occlusion, roughness, metalness.
    emission : uint8[h, w, 3], optional
        sRGB.
    """

    color: UInt8Array
    normal: UInt8Array | None = None
    surface: UInt8Array | None = None
    emission: UInt8Array | None = None


def vertex_tangents(vertices: Float32Array, unit: Float32Array, part: Unwrapped) -> Float32Array:
    """Return unit tangents along u and the sign of the bitangent along v, ``float32[n, 4]``, v upward.

    The vertices and unit normals are those of the mesh, before it was unwrapped.
    """
    points, normals = vertices[part.rows].astype(np.float64), unit[part.rows].astype(np.float64)
    corners, places = points[part.faces], part.places[part.faces].astype(np.float64)
    a, b = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turned = np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    sums = np.zeros((2, len(points), 3))
    for total, along in zip(
        sums,
        (turned * (b[:, 1:] * p - a[:, 1:] * q), turned * (b[:, :1] * p - a[:, :1] * q)),
        strict=True,  # the second is against the rows, which go down
    ):
        for corner in range(3):
            np.add.at(total, part.faces[:, corner], along)
    tangents, up = sums
    tangents -= (tangents * normals).sum(axis=1, keepdims=True) * normals
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    spare = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])  # where faces cancel
    tangents = np.where(lengths > 1e-12 * np.abs(sums).max(initial=0.0), tangents, spare)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-30)
    signs = np.where((np.cross(normals, tangents) * up).sum(axis=1) < 0.0, -1.0, 1.0)
    return np.column_stack([tangents, signs]).astype(np.float32)


def surface_values(
    colors: Float32Array, samples: MaterialSamples, normals: Float32Array, tangents: Float32Array
) -> Float32Array:
    """Return what a texel averages, ``float32[n, 12]``, from base colours and the maps there."""
    bare = 1.0 - samples.part.astype(np.float64)
    bent = samples.normal + bare[:, None] * normals
    axis = tangents[:, :3] - (tangents[:, :3] * normals).sum(axis=1, keepdims=True) * normals
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-30)
    up = np.sign(tangents[:, 3:]) * np.cross(normals, axis)
    local = np.column_stack([(bent * direction).sum(axis=1) for direction in (axis, up, normals)])
    surface = np.column_stack(
        [samples.occlusion + bare, samples.roughness + bare * ROUGHNESS, samples.metallic]
    )
    return np.concatenate([colors, local, surface, samples.emission], axis=1).astype(np.float32)


def material_bytes(values: Float32Array) -> UInt8Array:
    """Return the texels of all maps, ``uint8[n, 12]``, from means of `surface_values`."""
    normals = values[:, 3:6] / np.maximum(np.linalg.norm(values[:, 3:6], axis=1, keepdims=True), 1e-30)
    levels = [
        255.0 * encode_srgb(values[:, :3]),
        128.0 + 127.0 * normals,
        255.0 * np.clip(values[:, 6:9], 0.0, 1.0),
        255.0 * encode_srgb(values[:, 9:]),
    ]
    texels: UInt8Array = np.rint(np.concatenate(levels, axis=1)).astype(np.uint8)
    return texels


def split_maps(texture: UInt8Array) -> Maps:
    """Return the maps of a texture of 12 channels, or of 3."""
    if texture.shape[2] == 3:
        return Maps(texture)
    color, normal, surface, emission = (np.ascontiguousarray(of) for of in np.split(texture, 4, axis=2))
    return Maps(
        color,
        normal if (normal != FLAT).any() else None,
        surface,
        emission if emission.any() else None,
    )
