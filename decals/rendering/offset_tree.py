"""BlobTrees whose surface heights of decals move: traced as offset surfaces, with silhouettes and depth.

A point p has a foot, the closest point q of the surface, at the signed distance d. It is outside if d exceeds
the height at q. Rays skip space by a shell of cells around the surface, and inside it follow the foot from
step to step by Newton's method (``shaders/offset.glsl``). A safe step is at most the gap d − height over
the greatest rate at which the gap can shrink: the distance shrinks at most by the fall of the ray, the height
rises at most by the slope of a cone that contains the heights up to some distance (cone step mapping, Dummer
2006). The longest of the steps for four distances is taken. As most cones are far steeper than the heights,
a longer step is tried first; where the cones at both of its ends do not cover it, the ray goes back to the
end of the shorter one (Keinert et al. 2014).
Between a point outside and one inside, the hit lies where two secants agree; the gap there is not looked up.
Cones around the rays of squares of pixels first find where these begin (``shaders/offset_start.glsl``).
"""

from dataclasses import dataclass
from functools import lru_cache

import moderngl
import numpy as np

from blobtree import Node, polygonize
from blobtree._typing import Float32Array, Float64Array
from blobtree.progress import reporting
from decals.rendering.context import Context
from decals.rendering.decal_data import stored
from decals.rendering.decal_library import Form
from decals.rendering.decal_pass import DecalSource
from decals.rendering.gbuffer import GBuffer
from decals.rendering.pixel_pass import GROUP, PassBackend, PixelPass, Program, attach_camera, set_uniform
from decals.rendering.rest_buffer import RestBuffer
from decals.rendering.tracing_shader import Kinds, many_kinds, tracing_slots
from decals.rendering.tree import TreeDrawable, draw_box
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Rectangle, Tile, covered_rectangle
from decals.shaders import Source, compose

SHELL_CELLS = 48
"""Cells of a shell along its longest side."""

SHELL_RESOLUTION = 64
"""Cells of the mesh whose vertices are the points of a shell, along the longest side of the support."""

BLOCK = 4
"""Side, in samples, of the squares whose rays begin at one distance."""

REACH_MARGIN = 1.25
"""Reach of a new shell over the heights at hand, so that edits seldom take another."""


@dataclass(frozen=True, eq=False)
class Shell:
    """Cells around a surface, each with a point of it.

    Attributes
    ----------
    texels
        float32[nx ny nz, 4]: for each cell a point of the surface near its middle, and a lower
        bound of the distance from the surface to the middle.
    lower, cell, counts
        Lowest corner (3,), side of the cells, number of cells along each axis.
    reach
        Distance from the surface up to which the cells reach.
    """

    texels: Float32Array
    lower: Float64Array
    cell: float
    counts: tuple[int, int, int]
    reach: float

    @classmethod
    def of(cls, tree: Node, reach: float) -> "Shell":
        """Return the shell of a tree's surface; without a surface, one far from everything."""
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        mesh = polygonize(tree, resolution=SHELL_RESOLUTION)
        points = mesh.vertices.astype(np.float64)
        if not len(points):
            return cls(np.full((1, 4), 1e30, np.float32), np.zeros(3), 1.0, (1, 1, 1), reach)
        edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        edges = edges[edges[:, 0] < edges[:, 1]]
        ends = points[edges]
        gap = 0.5 * float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max())
        lower, upper = points.min(axis=0), points.max(axis=0)
        size = upper - lower + 2.0 * (reach + 2.0 * gap)
        cell = float(size.max()) * (1.0 + 1e-6) / SHELL_CELLS
        counts = np.ceil(size / cell).astype(int)
        lower = 0.5 * (lower + upper) - 0.5 * cell * counts
        middles = lower + (np.indices(counts).reshape(3, -1).T + 0.5) * cell
        near = np.concatenate([np.arange(len(points)), edges[:, 0]])
        near_of = cKDTree(np.concatenate([points, ends.mean(axis=1)]))
        found = []
        with reporting() as report:
            for done, layer in enumerate(np.array_split(middles, counts[0])):
                report("measuring distances", done / counts[0])
                found.append(near_of.query(layer))
        distances, nearest = (np.concatenate(one) for one in zip(*found, strict=True))
        texels = np.column_stack([points[near[nearest]], distances - gap]).astype(np.float32)
        x, y, z = counts.tolist()
        return cls(texels, lower, cell, (x, y, z), reach)

    @property
    def bounds(self) -> Bounds:
        """Box of all cells."""
        return self.lower, self.lower + self.cell * np.array(self.counts)


class OffsetTreeDrawable(TreeDrawable):
    """A tree's tracing cells on the GPU, and for scenes with relief its shell."""

    _shell: tuple[Shell, moderngl.Texture3D] | None = None
    _offset_programs: tuple[object, tuple[Program, Program]] | None = None
    _starts: moderngl.Texture | None = None
    _start_pass: PixelPass | None = None

    def prepare(self, source: DecalSource) -> None:
        """Make everything that `draw_offset` needs at the first call."""
        assert source.relief is not None
        self._shell_for(source.relief.reach)
        self._programs_for(source)

    def draw_offset(
        self,
        object_id: int,
        tile: Tile,
        gbuffer: GBuffer,
        rest: RestBuffer,
        source: DecalSource,
        part: Part = WHOLE,
    ) -> None:
        """Trace the rays to the surface that heights move, or those of a part of the rows."""
        assert source.relief is not None
        bounds = self._shell_for(source.relief.reach)[0].bounds
        start_program, program = self._programs_for(source)
        rows = covered_rectangle(bounds, tile).rows(part)
        if isinstance(program, moderngl.Program):
            rows = Rectangle(0, 0, tile.width, tile.height).rows(part)
        if rows.area == 0:
            return
        starts = self._draw_starts(start_program, object_id, rows, gbuffer, source)
        unit = self._use(program, object_id, source)
        starts.use(unit)
        set_uniform(program, "starts", unit)
        if isinstance(program, moderngl.Program):
            rest.use_with_surface(tile.width, tile.height, part)
            draw_box(self._gl, program, self._box(program), bounds)
            return
        rest.bind_images(first_unit=3)
        self.trace_rows(program, rows, gbuffer)

    def _draw_starts(
        self, program: Program, object_id: int, rows: Rectangle, gbuffer: GBuffer, source: DecalSource
    ) -> moderngl.Texture:
        """Draw where the rays begin in all squares that contain these samples; return the texture."""
        size = -(-gbuffer.size[0] // BLOCK), -(-gbuffer.size[1] // BLOCK)
        if self._starts is None or size[0] > self._starts.width or size[1] > self._starts.height:
            self._release_starts()
            self._starts = self._context.texture(size, "f4")
            self._starts.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if self._start_pass is None or self._start_pass.program is not program:
            if self._start_pass is not None:
                self._start_pass.release()
            self._start_pass = PixelPass(self._gl, program, [self._starts])
        self._use(program, object_id, source)
        x, y = rows.x // BLOCK, rows.y // BLOCK
        right, top = (rows.x + rows.width - 1) // BLOCK, (rows.y + rows.height - 1) // BLOCK
        self._start_pass.run(Rectangle(x, y, right - x + 1, top - y + 1))
        return self._starts

    def _use(self, program: Program, object_id: int, source: DecalSource) -> int:
        """Bind all textures, and set the uniforms; return the next texture unit."""
        assert source.relief is not None
        shell, texels = self._shell_for(source.relief.reach)
        for unit, texture in enumerate(self._textures):
            texture.use(unit)
        texels.use(2)
        uniforms = {
            **self._uniforms,
            "object_id": object_id,
            "shell": 2,
            "shell_lower": tuple(shell.lower.tolist()),
            "shell_cell": shell.cell,
            "shell_counts": shell.counts,
        }
        for name, value in uniforms.items():
            set_uniform(program, name, value)
        return source.use(program, 3)

    def _programs_for(self, source: DecalSource) -> tuple[Program, Program]:
        """Return the programs that find where rays begin and trace them; composing takes long."""
        if self._offset_programs is None or self._offset_programs[0] != source.form:
            makers = start_program, offset_program
            start, offset = (make(self._context, self.kinds, source) for make in makers)
            self._offset_programs = source.form, (start, offset)
        return self._offset_programs[1]

    def _shell_for(self, reach: float) -> tuple[Shell, moderngl.Texture3D]:
        if self._shell is None or not reach <= self._shell[0].reach <= 4.0 * max(reach, 1e-30):
            if self._shell is not None:
                self._shell[1].release()
            shell = Shell.of(self._tree, REACH_MARGIN * reach)
            texture = self._gl.texture3d(shell.counts[::-1], 4, shell.texels.tobytes(), dtype="f4")
            texture.repeat_x = texture.repeat_y = texture.repeat_z = False
            self._shell = shell, texture
        return self._shell

    def _release_starts(self) -> None:
        for resource in (self._start_pass, self._starts):
            if resource is not None:
                resource.release()
        self._start_pass = self._starts = None

    def release(self) -> None:
        """Release the memory."""
        super().release()
        self._release_starts()
        if self._shell is not None:
            self._shell[1].release()


def offset_program(context: Context, kinds: Kinds, source: DecalSource) -> Program:
    """Return the program that traces moved trees of these kinds, for the context's backend."""
    slots, defines = _filled(context, kinds, source)
    if context.backend is PassBackend.COMPUTE:
        defines |= {"GROUP": GROUP}
        return attach_camera(
            context.compute_program(compose("offset.comp", slots=slots, defines=defines, version="430 core"))
        )
    text = compose("offset.frag", slots=slots, defines=defines)
    return attach_camera(context.program(compose("box.vert"), text))


def start_program(context: Context, kinds: Kinds, source: DecalSource) -> Program:
    """Return the program that finds where the rays of squares of pixels begin."""
    slots, defines = _filled(context, kinds, source)
    return attach_camera(context.pixel_program("offset_start.glsl", 1, slots=slots, defines=defines))


@lru_cache(maxsize=64)
def offset_slots(kinds: Kinds, form: Form, *, buffers: bool) -> dict[str, str | Source]:
    """Return the fillings of ``offset_foot.glsl``: the cases of `kinds` and the formulas of decals."""
    slots = tracing_slots(kinds, form.functions) | {"constants": form.constants, "functions": ""}
    return slots | {"library": stored(str(slots["library"]))} if buffers else slots


def _filled(
    context: Context, kinds: Kinds, source: DecalSource
) -> tuple[dict[str, str | Source], dict[str, str | int | float | bool]]:
    """Return slots and defines of ``offset_foot.glsl``."""
    compute = context.backend is PassBackend.COMPUTE
    slots = offset_slots(kinds, source.form, buffers=compute)
    return slots, {
        "RELIEF": True,
        "LIMITED": source.form.limited,
        "BLOCK": BLOCK,
        "STORED": compute,
        "MANY_KINDS": many_kinds(slots),
    }
