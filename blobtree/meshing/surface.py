"""The surface in sparse cells as triangles on a device, and the same after an edit from what is there.

Only blocks that have changed are sampled. Beside them some cells may take another row of the tables, so the
neighbours' vertices are placed anew too, and triangles of all blocks that use such vertices. Everything else
is copied, in the order of a mesh made from nothing, so the two are the same bit for bit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import warp as wp

from blobtree.launch import launch
from blobtree.memory import demand_memory
from blobtree.meshing.dual import SAMPLES, classify_cells, connect_vertices, sample_blocks, settle_rows
from blobtree.meshing.patches import KNOTTED_FACE, PATCH_COUNT, PATCH_OF_EDGE
from blobtree.meshing.reuse import (
    copy_counts,
    copy_faces,
    copy_vertices,
    copy_words,
    count_listed,
    invert,
    mark_above,
    mark_beside,
)
from blobtree.meshing.strays import mend_vertices
from blobtree.meshing.vertices import list_patches, place_vertices
from blobtree.progress import Progress
from blobtree.sparse.cells import SparseCells
from blobtree.sparse.grid import CHILDREN
from blobtree.sparse.scan import chosen, everything, starts_of, where_negative

Array = Any

WORD = 16

SAMPLE_BYTES = 4

BLOCK_BYTES = 64 * 4 + 13 * (3 * 12 + 4) + 13 * 24
"""What a block holds in the end: codes, rows and offsets of 64 cells, some 13 vertices and 26 triangles."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles in a device's memory, and by block how they came about."""

    cells: SparseCells
    codes: "wp.array[wp.uint8]"
    """By cell, which corners are inside (64 n)."""
    rows: "wp.array[wp.int16]"
    """By cell, the row in the tables of `patches` (64 n)."""
    offsets: "wp.array[wp.uint8]"
    """By cell, its first vertex counted from its block's (64 n)."""
    vertex_starts: "wp.array[wp.int32]"
    """By block, its first vertex; and the end (n + 1)."""
    quad_starts: "wp.array[wp.int32]"
    """By block, its first pair of triangles; and the end (n + 1)."""
    vertices: "wp.array[wp.vec3]"
    normals: "wp.array[wp.vec3]"
    colors: "wp.array[wp.vec3]"
    faces: "wp.array[wp.vec3i]"


@dataclass(frozen=True)
class Tables:
    """`patches`' tables in a device's memory."""

    patch_count: Array
    patch_of_edge: Array
    knotted_face: Array


@cache
def tables(device: str) -> Tables:
    """The tables in the memory of one device."""
    return Tables(
        wp.array(PATCH_COUNT, dtype=wp.int8, device=device),
        wp.array(PATCH_OF_EDGE.ravel(), dtype=wp.int8, device=device),
        wp.array(KNOTTED_FACE, dtype=wp.int8, device=device),
    )


def extract_surface(cells: SparseCells, report: Progress, previous: Surface | None = None) -> Surface:
    """The triangles of the surface in `cells`; `previous` is what `cells` were made from, if anything."""
    return _Extraction(cells, previous).surface(report)


class _Extraction:
    """One way from cells to triangles."""

    def __init__(self, cells: SparseCells, previous: Surface | None) -> None:
        self._cells, self._old, self._device = cells, previous, cells.device
        self._leaves, self._count = cells.leaves, len(cells.leaves)
        self._tables = tables(cells.device)
        base = cells.grid.base_of(cells.grid.depth)
        leaves = self._leaves
        self._geometry = [leaves.blocks, leaves.spans, leaves.tape, wp.vec3i(*base)]
        self._geometry += [wp.vec3(*cells.grid.corner), cells.grid.cell_size]

    def surface(self, report: Progress) -> Surface:
        """Sample, place, connect."""
        report("sampling the field", 0.0)
        anew, rest = self._changed_blocks()
        needed = len(anew) * SAMPLES * SAMPLE_BYTES + self._count * BLOCK_BYTES
        demand_memory(needed, self._device, f"the surface in {self._count:,} blocks of cells")
        codes, rows, offsets = (
            self._empty(self._count * CHILDREN, dtype) for dtype in (wp.uint8, wp.int16, wp.uint8)
        )
        counts = [self._zeros(self._count + 1) for _ in range(2)]
        self._copy_cells(rest, [codes, rows, offsets], counts)
        values = self._empty(len(anew) * SAMPLES, wp.float32)
        vocabulary = self._cells.tape.vocabulary
        step = partial(report, "sampling the field")
        inputs: list[Any] = [anew, *self._geometry]
        self._launch(vocabulary.kernel(sample_blocks), len(anew) * SAMPLES, inputs, [values], step)
        self._launch(classify_cells, len(anew), [anew, values], [codes, counts[1]])
        found = [self._leaves.blocks, self._leaves.keys]
        inputs = [anew, *found, codes, self._tables.patch_count, self._tables.knotted_face]
        self._launch(settle_rows, len(anew), inputs, [rows, offsets, counts[0]])
        vertex_starts, vertex_total = starts_of(counts[0], "vertices")
        quad_starts, quad_total = starts_of(counts[1], "triangles")
        report("sampling the field", 1.0)
        report("placing vertices", 0.0)
        vertices, normals, colors = (self._empty(vertex_total, wp.vec3) for _ in range(3))
        step = partial(report, "placing vertices")
        self._place(anew, values, rows, offsets, vertex_starts, [vertices, normals, colors], step)
        moved = self._copy_vertices(rest, vertex_starts, [vertices, normals, colors])
        report("placing vertices", 1.0)
        faces = self._empty(2 * quad_total, wp.vec3i)
        connected, rest = self._users(anew)
        inputs = [connected, *found, rows, offsets, self._tables.patch_of_edge]
        inputs += [quad_starts, vertex_starts, vertices]
        self._launch(connect_vertices, len(connected), inputs, [faces])
        self._copy_faces(rest, quad_starts, moved, faces)
        report("connecting vertices", 1.0)
        return Surface(
            self._cells, codes, rows, offsets, vertex_starts, quad_starts, vertices, normals, colors, faces
        )

    def _empty(self, size: int, dtype: Any) -> Array:
        return wp.empty(size, dtype=dtype, device=self._device)

    def _zeros(self, size: int) -> Array:
        return wp.zeros(size, dtype=wp.int32, device=self._device)

    def _launch(
        self,
        kernel: wp.Kernel,
        count: int,
        inputs: list[Any],
        outputs: list[Any],
        step: Callable[[float], None] | None = None,
    ) -> None:
        launch(kernel, count, inputs, outputs, self._device, step=step)

    def _changed_blocks(self) -> tuple[Array, Array]:
        """Blocks whose cells or rows may have changed, and the others."""
        if self._old is None:
            return everything(self._count, self._device), everything(0, self._device)
        return self._around(mark_beside, where_negative(self._leaves.sources))

    def _users(self, anew: Array) -> tuple[Array, Array]:
        """Blocks whose triangles use the vertices of `anew`, and the others."""
        if self._old is None:
            return anew, everything(0, self._device)
        return self._around(mark_above, anew)

    def _around(self, mark: wp.Kernel, listed: Array) -> tuple[Array, Array]:
        """The blocks that `mark` finds, and the others."""
        flags, others = self._zeros(self._count + 1), self._zeros(self._count + 1)
        self._launch(mark, len(listed), [listed, self._leaves.blocks, self._leaves.keys], [flags])
        self._launch(invert, self._count, [flags], [others])
        return chosen(flags), chosen(others)

    def _copy_cells(self, rest: Array, arrays: list[Array], counts: list[Array]) -> None:
        """Codes, rows, offsets, and the numbers of vertices and quads."""
        if self._old is None:
            return
        sources, old = self._leaves.sources, self._old
        for before, after in zip((old.codes, old.rows, old.offsets), arrays, strict=True):
            words = CHILDREN * after.strides[0] // WORD
            inputs = [words, rest, sources, _as_words(before)]
            self._launch(copy_words, len(rest) * words, inputs, [_as_words(after)])
        for starts, numbers in zip((old.vertex_starts, old.quad_starts), counts, strict=True):
            self._launch(copy_counts, len(rest), [rest, sources, starts], [numbers])

    def _place(
        self,
        anew: Array,
        values: Array,
        rows: Array,
        offsets: Array,
        starts: Array,
        outputs: list[Array],
        step: Callable[[float], None],
    ) -> None:
        """The vertices of the blocks `anew`."""
        counts = self._zeros(len(anew) + 1)
        self._launch(count_listed, len(anew), [anew, starts], [counts])
        list_starts, total = starts_of(counts, "vertices")
        patches = self._empty(total, wp.int32)
        inputs = [anew, rows, self._tables.patch_count, list_starts]
        self._launch(list_patches, len(anew), inputs, [patches])
        inputs = [patches, anew, *self._geometry, values, rows, offsets, self._tables.patch_of_edge, starts]
        strays = self._zeros(1)
        speak = self._cells.tape.vocabulary.kernel
        self._launch(speak(place_vertices), total, inputs, [*outputs, strays], step)
        if total and strays.numpy()[0]:
            self._launch(speak(mend_vertices), total, inputs, outputs)

    def _copy_vertices(self, rest: Array, starts: Array, arrays: list[Array]) -> Array:
        """The other blocks' vertices; gives the new numbers of old ones."""
        if self._old is None:
            return None
        old = self._old
        moved = self._empty(len(old.vertices), wp.int32)
        inputs = [
            rest,
            self._leaves.sources,
            old.vertex_starts,
            starts,
            old.vertices,
            old.normals,
            old.colors,
        ]
        self._launch(copy_vertices, len(rest), inputs, [*arrays, moved])
        return moved

    def _copy_faces(self, rest: Array, starts: Array, moved: Array, faces: Array) -> None:
        """The other blocks' triangles."""
        if self._old is None:
            return
        inputs = [rest, self._leaves.sources, self._old.quad_starts, starts, self._old.faces, moved]
        self._launch(copy_faces, len(rest), inputs, [faces])


def _as_words(array: Array) -> Array:
    """The same memory as words of WORD bytes, so that it is copied faster."""
    size = len(array) * array.strides[0] // WORD
    return wp.array(ptr=array.ptr, dtype=wp.vec4i, shape=size, device=array.device)
