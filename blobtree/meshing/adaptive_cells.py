"""Cells of several sizes: large where the surface is simple, small where its shape or its error demands it.

The cells are the leaves of an octree. Each block of a `BlockTree` has 4³ cells; eight of them may be merged
to a leaf, and each may be replaced by the block that refines it. A group of cells may be one leaf if that
changes no topology: the three conditions of Ju et al. (2002), *Dual contouring of Hermite data*.

* Each of the smaller cells may be a leaf.
* In the merged cell, the inside corners are connected along its edges, and so are the outside corners.
* The sign in the middle of each edge, of each face and of the cell occurs at one of its corners.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, IndexArray, Int32Array
from blobtree.cells.grid import CHILDREN
from blobtree.formulas.falloff import ISO
from blobtree.meshing.block_tree import BlockTree
from blobtree.meshing.patches import EDGES

OCTANTS = 8

CELL_OFFSETS: Int32Array = np.stack(np.unravel_index(np.arange(CHILDREN), (4, 4, 4)), axis=1).astype(np.int32)
"""Coordinates of a block's cells in it (64, 3)."""

OCTANT_OFFSETS: Int32Array = np.stack(np.unravel_index(np.arange(OCTANTS), (2, 2, 2)), axis=1).astype(
    np.int32
)

OCTANT_OF_CELL: IndexArray = (CELL_OFFSETS // 2) @ np.array([4, 2, 1])
"""The octant of each cell of a block (64,)."""

CELLS_OF_OCTANT: IndexArray = np.stack([np.flatnonzero(o == OCTANT_OF_CELL) for o in range(OCTANTS)])
"""The eight cells of each octant (8, 8)."""

CORNERS: Int32Array = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)], np.int32)
"""Coordinates of a cell's corners (8, 3)."""

MAX_BEND = 0.5
"""Largest distance of the samples of an octant to a linear function, over the change of this one along an
edge, at which nothing is expected between the samples."""


def _connected(corners: set[int]) -> bool:
    """Return True if corners of a cell are connected along its edges."""
    reached = set(list(corners)[:1])
    while (
        more := {b for a, b in (*EDGES, *(e[::-1] for e in EDGES)) if a in reached and b in corners} - reached
    ):
        reached |= more
    return reached == corners


SIMPLE: BoolArray = np.array(
    [
        all(_connected({c for c in range(8) if (code >> c & 1) == side}) for side in (0, 1))
        for code in range(256)
    ]
)
"""By code (256,): True if the inside corners and the outside corners are connected; also if all are alike."""


@dataclass(frozen=True)
class Leaves:
    """The leaves that the surface crosses."""

    blocks: IndexArray
    """Blocks (n,)."""
    slots: IndexArray
    """Cells of the blocks, or CHILDREN + octants (n,)."""
    codes: NDArray[np.uint8]
    """Corners that are inside, as bits (n,)."""
    lowest: Int32Array
    """Lowest corners (n, 3), in cells of the finest level from the root's lowest one."""
    sizes: Int32Array
    """Sides (n,), in cells of the finest level."""

    def __len__(self) -> int:
        return len(self.blocks)


class AdaptiveCells:
    """The choice of leaves in a `BlockTree`, which starts with the cells of the base."""

    def __init__(self, tree: BlockTree, tolerance: float) -> None:
        self.tree = tree
        self._tolerance = tolerance
        self.divided: BoolArray = np.ones((0, OCTANTS), bool)
        """By block, the octants that are not merged (n, 8)."""
        self.links: Int32Array = np.empty(0, np.int32)
        """By cell, the block that replaces it, or −1 (64 n,)."""
        self._codes = np.empty((0, CHILDREN), np.uint8)
        self._octant_codes = np.empty((0, OCTANTS), np.uint8)
        self._octant_agrees = np.empty((0, OCTANTS), bool)
        self._block_ok = np.empty(0, bool)
        self._explored = np.empty((0, OCTANTS), bool)
        self._extend()
        self.divided[:] = True

    def _extend(self) -> None:
        """Classify the blocks that are new in the tree."""
        old, new = len(self.divided), len(self.tree)
        if old == new:
            return
        values, count = self.tree.values[old:], new - old
        inside = values >= ISO
        sides: Float64Array = self.tree.grid(0).cell_size * 0.25 ** self.tree.levels[old:].astype(np.float64)
        octants = [_octant_samples(values, octant) for octant in OCTANT_OFFSETS]
        agrees = [_agrees(samples, self._tolerance / sides) for samples in octants]
        bends = np.stack([_bend(samples) for samples in octants], axis=1)
        self._codes = np.concatenate([self._codes, _codes(inside).reshape(count, CHILDREN)])
        self._octant_codes = np.concatenate(
            [self._octant_codes, _codes(inside[:, ::2, ::2, ::2]).reshape(count, OCTANTS)]
        )
        self._octant_agrees = np.concatenate([self._octant_agrees, np.stack(agrees, axis=1)])
        ok = SIMPLE[_codes(inside[:, ::4, ::4, ::4]).reshape(count)]
        ok &= _agrees(values[:, ::2, ::2, ::2], 0.5 * self._tolerance / sides)
        self._block_ok = np.concatenate([self._block_ok, ok])
        self._explored = np.concatenate([self._explored, bends <= MAX_BEND])
        self.divided = np.concatenate([self.divided, np.zeros((count, OCTANTS), bool)])
        self.links = np.concatenate([self.links, np.full(count * CHILDREN, -1, np.int32)])

    def explore(self, smallest: float) -> None:
        """Refine blocks in which the field bends, down to cells between `smallest` and twice as large."""
        while True:
            sizes = self.tree.grid(0).cell_size / 4.0**self.tree.levels
            wanted = ~self._explored & (sizes >= 2.0 * smallest)[:, None]
            wanted &= (self.tree.levels < self.tree.max_level)[:, None]
            if not wanted.any():
                return
            self._explored |= wanted
            blocks, octants = np.nonzero(wanted)
            self.tree.refine((blocks[:, None] * CHILDREN + CELLS_OF_OCTANT[octants]).ravel())
            self._extend()

    def settle(self) -> None:
        """Divide leaves whose topology the samples inside contradict."""
        tree = self.tree
        child = tree.children.reshape(-1, CHILDREN)
        block_ok = self._block_ok.copy()
        octant_ok = np.empty_like(self.divided)
        for level in range(tree.depth, -1, -1):
            blocks = np.flatnonzero(tree.levels == level)
            below = child[blocks]
            small = tree.grid(level).cell_size <= self._tolerance
            cells_ok = np.where(
                below >= 0, block_ok[np.maximum(below, 0)], SIMPLE[self._codes[blocks]] | small
            )
            ok = cells_ok[:, CELLS_OF_OCTANT].all(axis=2)
            ok &= SIMPLE[self._octant_codes[blocks]] & self._octant_agrees[blocks]
            octant_ok[blocks] = ok
            block_ok[blocks] &= ok.all(axis=1)
        reached = tree.levels == 0
        for level in range(tree.depth + 1):
            blocks = np.flatnonzero(reached & (tree.levels == level))
            self.divided[blocks] |= ~octant_ok[blocks]
            below, links = child[blocks], self.links.reshape(-1, CHILDREN)
            active = (below >= 0) & ~block_ok[np.maximum(below, 0)] & self.divided[blocks][:, OCTANT_OF_CELL]
            links[blocks] = np.where(active, below, links[blocks])
            used = links[blocks]
            reached[used[(used >= 0) & self.divided[blocks][:, OCTANT_OF_CELL]]] = True

    def leaves(self) -> Leaves:
        """Return the leaves that the surface crosses, by block and cell."""
        tree = self.tree
        links = self.links.reshape(-1, CHILDREN)
        open_cells = self.divided[:, OCTANT_OF_CELL]
        reached = self._reached()
        crossed = (self._codes > 0) & (self._codes < 255)
        blocks, cells = np.nonzero(crossed & open_cells & (links < 0) & reached[:, None])
        crossed = (self._octant_codes > 0) & (self._octant_codes < 255)
        octant_blocks, octants = np.nonzero(crossed & ~self.divided & reached[:, None])
        scale = 4 ** (tree.depth - tree.levels)
        lowest = tree.coordinates[blocks] * 4 + CELL_OFFSETS[cells]
        octant_lowest = tree.coordinates[octant_blocks] * 4 + 2 * OCTANT_OFFSETS[octants]
        both = np.concatenate([blocks, octant_blocks])
        return Leaves(
            both,
            np.concatenate([cells, CHILDREN + octants]),
            np.concatenate([self._codes[blocks, cells], self._octant_codes[octant_blocks, octants]]),
            (np.concatenate([lowest, octant_lowest]) * scale[both][:, None]).astype(np.int32),
            (scale[both] * np.repeat([1, 2], [len(blocks), len(octants)])).astype(np.int32),
        )

    def _reached(self) -> BoolArray:
        """Return the blocks whose cells are leaves, or hold leaves (n,)."""
        reached: BoolArray = self.tree.levels == 0
        links = self.links.reshape(-1, CHILDREN)
        for level in range(self.tree.depth):
            blocks = np.flatnonzero(reached & (self.tree.levels == level))
            used = links[blocks]
            reached[used[(used >= 0) & self.divided[blocks][:, OCTANT_OF_CELL]]] = True
        return reached

    def corner_values(self, leaves: Leaves, chosen: IndexArray) -> Float32Array:
        """Return the field at the corners of some of the leaves (n, 8)."""
        merged = leaves.slots[chosen] >= CHILDREN
        slots = leaves.slots[chosen] % CHILDREN
        lowest = np.where(merged[:, None], 2 * OCTANT_OFFSETS[slots % OCTANTS], CELL_OFFSETS[slots])
        at = lowest[:, None] + CORNERS * np.where(merged, 2, 1)[:, None, None]
        return self.tree.values[leaves.blocks[chosen][:, None], at[..., 0], at[..., 1], at[..., 2]]

    def divide(self, blocks: IndexArray, slots: IndexArray, twice: BoolArray) -> bool:
        """Divide leaves, given by block and slot, into halves or, where `twice`, quarters.

        Return False if nothing can be divided.
        """
        merged = slots >= CHILDREN
        octants = slots[merged] - CHILDREN
        changed = bool(merged.any())
        self.divided[blocks[merged], octants] = True
        inner = (blocks[merged][:, None] * CHILDREN + CELLS_OF_OCTANT[octants])[twice[merged]].ravel()
        codes = self._codes.ravel()[inner]
        inner = inner[(codes > 0) & (codes < 255)]
        cells = blocks[~merged] * CHILDREN + slots[~merged]
        self.tree.refine(np.concatenate([cells, inner]))
        self._extend()
        below = self.tree.children[cells]
        changed |= bool((below >= 0).any())
        self.divided[below[(below >= 0) & twice[~merged]]] = True
        for listed in (cells, inner):
            self.links[listed] = np.maximum(self.tree.children[listed], -1)
        return changed

    def divide_pierced(self, cells: IndexArray) -> bool:
        """Divide empty leaves, given by cells of theirs, at whose faces the surface shows."""
        blocks, slots = cells // CHILDREN, cells % CHILDREN
        octants = OCTANT_OF_CELL[slots]
        merged = ~self.divided[blocks, octants]
        slots = np.where(merged, CHILDREN + octants, slots)
        return self.divide(blocks, slots, np.zeros(len(blocks), bool))


def _octant_samples(samples: Float32Array, octant: Int32Array) -> Float32Array:
    """Return the samples (n, 3, 3, 3) of one octant of blocks (n, 5, 5, 5)."""
    x, y, z = 2 * octant
    return samples[:, x : x + 3, y : y + 3, z : z + 3]


def _codes(inside: BoolArray) -> NDArray[np.uint8]:
    """Return the codes (n, k, k, k) of cells from the signs of their corners (n, k + 1, k + 1, k + 1)."""
    side = inside.shape[-1] - 1
    code = np.zeros((len(inside), side, side, side), np.uint8)
    for corner, (x, y, z) in enumerate(CORNERS.tolist()):
        code |= inside[:, x : x + side, y : y + side, z : z + side].astype(np.uint8) << np.uint8(corner)
    return code


def _agrees(values: Float32Array, tolerance: Float64Array) -> BoolArray:
    """Return True where each middle of an edge, a face or the cell has a sign of its corners (n,).

    Values (n, 3, 3, 3) whose distance to the surface is at most `tolerance` (n,), in steps between them, may
    have either sign.
    """
    steepest = np.zeros(len(values), np.float32)
    for axis in range(1, 4):
        steepest = np.maximum(steepest, np.abs(np.diff(values, axis=axis)).max(axis=(1, 2, 3)))
    near = (tolerance * steepest)[:, None, None, None]
    inside, outside = values >= ISO - near, values < ISO + near
    signs = values >= ISO
    result = np.ones(len(values), bool)
    for middle in np.ndindex(3, 3, 3):
        inner = [axis for axis in range(3) if middle[axis] == 1]
        if inner:
            where = tuple(slice(0, 3, 2) if axis in inner else middle[axis] for axis in range(3))
            corners = signs[(slice(None), *where)].reshape(len(values), -1)
            at = (slice(None), *middle)
            result &= (inside[at] & corners.any(axis=1)) | (outside[at] & ~corners.all(axis=1))
    return result


def _bend(values: Float32Array) -> Float32Array:
    """Return how far values (n, 3, 3, 3) are from a linear function, over its change along an edge (n,)."""
    steps = np.array([-1.0, 0.0, 1.0], np.float32)
    gradient = [
        (values * steps.reshape(shape)).sum(axis=(1, 2, 3)) / 18
        for shape in ((3, 1, 1), (1, 3, 1), (1, 1, 3))
    ]
    x, y, z = (g[:, None, None, None] for g in gradient)
    mean = values.mean(axis=(1, 2, 3))[:, None, None, None]
    linear = mean + x * steps[:, None, None] + y * steps[:, None] + z * steps
    change = 2.0 * np.sqrt(sum(g**2 for g in gradient))
    rest = np.abs(values - linear).max(axis=(1, 2, 3))
    return np.where(change > 0.0, rest / np.maximum(change, 1e-30), np.inf)
