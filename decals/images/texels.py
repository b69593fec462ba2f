"""Pixels of any depth, and as linear light: bytes and 16 bits hold sRGB, floats hold linear light itself."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from blobtree._typing import Float32Array, FloatArray, UInt8Array
from decals.errors import InvalidImage

Pixels: TypeAlias = NDArray[Any]
"""Straight RGBA ``[h, w, 4]`` of uint8, uint16 or float32, row 0 at the top."""

MAX_IMAGE_EDGE = 16384
"""Longest edge of an image that is read, in pixels: the limit of usual graphics cards."""

MAX_IMAGE_AREA = 1 << 26
"""Most pixels of an image that is read."""


def check_size(width: int, height: int, name: str, max_edge: int = MAX_IMAGE_EDGE) -> None:
    """Raise InvalidImage for a picture without pixels, or with more than are read."""
    if not (0 < width <= max_edge and 0 < height <= max_edge and width * height <= MAX_IMAGE_AREA):
        raise InvalidImage(
            f"expected an image of 1 to {max_edge} pixels a side and {MAX_IMAGE_AREA:,} together, "
            f"{name!r} has {width} x {height}: scale it first"
        )


def decode_srgb(colors: FloatArray) -> FloatArray:
    """Decode sRGB colours from 0 to 1 to linear light, in the precision of ``colors``."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)


def encode_srgb(colors: FloatArray) -> FloatArray:
    """Encode linear light, clamped to [0, 1], as sRGB colours, in the precision of ``colors``."""
    light = np.clip(colors, 0.0, 1.0)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def unit_levels(pixels: Pixels) -> Float32Array:
    """Return levels from 0 to 1, without decoding; floats are returned as they are."""
    if pixels.dtype.kind == "f":
        return pixels.astype(np.float32, copy=False)
    return pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)


def linear_premultiplied(pixels: Pixels) -> Float32Array:
    """Return an image in linear light, colours multiplied by alpha."""
    alpha = unit_levels(pixels[..., 3:])
    if pixels.dtype.kind == "f":
        light = unit_levels(pixels[..., :3])
    else:
        top = np.iinfo(pixels.dtype).max
        levels = np.arange(top + 1, dtype=np.float32) / np.float32(top)
        light = decode_srgb(levels)[pixels[..., :3]]
    return np.concatenate([light * alpha, alpha], axis=-1)


def as_bytes(pixels: Pixels) -> UInt8Array:
    """Return an image as sRGB bytes; light above 1 becomes white."""
    if pixels.dtype == np.uint8:
        return pixels.astype(np.uint8, copy=False)
    levels: UInt8Array = np.rint(255.0 * unit_levels(without_excess(pixels))).astype(np.uint8)
    return levels


def without_excess(pixels: Pixels) -> Pixels:
    """Return an image as sRGB: floats in 16 bits, with light above 1 as white."""
    if pixels.dtype.kind != "f":
        return pixels
    levels = np.concatenate([encode_srgb(pixels[..., :3].astype(np.float64)), pixels[..., 3:]], axis=-1)
    return np.rint(65535.0 * levels).astype(np.uint16)


def resized_texels(texels: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Return texels ``[h, w, c]`` in another shape; without overshoot, so no value leaves its range."""
    if texels.shape[:2] == shape:
        return texels
    channels = [
        np.asarray(
            Image.fromarray(np.ascontiguousarray(channel)).resize(shape[::-1], Image.Resampling.BILINEAR)
        )
        for channel in np.moveaxis(texels, -1, 0)
    ]
    return np.stack(channels, axis=-1)
