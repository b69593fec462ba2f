"""Meshes: the dual mesh of sparse cells in a device's memory, its update after an edit, and NumPy copies.

Only changed blocks are sampled again. The rows of cells beside them may change too, so the vertices of
neighbouring blocks are placed again, and the triangles of all blocks that use such vertices. All else is
copied, in the order of a mesh made from scratch: both meshes are the same bit for bit.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, IndexArray, Int32Array
from blobtree.cells.grid import CHILDREN
from blobtree.cells.runs import Runs, copy_indices, copy_runs, item_runs, long_runs, runs_of
from blobtree.cells.scan import DeviceArray, arange, compact, exclusive_scan, where_negative
from blobtree.cells.sparse_cells import SparseCells, child_grid
from blobtree.device import demand_memory, launch, on_host
from blobtree.errors import InvalidFile
from blobtree.identity import Value
from blobtree.meshing.bisection_kernels import bisect_unconverged
from blobtree.meshing.dual_kernels import (
    SAMPLES,
    CellPatches,
    PatchTables,
    choose_rows,
    classify_cells,
    connect_vertices,
    mark_bridging,
    sample_blocks,
)
from blobtree.meshing.patches import KNOTTED_FACE, PATCH_COUNT, PATCH_OF_EDGE
from blobtree.meshing.vertex_kernels import (
    VertexArrays,
    count_listed,
    list_patches,
    place_vertices,
)
from blobtree.progress import Progress
from blobtree.pyvista_views import MESH_SUFFIXES, to_polydata, write_polydata
from blobtree.validation import describe

WORD_BYTES = 16
"""Bytes that one thread copies."""

SAMPLE_BYTES = 4

BLOCK_BYTES = 64 * 4 + 13 * (3 * 12 + 4) + 13 * 24
"""Bytes of a block in the result: codes, rows and offsets of 64 cells, some 13 vertices and 26 triangles."""


@dataclass(frozen=True, eq=False)
class Mesh(Value):
    """A closed triangle mesh, as `polygonize` returns it.

    Attributes
    ----------
    vertices
        float32[n, 3]: positions, in the model's units.
    faces
        int32[m, 3]: indices of vertices, counter-clockwise seen from outside.
    normals
        float32[n, 3]: outward unit normals; on a crease, the mean of the normals of its sides.
    colors
        float32[n, 3]: blended colours, from 0 to 1.
    sheet_counts
        uint8[n], or None without ``creases=True``: the number of smooth sheets that meet in each vertex. It
        is 1 on a smooth part, 2 on a crease, 3 or 4 in a corner, and 0 if the sheets of a cell do not meet
        nearby.

    Examples
    --------
    >>> from blobtree import Point, polygonize
    >>> mesh = polygonize(Point((0, 0, 0), radius=1.0), resolution=16)
    >>> mesh.vertices.shape[1], mesh.faces.dtype.name, mesh.sheet_counts
    (3, 'int32', None)
    """

    vertices: Float32Array
    faces: Int32Array
    normals: Float32Array
    colors: Float32Array
    sheet_counts: NDArray[np.uint8] | None = None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the mesh to a file, whole or not at all.

        Parameters
        ----------
        path : str or path-like
            The file; its suffix is the format: ply (with colours), vtp (with colours and normals), obj or
            stl.

        Raises
        ------
        InvalidFile
            The suffix is another one, or the mesh has no faces.
        OSError
            The file cannot be written; an existing file stays as it was.
        MissingPackage
            pyvista is not installed.

        Examples
        --------
        >>> from blobtree import Point, polygonize
        >>> polygonize(Point((0, 0, 0), radius=1.0), resolution=16).save("ball.ply")
        """
        if not isinstance(path, str | os.PathLike) or Path(path).suffix.lower() not in MESH_SUFFIXES:
            raise InvalidFile(
                f"path: expected a file that ends in {', '.join(MESH_SUFFIXES)}, "
                f"got {describe(path)}; rename it"
            )
        if not len(self.faces):
            raise InvalidFile("expected a mesh with faces, got none; its parts may be smaller than a cell")
        write_polydata(path, to_polydata(self))


@dataclass(frozen=True, eq=False)
class DeviceMesh:
    """Triangles in a device's memory, with the patches by block that a later update reuses."""

    cells: SparseCells
    codes: "wp.array[wp.uint8]"
    """By cell, the corners that are inside, as bits (64 n)."""
    rows: "wp.array[wp.int16]"
    """By cell, its row in the tables of `patches` (64 n)."""
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

    @property
    def patches(self) -> Any:
        """The patches of all cells as an argument of kernels."""
        return cell_patches(self.rows, self.offsets, self.vertex_starts, self.cells.device)


@cache
def patch_tables(device: str) -> Any:
    """Return the tables of `patches` in a device's memory, as an argument of kernels."""
    tables: Any = PatchTables()
    tables.patch_count = wp.array(PATCH_COUNT, dtype=wp.int8, device=device)
    tables.patch_of_edge = wp.array(PATCH_OF_EDGE.ravel(), dtype=wp.int8, device=device)
    tables.knotted_face = wp.array(KNOTTED_FACE, dtype=wp.int8, device=device)
    return tables


def cell_patches(rows: DeviceArray, offsets: DeviceArray, vertex_starts: DeviceArray, device: str) -> Any:
    """Return the patches of all cells as an argument of kernels."""
    patches: Any = CellPatches()
    patches.rows, patches.offsets, patches.vertex_starts = rows, offsets, vertex_starts
    patches.patch_of_edge = patch_tables(device).patch_of_edge
    return patches


def vertex_arrays(positions: DeviceArray, normals: DeviceArray, colors: DeviceArray) -> Any:
    """Return the vertices of a mesh as an argument of kernels."""
    vertices: Any = VertexArrays()
    vertices.positions, vertices.normals, vertices.colors = positions, normals, colors
    return vertices


def bridging_faces(mesh: DeviceMesh) -> IndexArray:
    """Return the triangles that may bridge a gap: an edge has outward normals that face each other."""
    count, device = len(mesh.faces), mesh.cells.device
    bridging: Any = wp.zeros(count, dtype=wp.bool, device=device)
    launch(mark_bridging, count, [mesh.faces, mesh.vertices, mesh.normals], [bridging], device)
    return np.flatnonzero(bridging.numpy())


def extract_mesh(
    cells: SparseCells,
    report: Progress,
    previous: DeviceMesh | None = None,
    samples: DeviceArray | None = None,
) -> DeviceMesh:
    """Return the dual mesh of the surface in `cells`.

    `previous` is the mesh before an edit, which is reused. `samples` receives the field at the samples.
    """
    return _Extraction(cells, previous).mesh(report, samples)


def download(mesh: DeviceMesh, sheet_counts: NDArray[np.uint8] | None = None) -> Mesh:
    """Return the triangles of a device as NumPy arrays."""
    arrays = [mesh.vertices, mesh.faces, mesh.normals, mesh.colors]
    vertices, faces, normals, colors = map(on_host, arrays)
    return Mesh(vertices, faces, normals, colors, sheet_counts)


class _Extraction:
    """The steps from cells to triangles."""

    def __init__(self, cells: SparseCells, previous: DeviceMesh | None) -> None:
        self._cells, self._old, self._device = cells, previous, cells.device
        self._arrays, self._sources = cells.arrays, cells.leaves.sources
        self._count = len(cells.leaves)
        self._tables = patch_tables(cells.device)
        self._runs: Runs | None = None  # of unchanged blocks, where runs are copied rather than blocks
        if previous is not None:  # imported here, because all imported kernels of a package compile together
            from blobtree.meshing import reuse_kernels

            self._reuse = reuse_kernels
        self._kernel = cells.tape.instruction_set.kernel_for

    def mesh(self, report: Progress, values: DeviceArray | None) -> DeviceMesh:
        """Sample the field, place the vertices, connect them."""
        report("sampling the field", 0.0)
        changed, unchanged = self._changed_blocks()
        self._runs = long_runs(unchanged, self._sources)
        needed = len(changed) * SAMPLES * SAMPLE_BYTES + self._count * BLOCK_BYTES
        demand_memory(needed, self._device, f"the surface in {self._count:,} blocks of cells")
        if values is None:
            values = self._empty(len(changed) * SAMPLES, wp.float32)
        self._sample(changed, values, partial(report, "sampling the field"))
        codes, rows, offsets, vertex_counts, quad_counts = self._classify(changed, unchanged, values)
        vertex_starts, vertex_total = exclusive_scan(vertex_counts, "vertices")
        quad_starts, quad_total = exclusive_scan(quad_counts, "triangles")
        patches = cell_patches(rows, offsets, vertex_starts, self._device)
        report("sampling the field", 1.0)
        report("placing vertices", 0.0)
        vertices, normals, colors = (self._empty(vertex_total, wp.vec3) for _ in range(3))
        arrays = vertex_arrays(vertices, normals, colors)
        self._place(changed, values, patches, arrays, partial(report, "placing vertices"))
        moved = self._copy_vertices(unchanged, vertex_starts, arrays)
        report("placing vertices", 1.0)
        faces = self._empty(2 * quad_total, wp.vec3i)
        users, others = self._users(changed)
        inputs = [users, self._arrays, patches, quad_starts, vertices]
        self._launch(connect_vertices, len(users), inputs, [faces])
        self._copy_faces(others, quad_starts, moved, faces)
        report("connecting vertices", 1.0)
        return DeviceMesh(
            self._cells, codes, rows, offsets, vertex_starts, quad_starts, vertices, normals, colors, faces
        )

    def _empty(self, size: int, dtype: Any) -> DeviceArray:
        return wp.empty(size, dtype=dtype, device=self._device)

    def _zeros(self, size: int) -> DeviceArray:
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

    def _changed_blocks(self) -> tuple[DeviceArray, DeviceArray]:
        """Return the blocks whose cells or rows may have changed, and the others."""
        if self._old is None:
            return arange(self._count, self._device), arange(0, self._device)
        return self._marked(self._reuse.mark_face_neighbors, where_negative(self._sources))

    def _users(self, changed: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the blocks whose triangles use vertices of changed blocks, and the others."""
        if self._old is None:
            return changed, arange(0, self._device)
        return self._marked(self._reuse.mark_vertex_users, changed)

    def _marked(self, mark: wp.Kernel, listed: DeviceArray) -> tuple[DeviceArray, DeviceArray]:
        """Return the blocks that the kernel `mark` flags, and the others."""
        flags, others = self._zeros(self._count + 1), self._zeros(self._count + 1)
        self._launch(mark, len(listed), [listed, self._arrays], [flags])
        self._launch(self._reuse.invert_flags, self._count, [flags], [others])
        return compact(flags), compact(others)

    def _sample(self, changed: DeviceArray, values: DeviceArray, step: Callable[[float], None]) -> None:
        """Write the field at the samples of changed blocks."""
        cells, grid = self._arrays, self._cells.grid
        inputs = [changed, cells.blocks, cells.keys, cells.spans, cells.tape]
        inputs += [child_grid(grid, grid.depth), cells.models]
        self._launch(self._kernel(sample_blocks), len(values), inputs, [values], step)

    def _classify(
        self, changed: DeviceArray, unchanged: DeviceArray, values: DeviceArray
    ) -> tuple[DeviceArray, ...]:
        """Return codes, rows and offsets by cell, and the numbers of vertices and quads by block."""
        cells = self._count * CHILDREN
        codes, rows, offsets = (self._empty(cells, dtype) for dtype in (wp.uint8, wp.int16, wp.uint8))
        vertex_counts, quad_counts = self._zeros(self._count + 1), self._zeros(self._count + 1)
        self._copy_cells(unchanged, [codes, rows, offsets], [vertex_counts, quad_counts])
        self._launch(classify_cells, len(changed), [changed, values], [codes, quad_counts])
        inputs = [changed, self._arrays, codes, self._tables]
        self._launch(choose_rows, len(changed), inputs, [rows, offsets, vertex_counts])
        return codes, rows, offsets, vertex_counts, quad_counts

    def _copy_cells(
        self, unchanged: DeviceArray, arrays: list[DeviceArray], counts: list[DeviceArray]
    ) -> None:
        """Copy codes, rows, offsets, and the numbers of vertices and quads of unchanged blocks."""
        if self._old is None:
            return
        old, runs = self._old, self._runs
        if runs is not None:
            cells: tuple[DeviceArray, ...] = old.codes, old.rows, old.offsets
            for before, after in zip(cells, arrays, strict=True):
                copy_runs(CHILDREN * runs, before.numpy(), after.numpy())
            for starts, numbers in zip((old.vertex_starts, old.quad_starts), counts, strict=True):
                copy_runs(runs, np.diff(starts.numpy()), numbers.numpy())
            return
        for before, after in zip((old.codes, old.rows, old.offsets), arrays, strict=True):
            words = CHILDREN * after.strides[0] // WORD_BYTES
            inputs = [words, unchanged, self._sources, _as_words(before)]
            self._launch(self._reuse.copy_words, len(unchanged) * words, inputs, [_as_words(after)])
        for starts, numbers in zip((old.vertex_starts, old.quad_starts), counts, strict=True):
            self._launch(
                self._reuse.copy_counts, len(unchanged), [unchanged, self._sources, starts], [numbers]
            )

    def _place(
        self,
        changed: DeviceArray,
        values: DeviceArray,
        patches: Any,
        vertices: Any,
        step: Callable[[float], None],
    ) -> None:
        """Place the vertices of changed blocks."""
        counts = self._zeros(len(changed) + 1)
        self._launch(count_listed, len(changed), [changed, patches.vertex_starts], [counts])
        list_starts, total = exclusive_scan(counts, "vertices")
        identifiers = self._empty(total, wp.int32)
        inputs = [changed, patches.rows, self._tables.patch_count, list_starts]
        self._launch(list_patches, len(changed), inputs, [identifiers])
        inputs = [identifiers, changed, self._arrays, values, patches]
        unconverged = self._zeros(max(1, len(self._cells.models)))
        self._launch(self._kernel(place_vertices), total, inputs, [vertices, unconverged], step)
        if total and unconverged.numpy().any():
            self._launch(self._kernel(bisect_unconverged), total, [*inputs, unconverged], [vertices])

    def _copy_vertices(self, unchanged: DeviceArray, starts: DeviceArray, vertices: Any) -> Any:
        """Copy the vertices of unchanged blocks, and return how they moved: new indices of all, or runs."""
        if self._old is None:
            return None
        old = self._old
        if self._runs is not None:
            runs = item_runs(self._runs, starts.numpy(), old.vertex_starts.numpy())
            copy_runs(runs, old.vertices.numpy(), vertices.positions.numpy())
            copy_runs(runs, old.normals.numpy(), vertices.normals.numpy())
            copy_runs(runs, old.colors.numpy(), vertices.colors.numpy())
            return runs
        new_index = self._empty(len(old.vertices), wp.int32)
        before = vertex_arrays(old.vertices, old.normals, old.colors)
        inputs = [unchanged, self._sources, old.vertex_starts, starts, before]
        self._launch(self._reuse.copy_vertices, len(unchanged), inputs, [vertices, new_index])
        return new_index

    def _copy_faces(self, others: DeviceArray, starts: DeviceArray, moved: Any, faces: DeviceArray) -> None:
        """Copy the triangles of blocks that use unchanged vertices alone."""
        if self._old is None:
            return
        if self._runs is not None:
            blocks = runs_of(others.numpy(), self._sources.numpy())
            runs = 2 * item_runs(blocks, starts.numpy(), self._old.quad_starts.numpy())
            homes = np.searchsorted(self._runs[:, 0], blocks[:, 0], "right") - 1
            copy_indices(runs, self._old.faces.numpy(), faces.numpy(), moved, homes)
            return
        inputs = [others, self._sources, self._old.quad_starts, starts, self._old.faces, moved]
        self._launch(self._reuse.copy_faces, len(others), inputs, [faces])


def _as_words(array: DeviceArray) -> DeviceArray:
    """Return the memory of an array as words of WORD_BYTES."""
    size = len(array) * array.strides[0] // WORD_BYTES
    return wp.array(ptr=array.ptr, dtype=wp.vec4i, shape=size, device=array.device)
