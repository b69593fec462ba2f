"""BlobTrees in the G-buffer: traced, one ray per pixel of their box."""

from typing import Protocol, runtime_checkable

import moderngl
import numpy as np

from blobtree import Node
from blobtree._typing import Float64Array
from blobtree.tracing.tree_cells import TracingCells, tracing_cells
from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.pixel_pass import GROUP, PassBackend, Program
from decals.rendering.regions import WHOLE, Part, Rectangle
from decals.rendering.tape_shader import Kinds, tracing_shader
from decals.rendering.textures import DataTexture
from decals.rendering.tiles import Tile, attach_camera, set_uniform
from decals.rendering.viewpoint import Bounds
from decals.rendering.warmup import SHADERS, SHAPES, WarmupPlan, WarmupTask
from decals.shaders import compose

BOX_VERTICES = 36
"""Vertices of the triangles in ``box.vert``."""

POSITION, NORMAL, COLOR = range(3)
"""Image units of ``trace.comp``."""


@runtime_checkable
class TreeHolder(Protocol):
    """An implicit object: it has a tree."""

    @property
    def tree(self) -> Node: ...  # noqa: D102


class TreeDrawable:
    """A tree's tracing cells on the GPU.

    Rays are traced by a fragment shader on the back of the tree's box, or by a compute shader, depending on
    the context's backend.
    """

    def __init__(self, context: Context, item: TreeHolder) -> None:
        tree = item.tree
        cells = tracing_cells(tree)
        self._bounds = tree.bounds
        self._textures = (DataTexture(context, cells.tape), DataTexture(context, cells.blocks))
        self._uniforms = {**tracing_uniforms(cells), "tape": 0, "blocks": 1}
        tracer = _ComputeTracer if context.backend is PassBackend.COMPUTE else _FragmentTracer
        self._tracer: _FragmentTracer | _ComputeTracer = tracer(context, Kinds.of(tree.tape), tree.bounds)

    @staticmethod
    def warmup(context: Context, item: TreeHolder) -> WarmupPlan:
        """Return the slow first-time work of a drawable."""
        tree, kinds = item.tree, Kinds.of(item.tree.tape)
        tasks = (
            WarmupTask(SHAPES, lambda: tracing_cells(tree), threaded=True),
            WarmupTask(SHADERS, lambda: tracing_shader(kinds, context.backend)),
            WarmupTask(SHADERS, lambda: tracing_program(context, kinds)),
        )
        return WarmupPlan(kinds, tasks)

    @property
    def bounds(self) -> Bounds:
        """The tree's box of influence."""
        return self._bounds

    @property
    def rasterised(self) -> bool:
        """True if a fragment shader traces the rays."""
        return isinstance(self._tracer, _FragmentTracer)

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Trace the rays of all pixels that the box covers, or of a part of their rows."""
        for unit, texture in enumerate(self._textures):
            texture.use(unit)
        for name, value in {**self._uniforms, "object_id": object_id}.items():
            set_uniform(self._tracer.program, name, value)
        self._tracer.run(tile, gbuffer, part)

    def release(self) -> None:
        """Release the memory."""
        for resource in (self._tracer, *self._textures):
            resource.release()


def tracing_program(context: Context, kinds: Kinds) -> Program:
    """Return the program that traces trees of these kinds, for the context's backend."""
    source = tracing_shader(kinds, context.backend)
    if context.backend is PassBackend.COMPUTE:
        return attach_camera(context.compute_program(source))
    return attach_camera(context.program(compose("box.vert"), source))


def tracing_uniforms(cells: TracingCells) -> dict[str, object]:
    """Return the uniforms of ``trace.glsl`` for a tree's cells, without the textures."""
    return {
        "grid_lower": tuple(cells.lower.tolist()),
        "block_size": cells.block_size,
        "grid_counts": cells.counts,
        "tolerance": cells.tolerance,
    }


class _FragmentTracer:
    """Traces a ray for every pixel that the back of the box covers."""

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
    """Runs an invocation for every pixel of the rectangle around the box."""

    def __init__(self, context: Context, kinds: Kinds, bounds: Bounds) -> None:
        self.program: Program = tracing_program(context, kinds)
        self._bounds = bounds
        self._gl = context.gl

    def run(self, tile: Tile, gbuffer: GBuffer, part: Part) -> None:
        rows = covered_rectangle(self._bounds, tile).rows(part)
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
        """Do nothing: the tracer owns nothing but the program."""


def covered_rectangle(bounds: Bounds, tile: Tile) -> Rectangle:
    """Return the samples of a tile, counted from its own corner, that a box may cover."""
    size = np.array([tile.width, tile.height])
    choices = np.indices((2, 2, 2)).reshape(3, 8).T == 1
    corners = np.where(choices, *np.asarray(bounds, np.float64)[::-1])
    clip = np.column_stack([corners, np.ones(8)]) @ tile.matrix().T
    low, high = np.zeros(2), size.astype(np.float64)
    if (clip[:, 3] > 0.0).all():  # a box that reaches behind the eye may cover any sample
        positions: Float64Array = (0.5 * clip[:, :2] / clip[:, 3:] + 0.5) * size
        low = np.clip(np.floor(positions.min(axis=0)) - 1.0, 0.0, size)
        high = np.clip(np.ceil(positions.max(axis=0)) + 1.0, 0.0, size)
    x, y = (int(corner) for corner in low)
    width, height = (int(length) for length in high - low)
    return Rectangle(x, y, width, height)
