"""From samples to pixels: a box filter in linear light, the background, and sRGB."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from decals.checks import shown
from decals.errors import InvalidScene
from decals.render.context import Context
from decals.render.tile import Tile, set_uniform
from implicit_decals.shaders import compose

Rgba = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Background:
    """A vertical gradient behind everything: sRGB and alpha, each in [0, 1], not premultiplied."""

    top: Rgba
    bottom: Rgba

    def __post_init__(self) -> None:
        for name, color in (("top", self.top), ("bottom", self.bottom)):
            try:
                given = np.array(color, np.float64)
            except (TypeError, ValueError, OverflowError):
                given = np.zeros(0)
            if given.shape != (4,) or not ((given >= 0.0) & (given <= 1.0)).all():
                raise InvalidScene(
                    f"a background's {name}: expected sRGB and alpha in [0, 1], got {shown(color)}"
                )


STUDIO = Background((0.80, 0.82, 0.85, 1.0), (0.96, 0.96, 0.95, 1.0))
"""Light grey paper, a little darker at the top."""
TRANSPARENT = Background((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
"""Nothing: alpha is how much of a pixel the objects cover."""


def resolve_program(context: Context) -> moderngl.Program:
    """Give the program that filters samples down."""
    return context.program(compose("screen.vert"), compose("resolve.frag"))


class ResolvePass:
    """Filters a tile's samples down and reads the pixels.

    Parameters
    ----------
    context
        Where to draw.
    size
        The largest tile, in samples.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self._program = resolve_program(context)
        self._array = context.gl.vertex_array(self._program, [])
        self._target = context.texture(size, "f1")
        self._framebuffer = context.gl.framebuffer([self._target])
        self._gl = context.gl

    def pixels(
        self, light: moderngl.Texture, tile: Tile, samples: int, background: Background
    ) -> NDArray[np.uint8]:
        """Give the tile's pixels, ``uint8[h, w, 4]``, the lowest row first."""
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
        set_uniform(self._program, "rows", tile.picture.size[1] / samples)
        set_uniform(self._program, "background_top", background.top)
        set_uniform(self._program, "background_bottom", background.bottom)
        self._array.render(vertices=3)
        data = self._framebuffer.read(viewport=(0, 0, width, height), components=4, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 4)

    def release(self) -> None:
        """Give the memory back."""
        for resource in (self._array, self._framebuffer, self._target):
            resource.release()
