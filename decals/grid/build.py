"""Building the decal index in parallel, on any Warp device, in time and memory linear in decals.

All cells of all decals are listed in drawing order, equal cells get one slot of a scratch hash table, a
stable sort by slot brings each cell's decals together, and the cells move to a table of their number's size.
"""

from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from decals.grid import kernels as kernels
from decals.grid.cells import ALONE, EMPTY, EXPONENT_OF_ONE, EXPONENTS

NOTHING = np.iinfo(np.int32)

MOST_CELLS = 24
"""Cells a decal, on average, up to which sizes join: twice as many as are usual in cells of its own size."""


class IndexArrays(NamedTuple):
    """Arrays of an index on a device, as index.py lays them out."""

    levels: Any
    table: Any
    ids: Any
    parity: int


def build_index(positions: Any, influence: Any, ranks: Any) -> IndexArrays:
    """Index decals whose arrays (vec3, float32, int32) lie on one device."""
    return _Builder(positions, influence, ranks).build()


class _Sizes(NamedTuple):
    """Of each decal, its cells' exponent, number, and the sum of these; of each exponent, the ranks there."""

    parity: int
    exponents: Any
    counts: Any
    ends: Any
    cells: int
    lowest: NDArray[np.int32]
    highest: NDArray[np.int32]

    @property
    def used(self) -> NDArray[np.int64]:
        """Numbers of the exponents that there are, one for each level."""
        return np.flatnonzero(self.lowest != NOTHING.max)

    @property
    def cost(self) -> tuple[int, int]:
        """What is worse: each level costs every look-up, each cell memory."""
        return len(self.used), self.cells


class _Builder:
    def __init__(self, positions: Any, influence: Any, ranks: Any) -> None:
        self.positions, self.influence, self.ranks = positions, influence, ranks
        self.device, self.count = positions.device, len(positions)

    def build(self) -> IndexArrays:
        if not self.count:
            nothing = wp.zeros(0, dtype=wp.vec4, device=self.device)
            return IndexArrays(nothing, self.empty_table(1), self.whole(0), ALONE)
        order = self.drawing_order()
        sizes = self.joined_sizes(order)
        levels, level_of = _levels(sizes)
        keys, owners = wp.empty(sizes.cells, dtype=wp.vec3i, device=self.device), self.whole(2 * sizes.cells)
        numbers: Any = wp.array(level_of, dtype=wp.int32, device=self.device)
        self.launch(
            kernels.list_cells,
            self.count,
            [self.positions, self.influence, order, sizes.exponents, numbers, sizes.ends, sizes.counts],
            [keys, owners],
        )
        table, ids = self.gathered(keys, owners)
        return IndexArrays(wp.array(levels, dtype=wp.vec4, device=self.device), table, ids, sizes.parity)

    def joined_sizes(self, order: Any) -> "_Sizes":
        """Sizes joined in pairs where that makes levels fewer and cells not too many."""
        best = self.sizes(order, ALONE)
        used = best.used - EXPONENT_OF_ONE
        for parity in (0, 1):
            if len(np.unique(used - ((used & 1) != parity))) < len(best.used):
                other = self.sizes(order, parity)
                if other.cells <= MOST_CELLS * self.count and other.cost < best.cost:
                    best = other
        return best

    def sizes(self, order: Any, parity: int) -> "_Sizes":
        exponents, counts, ends = (self.whole(self.count) for _ in range(3))
        lowest = self.filled(EXPONENTS, NOTHING.max)
        highest = self.filled(EXPONENTS, NOTHING.min)
        self.launch(
            kernels.measure_decals,
            self.count,
            [self.positions, self.influence, self.ranks, order, parity],
            [exponents, counts, lowest, highest],
        )
        wp.utils.array_scan(counts, ends, inclusive=True)
        cells = int(ends[self.count - 1 :].numpy()[0])
        return _Sizes(parity, exponents, counts, ends, cells, lowest.numpy(), highest.numpy())

    def drawing_order(self) -> Any:
        """Numbers of the decals by rank, then number."""
        keys, order = self.whole(2 * self.count), self.whole(2 * self.count)
        self.launch(kernels.number_decals, self.count, [self.ranks], [keys, order])
        wp.utils.radix_sort_pairs(keys, order, self.count)
        return order

    def gathered(self, keys: Any, owners: Any) -> tuple[Any, Any]:
        """Table and lists from the cells of all decals."""
        entries = len(keys)
        scratch = 1 << (entries + entries // 4).bit_length()
        claims, slots = self.filled(scratch, EMPTY), self.whole(2 * entries)
        sizes, used, numbers, heads = (self.filled(scratch, 0) for _ in range(4))
        self.launch(kernels.claim_slots, entries, [keys, scratch - 1, claims], [slots, sizes])
        self.launch(kernels.mark_used, scratch, [sizes], [used])
        wp.utils.array_scan(used, numbers, inclusive=True)
        cells = int(numbers[scratch - 1 :].numpy()[0])
        wp.utils.radix_sort_pairs(slots, owners, entries, end_bit=max(1, scratch.bit_length() - 1))
        ids = self.whole(entries + cells)
        self.launch(kernels.write_lists, entries, [slots, owners, sizes, numbers], [heads, ids])
        size = table_size(cells)
        table, taken = self.empty_table(size), self.filled(size, 0)
        self.launch(kernels.fill_table, scratch, [claims, keys, heads, size - 1], [taken, table])
        return table, ids

    def launch(self, kernel: Any, count: int, inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(kernel, count, inputs, outputs, device=self.device)

    def whole(self, count: int) -> Any:
        return wp.empty(count, dtype=wp.int32, device=self.device)

    def empty_table(self, slots: int) -> Any:
        return wp.full(slots, wp.vec4i(EMPTY), dtype=wp.vec4i, device=self.device)

    def filled(self, count: int, value: int) -> Any:
        return wp.full(count, value, dtype=wp.int32, device=self.device)


def table_size(cells: int) -> int:
    """Slots of a table for so many cells: a power of two, at most half full."""
    return 1 << (2 * cells).bit_length()


def _levels(sizes: _Sizes) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Levels (index.py) and, for each exponent, which level it is."""
    used = sizes.used
    width = np.exp2(used.astype(np.float64) - EXPONENT_OF_ONE)
    level_of = np.full(EXPONENTS, EMPTY, np.int32)
    level_of[used] = np.arange(len(used))
    columns = [1.0 / width, width, sizes.lowest[used], sizes.highest[used]]
    return np.column_stack(columns).astype(np.float32), level_of
