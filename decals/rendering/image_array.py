"""The images of decals on the GPU."""

from collections.abc import Sequence
from typing import TypeVar

import moderngl
import numpy as np
from PIL import Image

from blobtree._typing import Float32Array, UInt8Array
from decals.images.texels import Pixels, linear_premultiplied, resized_texels
from decals.rendering.context import Context
from decals.validation import require_rgba

MAX_IMAGE_BYTES = 1 << 29
"""Memory of all images without mip levels, at most; for more, all become smaller."""
_TEXEL_BYTES = 8  # four half floats

Texels = TypeVar("Texels", UInt8Array, Float32Array)


class ImageArray:
    """Images for one shader: layer ``i`` is image ``i``, its first row at v = 1.

    Images are converted to linear light with premultiplied alpha in half floats, so filtering and
    compositing are sums. All layers have one width and one height, with mip levels. An empty list gives
    one transparent layer.

    Attributes
    ----------
    width, height : int
        Texels of a layer.
    texture : moderngl.TextureArray
        The layers.

    Raises
    ------
    InvalidImage
        If an array is no image, see `decals.images.texels.Pixels`.
    """

    def __init__(self, context: Context, images: Sequence[Pixels]) -> None:
        for number, image in enumerate(images):
            require_rgba(f"image {number}", image)
        shapes = [(image.shape[0], image.shape[1]) for image in images]
        self.height, self.width = common_shape(shapes, limit=context.max_texture_size)
        layers = len(images) or 1
        self.texture = context.gl.texture_array((self.width, self.height, layers), 4, dtype="f2")
        empty = np.zeros((1, 1, 4), np.uint8)
        for layer, image in enumerate(images or [empty]):
            texels = color_texels(image, (self.height, self.width))[::-1]
            region = (0, 0, layer, self.width, self.height, 1)
            self.texture.write(texels.astype(np.float16).tobytes(), viewport=region)
        self.texture.repeat_x = self.texture.repeat_y = False
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        if max(self.height, self.width) > 1:  # the first mip levels of a context cost llvmpipe 70 ms
            self.texture.build_mipmaps()
            self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.texture.anisotropy = context.anisotropy

    def use(self, unit: int) -> None:
        """Bind the array to a unit."""
        self.texture.use(unit)

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()


def common_shape(shapes: Sequence[tuple[int, int]], *, limit: int) -> tuple[int, int]:
    """Return powers of two from the largest height and width upward, within the limits of size and memory."""
    height, width = (
        min(1 << (max(sides, default=1) - 1).bit_length(), 1 << (limit.bit_length() - 1))
        for sides in ([shape[axis] for shape in shapes] for axis in (0, 1))
    )
    while len(shapes) * height * width * _TEXEL_BYTES > MAX_IMAGE_BYTES:
        if height >= width:
            height //= 2
        else:
            width //= 2
    return height, width


def color_texels(image: Pixels, shape: tuple[int, int]) -> Float32Array:
    """Return an image in linear light and another shape, with colours around its disc."""
    if image.dtype == np.uint8:
        return linear_premultiplied(filled_corners(resized(image.astype(np.uint8, copy=False), shape)))
    return resized_texels(filled_corners(linear_premultiplied(image)), shape)


def resized(image: UInt8Array, shape: tuple[int, int]) -> UInt8Array:
    """Return an image in another shape, colours weighted by alpha so that hidden colours do not show."""
    if image.shape[:2] == shape:
        return image
    picture = Image.fromarray(np.ascontiguousarray(image))
    return np.asarray(picture.resize(shape[::-1], Image.Resampling.LANCZOS))


DISC_MARGIN = 1.5
"""Texels around the disc of an image that bilinear look-ups inside it may read."""


def filled_corners(image: Texels) -> Texels:
    """Return an image whose texels outside its disc continue its rim outward.

    Decals show the disc alone, but mip levels average texels on both sides of its rim.
    """
    height, width = image.shape[:2]
    y = (np.arange(height, dtype=np.float32) + 0.5)[:, None] - 0.5 * height
    x = (np.arange(width, dtype=np.float32) + 0.5) - 0.5 * width
    distance = np.hypot(2.0 * x / width, 2.0 * y / height)
    outside = np.nonzero(distance > 1.0 + 2.0 * DISC_MARGIN / min(height, width))
    if not len(outside[0]):
        return image
    filled = image.copy()
    shrink = (1.0 - 1.0 / min(height, width)) / distance[outside]
    row = (0.5 * height + y[outside[0], 0] * shrink).astype(np.intp)
    column = (0.5 * width + x[outside[1]] * shrink).astype(np.intp)
    filled[outside] = image[row, column]
    return filled
