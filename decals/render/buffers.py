"""Arrays on the graphics card: textures of 1024 texels a row, read with ``texelFetch``.

Element ``i`` lies at ``ivec2(i & 1023, i >> 10)``: the form into which `blobtree.glsl` translates arrays.
"""

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from decals.render.context import Context

WIDTH = 1024
"""Texels in a row."""

_KINDS = {np.dtype(np.float32): (4, "f4"), np.dtype(np.int32): (1, "i4")}


class DataTexture:
    """A ``float32[n, 4]`` or ``int32[n]`` array as a texture.

    Parameters
    ----------
    context
        Where the texture lives.
    array
        What it holds; an empty array takes one row of zeros, because textures have no size 0.

    Raises
    ------
    ValueError
        Another shape or type, or more elements than a texture has room for.
    """

    def __init__(self, context: Context, array: NDArray[Any]) -> None:
        components, dtype = _kind(array)
        rows = max(1, -(-len(array) // WIDTH))
        if rows > context.max_texture_size:
            raise ValueError(
                f"{len(array):,} elements do not fit into one texture here; the most are "
                f"{context.max_texture_size * WIDTH:,}"
            )
        self.count = len(array)
        self.texture = context.gl.texture(
            (WIDTH, rows), components, _rows(array, rows, components), dtype=dtype
        )
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._components = components

    def read(self) -> NDArray[Any]:
        """Read the array back: the same shape, type and bits."""
        kind = np.float32 if self._components == 4 else np.int32
        flat = np.frombuffer(self.texture.read(), kind)[: self.count * self._components]
        return flat.reshape(-1, 4) if self._components == 4 else flat

    def use(self, unit: int) -> None:
        """Bind the texture to a unit."""
        self.texture.use(unit)

    def release(self) -> None:
        """Give the memory back."""
        self.texture.release()


def _kind(array: NDArray[Any]) -> tuple[int, str]:
    components, dtype = _KINDS.get(array.dtype, (0, ""))
    if array.shape[1:] != ((4,) if components == 4 else ()) or not components:
        raise ValueError(f"expected float32[n, 4] or int32[n], got {array.dtype}{list(array.shape)}")
    return components, dtype


def _rows(array: NDArray[Any], rows: int, components: int) -> NDArray[Any]:
    padded = np.zeros(rows * WIDTH * components, array.dtype)
    padded[: array.size] = array.reshape(-1)
    return padded
