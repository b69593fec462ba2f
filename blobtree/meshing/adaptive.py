"""Meshes by chord error on adaptive cells: as small as the error demands, where it demands it.

The first pass has cells of one size. After each pass, the triangles are measured, and the leaves at those
that are too far from the surface are divided. As the error of a smooth surface falls with the square of the
cell size, a pass divides a leaf once for each factor of four of its error, but at most twice.

The topology is that of cells in which the field is nearly linear. `AdaptiveCells.explore` looks for such
cells down to the size that the chord error needs at the sharpest bend, where the uniform mesh would stop.
"""

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Int64Array
from blobtree.cells.sparse_cells import SparseCells
from blobtree.meshing.adaptive_cell_kernels import write_polygons
from blobtree.meshing.adaptive_cells import AdaptiveCells
from blobtree.meshing.adaptive_kernels import place_on_surface
from blobtree.meshing.adaptive_mesh import AdaptiveMesh, AdaptiveMesher
from blobtree.meshing.block_tree import BlockTree
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.progress import Progress

Hashes: TypeAlias = NDArray[np.uint64]

ADAPTIVE_KERNELS = (place_on_surface, write_polygons, sample_blocks)
"""Kernels of every adaptive mesh, for `load_together`."""

ALLOWED_SHARE = 0.8
"""Largest error of a triangle's samples, over the allowed one: it may be more between samples."""

EXPLORED_SHARE = 1 / 4
"""Size, in cells of the base, down to which parts are looked for, whatever the chord error."""

MAX_DIVISIONS = 2
"""Most divisions of a leaf in one pass: estimates hold no farther."""


@dataclass
class AdaptivePasses:
    """Passes of one model with smaller and smaller leaves."""

    cells: SparseCells
    """The base."""
    allowed: float
    """The chord error."""
    creases: bool
    mesh: AdaptiveMesh = field(init=False)
    """The mesh of the last pass."""

    def __post_init__(self) -> None:
        self._leaves = AdaptiveCells(BlockTree(self.cells), self.allowed)
        self._leaves.explore(EXPLORED_SHARE * self.cells.grid.cell_size)
        self._mesher = AdaptiveMesher(self._leaves, self.creases)
        self._fine = np.empty(0, np.uint64)
        self._errors = np.empty(0, np.float32)

    def run(self, report: Progress) -> bool:
        """Make the mesh and measure it; return True if it is within the chord error."""
        self.mesh = mesh = self._mesher.mesh(report)
        hashes = _hashes(mesh.vertices.identifiers[mesh.faces])
        new = np.flatnonzero(~_among(hashes, self._fine))
        errors = np.zeros(len(mesh.faces), np.float32)
        errors[new] = self._mesher.errors(mesh, new, report)
        self._fine = np.sort(hashes[errors <= ALLOWED_SHARE * self.allowed])
        self._errors = self._leaf_errors(errors)
        return len(self._fine) == len(hashes)

    def _leaf_errors(self, errors: Float32Array) -> Float32Array:
        """Return the error of each leaf, the largest of the triangles in which it is the largest leaf."""
        owners = self.mesh.owners[self.mesh.faces]
        sizes = self.mesh.leaves.sizes[owners]
        result = np.zeros(len(self.mesh.leaves), np.float32)
        largest = sizes == sizes.max(axis=1, keepdims=True)
        np.maximum.at(result, owners[largest], np.broadcast_to(errors[:, None], owners.shape)[largest])
        return result

    def _divisions(self, scale: float = 1.0) -> Float32Array:
        """Return how often each leaf is to be divided to meet the chord error.

        `scale` is the size of all leaves over the present one.
        """
        ratio = np.maximum(scale**2 * self._errors / (ALLOWED_SHARE * self.allowed), 1.0)
        times: Float32Array = np.ceil(0.5 * np.log2(ratio))
        return times

    def expected_triangles(self, divisions: int | None = None, scale: float = 1.0) -> float:
        """Return the expected number of triangles once leaves are divided, at most `divisions` times.

        `scale` is the size of all leaves over the present one.
        """
        times = self._divisions(scale)
        if divisions is not None:
            times = np.minimum(times, divisions)
        return float(2.0 * (4.0**times).sum() / scale**2)

    def smallest_size(self) -> float:
        """Return the size of the smallest leaf that the chord error is expected to take."""
        finest = self._leaves.tree.grid(self._leaves.tree.depth).cell_size
        sizes = self.mesh.leaves.sizes * finest
        ratio = np.maximum(self._errors / (ALLOWED_SHARE * self.allowed), 1.0)
        return float(np.min(sizes / np.sqrt(ratio), initial=self.cells.grid.cell_size))

    def refine(self) -> None:
        """Divide the leaves that are too far from the surface, and look for parts that they miss."""
        self._leaves.explore(min(self.smallest_size(), EXPLORED_SHARE * self.cells.grid.cell_size))
        times = np.minimum(self._divisions(), MAX_DIVISIONS)
        wrong = np.flatnonzero(times > 0)
        leaves = self.mesh.leaves
        self._leaves.divide(leaves.blocks[wrong], leaves.slots[wrong], times[wrong] > 1)


def _among(hashes: Hashes, ascending: Hashes) -> BoolArray:
    """Return which hashes are among others (n,); `np.isin` takes four times as long."""
    order = np.argsort(hashes)
    at = np.searchsorted(ascending, hashes[order])
    found = np.zeros(len(hashes), bool)
    found[order] = np.append(ascending, 0)[at] == hashes[order] if len(ascending) else False
    return found


def _hashes(identifiers: Int64Array) -> Hashes:
    """Return a hash of each triangle (n,) from the identifiers of its corners (n, 3)."""
    mixed = np.zeros(len(identifiers), np.uint64)
    for corner in np.sort(identifiers, axis=1).astype(np.uint64).T:
        mixed = (mixed ^ corner) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return mixed
