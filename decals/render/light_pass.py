"""The light pass: studio light on what the decal pass painted."""

import moderngl

from decals.render.context import Context
from decals.render.decal_pass import use_textures
from decals.render.entry import pixel_pass
from decals.render.gbuffer import GBuffer
from decals.render.parts import WHOLE, Part
from decals.render.tile import MARGIN, Tile, attach_camera, set_uniform

BODY = "lit.glsl"


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
        self._pass = pixel_pass(context, BODY, [self.light])
        attach_camera(self._pass.program)

    def draw(
        self,
        gbuffer: GBuffer,
        paint: moderngl.Texture,
        tile: Tile,
        ambient_radius: float,
        part: Part = WHOLE,
    ) -> None:
        """Light rows of a tile, all of which must be in the G-buffer.

        ``ambient_radius`` is how far away surroundings may be to keep light out, in the scene's units.
        """
        program = self._pass.program
        use_textures(program, {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_paint": paint})
        set_uniform(program, "tile_corner", (tile.x, tile.y))
        set_uniform(program, "tile_size", (tile.width, tile.height))
        set_uniform(program, "ambient_radius", ambient_radius)
        set_uniform(program, "ambient_limit", MARGIN)
        self._pass.run(tile.width, tile.height, part)

    def release(self) -> None:
        """Give the memory back."""
        self._pass.release()
        self.light.release()
