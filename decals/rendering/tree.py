"""BlobTrees in the G-buffer: traced, one ray per pixel of their box."""

from typing import Protocol, runtime_checkable

import moderngl
import numpy as np

from blobtree import Node
from blobtree.cells.surface_box import surface_box
from blobtree.tracing.tree_cells import TracingCells, tracing_cells
from decals.rendering.context import Context
from decals.rendering.data_texture import DataTexture
from decals.rendering.gbuffer import GBuffer
from decals.rendering.loop_guard import GuardedProgram, is_guarded
from decals.rendering.pixel_pass import GROUP, PassBackend, Program, attach_camera, draw, set_uniform
from decals.rendering.tracing_shader import Kinds, tracing_shader
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Rectangle, Tile, covered_rectangle
from decals.rendering.warmup import SHADERS, SHAPES, WarmupPlan, WarmupTask
from decals.shaders import Source, compose

BOX_VERTICES = 36
"""Vertices of the triangles in ``box.vert``."""


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
        self._tree, self._context, self.kinds = tree, context, Kinds.of(tree.tape)
        self._cells = cells  # others that need them find them while they are drawn
        self._bounds = surface_box(tree)
        self._textures = (DataTexture(context, cells.tape), DataTexture(context, cells.blocks))
        self._uniforms = {**tracing_uniforms(cells), "tape": 0, "blocks": 1}
        self._gl = context.gl
        self._programs = GuardedProgram(
            tracing_program(context, self.kinds),
            lambda: tracing_program(context, self.kinds, resuming=True),
        )
        self._boxes: dict[Program, moderngl.VertexArray] = {}

    @staticmethod
    def warmup(context: Context, item: TreeHolder) -> WarmupPlan:
        """Return the slow first-time work of a drawable."""
        tree, kinds = item.tree, Kinds.of(item.tree.tape)
        tasks = (
            WarmupTask(SHAPES, lambda: tracing_cells(tree), threaded=True),
            WarmupTask(SHADERS, lambda: _source(context, kinds)),
            WarmupTask(SHADERS, lambda: tracing_program(context, kinds)),
        )
        return WarmupPlan(kinds, tasks)

    @property
    def bounds(self) -> Bounds:
        """A box around the surface, see `surface_box`."""
        return self._bounds

    @property
    def rasterised(self) -> bool:
        """True if a fragment shader traces the rays."""
        return isinstance(self._programs.first, moderngl.Program)

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Trace the rays of all pixels that the box covers, or of a part of their rows."""
        for unit, texture in enumerate(self._textures):
            texture.use(unit)
        for program in gbuffer.guard.drawings(self._programs):
            for name, value in {**self._uniforms, "object_id": object_id}.items():
                set_uniform(program, name, value)
            self._trace(program, tile, gbuffer, part)

    def _trace(self, program: Program, tile: Tile, gbuffer: GBuffer, part: Part) -> None:
        """Trace these rays once; hits behind others are hidden."""
        if isinstance(program, moderngl.Program):
            gbuffer.use(tile.width, tile.height, part)
            draw_box(self._gl, program, self._box(program), self._bounds)
        else:
            self.trace_rows(program, covered_rectangle(self._bounds, tile).rows(part), gbuffer)

    def _box(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Return the vertices of ``box.vert`` for a program."""
        if program not in self._boxes:
            self._boxes[program] = self._gl.vertex_array(program, [])
        return self._boxes[program]

    def trace_rows(self, program: Program, rows: Rectangle, gbuffer: GBuffer) -> None:
        """Trace a ray for every pixel of a rectangle, in a compute shader."""
        if rows.area == 0:
            return
        assert isinstance(program, moderngl.ComputeShader)
        set_uniform(program, "rectangle", (rows.x, rows.y, rows.width, rows.height))
        gbuffer.bind_surface()
        self._gl.memory_barrier()
        program.run(-(-rows.width // GROUP), -(-rows.height // GROUP))
        self._gl.memory_barrier()

    def release(self) -> None:
        """Release the memory."""
        for texture in self._textures:
            texture.release()
        for box in self._boxes.values():
            box.release()


def draw_box(gl: moderngl.Context, program: Program, box: moderngl.VertexArray, bounds: Bounds) -> None:
    """Trace a ray for every pixel that the back of a box covers, in a fragment shader."""
    for name, corner in zip(("box_lower", "box_upper"), bounds, strict=True):
        set_uniform(program, name, tuple(np.asarray(corner).tolist()))
    gl.enable(moderngl.CULL_FACE)
    gl.cull_face = "front"
    try:
        draw(box, BOX_VERTICES)
    finally:
        gl.cull_face = "back"
        gl.disable(moderngl.CULL_FACE)


def tracing_program(context: Context, kinds: Kinds, *, resuming: bool = False) -> Program:
    """Return the program that traces trees of these kinds, for the context's backend."""
    source = _source(context, kinds, resuming=resuming)
    if context.backend is PassBackend.COMPUTE:
        return attach_camera(context.compute_program(source))
    return attach_camera(context.program(compose("box.vert"), source))


def _source(context: Context, kinds: Kinds, *, resuming: bool = False) -> Source:
    return tracing_shader(kinds, context.backend, guarded=is_guarded(context), resuming=resuming)


def tracing_uniforms(cells: TracingCells) -> dict[str, object]:
    """Return the uniforms of ``trace.glsl`` for a tree's cells, without the textures."""
    return {
        "grid_lower": tuple(cells.lower.tolist()),
        "block_size": cells.block_size,
        "grid_counts": cells.counts,
        "tolerance": cells.tolerance,
        "tape_start": cells.start,
    }
