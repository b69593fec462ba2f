"""The decals' images as one texture array: one size, premultiplied, linear light, with mip levels."""

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from decals.errors import InvalidImage
from decals.render.context import Context

MAX_SIZE = 2048
"""Images are at most this wide on the card."""
MAX_BYTES = 1 << 29
"""All of them together take at most this much, before mip levels; beyond, all become smaller."""
_BYTES = 8  # four half floats

RGBA = NDArray[np.uint8]


class ImageArray:
    """Images for one shader: layer ``i`` is image ``i``, its first row at v = 1.

    Images are sRGB; here they become linear light with premultiplied alpha in half floats, so filtering and
    compositing are sums. An empty list takes one transparent layer.

    Raises
    ------
    InvalidImage
        An array that is not ``uint8[h, w, 4]``.
    """

    def __init__(self, context: Context, images: Sequence[RGBA]) -> None:
        for number, image in enumerate(images):
            if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 4 or 0 in image.shape:
                raise InvalidImage(
                    f"image {number} must be uint8[h, w, 4], got {image.dtype}{list(image.shape)}"
                )
        size = common_size(
            [image.shape[:2] for image in images], limit=min(MAX_SIZE, context.max_texture_size)
        )
        layers = [linear_premultiplied(resized(image, size)) for image in images] or [
            np.zeros((size, size, 4), np.float32)
        ]
        data = np.stack(layers)[:, ::-1].astype(np.float16)
        self.size = size
        self.texture = context.gl.texture_array((size, size, len(layers)), 4, data.tobytes(), dtype="f2")
        self.texture.repeat_x = self.texture.repeat_y = False
        self.texture.build_mipmaps()
        self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.texture.anisotropy = context.anisotropy

    def use(self, unit: int) -> None:
        """Bind the array to a unit."""
        self.texture.use(unit)

    def release(self) -> None:
        """Give the memory back."""
        self.texture.release()


def common_size(shapes: Sequence[tuple[int, ...]], *, limit: int = MAX_SIZE) -> int:
    """Give the power of two that holds the largest side, within the limits of size and memory."""
    largest = max((max(shape) for shape in shapes), default=1)
    size = min(1 << (largest - 1).bit_length(), 1 << (limit.bit_length() - 1))
    while len(shapes) * size * size * _BYTES > MAX_BYTES and size > 1:
        size //= 2
    return size


def linear_premultiplied(image: RGBA) -> NDArray[np.float32]:
    """Decode sRGB, and multiply the colours by alpha."""
    levels = np.arange(256, dtype=np.float32) / 255
    decoded = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4).astype(
        np.float32
    )
    alpha = levels[image[..., 3:]]
    return np.concatenate([decoded[image[..., :3]] * alpha, alpha], axis=-1)


def resized(image: RGBA, size: int) -> RGBA:
    """Bring an image to a square, colours weighted by alpha so that hidden ones do not bleed in."""
    if image.shape[:2] == (size, size):
        return image
    picture = Image.fromarray(np.ascontiguousarray(image))
    return np.asarray(picture.resize((size, size), Image.Resampling.LANCZOS))
