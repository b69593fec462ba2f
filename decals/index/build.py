"""Parallel construction of the index on any Warp device, in time and memory linear in the decals.

The cells of all decals are listed in draw order. Equal cells claim the same slot of a temporary hash table. A
stable sort by slot collects the decals of each cell. The cells then move to a table that fits their number.
"""

from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.kernels import loaded
from decals.index import build_kernels as kernels
from decals.index.decal_cells import EMPTY, EXPONENT_OF_ONE, EXPONENTS, NO_FLOOR, NO_PARITY

INT32 = np.iinfo(np.int32)

MAX_AVERAGE_CELLS = 24
"""Average number of cells of a decal up to which sizes share levels: twice the usual number."""


MIN_LARGER = 16
"""Number of decals on a level for each smaller decal that uses its cells."""

MAX_SMALLER = 4
"""Largest number of such smaller decals with their centres in one cell."""


class IndexArrays(NamedTuple):
    """Arrays of an index on a device, as `DecalIndex` describes them."""

    levels: Any
    table: Any
    ids: Any
    parity: int
    floor: int


def build_index(positions: Any, influence: Any, ranks: Any) -> IndexArrays:
    """Build the index of decals whose arrays (vec3, float32, int32) lie on one device."""
    return _Builder(positions, influence, ranks).build()


class _Sizes(NamedTuple):
    """Cells of each decal (exponent, number, running sum), and the range of ranks of each exponent."""

    parity: int
    floor: int
    exponents: Any
    counts: Any
    ends: Any
    cells: int
    lowest: NDArray[np.int32]
    highest: NDArray[np.int32]

    @property
    def used(self) -> NDArray[np.int64]:
        """Exponents in use, one for each level."""
        return np.flatnonzero(self.lowest != INT32.max)

    @property
    def cost(self) -> tuple[int, int]:
        """Cost for comparison: number of levels (time of each look-up), then cells (memory)."""
        return len(self.used), self.cells


class _Builder:
    def __init__(self, positions: Any, influence: Any, ranks: Any) -> None:
        self.positions, self.influence, self.ranks = positions, influence, ranks
        self.device, self.count = positions.device, len(positions)

    def build(self) -> IndexArrays:
        if not self.count:
            nothing = wp.zeros(0, dtype=wp.vec4, device=self.device)
            return IndexArrays(nothing, self.empty_table(1), self.empty_ints(0), NO_PARITY, NO_FLOOR)
        order = self.drawing_order()
        sizes = self.choose_sizes(order)
        levels, level_of = _levels(sizes)
        keys, owners = (
            wp.empty(sizes.cells, dtype=wp.vec3i, device=self.device),
            self.empty_ints(2 * sizes.cells),
        )
        numbers: Any = wp.array(level_of, dtype=wp.int32, device=self.device)
        self.launch(
            kernels.list_cells,
            self.count,
            [self.positions, self.influence, order, sizes.exponents, numbers, sizes.ends, sizes.counts],
            [keys, owners],
        )
        table, ids = self.build_lists(keys, owners)
        numbers = wp.array(levels, dtype=wp.vec4, device=self.device)
        return IndexArrays(numbers, table, ids, sizes.parity, sizes.floor)

    def choose_sizes(self, order: Any) -> "_Sizes":
        """Return the sizes with the fewest levels, shared in pairs if that does not need too many cells.

        A few small decals use the cells of larger ones first.
        """
        best = self.sizes(order, NO_PARITY, NO_FLOOR)
        floor = self.floor_of(best, order)
        if floor != NO_FLOOR:
            best = self.sizes(order, NO_PARITY, floor)
        used = best.used - EXPONENT_OF_ONE
        for parity in (0, 1):
            if len(np.unique(used - ((used & 1) != parity))) < len(best.used):
                other = self.sizes(order, parity, floor)
                if other.cells <= MAX_AVERAGE_CELLS * self.count and other.cost < best.cost:
                    best = other
        return best

    def floor_of(self, sizes: "_Sizes", order: Any) -> int:
        """Return the largest exponent that a few smaller decals can share; NO_FLOOR for none.

        Each level costs a look-up at every point. A decal in larger cells than its own costs one more
        candidate at the few points in these.
        """
        used = sizes.used - EXPONENT_OF_ONE
        if len(used) < 2:
            return NO_FLOOR
        exponents = sizes.exponents.numpy()
        for exponent in used[:0:-1].tolist():
            smaller = np.flatnonzero(exponents < exponent)
            if MIN_LARGER * len(smaller) > np.count_nonzero(exponents == exponent):
                continue
            rows = order.numpy()[smaller]
            cells = np.floor(self.positions.numpy()[rows] / 2.0**exponent)
            if np.unique(cells, axis=0, return_counts=True)[1].max() <= MAX_SMALLER:
                return int(exponent)
        return NO_FLOOR

    def sizes(self, order: Any, parity: int, floor: int) -> "_Sizes":
        exponents, counts, ends = (self.empty_ints(self.count) for _ in range(3))
        lowest = self.filled(EXPONENTS, INT32.max)
        highest = self.filled(EXPONENTS, INT32.min)
        self.launch(
            kernels.measure_decals,
            self.count,
            [self.positions, self.influence, self.ranks, order, parity, floor],
            [exponents, counts, lowest, highest],
        )
        wp.utils.array_scan(counts, ends, inclusive=True)
        cells = int(ends[self.count - 1 :].numpy()[0])
        return _Sizes(parity, floor, exponents, counts, ends, cells, lowest.numpy(), highest.numpy())

    def drawing_order(self) -> Any:
        """Return the numbers of the decals in draw order."""
        keys, order = self.empty_ints(2 * self.count), self.empty_ints(2 * self.count)
        self.launch(kernels.number_decals, self.count, [self.ranks], [keys, order])
        wp.utils.radix_sort_pairs(keys, order, self.count)
        return order

    def build_lists(self, keys: Any, owners: Any) -> tuple[Any, Any]:
        """Return the table and lists of the cells of all decals."""
        entries = len(keys)
        scratch = 1 << (entries + entries // 4).bit_length()
        claims, slots = self.filled(scratch, EMPTY), self.empty_ints(2 * entries)
        sizes, used, numbers, heads = (self.filled(scratch, 0) for _ in range(4))
        self.launch(kernels.claim_slots, entries, [keys, scratch - 1, claims], [slots, sizes])
        self.launch(kernels.mark_used, scratch, [sizes], [used])
        wp.utils.array_scan(used, numbers, inclusive=True)
        cells = int(numbers[scratch - 1 :].numpy()[0])
        wp.utils.radix_sort_pairs(slots, owners, entries, end_bit=max(1, scratch.bit_length() - 1))
        ids = self.empty_ints(entries + cells)
        self.launch(kernels.write_lists, entries, [slots, owners, sizes, numbers], [heads, ids])
        size = table_size(cells)
        table, taken = self.empty_table(size), self.filled(size, 0)
        self.launch(kernels.fill_table, scratch, [claims, keys, heads, size - 1], [taken, table])
        return table, ids

    def launch(self, kernel: Any, count: int, inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(loaded(kernel, self.device), count, inputs, outputs, device=self.device)

    def empty_ints(self, count: int) -> Any:
        return wp.empty(count, dtype=wp.int32, device=self.device)

    def empty_table(self, slots: int) -> Any:
        return wp.full(slots, wp.vec4i(EMPTY), dtype=wp.vec4i, device=self.device)

    def filled(self, count: int, value: int) -> Any:
        return wp.full(count, value, dtype=wp.int32, device=self.device)


def table_size(cells: int) -> int:
    """Return the size of a table for this many cells: a power of two, at most half full."""
    return 1 << (2 * cells).bit_length()


def _levels(sizes: _Sizes) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the levels, and the level of each exponent."""
    used = sizes.used
    width = np.exp2(used.astype(np.float64) - EXPONENT_OF_ONE)
    level_of = np.full(EXPONENTS, EMPTY, np.int32)
    level_of[used] = np.arange(len(used))
    columns = [1.0 / width, width, sizes.lowest[used], sizes.highest[used]]
    return np.column_stack(columns).astype(np.float32), level_of
