"""Arrays on the graphics card: textures of 4096 texels a row, read with ``texelFetch``.

Element ``i`` lies at ``ivec2(i & 4095, i >> 12)``: `blobtree.typed.glsl` translates arrays into that form.
"""

import math
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from blobtree.typed.glsl import TEXTURE_WIDTH_BITS
from decals.errors import TooMuchData
from decals.render.context import Context

WIDTH = 1 << TEXTURE_WIDTH_BITS
"""Texels in a row. With 16,384 rows, which every card of the last ten years has, 67 million elements."""

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
        What it holds; an empty array takes one row of zeros, because textures have no size 0.

    Raises
    ------
    ValueError
        Another shape or type.
    TooMuchData
        More elements than a texture has room for here.
    """

    def __init__(self, context: Context, array: NDArray[Any]) -> None:
        components, dtype = _kind(array)
        rows = max(1, -(-len(array) // WIDTH))
        if rows > context.max_texture_size:
            raise TooMuchData(
                f"{len(array):,} elements do not fit into one texture here; expected at most "
                f"{context.max_texture_size * WIDTH:,}; take fewer decals or a smaller tree"
            )
        self.count = len(array)
        self.texture = context.gl.texture(
            (WIDTH, rows), components, _rows(array, rows, components), dtype=dtype
        )
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._shape, self._kind = array.shape[1:], array.dtype

    def read(self) -> NDArray[Any]:
        """Read the array back: the same shape, type and bits."""
        flat = np.frombuffer(self.texture.read(), self._kind)
        return flat[: self.count * math.prod(self._shape)].reshape(-1, *self._shape)

    def write(self, first: int, array: NDArray[Any]) -> None:
        """Write over the elements from ``first`` on: their bytes alone go to the card."""
        done = 0
        while done < len(array):
            x, y = (first + done) % WIDTH, (first + done) // WIDTH
            left = len(array) - done
            width, height = (WIDTH, left // WIDTH) if x == 0 and left >= WIDTH else (min(WIDTH - x, left), 1)
            part = np.ascontiguousarray(array[done : done + width * height], self._kind)
            self.texture.write(part, viewport=(x, y, width, height))
            done += width * height

    def use(self, unit: int) -> None:
        """Bind the texture to a unit."""
        self.texture.use(unit)

    def release(self) -> None:
        """Give the memory back."""
        self.texture.release()


def _kind(array: NDArray[Any]) -> tuple[int, str]:
    """Components of a texel, and their type as moderngl names it."""
    kind = _KINDS.get((array.dtype, array.shape[1:]))
    if kind is None or not array.ndim:
        raise ValueError(
            f"expected float32[n, 4], int32[n] or int32[n, 4], got {array.dtype}{list(array.shape)}"
        )
    return math.prod(array.shape[1:]), kind


def _rows(array: NDArray[Any], rows: int, components: int) -> NDArray[Any]:
    padded = np.zeros(rows * WIDTH * components, array.dtype)
    padded[: array.size] = array.reshape(-1)
    return padded
