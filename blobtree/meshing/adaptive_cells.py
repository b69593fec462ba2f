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
from blobtree.meshing.block_tree import BlockTree, Rows
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
        self._rows: dict[str, Rows] = {}
        self.divided: BoolArray
        """By block, the octants that are not merged (n, 8)."""
        self.links: Int32Array
        """By cell, the block that replaces it, or −1 (64 n,)."""
        self._codes: NDArray[np.uint8]
        self._cell_ok: BoolArray
        self._octant_codes: NDArray[np.uint8]
        self._octant_agrees: BoolArray
        self._block_ok: BoolArray
        self._explored: BoolArray
        self._extend()
        self.divided[:] = True

    def _extend(self) -> None:
        """Classify the blocks that are new in the tree."""
        old, new = len(self._rows["divided"].all) if self._rows else 0, len(self.tree)
        if self._rows and old == new:
            return
        count = new - old
        values = np.ascontiguousarray(np.moveaxis(self.tree.values[old:], 0, -1))  # each sample's in a row
        inside = values >= ISO
        sides: Float64Array = self.tree.grid(0).cell_size * 0.25 ** self.tree.levels[old:].astype(np.float64)
        octants = [_octant_samples(values, octant) for octant in OCTANT_OFFSETS]
        agrees = [_agrees(samples, self._tolerance / sides) for samples in octants]
        bends = np.stack([_bend(samples) for samples in octants], axis=1)
        ok = SIMPLE[cell_codes(inside[::4, ::4, ::4]).reshape(count)]
        ok &= _agrees(values[::2, ::2, ::2], 0.5 * self._tolerance / sides)
        codes = cell_codes(inside)
        for name, rows in {
            "divided": np.zeros((count, OCTANTS), bool),
            "links": np.full(count * CHILDREN, -1, np.int32),
            "_codes": codes,
            "_cell_ok": SIMPLE[codes],
            "_octant_codes": cell_codes(inside[::2, ::2, ::2]),
            "_octant_agrees": np.stack(agrees, axis=1),
            "_block_ok": ok,
            "_explored": bends <= MAX_BEND,
        }.items():
            if name in self._rows:
                self._rows[name].append(rows)
            else:
                self._rows[name] = Rows(rows)
            setattr(self, name, self._rows[name].all)

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
            cells_ok = np.where(below >= 0, block_ok[np.maximum(below, 0)], self._cell_ok[blocks] | small)
            ok = cells_ok[:, CELLS_OF_OCTANT].all(axis=2)
            ok &= SIMPLE[self._octant_codes[blocks]] & self._octant_agrees[blocks]
            octant_ok[blocks] = ok
            block_ok[blocks] &= ok.all(axis=1)
        reached = tree.levels == 0
        for level in range(tree.depth + 1):
            blocks = np.flatnonzero(reached & (tree.levels == level))
            self.divided[blocks] |= ~octant_ok[blocks]
            below, links = child[blocks], self.links.reshape(-1, CHILDREN)
            active = (below >= 0) & ~block_ok[np.maximum(below, 0)] & of_cells(self.divided[blocks])
            links[blocks] = np.where(active, below, links[blocks])
            used = links[blocks]
            reached[used[(used >= 0) & of_cells(self.divided[blocks])]] = True

    @property
    def open_cells(self) -> BoolArray:
        """By cell, True if its octant is not merged (n, 64)."""
        return of_cells(self.divided)

    def leaves(self) -> Leaves:
        """Return the leaves that the surface crosses, by block and cell."""
        tree = self.tree
        links = self.links.reshape(-1, CHILDREN)
        reached = self._reached()
        crossed = (self._codes > 0) & (self._codes < 255)
        blocks, cells = np.nonzero(crossed & self.open_cells & (links < 0) & reached[:, None])
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
            reached[used[(used >= 0) & of_cells(self.divided[blocks])]] = True
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

    def replace(self, blocks: IndexArray, divided: BoolArray) -> None:
        """Let blocks replace the cells that they refine; where not `divided`, their octants are merged."""
        self._extend()
        self.links[self.tree.parents[blocks]] = blocks
        self.divided[blocks[divided]] = True

    def divide_pierced(self, cells: IndexArray) -> bool:
        """Divide empty leaves, given by cells of theirs, at whose faces the surface shows."""
        blocks, slots = cells // CHILDREN, cells % CHILDREN
        octants = OCTANT_OF_CELL[slots]
        merged = ~self.divided[blocks, octants]
        slots = np.where(merged, CHILDREN + octants, slots)
        return self.divide(blocks, slots, np.zeros(len(blocks), bool))


def of_cells(octants: BoolArray) -> BoolArray:
    """Return for each cell of blocks (n, 64) the value of its octant (n, 8)."""
    return octants.take(OCTANT_OF_CELL, axis=1)


def _octant_samples(samples: Float32Array, octant: Int32Array) -> Float32Array:
    """Return the samples (3, 3, 3, n) of one octant of blocks (5, 5, 5, n)."""
    x, y, z = 2 * octant
    return samples[x : x + 3, y : y + 3, z : z + 3]


def cell_codes(inside: BoolArray) -> NDArray[np.uint8]:
    """Return the codes (n, k³) of cells from the signs of their corners (k + 1, k + 1, k + 1, n)."""
    side, count = len(inside) - 1, inside.shape[-1]
    code = np.zeros((side, side, side, count), np.uint8)
    for corner, (x, y, z) in enumerate(CORNERS.tolist()):
        code |= inside[x : x + side, y : y + side, z : z + side].astype(np.uint8) << np.uint8(corner)
    return np.ascontiguousarray(code.reshape(side**3, count).T)


def _agrees(values: Float32Array, tolerance: Float64Array) -> BoolArray:
    """Return True where each middle of an edge, a face or the cell has a sign of its corners (n,).

    Values (3, 3, 3, n) whose distance to the surface is at most `tolerance` (n,), in steps between them, may
    have either sign.
    """
    steepest = np.zeros(values.shape[-1], np.float32)
    for axis in range(3):
        steepest = np.maximum(steepest, np.abs(np.diff(values, axis=axis)).max(axis=(0, 1, 2)))
    near = tolerance * steepest
    inside, outside = values >= ISO - near, values < ISO + near
    signs = values >= ISO
    result = np.ones(values.shape[-1], bool)
    for middle in np.ndindex(3, 3, 3):
        if 1 in middle:
            corners = signs[tuple(slice(0, 3, 2) if place == 1 else place for place in middle)]
            corners = corners.reshape(2 ** middle.count(1), len(result))
            result &= (inside[middle] & corners.any(axis=0)) | (outside[middle] & ~corners.all(axis=0))
    return result


def _bend(values: Float32Array) -> Float32Array:
    """Return how far values (3, 3, 3, n) are from a linear function, over its change along an edge (n,)."""
    steps = np.array([-1.0, 0.0, 1.0], np.float32)[:, None]
    x, y, z = ((values.take(2, axis) - values.take(0, axis)).sum(axis=(0, 1)) / 18 for axis in range(3))
    linear = values.mean(axis=(0, 1, 2)) + x * steps[:, None, None] + y * steps[:, None] + z * steps
    change = 2.0 * np.sqrt(x**2 + y**2 + z**2)
    rest = np.abs(values - linear).max(axis=(0, 1, 2))
    return np.where(change > 0.0, rest / np.maximum(change, 1e-30), np.inf)
