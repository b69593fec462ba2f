"""The decal pass: colours all pixels at once, however many decals and objects there are."""

from collections.abc import Mapping as Table

import moderngl
import numpy as np
from numpy.typing import NDArray

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render.context import Context
from decals.render.decal_data import DecalData, library
from decals.render.entry import PixelPass, Program, pixel_pass, pixel_program
from decals.render.gbuffer import GBuffer
from decals.render.parts import WHOLE, Part, Rectangle
from decals.render.textures import ImageArray
from decals.render.tile import Tile, attach_camera, read_floats, set_uniform

BODY = "paint.glsl"
FIRST_UNIT = 3
"""Texture units below hold the G-buffer, this one the images, those above the decals' data."""


class DecalPass:
    """Reads a G-buffer, writes its colour with decals and, where asked, what was found at every pixel.

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
        self.paint = context.texture(size, "f2")
        self.decal = context.texture(size, "f4") if buffers else None
        self._targets = [texture for texture in (self.paint, self.decal) if texture is not None]
        self._reading = context.gl.framebuffer(self._targets)
        self._context = context
        self._passes: dict[str, PixelPass] = {}

    def draw(
        self,
        where: Rectangle,
        gbuffer: GBuffer,
        decals: DecalData | None,
        images: ImageArray | None,
        mapping: Mapping,
        contact: Contact,
        part: Part = WHOLE,
    ) -> None:
        """Paint rows of a rectangle; without decals (or images for them) the objects' own colours show.

        ``mapping`` is how images are laid onto curved surface, ``contact`` how decals push each other.
        """
        painting = self._pass("" if decals is None else library(contact, layered=decals.layered))
        program = painting.program
        textures = {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_color": gbuffer.color}
        use_textures(program, textures)
        if decals is not None and images is not None:
            images.use(FIRST_UNIT)
            set_uniform(program, "decal_images", FIRST_UNIT)
            set_uniform(program, "decal_mapping", int(mapping))
            decals.use(program, FIRST_UNIT + 1)
        painting.run(where.rows(part))

    def read_decal(self, tile: Tile) -> NDArray[np.float32]:
        """Read owner, field and uv, ``float32[h, w, 4]``, the lowest row first."""
        return read_floats(self._reading, 1, tile)

    def _pass(self, functions: str) -> PixelPass:
        """Give the pass with these decal functions, or without decals where there are none."""
        if functions not in self._passes:
            program = painting_program(self._context, functions, len(self._targets))
            self._passes[functions] = pixel_pass(self._context, program, self._targets)
        return self._passes[functions]

    def release(self) -> None:
        """Give the memory back."""
        for painting in self._passes.values():
            painting.release()
        self._reading.release()
        for target in self._targets:
            target.release()


def painting_program(context: Context, functions: str, targets: int = 1) -> Program:
    """Give the program that paints with these decal functions, or without decals where there are none."""
    slots = {"decals": "//@ include decals.glsl", "functions": functions} if functions else {}
    defines = {"DECALS": bool(functions)}
    return attach_camera(pixel_program(context, BODY, targets, slots=slots, defines=defines))


def use_textures(program: Program, textures: Table[str, moderngl.Texture]) -> None:
    """Bind textures to the units from 0 on, and tell the program by their names."""
    for unit, (name, texture) in enumerate(textures.items()):
        texture.use(unit)
        set_uniform(program, name, unit)
