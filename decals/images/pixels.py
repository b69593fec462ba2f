"""Pixels of images: their one check, and the decoding of sRGB."""

from typing import Any

import numpy as np

from blobtree._typing import FloatArray, UInt8Array
from decals.errors import ImplicitDecalsError, InvalidImage
from decals.validation import describe


def require_rgba(name: str, pixels: Any, error: type[ImplicitDecalsError] = InvalidImage) -> UInt8Array:
    """Return pixels that are ``uint8[h, w, 4]`` with h, w > 0, or raise an error."""
    if not isinstance(pixels, np.ndarray):
        raise error(f"{name}: expected uint8 pixels [h, w, 4], got {describe(pixels)}; use load_image")
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 4 or 0 in pixels.shape:
        got = f"{pixels.dtype}{list(pixels.shape)}"
        raise error(f"{name}: expected uint8 pixels [h, w, 4], got {got}; use load_image")
    return pixels


def decode_srgb(colors: FloatArray) -> FloatArray:
    """Decode sRGB colours from 0 to 1 to linear light, in the precision of ``colors``."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
