"""BlobTrees in the G-buffer: traced, one ray per pixel of their box."""

from typing import Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from blobtree import Node
from blobtree.tracing.cells import TracingCells, tracing_cells
from decals.render.buffers import DataTexture
from decals.render.context import Context
from decals.render.entry import GROUP, Entry, Program
from decals.render.gbuffer import GBuffer
from decals.render.parts import WHOLE, Part, Rectangle
from decals.render.pieces import SHADERS, SHAPES, Ahead, Piece
from decals.render.tape_shader import Kinds, tracing_shader
from decals.render.tile import Tile, attach_camera, set_uniform
from decals.scenes.viewpoint import Bounds
from implicit_decals.shaders import compose

BOX_VERTICES = 36
"""Corners of the triangles that ``box.vert`` makes."""

POSITION, NORMAL, COLOR = range(3)
"""Image units of ``trace.comp``."""


class TreeLike(Protocol):
    """What is read of an implicit object."""

    @property
    def tree(self) -> Node: ...  # noqa: D102


class TreeDrawable:
    """A tree's tracing cells on the graphics card.

    The rays are sent by a fragment shader on the back of the tree's box, or by a compute shader, as the
    context runs its passes over all pixels.
    """

    def __init__(self, context: Context, thing: TreeLike) -> None:
        tree = thing.tree
        cells = tracing_cells(tree)
        self._bounds = tree.bounds
        self._textures = (DataTexture(context, cells.tape), DataTexture(context, cells.blocks))
        self._uniforms = {**tracing_uniforms(cells), "tape": 0, "blocks": 1}
        tracer = _ComputeTracer if context.entry is Entry.COMPUTE else _FragmentTracer
        self._tracer: _FragmentTracer | _ComputeTracer = tracer(context, Kinds.of(tree.tape), tree.bounds)

    @staticmethod
    def ahead(context: Context, thing: TreeLike) -> Ahead:
        """Say what one needs that takes long for the first time."""
        tree, kinds = thing.tree, Kinds.of(thing.tree.tape)
        pieces = (
            Piece(SHAPES, lambda: tracing_cells(tree), beside=True),
            Piece(SHADERS, lambda: tracing_shader(kinds, context.entry)),
            Piece(SHADERS, lambda: tracing_program(context, kinds)),
        )
        return Ahead(kinds, pieces)

    @property
    def bounds(self) -> Bounds:
        """The tree's box of influence."""
        return self._bounds

    @property
    def rasterised(self) -> bool:
        """Where a fragment shader sends the rays."""
        return isinstance(self._tracer, _FragmentTracer)

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Trace the rays of all pixels on which the box falls, or of a part of their rows."""
        for unit, texture in enumerate(self._textures):
            texture.use(unit)
        for name, value in {**self._uniforms, "object_id": object_id}.items():
            set_uniform(self._tracer.program, name, value)
        self._tracer.run(tile, gbuffer, part)

    def release(self) -> None:
        """Give the memory back."""
        for resource in (self._tracer, *self._textures):
            resource.release()


def tracing_program(context: Context, kinds: Kinds) -> Program:
    """Give the program that traces trees of these kinds, as the context runs its passes over all pixels."""
    source = tracing_shader(kinds, context.entry)
    if context.entry is Entry.COMPUTE:
        return attach_camera(context.compute_program(source))
    return attach_camera(context.program(compose("box.vert"), source))


def tracing_uniforms(cells: TracingCells) -> dict[str, object]:
    """What ``trace.glsl`` is told of a tree's cells, less the textures."""
    return {
        "grid_lower": tuple(cells.lower.tolist()),
        "block_size": cells.block_size,
        "grid_counts": cells.counts,
        "tolerance": cells.tolerance,
    }


class _FragmentTracer:
    """A ray for every pixel on which the back of the box falls."""

    def __init__(self, context: Context, kinds: Kinds, bounds: Bounds) -> None:
        self.program: Program = tracing_program(context, kinds)
        self._array = context.gl.vertex_array(self.program, [])
        self._box = {"box_lower": bounds[0], "box_upper": bounds[1]}
        self._gl = context.gl

    def run(self, tile: Tile, gbuffer: GBuffer, part: Part) -> None:
        gbuffer.use(tile.width, tile.height, part)
        for name, corner in self._box.items():
            set_uniform(self.program, name, tuple(np.asarray(corner).tolist()))
        self._gl.enable(moderngl.CULL_FACE)
        self._gl.cull_face = "front"
        self._array.render(vertices=BOX_VERTICES)
        self._gl.cull_face = "back"
        self._gl.disable(moderngl.CULL_FACE)

    def release(self) -> None:
        self._array.release()


class _ComputeTracer:
    """An invocation for every pixel of the rectangle around the box."""

    def __init__(self, context: Context, kinds: Kinds, bounds: Bounds) -> None:
        self.program: Program = tracing_program(context, kinds)
        self._bounds = bounds
        self._gl = context.gl

    def run(self, tile: Tile, gbuffer: GBuffer, part: Part) -> None:
        rows = covered(self._bounds, tile).rows(part)
        if rows.area == 0:
            return
        assert isinstance(self.program, moderngl.ComputeShader)
        set_uniform(self.program, "rectangle", (rows.x, rows.y, rows.width, rows.height))
        gbuffer.position.bind_to_image(POSITION, read=True, write=True)
        gbuffer.normal.bind_to_image(NORMAL, read=False, write=True)
        gbuffer.color.bind_to_image(COLOR, read=False, write=True)
        self._gl.memory_barrier()
        self.program.run(-(-rows.width // GROUP), -(-rows.height // GROUP))
        self._gl.memory_barrier()

    def release(self) -> None:
        """Nothing but the program was made."""


def covered(bounds: Bounds, tile: Tile) -> Rectangle:
    """The samples of a tile, counted from its own corner, on which a box may fall."""
    size = np.array([tile.width, tile.height])
    choices = np.indices((2, 2, 2)).reshape(3, 8).T == 1
    corners = np.where(choices, *np.asarray(bounds, np.float64)[::-1])
    clip = np.column_stack([corners, np.ones(8)]) @ tile.matrix().T
    low, high = np.zeros(2), size.astype(np.float64)
    if (clip[:, 3] > 0.0).all():  # a box that reaches behind the eye may fall anywhere
        places: NDArray[np.float64] = (0.5 * clip[:, :2] / clip[:, 3:] + 0.5) * size
        low = np.clip(np.floor(places.min(axis=0)) - 1.0, 0.0, size)
        high = np.clip(np.ceil(places.max(axis=0)) + 1.0, 0.0, size)
    x, y = (int(corner) for corner in low)
    width, height = (int(length) for length in high - low)
    return Rectangle(x, y, width, height)
