"""Index whose arrays change in place, one decal at a time; it is rebuilt where many decals change at once."""

import math
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int64Array
from blobtree.kernels import load_together, loaded
from decals.index import edit_kernels as kernels
from decals.index.build_kernels import list_cells
from decals.index.change_log import ChangeLog
from decals.index.decal_cells import FINEST, MAX_CELLS_OF_DECAL, NO_FLOOR, NO_PARITY, REACH_WITH_SLACK
from decals.index.index import DecalIndex, has_nested, indexed_decals
from decals.index.lookup import find_nested
from decals.index.rows import with_spare
from decals.model import RECORD

MAX_LEVELS = 128

MAX_SMALL_EDITS = 64
"""Number of decals smaller than the cells they share, from which the index is rebuilt."""

BUILD_KERNELS = (list_cells, find_nested)
EDIT_KERNELS = (kernels.insert_decal, kernels.remove_decal)

LEVELS, TABLE, IDS = "index_levels", "index_table", "index_ids"


class EditableIndex:
    """Levels, hash table and lists of an index (`decals.index.index`), with spare room at the end.

    Attributes
    ----------
    arrays : dict
        "index_levels", "index_table" and "index_ids". A change may replace an array.
    stale : bool
        True if `build` must run before the arrays may be read.
    nested : bool
        True if contact decals have been nested.
    parity, floor : int
        Sizes that share levels, as in `DecalIndex`.
    """

    def __init__(self) -> None:
        self.arrays: dict[str, NDArray[Any]] = {}
        self.stale, self.nested = True, False
        self.parity, self.floor = NO_PARITY, NO_FLOOR
        self._small_edits = 0
        self._level_of: dict[int, int] = {}
        self._list_rooms: Any = None
        self._records: Float32Array | None = None
        self._launches: tuple[wp.Launch, wp.Launch] | None = None
        self._nesting_unknown = False
        self._request, self._request_on_cpu = _shared(np.zeros(kernels.REQUESTS, np.int32), wp.int32)
        self._state, self._state_on_cpu = _shared(np.zeros(kernels.STATES, np.int32), wp.int32)
        self._ranges, self._ranges_on_cpu = _shared(np.zeros((MAX_CELLS_OF_DECAL, 2), np.int32), wp.vec2i)
        self._slots, self._slots_on_cpu = _shared(np.zeros(MAX_CELLS_OF_DECAL, np.int32), wp.int32)

    @property
    def level_count(self) -> int:
        """Number of levels."""
        return len(self._level_of)

    def load_kernels(self, *, ahead: bool = False) -> None:
        """Load the kernels of the next change, so that a missing one raises before anything changes.

        With `ahead`, load those of all changes.
        """
        if ahead or self.stale:
            load_together(BUILD_KERNELS, "cpu")
        if ahead or not (self.stale or self._launches):  # recorded launches have loaded kernels
            load_together(EDIT_KERNELS, "cpu")

    def build(self, records: Float32Array, numbers: Int64Array, log: ChangeLog) -> bool:
        """Build the index of the decals of these numbers anew.

        Return True if sums over neighbours may now round otherwise, because levels follow each other in
        another order.
        """
        self.stale = False
        rows = records.reshape(-1, RECORD, 4)[numbers]
        ranks = np.floor(rows[:, 1, 3]).astype(np.int32)
        index = DecalIndex.build(rows[:, 0, :3], rows[:, 0, 3], ranks)
        if not self.nested:
            packed = rows.reshape(-1, 4)
            self.nested = has_nested(index.on("cpu", records=packed, layered=True, copy=False), len(rows))
        levels = np.zeros((MAX_LEVELS, 4), np.float32)
        levels[: index.level_count] = index.levels
        level_of = {round(math.log2(size)): i for i, size in enumerate(index.levels[:, 1].tolist())}
        shared = self.parity, self.floor
        self.parity, self.floor, self._small_edits = index.parity, index.floor, 0
        reordered = shared != (self.parity, self.floor) or not _same_order(self._level_of, level_of)
        self._level_of = level_of
        table, ids = index.table.copy(), index.ids.copy()
        full = np.flatnonzero(table[:, 0] >= 0)
        heads = table[full, 3]
        rooms = np.zeros(len(table), np.int32)
        rooms[full] = ids[heads]
        listed = np.ones(len(ids), bool)
        listed[heads] = False
        ids[listed] = numbers[ids[listed]]
        self._state[:2] = len(ids), len(full)
        for name, array in {LEVELS: levels, TABLE: table, IDS: with_spare(ids)}.items():
            self.arrays[name] = np.ascontiguousarray(array)
            log.add(name, (0, len(array)), new=True)
        self._list_rooms = _shared(rooms, wp.int32)[1]
        self._launches = None
        self._nesting_unknown = False
        return reordered

    def insert(self, records: Float32Array, number: int, rank: int, log: ChangeLog) -> bool:
        """Insert a decal into the lists of its cells; return False if they have no room for it."""
        exponent = self._exponent(records, number)
        self._small_edits += _exponent_above(records[RECORD * number, 3]) < self.floor
        if self._small_edits > MAX_SMALL_EDITS:
            return False
        self._widen_level(exponent, float(rank), log)
        insert, _ = self._recorded(records)
        self._request_change(number, exponent)
        insert.launch()
        _, _, touched, fits, nested = self._state.tolist()
        if not fits:
            return False
        for slot in self._slots[:touched].tolist():
            if slot >= 0:
                log.add(TABLE, (slot, slot + 1))
        self._log_lists(log)
        self.nested = self.nested or nested == kernels.IS_NESTED
        self._nesting_unknown = self._nesting_unknown or nested == kernels.UNKNOWN
        return True

    def check_nesting(self, records: Float32Array, count: int) -> None:
        """Update `nested` for inserted decals that reach too many cells, of the first `count` decals."""
        if self._nesting_unknown and not self.nested:
            arrays = self.arrays[LEVELS][: self.level_count], self.arrays[TABLE], self.arrays[IDS]
            self.nested = has_nested(indexed_decals(records, *arrays, layered=True, device="cpu"), count)
        self._nesting_unknown = False

    def remove(self, records: Float32Array, number: int, log: ChangeLog) -> None:
        """Remove a decal, whose record is still unchanged, from the lists of its cells."""
        _, remove = self._recorded(records)
        self._request_change(number, self._exponent(records, number))
        remove.launch()
        self._log_lists(log)

    def _recorded(self, records: Float32Array) -> tuple[wp.Launch, wp.Launch]:
        """Return launches that insert and remove a decal; they share the memory of records and index."""
        if self._launches is None or self._records is not records:
            self._records = records
            arrays = (self.arrays[name] for name in (LEVELS, TABLE, IDS))
            indexed = indexed_decals(records, *arrays, layered=True, device="cpu")
            changed = self._state_on_cpu, self._ranges_on_cpu
            removed = self._request_on_cpu, indexed, *changed
            inserted = self._request_on_cpu, indexed, self._list_rooms, *changed, self._slots_on_cpu
            self._launches = (
                _recorded(kernels.insert_decal, inserted),
                _recorded(kernels.remove_decal, removed),
            )
        return self._launches

    def _request_change(self, number: int, exponent: int) -> None:
        """Write the numbers that the next launch reads."""
        searched = 0 if self.nested else self.level_count
        self._request[:] = number, exponent, self._level_of[exponent], searched

    def _exponent(self, records: Float32Array, number: int) -> int:
        """Return the exponent of a decal's cell size, as `decal_cells.cell_exponent`."""
        x, y, z, influence = records[RECORD * number].tolist()
        reach = influence * REACH_WITH_SLACK
        farthest = max(abs(x), abs(y), abs(z)) + reach
        exponent = _exponent_above(influence)
        joins = self.parity != NO_PARITY and exponent % 2 != self.parity
        return max(exponent - joins, self.floor, math.frexp(farthest)[1] - FINEST)

    def _widen_level(self, exponent: int, rank: float, log: ChangeLog) -> None:
        """Add the level of a cell size if it is missing, and include a rank in its range."""
        levels = self.arrays[LEVELS]
        level = self._level_of.get(exponent)
        if level is None:
            level = self._level_of[exponent] = len(self._level_of)
            levels[level] = 2.0**-exponent, 2.0**exponent, rank, rank
        elif levels[level, 2] <= rank <= levels[level, 3]:
            return
        levels[level, 2:] = min(levels[level, 2], rank), max(levels[level, 3], rank)
        log.add(LEVELS, (level, level + 1))

    def _log_lists(self, log: ChangeLog) -> None:
        for first, end in self._ranges[: self._state[2]].tolist():
            log.add(IDS, (first, end))


def _exponent_above(influence: float) -> int:
    """Return the exponent of the smallest power of two above a neighbour reach."""
    return math.frexp(float(influence) * REACH_WITH_SLACK)[1]


def _shared(array: NDArray[Any], dtype: Any) -> tuple[NDArray[Any], Any]:
    """Return an array, and a Warp array in the same memory."""
    contiguous = np.ascontiguousarray(array)
    return contiguous, wp.array(contiguous, dtype=dtype, device="cpu", copy=False)


def _recorded(kernel: wp.Kernel, inputs: tuple[Any, ...]) -> wp.Launch:
    """Return a launch that can be repeated, which takes a fifth of the time of a new one."""
    launch: wp.Launch = wp.launch(loaded(kernel, "cpu"), 1, inputs, device="cpu", record_cmd=True)
    return launch


def _same_order(before: dict[int, int], after: dict[int, int]) -> bool:
    """Return True if the levels that two indices share are in the same order."""
    return [size for size in before if size in after] == [size for size in after if size in before]
