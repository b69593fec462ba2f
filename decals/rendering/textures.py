"""Textures: the decals' images as one array, and arrays of numbers that shaders read."""

import math
from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from blobtree._typing import Float32Array, UInt8Array
from blobtree.transpile.glsl import TEXTURE_WIDTH_BITS
from decals.errors import TooMuchData
from decals.images.load import decode_srgb
from decals.rendering.context import Context
from decals.validation import require_rgba

MAX_IMAGE_SIZE = 2048
"""Side of an image on the GPU, at most."""
MAX_IMAGE_BYTES = 1 << 29
"""Memory of all images without mip levels, at most; for more, all become smaller."""
_TEXEL_BYTES = 8  # four half floats


class ImageArray:
    """Images for one shader: layer ``i`` is image ``i``, its first row at v = 1.

    Images are sRGB. They are converted to linear light with premultiplied alpha in half floats, so filtering
    and compositing are sums. All layers have one size, with mip levels. An empty list gives one transparent
    layer.

    Raises
    ------
    InvalidImage
        If an array is not ``uint8[h, w, 4]``.
    """

    def __init__(self, context: Context, images: Sequence[UInt8Array]) -> None:
        for number, image in enumerate(images):
            require_rgba(f"image {number}", image)
        size = common_size(
            [image.shape[:2] for image in images], limit=min(MAX_IMAGE_SIZE, context.max_texture_size)
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
        """Release the memory."""
        self.texture.release()


def common_size(shapes: Sequence[tuple[int, ...]], *, limit: int = MAX_IMAGE_SIZE) -> int:
    """Return the power of two from the largest side upward, within the limits of size and memory."""
    largest = max((max(shape) for shape in shapes), default=1)
    size = min(1 << (largest - 1).bit_length(), 1 << (limit.bit_length() - 1))
    while len(shapes) * size * size * _TEXEL_BYTES > MAX_IMAGE_BYTES and size > 1:
        size //= 2
    return size


def linear_premultiplied(image: UInt8Array) -> Float32Array:
    """Return an sRGB image in linear light, colours multiplied by alpha."""
    levels = np.arange(256, dtype=np.float32) / 255
    decoded = decode_srgb(levels)
    alpha = levels[image[..., 3:]]
    return np.concatenate([decoded[image[..., :3]] * alpha, alpha], axis=-1)


def resized(image: UInt8Array, size: int) -> UInt8Array:
    """Return an image as a square, colours weighted by alpha so that hidden colours do not show."""
    if image.shape[:2] == (size, size):
        return image
    picture = Image.fromarray(np.ascontiguousarray(image))
    return np.asarray(picture.resize((size, size), Image.Resampling.LANCZOS))


ROW_TEXELS = 1 << TEXTURE_WIDTH_BITS
"""Texels in a row of a data texture; 16,384 rows, a usual limit, hold 67 million elements."""

_KINDS = {
    (np.dtype(np.float32), (4,)): "f4",
    (np.dtype(np.int32), ()): "i4",
    (np.dtype(np.int32), (4,)): "i4",
}


class DataTexture:
    """A ``float32[n, 4]``, ``int32[n]`` or ``int32[n, 4]`` array as a texture.

    Parameters
    ----------
    context
        Where the texture lives.
    array
        Its contents; an empty array takes one row of zeros, because no texture has size 0.

    Raises
    ------
    ValueError
        If the array has another shape or type.
    TooMuchData
        If the array has more elements than a texture on this GPU.
    """

    def __init__(self, context: Context, array: NDArray[Any]) -> None:
        components, dtype = _kind(array)
        rows = max(1, -(-len(array) // ROW_TEXELS))
        if rows > context.max_texture_size:
            raise TooMuchData(
                f"{len(array):,} elements do not fit into one texture here; expected at most "
                f"{context.max_texture_size * ROW_TEXELS:,}; take fewer decals or a smaller tree"
            )
        self.count = len(array)
        self.texture = context.gl.texture(
            (ROW_TEXELS, rows), components, _rows(array, rows, components), dtype=dtype
        )
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._shape, self._kind = array.shape[1:], array.dtype

    def read(self) -> NDArray[Any]:
        """Read the array back: the same shape, type and bits."""
        flat = np.frombuffer(self.texture.read(), self._kind)
        return flat[: self.count * math.prod(self._shape)].reshape(-1, *self._shape)

    def write(self, first: int, array: NDArray[Any]) -> None:
        """Overwrite the elements from ``first`` on; only their bytes are uploaded."""
        done = 0
        while done < len(array):
            x, y = (first + done) % ROW_TEXELS, (first + done) // ROW_TEXELS
            left = len(array) - done
            whole_rows = x == 0 and left >= ROW_TEXELS
            width, height = (ROW_TEXELS, left // ROW_TEXELS) if whole_rows else (min(ROW_TEXELS - x, left), 1)
            part = np.ascontiguousarray(array[done : done + width * height], self._kind)
            self.texture.write(part, viewport=(x, y, width, height))
            done += width * height

    def use(self, unit: int) -> None:
        """Bind the texture to a unit."""
        self.texture.use(unit)

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()


def _kind(array: NDArray[Any]) -> tuple[int, str]:
    """Return the components of a texel, and their moderngl type."""
    kind = _KINDS.get((array.dtype, array.shape[1:]))
    if kind is None or not array.ndim:
        raise ValueError(
            f"expected float32[n, 4], int32[n] or int32[n, 4], got {array.dtype}{list(array.shape)}"
        )
    return math.prod(array.shape[1:]), kind


def _rows(array: NDArray[Any], rows: int, components: int) -> NDArray[Any]:
    padded = np.zeros(rows * ROW_TEXELS * components, array.dtype)
    padded[: array.size] = array.reshape(-1)
    return padded
