"""Images as arrays that kernels read: premultiplied, in linear light, one after the other."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decals.checks import shown
from decals.errors import InvalidImage
from decals.model import linear_light

RGBA = NDArray[np.uint8]


def texel_arrays(images: Sequence[RGBA]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Lay out sRGB images of any sizes.

    Returns
    -------
    places : int32[k, 3]
        Of each image, its first texel, width and height.
    texels : float32[t, 4]
        Premultiplied linear colours, row after row, the upper row first.

    Raises
    ------
    InvalidImage
        An array that is not ``uint8[h, w, 4]``.
    """
    places, parts, first = [], [], 0
    for number, image in enumerate(images):
        if not isinstance(image, np.ndarray):
            raise InvalidImage(f"image {number} must be uint8[h, w, 4], got {shown(image)}; load it first")
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 4 or 0 in image.shape:
            raise InvalidImage(f"image {number} must be uint8[h, w, 4], got {image.dtype}{list(image.shape)}")
        height, width = image.shape[:2]
        places.append((first, width, height))
        colors = image.reshape(-1, 4).astype(np.float32) / np.float32(255)
        parts.append(np.column_stack([linear_light(colors[:, :3]) * colors[:, 3:], colors[:, 3]]))
        first += width * height
    texels = np.concatenate([np.zeros((0, 4), np.float32), *parts]).astype(np.float32)
    return np.array(places, np.int32).reshape(-1, 3), texels
