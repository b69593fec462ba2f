"""Arrays as textures."""

import math
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
        rows = max(1, -(-len(array) // ROW_TEXELS))
        if rows > context.max_texture_size:
            raise TooMuchData(
                f"{len(array):,} elements do not fit into one texture here; expected at most "
                f"{context.max_texture_size * ROW_TEXELS:,}; take fewer decals or a smaller tree"
            )
        if rows & (rows - 1) == 0 and rows < context.max_texture_size:
            rows = max(rows + 1, 3)  # llvmpipe compiles programs anew where a side becomes a power of two
        self.count = len(array)
        self.texture = context.gl.texture(
            (ROW_TEXELS, rows), components, _rows(array, rows, components), dtype=dtype
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
        done = 0
        while done < len(array):
            x, y = (first + done) % ROW_TEXELS, (first + done) // ROW_TEXELS
            left = len(array) - done
            whole_rows = x == 0 and left >= ROW_TEXELS
            width, height = (ROW_TEXELS, left // ROW_TEXELS) if whole_rows else (min(ROW_TEXELS - x, left), 1)
            part = np.ascontiguousarray(array[done : done + width * height], self._kind)
            self.texture.write(part, viewport=(x, y, width, height))
            if self._buffer is not None:
                self._buffer.write(part, (first + done) * part[0].nbytes)
            done += width * height

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


def _kind(array: NDArray[Any]) -> tuple[int, str]:
    """Return the components of a texel, and their moderngl type."""
    kind = _TEXTURE_KINDS.get((array.dtype, array.shape[1:]))
    if kind is None or not array.ndim:
        raise ValueError(
            f"expected float32[n, 4], int32[n] or int32[n, 4], got {array.dtype}{list(array.shape)}"
        )
    return math.prod(array.shape[1:]), kind


def _rows(array: NDArray[Any], rows: int, components: int) -> NDArray[Any]:
    padded = np.zeros(rows * ROW_TEXELS * components, array.dtype)
    padded[: array.size] = array.reshape(-1)
    return padded
