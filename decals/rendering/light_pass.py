"""The light pass: studio light, or the lights of a scene, on the surface that the decal pass painted."""

import moderngl
import numpy as np

from decals.rendering.context import Context
from decals.rendering.decal_pass import use_textures
from decals.rendering.gbuffer import GBuffer
from decals.rendering.lights import Lighting
from decals.rendering.pixel_pass import PixelPass, Program, pixel_pass
from decals.rendering.regions import WHOLE, Part, Rectangle
from decals.rendering.tiles import TILE_MARGIN, Tile, attach_camera, set_uniform

BODY = "light_pass.glsl"
STUDIO_LIGHT, SCENE_LIGHTS = "studio_light.glsl", "lights.glsl"
"""Shader files of the two kinds of light."""


class LightPass:
    """Reads a G-buffer and its painted colours, writes linear light.

    Parameters
    ----------
    context
        Where to draw.
    size
        Size of the largest tile, in samples.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.light = context.texture(size, "f2")
        self.light.repeat_x = self.light.repeat_y = False  # it may be magnified
        self._context = context
        self._passes: dict[str, PixelPass] = {}
        self._pass(STUDIO_LIGHT)

    def draw(
        self,
        rectangle: Rectangle,
        gbuffer: GBuffer,
        paint: moderngl.Texture,
        tile: Tile,
        ambient_radius: float,
        lights: Lighting | None = None,
        part: Part = WHOLE,
    ) -> None:
        """Light some rows of a rectangle of a tile; all of the tile must be in the G-buffer.

        ``ambient_radius`` is the greatest distance, in the scene's units, at which surface keeps out the
        studio light. Without ``lights`` the studio light is used.
        """
        light_pass = self._pass(light_file(lights))
        program = light_pass.program
        use_textures(program, {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_paint": paint})
        if lights is None:
            set_uniform(program, "tile_corner", (tile.x, tile.y))
            set_uniform(program, "tile_size", (tile.width, tile.height))
            set_uniform(program, "ambient_radius", ambient_radius)
            set_uniform(program, "ambient_limit", TILE_MARGIN)
        else:
            _use_lights(program, lights)
        light_pass.run(rectangle.rows(part))

    def _pass(self, file: str) -> PixelPass:
        if file not in self._passes:
            program = light_program(self._context, file)
            self._passes[file] = pixel_pass(self._context.gl, program, [self.light])
        return self._passes[file]

    def release(self) -> None:
        """Release the memory."""
        for light_pass in self._passes.values():
            light_pass.release()
        self.light.release()


def light_file(lights: Lighting | None) -> str:
    """Return the shader file of the studio light or of lights of a scene."""
    return STUDIO_LIGHT if lights is None else SCENE_LIGHTS


def light_program(context: Context, file: str) -> Program:
    """Return the program of a kind of light, by its shader file."""
    return attach_camera(context.pixel_program(BODY, 1, slots={"lighting": f"//@ include {file}"}))


def _use_lights(program: Program, lights: Lighting) -> None:
    set_uniform(program, "light_count", len(lights.lights))
    set_uniform(program, "light_frame", tuple(np.asarray(lights.matrix, np.float32).T.ravel().tolist()))
    rows = program["lights"]
    assert isinstance(rows, moderngl.Uniform)
    rows.write(lights.packed())
