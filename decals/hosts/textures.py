"""Textures of a shader of decals, as arrays that any graphics library uploads."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, UInt8Array
from blobtree.immutable import Immutable
from decals.errors import TooMuchData
from decals.images.load import HasPixels
from decals.images.texels import decode_srgb, encode_srgb
from decals.rendering.data_texture import ROW_TEXELS, padded_rows, texel_rows
from decals.rendering.image_array import color_texels, common_shape
from decals.rendering.materials import map_texels

MAX_ROWS = 16_384
"""Rows of a texture, at most: a usual limit of graphics cards, and room for 67 million elements."""

MAX_IMAGE_SIDE = 4096
"""Sides of images, at most. The textures of records and index are as wide."""

SRGB, HALF = "srgb8-alpha8", "rgba16f"
"""Formats of images: bytes, of which colours are sRGB and alpha is not; half floats in linear light."""

_DATA_FORMATS = {
    (np.dtype(np.float32), 4): "rgba32f",
    (np.dtype(np.int32), 4): "rgba32i",
    (np.dtype(np.int32), 1): "r32i",
}


@dataclass(frozen=True, eq=False)
class ShaderTexture(Immutable):
    """A texture that a shader of decals reads.

    Attributes
    ----------
    name : str
        Name of its uniform.
    kind : str
        ``"2d"`` or ``"2d-array"``.
    format : str
        ``"rgba32f"``, ``"rgba32i"``, ``"r32i"``, ``"rgba16f"``, or ``"srgb8-alpha8"``: four bytes, the first
        three of them sRGB.
    size : tuple of int
        Width and height, and the number of layers of an array.
    filter : str
        ``"nearest"`` or ``"linear"``.
    mips : bool
        True if the texture needs all its mip levels, which most graphics libraries generate; see `levels`.
    array : numpy.ndarray
        All texels, the first row first; of an array, layer after layer. Read-only.
    binding : int or None
        Number of its binding in version "450", from that of the block of uniforms.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
    >>> records = decals.shader(scene).textures[0]
    >>> records.name, records.format, records.size
    ('decal_records', 'rgba32f', (4096, 1))
    """

    name: str
    kind: str
    format: str
    size: tuple[int, ...]
    filter: str
    mips: bool
    array: NDArray[Any] = field(repr=False)
    binding: int | None = None

    def __post_init__(self) -> None:
        self.array.setflags(write=False)

    def linear(self) -> "ShaderTexture":
        """Return the texture in half floats, for graphics libraries without sRGB; others stay as they are.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20, images=["scale"])
        >>> images = decals.shader(scene).textures[-1]
        >>> images.format, images.linear().format
        ('srgb8-alpha8', 'rgba16f')
        """
        if self.format != SRGB:
            return self
        return replace(self, format=HALF, array=_decoded(self.array).astype(np.float16))

    def levels(self) -> list[NDArray[Any]]:
        """Return the mip levels, the largest first, each half as wide and high; one without `mips`.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20, images=["scale"])
        >>> [level.shape for level in decals.shader(scene).textures[-1].levels()][-2:]
        [(1, 2, 2, 4), (1, 1, 1, 4)]
        """
        levels = [self.array]
        light = _decoded(self.array) if self.format == SRGB else self.array.astype(np.float32)
        while self.mips and max(light.shape[1:3]) > 1:
            for axis in (1, 2):
                if light.shape[axis] > 1:
                    halves = np.split(
                        light.reshape(*light.shape[:axis], -1, 2, *light.shape[axis + 1 :]), 2, axis + 1
                    )
                    light = 0.5 * (halves[0] + halves[1]).squeeze(axis + 1)
            levels.append(_encoded(light) if self.format == SRGB else light.astype(np.float16))
        return levels


def data_texture(name: str, array: NDArray[Any], binding: int | None) -> ShaderTexture:
    """Return the texture of an array of records or of the index; TooMuchData if it has too many rows."""
    rows = data_size(array)[1]
    components = array.shape[1] if array.ndim > 1 else 1
    kind = _DATA_FORMATS[array.dtype, components]
    return ShaderTexture(
        name, "2d", kind, (ROW_TEXELS, rows), "nearest", False, padded_rows(array, rows), binding
    )


def data_size(array: NDArray[Any]) -> tuple[int, int]:
    """Return width and height of the texture of an array; TooMuchData if it has too many rows."""
    rows = texel_rows(len(array))
    if rows > MAX_ROWS:
        raise TooMuchData(
            f"{len(array):,} elements do not fit into one texture; expected at most "
            f"{MAX_ROWS * ROW_TEXELS:,}; take fewer decals"
        )
    return ROW_TEXELS, rows


def image_texture(name: str, images: Sequence[HasPixels], binding: int | None) -> ShaderTexture:
    """Return the texture of images, premultiplied: in bytes if all images are, else in half floats."""
    pixels = [image.pixels for image in images] or [np.zeros((1, 1, 4), np.uint8)]
    shape = image_shape(images)
    light = np.stack([color_texels(image, shape)[::-1] for image in pixels])
    if all(image.dtype == np.uint8 for image in pixels):
        return _array_texture(name, SRGB, _encoded(light), binding)
    return _array_texture(name, HALF, light.astype(np.float16), binding)


def map_texture(name: str, images: Sequence[HasPixels], binding: int | None) -> ShaderTexture:
    """Return the texture of the maps of images, two layers for each."""
    shape = image_shape(images)
    layers = [texels[::-1] for image in images for texels in map_texels(image, shape)]
    return _array_texture(name, HALF, np.stack(layers).astype(np.float16), binding)


def image_shape(images: Sequence[HasPixels]) -> tuple[int, int]:
    """Return height and width of all images."""
    shapes = [(image.pixels.shape[0], image.pixels.shape[1]) for image in images]
    return common_shape(shapes, limit=MAX_IMAGE_SIDE)


def _array_texture(name: str, kind: str, array: NDArray[Any], binding: int | None) -> ShaderTexture:
    layers, height, width = array.shape[:3]
    return ShaderTexture(name, "2d-array", kind, (width, height, layers), "linear", True, array, binding)


def _decoded(array: NDArray[Any]) -> Float32Array:
    """Return bytes as linear light; alpha is linear already."""
    levels = np.arange(256, dtype=np.float32) / np.float32(255)
    light: Float32Array = decode_srgb(levels)[array]
    light[..., 3] = levels[array[..., 3]]
    return light


def _encoded(light: Float32Array) -> UInt8Array:
    """Return linear light as bytes of sRGB, and alpha as bytes."""
    encoded = np.concatenate([encode_srgb(light[..., :3]), light[..., 3:]], axis=-1)
    texels: UInt8Array = np.rint(255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)
    return texels
