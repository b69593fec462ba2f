"""BlobTrees in the G-buffer: traced, one ray per pixel of their box."""

from typing import Protocol

import moderngl

from blobtree import Node
from blobtree.trace import tracing_cells
from decals.render.buffers import DataTexture
from decals.render.context import Context
from decals.render.tape_shader import Kinds, tracing_shader
from decals.render.tile import Tile, attach_camera, set_uniform
from decals.viewpoint import Bounds
from implicit_decals.shaders import compose

BOX_VERTICES = 36
"""Corners of the triangles that ``box.vert`` makes."""


class TreeLike(Protocol):
    """What is read of an implicit object."""

    @property
    def tree(self) -> Node: ...  # noqa: D102


class TreeDrawable:
    """A tree's tracing cells on the graphics card."""

    def __init__(self, context: Context, thing: TreeLike) -> None:
        tree = thing.tree
        cells = tracing_cells(tree)
        self._bounds = tree.bounds
        self._gl = context.gl
        self._textures = (DataTexture(context, cells.tape), DataTexture(context, cells.nodes))
        self._uniforms: dict[str, object] = {
            "tape": 0,
            "nodes": 1,
            "grid_lower": tuple(cells.lower.tolist()),
            "block_size": cells.block_size,
            "grid_depth": cells.depth,
            "tolerance": cells.tolerance,
            "box_lower": tuple(self._bounds[0].tolist()),
            "box_upper": tuple(self._bounds[1].tolist()),
        }
        self._program = attach_camera(
            context.program(compose("box.vert"), tracing_shader(Kinds.of(tree.tape)))
        )
        self._array = context.gl.vertex_array(self._program, [])

    @property
    def bounds(self) -> Bounds:
        """The tree's box of influence."""
        return self._bounds

    def draw(self, object_id: int, tile: Tile) -> None:
        """Trace the rays of all pixels on which the back of the box falls."""
        for unit, texture in enumerate(self._textures):
            texture.use(unit)
        for name, value in {**self._uniforms, "object_id": object_id}.items():
            set_uniform(self._program, name, value)
        self._gl.enable(moderngl.CULL_FACE)
        self._gl.cull_face = "front"
        self._array.render(vertices=BOX_VERTICES)
        self._gl.cull_face = "back"
        self._gl.disable(moderngl.CULL_FACE)

    def release(self) -> None:
        """Give the memory back."""
        for resource in (self._array, *self._textures):
            resource.release()
