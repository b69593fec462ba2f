"""The light pass, which lights the painted surface, and the resolve of its samples to pixels."""

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np

from blobtree._typing import UInt8Array
from decals.rendering.context import Context
from decals.rendering.environment import Environment
from decals.rendering.gbuffer import GBuffer
from decals.rendering.lights import Lighting
from decals.rendering.options import Background
from decals.rendering.pixel_pass import PixelPass, Program, attach_camera, set_uniform, use_textures
from decals.rendering.studio import ENVIRONMENTS, studio_ambient
from decals.rendering.viewpoint import TILE_MARGIN, WHOLE, Part, Rectangle, Tile
from decals.shaders import compose

BODY = "light_pass.glsl"
STUDIO_LIGHT, SCENE_LIGHTS, IMAGE_LIGHT = "studio_light.glsl", "lights.glsl", "image_light.glsl"
"""Shader files of the kinds of light."""


NO_LIGHTS = Lighting(())


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
        self._context = context
        self._last: tuple[tuple[object, ...], PixelPass] | None = None
        self._pass(**light_variant(None, None))

    def draw(
        self,
        rectangle: Rectangle,
        gbuffer: GBuffer,
        paint: moderngl.Texture,
        tile: Tile,
        ambient_radius: float,
        lights: Lighting | None = None,
        environment: Environment | None = None,
        maps: Mapping[str, moderngl.Texture] | None = None,
        materials: Mapping[str, moderngl.Texture] | None = None,
        relief: bool = False,
        part: Part = WHOLE,
    ) -> None:
        """Light some rows of a rectangle of a tile; all of the tile must be in the G-buffer.

        ``ambient_radius`` is the greatest distance, in the scene's units, at which surface keeps out the
        studio light, and that of an environment, whose textures are ``maps``. Without ``lights`` and
        environment the studio light is used. ``materials`` are the decal pass's targets; with ``relief`` they
        have shadows.
        """
        variant = light_variant(lights, environment, materials=bool(materials), relief=relief)
        light_pass = self._pass(**variant)
        program = light_pass.program
        textures = {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_paint": paint}
        use_textures(program, textures | dict(materials or {}) | dict(maps or {}))
        if environment is not None:
            set_uniform(program, "environment_strength", environment.strength)
            set_uniform(program, "environment_frame", tuple(environment.frame.T.ravel().tolist()))
        if lights is None or environment is not None:
            set_uniform(program, "tile_corner", (tile.x, tile.y))
            set_uniform(program, "tile_size", (tile.width, tile.height))
            set_uniform(program, "ambient_radius", ambient_radius)
            set_uniform(program, "ambient_limit", TILE_MARGIN)
        if lights is not None or environment is not None:
            _use_lights(program, lights or NO_LIGHTS)
        light_pass.run(rectangle.rows(part))

    def _pass(self, **variant: Any) -> PixelPass:
        """Return the pass of a variant. Only the last pass is kept, because it holds its program."""
        key = tuple(variant.values())
        if self._last is None or self._last[0] != key:
            program = light_program(self._context, **variant)
            if self._last is not None:
                self._last[1].release()
            self._last = key, PixelPass(self._context.gl, program, [self.light])
        return self._last[1]

    def release(self) -> None:
        """Release the memory."""
        if self._last is not None:
            self._last[1].release()
        self.light.release()


def light_variant(
    lights: Lighting | None,
    environment: Environment | None,
    *,
    materials: bool = False,
    relief: bool = False,
) -> dict[str, Any]:
    """Return the arguments of `light_program` for lights and an environment."""
    file = IMAGE_LIGHT if environment is not None else STUDIO_LIGHT if lights is None else SCENE_LIGHTS
    shown = environment is not None and environment.visible
    return {"file": file, "materials": materials, "relief": materials and relief, "shown": shown}


def light_program(context: Context, file: str, *, materials: bool, relief: bool, shown: bool) -> Program:
    """Return the program of a kind of light, by its shader file; ``shown``: the environment is visible."""
    slots, defines = light_text(file, materials=materials, relief=relief, shown=shown)
    return attach_camera(context.pixel_program(BODY, 1, slots=slots, defines=defines))


def light_text(
    file: str, *, materials: bool, relief: bool, shown: bool
) -> tuple[dict[str, str], dict[str, str | bool]]:
    """Return the slots and the definitions of the shader of a kind of light."""
    slots, image = {"lighting": f"//@ include {file}"}, file == IMAGE_LIGHT
    if materials or image:
        kind = "image" if image else "studio"
        environment = f"{ENVIRONMENTS[kind]()}//@ include {kind}_environment.glsl"
        slots |= {"material": "//@ include material.glsl", "environment": environment}
    defines: dict[str, str | bool] = {
        **studio_ambient(),
        "PHYSICAL": materials or image,
        "MATERIAL_LIGHT": materials,
        "RELIEF": relief,
        "ENVIRONMENT_SHOWN": shown,
    }
    return slots, defines


def _use_lights(program: Program, lights: Lighting) -> None:
    set_uniform(program, "light_count", len(lights.lights))
    set_uniform(program, "light_frame", tuple(np.asarray(lights.matrix, np.float32).T.ravel().tolist()))
    rows = program["lights"]
    assert isinstance(rows, moderngl.Uniform)
    rows.write(lights.packed())


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


def shown_program(context: Context) -> moderngl.Program:
    """Return the program that filters samples down for frames that show the picture."""
    return context.program(compose("screen.vert"), compose("shown.frag"))


class ShownPixels:
    """The pixels of a picture that stays on the card, and their depth, for frames that show it.

    Parameters
    ----------
    context
        Where to draw.
    size
        Size of the picture, in samples.
    samples
        Samples per pixel along each axis.

    Attributes
    ----------
    color, depth
        sRGB with premultiplied alpha, and the depth of the nearest sample.
    """

    def __init__(self, context: Context, size: tuple[int, int], samples: int) -> None:
        self.samples, pixels = samples, (size[0] // samples, size[1] // samples)
        self.color = context.texture(pixels, "f1")
        self.depth = context.gl.texture(pixels, 1, dtype="f4")
        self.color.repeat_x = self.color.repeat_y = False  # it may be magnified
        self.depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._pass = PixelPass(context.gl, shown_program(context), [self.color, self.depth])

    def draw(
        self, rectangle: Rectangle, light: moderngl.Texture, depth: moderngl.Texture, part: Part = WHOLE
    ) -> None:
        """Filter a part of the pixel rows down that a rectangle of samples touches."""
        use_textures(self._pass.program, {"light": light, "depth": depth})
        set_uniform(self._pass.program, "samples", self.samples)
        x, y = rectangle.x // self.samples, rectangle.y // self.samples
        right, top = (
            min(-(-end // self.samples), side)
            for end, side in zip(
                (rectangle.x + rectangle.width, rectangle.y + rectangle.height), self.color.size, strict=True
            )
        )
        self._pass.run(Rectangle(x, y, right - x, top - y).rows(part))

    def release(self) -> None:
        """Release the memory."""
        for resource in (self._pass, self.color, self.depth):
            resource.release()
