"""The light pass: studio light, or somebody's lamps, on what the decal pass painted."""

import moderngl
import numpy as np

from decals.render.context import Context
from decals.render.decal_pass import use_textures
from decals.render.entry import PixelPass, Program, pixel_pass, pixel_program
from decals.render.gbuffer import GBuffer
from decals.render.lamps import Lamps
from decals.render.parts import WHOLE, Part, Rectangle
from decals.render.tile import MARGIN, Tile, attach_camera, set_uniform

STUDIO, LAMPS = "lit.glsl", "lamplit.glsl"


class LightPass:
    """Reads a G-buffer and its paint, writes linear light.

    Parameters
    ----------
    context
        Where to draw.
    size
        The largest tile, in samples.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.light = context.texture(size, "f2")
        self.light.repeat_x = self.light.repeat_y = False  # it may be magnified
        self._context = context
        self._passes: dict[str, PixelPass] = {}
        self._pass(STUDIO)

    def draw(
        self,
        where: Rectangle,
        gbuffer: GBuffer,
        paint: moderngl.Texture,
        tile: Tile,
        ambient_radius: float,
        lamps: Lamps | None = None,
        part: Part = WHOLE,
    ) -> None:
        """Light rows of a rectangle of a tile, all of which must be in the G-buffer, by studio or lamps.

        ``ambient_radius`` is how far away surroundings may be to keep the studio's light out, in the
        scene's units.
        """
        lighting = self._pass(STUDIO if lamps is None else LAMPS)
        program = lighting.program
        use_textures(program, {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_paint": paint})
        if lamps is None:
            set_uniform(program, "tile_corner", (tile.x, tile.y))
            set_uniform(program, "tile_size", (tile.width, tile.height))
            set_uniform(program, "ambient_radius", ambient_radius)
            set_uniform(program, "ambient_limit", MARGIN)
        else:
            _use_lamps(program, lamps)
        lighting.run(where.rows(part))

    def _pass(self, body: str) -> PixelPass:
        if body not in self._passes:
            self._passes[body] = pixel_pass(
                self._context, lighting_program(self._context, body), [self.light]
            )
        return self._passes[body]

    def release(self) -> None:
        """Give the memory back."""
        for lighting in self._passes.values():
            lighting.release()
        self.light.release()


def lighting_program(context: Context, body: str) -> Program:
    """Give the program that lights with STUDIO or with LAMPS."""
    return attach_camera(pixel_program(context, body, 1))


def _use_lamps(program: Program, lamps: Lamps) -> None:
    set_uniform(program, "lamp_count", len(lamps.lamps))
    set_uniform(program, "lamp_place", tuple(np.asarray(lamps.matrix, np.float32).T.ravel().tolist()))
    rows = program["lamps"]
    assert isinstance(rows, moderngl.Uniform)
    rows.write(lamps.data())
