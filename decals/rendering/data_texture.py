"""Arrays as textures."""

import math
from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from blobtree.transpile.glsl import TEXTURE_WIDTH_BITS
from decals.errors import TooMuchData
from decals.rendering.context import Context

ROW_TEXELS = 1 << TEXTURE_WIDTH_BITS
"""Texels in a row of a data texture; 16,384 rows, a usual limit, hold 67 million elements."""

_TEXTURE_KINDS = {
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
        rows = texel_rows(len(array))
        if rows > context.max_texture_size:
            raise TooMuchData(
                f"{len(array):,} elements do not fit into one texture here; expected at most "
                f"{context.max_texture_size * ROW_TEXELS:,}; take fewer decals or a smaller tree"
            )
        if rows & (rows - 1) == 0 and rows < context.max_texture_size:
            rows = max(rows + 1, 3)  # llvmpipe compiles programs anew where a side becomes a power of two
        self.count = len(array)
        self.texture = context.gl.texture(
            (ROW_TEXELS, rows), components, padded_rows(array, rows), dtype=dtype
        )
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._shape, self._kind = array.shape[1:], array.dtype
        self._gl = context.gl
        self._buffer: moderngl.Buffer | None = None

    def read(self) -> NDArray[Any]:
        """Read the array back: the same shape, type and bits."""
        flat = np.frombuffer(self.texture.read(), self._kind)
        return flat[: self.count * math.prod(self._shape)].reshape(-1, *self._shape)

    def write(self, first: int, array: NDArray[Any]) -> None:
        """Overwrite the elements from ``first`` on; only their bytes are uploaded."""
        if self._buffer is not None and len(array):
            part = np.ascontiguousarray(array, self._kind)
            self._buffer.write(part, first * part[0].nbytes)
        for x, y, texels in rectangles(first, array):
            height, width = texels.shape[:2]
            part = np.ascontiguousarray(texels, self._kind)
            self.texture.write(part, viewport=(x, y, width, height))

    def use(self, unit: int) -> None:
        """Bind the texture to a unit."""
        self.texture.use(unit)

    def store(self, binding: int) -> None:
        """Bind a storage buffer with the same contents; the first call makes it."""
        if self._buffer is None:
            self._buffer = self._gl.buffer(self.texture.read())
        self._buffer.bind_to_storage_buffer(binding)

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()
        if self._buffer is not None:
            self._buffer.release()


def texel_rows(count: int) -> int:
    """Return the rows of texels that so many elements take, at least one."""
    return max(1, -(-count // ROW_TEXELS))


def rectangles(first: int, array: NDArray[Any]) -> Iterator[tuple[int, int, NDArray[Any]]]:
    """Yield column, row and texels ``[h, w, …]`` of the rectangles that elements from ``first`` on fill."""
    done = 0
    while done < len(array):
        y, x = divmod(first + done, ROW_TEXELS)
        left = len(array) - done
        whole_rows = x == 0 and left >= ROW_TEXELS
        width, height = (ROW_TEXELS, left // ROW_TEXELS) if whole_rows else (min(ROW_TEXELS - x, left), 1)
        part = array[done : done + width * height]
        yield x, y, part.reshape(height, width, *array.shape[1:])
        done += len(part)


def padded_rows(array: NDArray[Any], rows: int) -> NDArray[Any]:
    """Return an array as so many rows of texels, with zeros behind its end."""
    padded = np.zeros((rows * ROW_TEXELS, *array.shape[1:]), array.dtype)
    padded[: len(array)] = array
    return padded.reshape(rows, ROW_TEXELS, *array.shape[1:])


def _kind(array: NDArray[Any]) -> tuple[int, str]:
    """Return the components of a texel, and their moderngl type."""
    kind = _TEXTURE_KINDS.get((array.dtype, array.shape[1:]))
    if kind is None or not array.ndim:
        raise ValueError(
            f"expected float32[n, 4], int32[n] or int32[n, 4], got {array.dtype}{list(array.shape)}"
        )
    return math.prod(array.shape[1:]), kind
