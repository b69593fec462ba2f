"""Where leaves of adaptive cells changed: far from there, the polygons of leaves stay the same.

Changes are told apart by the cell of the base that holds them.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import IndexArray, Int32Array
from blobtree.cells.grid import CHILDREN
from blobtree.meshing.adaptive_cells import CELL_OFFSETS, CELLS_OF_OCTANT, CORNERS, AdaptiveCells, Leaves

MAX_CHANGES = 4000
"""Changed cells of the base up to which the others are told apart."""

BESIDE, NEAR, FAR = 2, 1, 0
"""A leaf or cell beside a change, one that a leaf beside a change may touch, and any other."""

REACH = 3
"""Cells of the base from a change to NEAR ones: a leaf beside it may be two cells large."""


class LeafChanges:
    """Changes of the leaves between two calls of `update`."""

    def __init__(self, cells: AdaptiveCells) -> None:
        self._cells, self._tree = cells, cells.tree
        base = 4 * self._tree.coordinates[self._tree.levels == 0]
        self._lowest = base.min(axis=0, initial=0) - REACH
        self._nearness = np.zeros(base.max(axis=0, initial=0) + 4 + REACH + 1 - self._lowest, np.uint8)
        self._divided = np.empty((0, 8), bool)
        self._links = np.empty(0, np.int32)

    def update(self) -> None:
        """Compare the leaves with those at the last call, or with none at the first one."""
        octants = self._cells.divided[: len(self._divided)] != self._divided
        links = np.flatnonzero(self._cells.links[: len(self._links)] != self._links)
        known = len(self._divided) > 0
        self._divided, self._links = self._cells.divided.copy(), self._cells.links.copy()
        blocks, changed = np.nonzero(octants)
        inner = (blocks[:, None] * CHILDREN + CELLS_OF_OCTANT[changed]).ravel()
        self._nearness[:] = FAR
        self._nearness[self._base_cells(np.concatenate([inner, links]))] = BESIDE
        at = np.argwhere(self._nearness)
        if not known or len(at) > MAX_CHANGES:
            self._nearness[:] = BESIDE
            return
        for mark, reach in ((NEAR, REACH), (BESIDE, 1)):
            for offset in product(range(-reach, reach + 1), repeat=3):
                self._nearness[tuple((at + offset).T)] = mark

    def of_leaves(self, leaves: Leaves) -> NDArray[np.uint8]:
        """Return BESIDE, NEAR or FAR for each leaf, the largest of its cells of the base."""
        shift = 2 * self._tree.depth
        at = (leaves.lowest >> shift) - self._lowest
        nearness: NDArray[np.uint8] = self._nearness[tuple(at.T)]
        large = np.flatnonzero(leaves.sizes > 1 << shift)
        corners = at[large][:, None] + CORNERS
        nearness[large] = self._nearness[tuple(np.moveaxis(corners, -1, 0))].max(axis=1, initial=FAR)
        return nearness

    def of_cells(self, cells: IndexArray) -> NDArray[np.uint8]:
        """Return BESIDE, NEAR or FAR for cells of blocks."""
        nearness: NDArray[np.uint8] = self._nearness[self._base_cells(cells)]
        return nearness

    def _base_cells(self, cells: IndexArray) -> tuple[Int32Array, ...]:
        """Return the cells of the base that hold cells of blocks, as an index of `_nearness`."""
        blocks = cells // CHILDREN
        levels, at = self._tree.levels[blocks], self._tree.coordinates[blocks]
        inner = at >> 2 * np.maximum(levels - 1, 0)[:, None]
        at = np.where(levels[:, None] == 0, 4 * at + CELL_OFFSETS[cells % CHILDREN], inner)
        return tuple((at - self._lowest).T)
