"""Base colours of a mesh at points of its faces, in float64 and without the product's code."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def linear(srgb: NDArray[np.generic]) -> Floats:
    """Return linear light of sRGB bytes or of floats from 0 to 1."""
    levels = np.asarray(srgb, np.float64) / (255.0 if srgb.dtype == np.uint8 else 1.0)
    return np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)


def wrapped(position: int, size: int, mode: str) -> int:
    """Return the texel of an infinite row of copies, counted one by one."""
    if mode == "clamp":
        return min(max(position, 0), size - 1)
    copy, place = divmod(position, size)
    return size - 1 - place if mode == "mirror" and copy % 2 else place


def texture_light(image: NDArray[np.uint8], u: float, v: float, modes: tuple[str, str]) -> Floats:
    """Return the bilinear colour of an image at a place, whose lower left corner is (0, 0)."""
    height, width = image.shape[:2]
    x, y = u * width - 0.5, v * height - 0.5
    light = np.zeros(3)
    for column in (int(np.floor(x)), int(np.floor(x)) + 1):
        for row in (int(np.floor(y)), int(np.floor(y)) + 1):
            share = (1.0 - abs(x - column)) * (1.0 - abs(y - row))
            texel = image[height - 1 - wrapped(row, height, modes[1]), wrapped(column, width, modes[0])]
            light += share * linear(texel)
    return light


def base_light(
    weights: Floats,
    corner_colors: Floats,
    corner_places: Floats | None = None,
    images: Sequence[NDArray[np.uint8] | None] = (),
    modes: tuple[str, str] = ("repeat", "repeat"),
) -> Floats:
    """Return the linear colour of each point from the colours ``[n, 3, 3]`` and places of its corners."""
    light = np.array([w @ c for w, c in zip(weights, corner_colors, strict=True)])
    if corner_places is None:
        return light
    for number, image in enumerate(images):
        if image is not None:
            u, v = weights[number] @ corner_places[number]
            light[number] *= texture_light(image, u, v, modes)
    return light
