"""The decal pass: one full-screen triangle colours all pixels, however many decals and objects there are."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from decals.mapping import Mapping
from decals.render.context import Context
from decals.render.decal_data import DecalData, library
from decals.render.gbuffer import GBuffer
from decals.render.textures import ImageArray
from decals.render.tile import MARGIN, Tile, attach_camera, read_floats, set_uniform
from implicit_decals.shaders import Source, compose

FIRST_UNIT = 3
"""Texture units below hold the G-buffer, this one the images, those above the decals' data."""


@dataclass(frozen=True, slots=True)
class Look:
    """How decals lie and how light falls.

    Parameters
    ----------
    mapping
        How images are laid onto curved surface.
    ambient_radius
        How far away surroundings may be to keep light out, in the scene's units.
    """

    mapping: Mapping
    ambient_radius: float


class DecalPass:
    """Reads a G-buffer, writes linear light and, where asked, what was found at every pixel.

    Parameters
    ----------
    context
        Where to draw.
    size
        The largest tile, in samples.
    buffers
        Whether to write owner, field and uv too.
    """

    def __init__(self, context: Context, size: tuple[int, int], *, buffers: bool = False) -> None:
        self.light = context.gl.texture(size, 4, dtype="f2")
        self.decal = context.gl.texture(size, 4, dtype="f4") if buffers else None
        targets = [texture for texture in (self.light, self.decal) if texture is not None]
        self._framebuffer = context.gl.framebuffer(targets)
        self._context = context
        self._arrays: dict[bool, moderngl.VertexArray] = {}

    def draw(
        self,
        gbuffer: GBuffer,
        tile: Tile,
        decals: DecalData | None,
        images: ImageArray | None,
        look: Look,
    ) -> None:
        """Shade a tile; without decals (or images for them) only the objects' own colours are seen."""
        array = self._array(with_decals=decals is not None)
        program = array.program
        self._framebuffer.use()
        self._framebuffer.viewport = (0, 0, tile.width, tile.height)
        self._context.gl.enable_only(moderngl.NOTHING)
        textures = {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_color": gbuffer.color}
        set_uniform(program, "tile_corner", (tile.x, tile.y))
        set_uniform(program, "tile_size", (tile.width, tile.height))
        set_uniform(program, "ambient_radius", look.ambient_radius)
        set_uniform(program, "ambient_limit", MARGIN)
        for unit, (name, texture) in enumerate(textures.items()):
            texture.use(unit)
            set_uniform(program, name, unit)
        if decals is not None and images is not None:
            images.use(FIRST_UNIT)
            set_uniform(program, "decal_images", FIRST_UNIT)
            set_uniform(program, "decal_mapping", int(look.mapping))
            decals.use(program, FIRST_UNIT + 1)
        array.render(vertices=3)

    def read_decal(self, tile: Tile) -> NDArray[np.float32]:
        """Read owner, field and uv, ``float32[h, w, 4]``, the lowest row first."""
        return read_floats(self._framebuffer, 1, tile)

    def _array(self, *, with_decals: bool) -> moderngl.VertexArray:
        if with_decals not in self._arrays:
            fragment = fragment_source(decals=with_decals, buffers=self.decal is not None)
            program = attach_camera(self._context.program(compose("screen.vert"), fragment))
            self._arrays[with_decals] = self._context.gl.vertex_array(program, [])
        return self._arrays[with_decals]

    def release(self) -> None:
        """Give the memory back."""
        for resource in (*self._arrays.values(), self._framebuffer, self.light, self.decal):
            if resource is not None:
                resource.release()


def fragment_source(*, decals: bool, buffers: bool) -> Source:
    """Compose the pass's fragment shader."""
    slots = {"decals": "//@ include decals.glsl", "functions": library()} if decals else {}
    return compose("decals.frag", slots=slots, defines={"DECALS": decals, "BUFFERS": buffers})
