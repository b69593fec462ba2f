"""The G-buffer: the visible surface at every pixel, which all kinds of objects write."""

from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np

from blobtree._typing import Float32Array
from decals.rendering.context import DEPTH, Context
from decals.rendering.loop_guard import LoopGuard
from decals.rendering.pixel_pass import (
    GROUP,
    PassBackend,
    attach_camera,
    read_floats,
    run_pixels,
    scissor_of,
    set_uniform,
)
from decals.rendering.viewpoint import WHOLE, Part, Rectangle, Tile
from decals.shaders import compose

NO_FACE = 0xFFFFFFFF
"""Entry of a pixel without a face."""


class GBuffer:
    """Position and object, normal, base colour, depth: see ``shaders/gbuffer.glsl``.

    Parameters
    ----------
    context
        Where to make the textures.
    size
        Width and height in samples.
    """

    def __init__(self, context: Context, size: tuple[int, int]) -> None:
        self.size = size
        self.position = context.texture(size, "f4")
        self.normal = context.texture(size, "f4")
        self.color = context.texture(size, "f2")
        self.depth = context.texture(size, DEPTH)
        for texture in (self.position, self.normal, self.color):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.guard = LoopGuard(context, size)
        self._framebuffer = context.gl.framebuffer([self.position, self.normal, self.color], self.depth)
        self._depth_framebuffer = context.gl.framebuffer([], self.depth)
        self._depth_program = depth_program(context)
        self._screen = context.gl.vertex_array(self._depth_program, [])
        self._clear_program = _clear_program(context) if context.backend is PassBackend.COMPUTE else None
        self._gl = context.gl
        self._faces: list[moderngl.Texture] = []

    def use(self, width: int, height: int, part: Part = WHOLE) -> None:
        """Restrict the next draws to these rows of the lower left part of this size."""
        self.bind(self._framebuffer, width, height, part)

    def bind(self, framebuffer: moderngl.Framebuffer, width: int, height: int, part: Part) -> None:
        """Restrict the next draws to these rows of a framebuffer with this depth."""
        framebuffer.viewport = (0, 0, width, height)
        framebuffer.scissor = scissor_of(Rectangle(0, 0, width, height).rows(part))
        framebuffer.use()
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "<"

    def clear(self, width: int, height: int, part: Part = WHOLE, *, depth: bool = True) -> None:
        """Clear these rows of the lower left part of this size; the depth may be left out."""
        rows = Rectangle(0, 0, width, height).rows(part)
        if self.clear_by_compute((self.position, self.normal, self.color), rows):
            if depth:
                self.bind(self._depth_framebuffer, width, height, part)
                self._depth_framebuffer.clear(depth=1.0)
        else:
            self.use(width, height, part)  # first: it ends scissors of other passes
            self._framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)

    def clear_by_compute(self, textures: Sequence[moderngl.Texture], rectangle: Rectangle) -> bool:
        """Clear three textures, if passes are compute shaders; return False without doing so otherwise."""
        if self._clear_program is None:
            return False
        for unit, texture in enumerate(textures):
            texture.bind_to_image(unit, read=False, write=True)
        run_pixels(self._clear_program, rectangle)
        self._gl.memory_barrier()
        return True

    def bind_surface(self, first_unit: int = 0) -> None:
        """Bind position, normal and color to image units, for compute shaders; positions can be read."""
        for unit, texture in enumerate((self.position, self.normal, self.color), first_unit):
            texture.bind_to_image(unit, read=texture is self.position, write=True)

    def bind_faces(self) -> None:
        """Bind depths and numbers of nearest faces to image units 0 and 1: ``shaders/face_rows.glsl``."""
        if not self._faces:
            empty = np.full(self.size, NO_FACE, np.uint32).tobytes()
            self._faces = [self._gl.texture(self.size, 1, empty, dtype="u4") for _ in range(2)]
        for unit, texture in enumerate(self._faces):
            texture.bind_to_image(unit, read=True, write=True)

    def forget_faces(self) -> None:
        """Release depths and numbers of faces that an interrupted drawing left behind."""
        while self._faces:
            self._faces.pop().release()

    def complete_depth(self, width: int, height: int, part: Part = WHOLE) -> None:
        """Write the depth of surface that was not rasterised, in the lower left part of this size.

        Only users of the depth buffer need it: in the other targets such surface is complete.
        """
        self.bind(self._depth_framebuffer, width, height, part)
        self.position.use(0)
        set_uniform(self._depth_program, "g_position", 0)
        self._screen.render(vertices=3)

    def read_position(self, tile: Tile) -> Float32Array:
        """Read position and object id + 1, ``float32[h, w, 4]``, the lowest row first."""
        return self._read(0, tile)

    def read_normal(self, tile: Tile) -> Float32Array:
        """Read the normals, ``float32[h, w, 4]``, the lowest row first."""
        return self._read(1, tile)

    def read_depth(self, part: Rectangle) -> float:
        """Read the least depth in a rectangle of samples."""
        viewport = part.x, part.y, part.width, part.height
        data = self._depth_framebuffer.read(viewport, components=1, attachment=-1, alignment=1, dtype="f4")
        return float(np.frombuffer(data, np.float32).min())

    def _read(self, attachment: int, tile: Tile) -> Float32Array:
        return read_floats(self._framebuffer, attachment, tile)

    def release(self) -> None:
        """Release the memory."""
        textures = self.position, self.normal, self.color, self.depth, *self._faces
        framebuffers = self._framebuffer, self._depth_framebuffer
        resources: tuple[Any, ...] = self._screen, *framebuffers, self.guard, *textures
        for resource in resources:
            resource.release()


def depth_program(context: Context) -> moderngl.Program:
    """Return the program that writes the depth of surface that was not rasterised."""
    return attach_camera(context.program(compose("screen.vert"), compose("depth.frag")))


def _clear_program(context: Context) -> moderngl.ComputeShader:
    return context.compute_program(compose("clear.comp", defines={"GROUP": GROUP}, version="430 core"))
