"""The resolve pass, from samples to pixels: a box filter in linear light, the background, and sRGB."""

import moderngl
import numpy as np

from blobtree._typing import UInt8Array
from decals.rendering.context import Context
from decals.rendering.options import Background
from decals.rendering.tiles import Tile, set_uniform
from decals.shaders import compose


def resolve_program(context: Context) -> moderngl.Program:
    """Return the program that filters samples down."""
    return context.program(compose("screen.vert"), compose("resolve.frag"))


class ResolvePass:
    """Filters a tile's samples down and reads the pixels.

    Parameters
    ----------
    context
        Where to draw.
    size
        Size of the largest tile, in samples.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self._program = resolve_program(context)
        self._array = context.gl.vertex_array(self._program, [])
        self._target = context.texture(size, "f1")
        self._framebuffer = context.gl.framebuffer([self._target])
        self._gl = context.gl

    def pixels(self, light: moderngl.Texture, tile: Tile, samples: int, background: Background) -> UInt8Array:
        """Return the tile's pixels, ``uint8[h, w, 4]``, the lowest row first."""
        inner = tile.inner
        width, height = inner.width // samples, inner.height // samples
        self._framebuffer.use()
        self._framebuffer.viewport = (0, 0, width, height)
        self._gl.enable_only(moderngl.NOTHING)
        light.use(0)
        set_uniform(self._program, "light", 0)
        set_uniform(self._program, "samples", samples)
        set_uniform(self._program, "first", (inner.x - tile.x, inner.y - tile.y))
        set_uniform(self._program, "first_row", inner.y / samples)
        set_uniform(self._program, "rows", tile.view.size[1] / samples)
        set_uniform(self._program, "background_top", background.top)
        set_uniform(self._program, "background_bottom", background.bottom)
        self._array.render(vertices=3)
        data = self._framebuffer.read(viewport=(0, 0, width, height), components=4, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 4)

    def release(self) -> None:
        """Release the memory."""
        for resource in (self._array, self._framebuffer, self._target):
            resource.release()
