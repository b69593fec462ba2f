"""Parallel construction of the index on any Warp device, in time and memory linear in the decals.

The cells of all decals are listed in draw order. Equal cells claim the same slot of a temporary hash table. A
stable sort by slot collects the decals of each cell. The cells then move to a table that fits their number.

The indices of many sets of decals are built at once. Each set has the levels, the table and the lists that it
would have alone; the arrays of all sets lie one after the other.
"""

import functools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Int64Array
from blobtree.kernels import loaded
from decals.index import build_kernels as kernels
from decals.index.decal_cells import EMPTY, EXPONENT_OF_ONE, EXPONENTS, NO_FLOOR, NO_PARITY

INT32 = np.iinfo(np.int32)

MAX_AVERAGE_CELLS = 24
"""Average number of cells of a decal up to which sizes share levels: twice the usual number."""


MIN_LARGER = 16
"""Number of decals on a level for each smaller decal that uses its cells."""

FEW = 2
"""Whole numbers up to which an array is kept from call to call, as builds of one set give to kernels."""

MAX_SMALLER = 4
"""Largest number of such smaller decals with their centres in one cell."""


class IndexArrays(NamedTuple):
    """Arrays of an index on a device, as `DecalIndex` describes them."""

    levels: Any
    table: Any
    ids: Any
    parity: int
    floor: int


class BatchArrays(NamedTuple):
    """Arrays of the indices of k sets on a device.

    Rows ``level_starts[i]:level_starts[i + 1]`` of the levels are those of set i, as slots of the table.
    Heads in the table count from the beginning of all lists.
    """

    levels: Any
    level_starts: Int64Array
    table: Any
    table_starts: Int64Array
    ids: Any
    parities: NDArray[np.int32]
    floors: NDArray[np.int32]


def build_index(positions: Any, influence: Any, ranks: Any) -> IndexArrays:
    """Build the index of decals whose arrays (vec3, float32, int32) lie on one device."""
    arrays = build_indices(positions, influence, ranks, np.array([0, len(positions)]))
    return IndexArrays(
        arrays.levels, arrays.table, arrays.ids, int(arrays.parities[0]), int(arrays.floors[0])
    )


def build_indices(positions: Any, influence: Any, ranks: Any, starts: Int64Array) -> BatchArrays:
    """Build the indices of k sets of decals, whose arrays lie on one device, one set after the other.

    The decals of set i are ``starts[i]:starts[i + 1]``. Lists hold their numbers in their set.
    """
    return _Builder(positions, influence, ranks, starts).build()


class _Sizes(NamedTuple):
    """Cells of each decal (exponent, number, running sum), and of each set the ranks of each exponent."""

    parities: NDArray[np.int32]
    floors: NDArray[np.int32]
    exponents: Any
    counts: Any
    ends: Any
    cells: Int64Array
    lowest: NDArray[np.int32]
    highest: NDArray[np.int32]
    used: BoolArray
    """True for each exponent in use by a set, one for each of its levels: bool[k, EXPONENTS]."""
    levels: Int64Array
    """Number of levels of each set."""

    def cheaper(self, other: "_Sizes") -> BoolArray:
        """Return True for each set that costs less than in other sizes.

        The number of levels counts first (time of each look-up), then that of cells (memory).
        """
        fewer_cells = (self.levels == other.levels) & (self.cells < other.cells)
        less: BoolArray = (self.levels < other.levels) | fewer_cells
        return less


class _Builder:
    def __init__(self, positions: Any, influence: Any, ranks: Any, starts: Int64Array) -> None:
        self.positions, self.influence, self.ranks, self.starts = positions, influence, ranks, starts
        self.device, self.count, self.set_count = positions.device, len(positions), len(starts) - 1
        self.sizes_of_sets, self.several = np.diff(starts), self.set_count > 1

    def build(self) -> BatchArrays:
        if not self.count:
            alone = np.full(self.set_count, NO_PARITY, np.int32), np.full(self.set_count, NO_FLOOR, np.int32)
            return BatchArrays(
                wp.zeros(0, dtype=wp.vec4, device=self.device),
                np.zeros(self.set_count + 1, np.int64),
                self.empty_table(self.set_count),
                np.arange(self.set_count + 1),
                self.empty_ints(0),
                *alone,
            )
        loaded(kernels.list_cells, self.device)  # with all others of their module
        if self.several:
            self.sets = self.ints(np.repeat(np.arange(self.set_count), self.sizes_of_sets))
        else:  # all decals are of set 0; zeros need no copy from the host
            self.sets = self.zeros(self.count)
        order = self.drawing_order()
        sizes = self.choose_sizes(order)
        levels, level_of = _levels(sizes)
        cells = int(sizes.cells.sum())
        keys, owners = wp.empty(cells, dtype=wp.vec3i, device=self.device), self.empty_ints(2 * cells)
        inputs = [self.positions, self.influence, order, self.sets, sizes.exponents, self.ints(level_of)]
        self.launch(kernels.list_cells, self.count, [*inputs, sizes.ends, sizes.counts], [keys, owners])
        table, table_starts, ids = self.build_lists(keys, owners)
        rows: Any = wp.array(levels, dtype=wp.vec4, device=self.device)
        level_starts = starts_of(sizes.levels)
        return BatchArrays(rows, level_starts, table, table_starts, ids, sizes.parities, sizes.floors)

    def choose_sizes(self, order: Any) -> "_Sizes":
        """Return the sizes with the fewest levels, shared in pairs if that does not need too many cells.

        A few small decals use the cells of larger ones first.
        """
        alone = np.full(self.set_count, NO_PARITY, np.int32)
        best = self.sizes(order, alone, np.full(self.set_count, NO_FLOOR, np.int32))
        floors = self.floors_of(best, order)
        if (floors != NO_FLOOR).any():
            best = self.sizes(order, alone, floors)
        used, parities = best.used, alone
        for parity in (0, 1) if best.levels.max() > 1 else ():
            shared = np.where(_shared_levels(used, parity) < best.levels, parity, parities)
            if (shared != parities).any():
                other = self.sizes(order, shared.astype(np.int32), floors)
                fits = other.cells <= MAX_AVERAGE_CELLS * self.sizes_of_sets
                parities = np.where(fits & other.cheaper(best), shared, parities).astype(np.int32)
                best = other if (parities == shared).all() else self.again(order, best, parities)
        return best

    def again(self, order: Any, sizes: "_Sizes", parities: NDArray[np.int32]) -> "_Sizes":
        """Return sizes of other parities; the same if they are those of `sizes`."""
        same = np.array_equal(parities, sizes.parities)
        return sizes if same else self.sizes(order, parities, sizes.floors)

    def floors_of(self, sizes: "_Sizes", order: Any) -> NDArray[np.int32]:
        """Return for each set the largest exponent that a few smaller decals can share; NO_FLOOR for none.

        Each level costs a look-up at every point. A decal in larger cells than its own costs one more
        candidate at the few points in these.
        """
        floors = np.full(self.set_count, NO_FLOOR, np.int32)
        several = np.flatnonzero(sizes.levels > 1)
        if not len(several):
            return floors
        exponents = sizes.exponents.numpy()
        positions = functools.cache(lambda: self.positions.numpy()[order.numpy()])  # rarely needed
        for number in several:
            start, end = self.starts[number : number + 2]
            floors[number] = _floor_of(exponents[start:end], partial(_rows, positions, start))
        return floors

    def sizes(self, order: Any, parities: NDArray[np.int32], floors: NDArray[np.int32]) -> "_Sizes":
        exponents, counts, ends = (self.empty_ints(self.count) for _ in range(3))
        lowest = self.filled(self.set_count * EXPONENTS, INT32.max)
        highest = self.filled(self.set_count * EXPONENTS, INT32.min)
        inputs = [self.positions, self.influence, self.ranks, order, self.sets]
        self.launch(
            kernels.measure_decals,
            self.count,
            [*inputs, self.ints(parities), self.ints(floors)],
            [exponents, counts, lowest, highest],
        )
        wp.utils.array_scan(counts, ends, inclusive=True)
        if self.several:
            cells = np.diff(np.concatenate([[0], ends.numpy()])[self.starts])
        else:  # without a copy of all sums from the device
            cells = ends[self.count - 1 :].numpy().astype(np.int64)
        low, high = (array.numpy().reshape(-1, EXPONENTS) for array in (lowest, highest))
        used = low != INT32.max
        return _Sizes(parities, floors, exponents, counts, ends, cells, low, high, used, used.sum(axis=1))

    def drawing_order(self) -> Any:
        """Return the numbers of the decals in draw order, set after set."""
        keys, order = self.empty_ints(2 * self.count), self.empty_ints(2 * self.count)
        self.launch(kernels.number_decals, self.count, [self.ranks], [keys, order])
        wp.utils.radix_sort_pairs(keys, order, self.count)
        if self.several:
            self.launch(kernels.number_sets, self.count, [order, self.sets], [keys])
            wp.utils.radix_sort_pairs(keys, order, self.count)
        return order

    def build_lists(self, keys: Any, owners: Any) -> tuple[Any, Int64Array, Any]:
        """Return the tables of the cells of all decals, where that of each set begins, and the lists."""
        entries = len(keys)
        scratch = 1 << (entries + entries // 4).bit_length()
        claims, slots = self.filled(scratch, EMPTY), self.empty_ints(2 * entries)
        sizes, used, numbers, heads = (self.zeros(scratch) for _ in range(4))
        nothing = _kept(self.device.alias)
        holders = self.zeros(scratch) if self.several else nothing
        counts = self.zeros(self.set_count) if self.several else nothing
        starts = self.ints(self.starts[:-1]) if self.several else self.sets
        self.launch(
            kernels.claim_slots,
            entries,
            [keys, owners, self.sets, self.several, scratch - 1, claims],
            [slots, sizes],
        )
        self.launch(
            kernels.mark_used, scratch, [claims, owners, self.sets, self.several], [used, holders, counts]
        )
        wp.utils.array_scan(used, numbers, inclusive=True)
        found = counts if self.several else numbers[scratch - 1 :]
        cells = found.numpy().astype(np.int64)
        wp.utils.radix_sort_pairs(slots, owners, entries, end_bit=max(1, scratch.bit_length() - 1))
        ids = self.empty_ints(entries + int(cells.sum()))
        inputs = [slots, owners, sizes, numbers, self.sets, self.several, starts]
        self.launch(kernels.write_lists, entries, inputs, [heads, ids])
        tables = starts_of([table_size(count) for count in cells.tolist()])
        table, taken = self.empty_table(int(tables[-1])), self.zeros(int(tables[-1]))
        inputs = [claims, keys, holders, heads, self.ints(tables)]
        self.launch(kernels.fill_table, scratch, inputs, [taken, table])
        return table, tables, ids

    def launch(self, kernel: Any, count: int, inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(kernel, count, inputs, outputs, device=self.device)

    def ints(self, values: NDArray[Any]) -> Any:
        if values.size <= FEW:
            return _kept(self.device.alias, *values.tolist())
        numbers, copy = np.asarray(values, np.int32).ravel(), not self.device.is_cpu
        return wp.array(numbers, dtype=wp.int32, device=self.device, copy=copy)

    def empty_ints(self, count: int) -> Any:
        return wp.empty(count, dtype=wp.int32, device=self.device)

    def zeros(self, count: int) -> Any:
        return wp.zeros(count, dtype=wp.int32, device=self.device)

    def empty_table(self, slots: int) -> Any:
        return wp.full(slots, wp.vec4i(EMPTY), dtype=wp.vec4i, device=self.device)

    def filled(self, count: int, value: int) -> Any:
        return wp.full(count, value, dtype=wp.int32, device=self.device)


@functools.lru_cache(maxsize=256)
def _kept(device: str, *numbers: int) -> Any:
    """Return an array that kernels only read, and that is kept: making it takes as long as a small launch."""
    return wp.array(np.array(numbers, np.int32), dtype=wp.int32, device=device)


def starts_of(counts: ArrayLike) -> Int64Array:
    """Return where each of several parts begins, and the end."""
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def table_size(cells: int) -> int:
    """Return the size of a table for this many cells: a power of two, at most half full."""
    return 1 << (2 * cells).bit_length()


def _shared_levels(used: BoolArray, parity: int) -> Int64Array:
    """Return the number of levels of each set if sizes of the other parity share the next smaller one."""
    shared = used.copy()
    other = np.arange(EXPONENTS) % 2 != parity
    shared[:, :-1] |= used[:, 1:] & other[1:]
    shared[:, other] = False
    counts: Int64Array = shared.sum(axis=1)
    return counts


def _rows(
    positions: Callable[[], NDArray[np.float32]], start: int, numbers: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Return the positions of some decals of the set that begins at `start`."""
    return positions()[start + numbers]


def _floor_of(
    exponents: NDArray[np.int32], positions: Callable[[NDArray[np.int64]], NDArray[np.float32]]
) -> int:
    """Return the floor of one set with several exponents, in draw order; `positions` takes their numbers."""
    for exponent in np.unique(exponents)[:0:-1].tolist():
        smaller = np.flatnonzero(exponents < exponent)
        if MIN_LARGER * len(smaller) > np.count_nonzero(exponents == exponent):
            continue
        cells = np.floor(positions(smaller) / 2.0**exponent)
        if np.unique(cells, axis=0, return_counts=True)[1].max() <= MAX_SMALLER:
            return int(exponent)
    return NO_FLOOR


def _levels(sizes: _Sizes) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the levels of all sets, and of each set the level of each exponent."""
    used = sizes.used
    width = np.exp2(np.nonzero(used)[1].astype(np.float64) - EXPONENT_OF_ONE)
    level_of = np.where(used, np.cumsum(used, axis=1) - 1, EMPTY).astype(np.int32)
    columns = [1.0 / width, width, sizes.lowest[used], sizes.highest[used]]
    return np.column_stack(columns).astype(np.float32), level_of
