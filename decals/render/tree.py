"""BlobTrees in the G-buffer: traced, one ray per pixel of their box."""

from typing import Protocol

import moderngl

from blobtree import Node
from blobtree.trace import trace_tolerance
from decals.camera import Bounds
from decals.render.buffers import DataTexture
from decals.render.context import Context
from decals.render.tape_shader import Kinds, tracing_shader
from decals.render.tile import Tile, attach_camera, set_uniform
from implicit_decals.shaders import compose

BOX_VERTICES = 36
"""Corners of the triangles that ``box.vert`` makes."""


class TreeLike(Protocol):
    """What is read of an implicit object."""

    @property
    def tree(self) -> Node: ...  # noqa: D102


class TreeDrawable:
    """A tree's tape on the graphics card."""

    def __init__(self, context: Context, thing: TreeLike) -> None:
        tape = thing.tree.tape
        self._bounds = thing.tree.bounds
        self._gl = context.gl
        self._tape = DataTexture(context, tape.data)
        self._uniforms: dict[str, object] = {
            "tape": 0,
            "tape_span": (0, len(tape.data)),
            "box_lower": tuple(self._bounds[0].tolist()),
            "box_upper": tuple(self._bounds[1].tolist()),
            "tolerance": trace_tolerance(self._bounds),
        }
        self._program = attach_camera(context.program(compose("box.vert"), tracing_shader(Kinds.of(tape))))
        self._array = context.gl.vertex_array(self._program, [])

    @property
    def bounds(self) -> Bounds:
        """The tree's box of influence."""
        return self._bounds

    def draw(self, object_id: int, tile: Tile) -> None:
        """Trace the rays of all pixels on which the back of the box falls."""
        self._tape.use(0)
        for name, value in {**self._uniforms, "object_id": object_id}.items():
            set_uniform(self._program, name, value)
        self._gl.enable(moderngl.CULL_FACE)
        self._gl.cull_face = "front"
        self._array.render(vertices=BOX_VERTICES)
        self._gl.cull_face = "back"
        self._gl.disable(moderngl.CULL_FACE)

    def release(self) -> None:
        """Give the memory back."""
        self._array.release()
        self._tape.release()
