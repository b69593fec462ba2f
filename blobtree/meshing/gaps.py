"""Gaps: places where two surfaces are so near each other that cells would bridge the space between them.

A mesh of cells joins two surfaces where both ends of a cell's edge are inside, one end behind each surface,
and no sample lies in the gap. The ends then belong to different primitives, and the middle of the gap is as
far from one primitive as from the other.

Beside a concave crease, edges cross the outside too, but other edges, which stay inside, join the same
samples. So the samples and the edges that stay inside are a graph. An edge crosses a gap if its ends lie in
different components of the graph. Cells beside such edges are divided until no such edge is left.

A mesh that bridges a gap has triangles with corners on both sides, whose normals face each other. Few meshes
without gaps have any, at creases, and these prove that an edge below the crease is inside. All others are
searched.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float64Array, IndexArray, Int32Array, Int64Array
from blobtree.cells.grid import BRANCHING, CHILDREN
from blobtree.cells.sparse_cells import SparseCells
from blobtree.device import launch
from blobtree.formulas.falloff import ISO
from blobtree.meshing.block_tree import BlockTree, on_device
from blobtree.meshing.dual_kernels import SAMPLES
from blobtree.meshing.gap_kernels import DIRECTIONS, find_crossing_edges, mark_open
from blobtree.meshing.mesh import DeviceMesh, bridging_faces, extract_mesh
from blobtree.progress import Progress

NEAR_BLOCKS = 3
"""Distance, in blocks of the base, within which edges inside join two samples."""

_AXES = np.eye(3, dtype=np.intp)
_SECOND, _THIRD = np.roll(_AXES, -1, axis=0), np.roll(_AXES, -2, axis=0)
STARTS = np.concatenate([0 * _AXES, 0 * _AXES, _THIRD])
STEPS = np.concatenate([_AXES, _SECOND + _THIRD, _SECOND - _THIRD])
"""Where the edges of a sample begin, and where they lead (DIRECTIONS, 3)."""


@dataclass(frozen=True)
class CrossingEdges:
    """Edges of cells with both ends inside that cross the outside."""

    blocks: IndexArray
    """The block of each (n,); an edge between blocks is in both of them."""
    lowest: IndexArray
    """Its lower end (n, 3), in cells from the lowest corner of the block."""
    steps: IndexArray
    """From there to the other end (n, 3): along an axis, or a diagonal of a face."""
    widths: Float64Array
    """Length of the part that is outside (n,)."""
    places: Float64Array
    """A place outside (n, 3)."""

    @staticmethod
    def none() -> "CrossingEdges":
        """Return no edges."""
        numbers, points = np.empty(0, np.intp), np.empty((0, 3))
        places = np.empty((0, 3), np.intp)
        return CrossingEdges(numbers, places, places, points[:, 0], points)

    def __len__(self) -> int:
        return len(self.blocks)

    def chosen(self, among: BoolArray | IndexArray) -> "CrossingEdges":
        """Return some of the edges."""
        return CrossingEdges(*(column[among] for column in vars(self).values()))

    def then(self, more: "CrossingEdges") -> "CrossingEdges":
        """Return these edges and others."""
        columns = zip(vars(self).values(), vars(more).values(), strict=True)
        return CrossingEdges(*map(np.concatenate, columns))

    @property
    def cells(self) -> IndexArray:
        """The cells of each edge's block beside it (n, 8), −1 for those that are none."""
        offsets = np.array(list(np.ndindex(2, 2, 2)))
        at = np.minimum(self.lowest, self.lowest + self.steps)[:, None] - offsets
        beside = (offsets == 0) | (self.steps[:, None] == 0)
        there = (beside & (at >= 0) & (at < BRANCHING)).all(axis=2)
        cells = self.blocks[:, None] * CHILDREN + at @ [BRANCHING**2, BRANCHING, 1]
        return np.where(there, cells, -1)


class Gaps:
    """The edges of a tree of blocks that cross gaps, as its blocks are refined."""

    def __init__(self, tree: BlockTree) -> None:
        self._tree = tree
        self._roots = np.arange(len(tree.cells.leaves))
        self._crossing = CrossingEdges.none()
        self._searched = 0

    def roots(self, blocks: IndexArray) -> IndexArray:
        """Return the blocks of the base that hold blocks."""
        self._search()
        return self._roots[blocks]

    def edges(self, leaves: BoolArray | None = None) -> CrossingEdges:
        """Return the edges across gaps beside cells (64 n,) that are leaves, by default all."""
        self._search()
        if leaves is None:
            leaves = np.ones(len(self._tree) * CHILDREN, bool)
        cells = self._crossing.cells
        beside = np.asarray(((cells >= 0) & leaves[cells]).any(axis=1))
        crossing = self._crossing.chosen(beside)
        if not len(crossing):
            return crossing
        return crossing.chosen(self._apart(crossing))

    def cross(self, blocks: IndexArray) -> bool:
        """Return True if there are edges across gaps, if there are any beside blocks of the base."""
        beside = np.flatnonzero(self._near(blocks, 1))
        few = 2 * len(beside) < len(self._tree)
        return (not few or len(self._crossing_in(beside, 0)) > 0) and len(self.edges()) > 0

    def _near(self, blocks: IndexArray, distance: int) -> BoolArray:
        """Return True for blocks of the base within a distance, in blocks, from some of them."""
        from scipy.spatial import cKDTree  # most meshes need none

        base = self._tree.coordinates[: len(self._tree.cells.leaves)]
        search = cKDTree(base[blocks])
        return np.asarray(search.query(base, p=np.inf, distance_upper_bound=distance + 0.5)[0] < np.inf)

    def _search(self) -> None:
        """Look for edges that cross the outside in new blocks."""
        tree, first = self._tree, self._searched
        if first == len(tree):
            return
        self._searched = len(tree)
        new = np.arange(len(self._roots), len(tree))
        self._roots = np.append(self._roots, new)
        for level in range(1, tree.depth + 1):
            of_level = new[tree.levels[new] == level]
            self._roots[of_level] = self._roots[tree.parents[of_level] // CHILDREN]
        for level in np.unique(tree.levels[first:]):
            listed = first + np.flatnonzero(tree.levels[first:] == level)
            self._crossing = self._crossing.then(self._crossing_in(listed, int(level)))

    def _crossing_in(self, listed: IndexArray, level: int) -> CrossingEdges:
        """Return the edges across the outside in blocks of a level, but for those with a way round there."""
        tree, device = self._tree, self._tree.cells.device
        grid, values = tree.grid(level), tree.values[listed]
        inputs: list[Any] = [on_device(listed, wp.int32, device), tree.level_arrays()]
        inputs += [wp.vec3i(*grid.base_of(grid.depth)), wp.vec3(*grid.corner), grid.cell_size]
        directions = DIRECTIONS if level else 3
        inputs += [directions, on_device(values.ravel(), wp.float32, device)]
        inputs += [wp.empty(values.size, dtype=wp.int32, device=device) for _ in range(2)]
        widths, shares = (
            wp.zeros(directions * values.size, dtype=wp.float32, device=device) for _ in range(2)
        )
        kernel = tree.cells.tape.instruction_set.kernel_for(find_crossing_edges)
        launch(kernel, len(listed), inputs, [widths, shares], device)
        lengths = widths.numpy()
        found = np.flatnonzero(lengths)
        row, *lowest, along = np.unravel_index(found, (*values.shape, directions))
        blocks, places, steps = listed[row], np.stack(lowest, axis=1) + STARTS[along], STEPS[along]
        starts = grid.origin + (tree.coordinates[blocks] * BRANCHING + places) * grid.cell_size
        between = shares.numpy()[found, None] * steps * grid.cell_size
        return CrossingEdges(blocks, places, steps, lengths[found].astype(np.float64), starts + between)

    def _apart(self, crossing: CrossingEdges) -> BoolArray:
        """Return True for edges whose ends no edges join that stay inside."""
        from scipy.sparse import coo_matrix  # as above
        from scipy.sparse.csgraph import connected_components

        tree = self._tree
        blocks = np.flatnonzero(self._near(np.unique(self._roots[crossing.blocks]), NEAR_BLOCKS)[self._roots])
        row_of = np.full(len(tree), -1)
        row_of[blocks] = np.arange(len(blocks))
        inside = tree.values[blocks] >= ISO
        keys = self._sample_keys(blocks)[inside]
        numbers = np.zeros(inside.shape, np.intp)
        nodes, numbers[inside] = np.unique(keys, return_inverse=True)
        known = self._crossing.chosen(row_of[self._crossing.blocks] >= 0)
        pairs = []
        for axis in range(3):
            low, high = (
                tuple(slice(*ends) if at == axis else slice(None) for at in range(3))
                for ends in ((0, 4), (1, 5))
            )
            joined = inside[:, *low] & inside[:, *high]
            of_axis = known.chosen((known.steps == np.eye(3)[axis]).all(axis=1))
            joined[row_of[of_axis.blocks], *of_axis.lowest.T] = False
            pairs.append(np.stack([numbers[:, *low][joined], numbers[:, *high][joined]]))
        start, end = np.concatenate(pairs, axis=1)
        graph = coo_matrix((np.ones(len(start), np.int8), (start, end)), (len(nodes),) * 2)
        labels = connected_components(graph, directed=False)[1]
        rows, ends = row_of[crossing.blocks], crossing.lowest + crossing.steps
        first, second = (labels[numbers[rows, *at.T]] for at in (crossing.lowest, ends))
        return np.asarray(first != second)

    def _sample_keys(self, blocks: IndexArray) -> Int64Array:
        """Return numbers (n, 5, 5, 5) of samples of blocks, equal for equal places."""
        tree = self._tree
        scale = 4 ** (tree.depth - tree.levels[blocks])
        x, y, z = (
            (tree.coordinates[blocks, axis].astype(np.int64) * BRANCHING)[:, None] + np.arange(BRANCHING + 1)
            for axis in range(3)
        )
        x, y, z = (line * scale[:, None] for line in (x, y, z))
        keys: Int64Array = (x << 42)[:, :, None, None] + (y << 21)[:, None, :, None] + z[:, None, None, :]
        return keys


def mesh_without_gaps(cells: SparseCells, report: Progress) -> DeviceMesh | None:
    """Return the mesh of cells of one size; None if it bridges a gap."""
    samples: Any = wp.empty(len(cells.leaves) * SAMPLES, dtype=wp.float32, device=cells.device)
    mesh = extract_mesh(cells, report, samples=samples)
    blocks = open_blocks(mesh)
    return None if len(blocks) and Gaps(BlockTree(cells, samples)).cross(blocks) else mesh


def open_blocks(mesh: DeviceMesh) -> IndexArray:
    """Return the blocks of triangles that may bridge a gap, but for those across creases."""
    bridging = bridging_faces(mesh)
    if not len(bridging):
        return bridging
    cells, faces = mesh.cells, mesh.faces.numpy()[bridging]
    blocks = np.searchsorted(mesh.vertex_starts.numpy(), faces[:, 0], side="right") - 1
    inputs = [on_device(faces, wp.vec3i, cells.device), mesh.vertices, mesh.normals, cells.grid.cell_size]
    inputs += [on_device(blocks, wp.int32, cells.device), cells.leaves.spans, cells.leaves.tape]
    opened: Any = wp.zeros(len(faces), dtype=wp.bool, device=cells.device)
    launch(cells.tape.instruction_set.kernel_for(mark_open), len(faces), inputs, [opened], cells.device)
    return np.unique(blocks[opened.numpy()])


def connected_blocks(coordinates: Int32Array) -> IndexArray:
    """Return the number of its group of neighbours for each of some blocks (n, 3)."""
    from scipy.sparse.csgraph import connected_components  # most meshes have no gaps
    from scipy.spatial import cKDTree

    search = cKDTree(coordinates)
    beside = search.sparse_distance_matrix(search, 1.5, p=np.inf)
    groups: IndexArray = connected_components(beside, directed=False)[1]
    return groups
