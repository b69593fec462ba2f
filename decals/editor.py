"""Editing one decal among many: records and index change by their own bytes, in memory and on the card.

    editor = DecalEditor(decals)
    number = editor.add(one)                       one: Decals of length 1
    editor.change(number, positions=[[1, 2, 3]])   move, resize, re-layer, ...
    editor.delete(number)
    editor.take_changes()                          {"index_ids": [(first, past last), ...], ...}

Look-ups give exactly what an index that is built anew would give. Numbers stay: a deleted decal leaves a gap.
"""

import math
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals import edit_kernels as kernels
from decals.errors import InvalidDecals
from decals.index import DecalIndex
from decals.index_cells import FINEST, NEIGHBOURHOOD, REACH_WITH_SLACK
from decals.model import RECORD, Decals, Interaction

Range = tuple[int, int]
MOST_LEVELS = 128
SPARE = 1024
"""Least spare rows of an array; arrays grow by half."""

RECORDS, LEVELS, TABLE, IDS = "decal_records", "index_levels", "index_table", "index_ids"
ROOMS = "rooms"
_TYPES = {RECORDS: wp.vec4, LEVELS: wp.vec4, TABLE: wp.vec4i, IDS: wp.int32}


class DecalEditor:
    """Decals and their index as arrays that change in place.

    Parameters
    ----------
    decals
        What there is at first; their numbers are their rows.

    Attributes
    ----------
    arrays
        "decal_records", "index_levels", "index_table" and "index_ids", with spare rows at the end, as
        `Decals.packed` and `DecalIndex` lay them out. An edit may put another array in place of a full one.
    """

    def __init__(self, decals: Decals) -> None:
        self._first = decals
        self._changed: dict[int, Decals | None] = {}
        self._count = len(decals)
        self.arrays: dict[str, NDArray[Any]] = {}
        self._dirty: dict[str, list[Range]] = {}
        self._shared: dict[str, Any] = {}
        self._state, self._wp_state = _shared(np.zeros(4, np.int32), wp.int32)
        self._ranges, self._wp_ranges = _shared(np.zeros((NEIGHBOURHOOD, 2), np.int32), wp.vec2i)
        self._slots, self._wp_slots = _shared(np.zeros(NEIGHBOURHOOD, np.int32), wp.int32)
        self._put(RECORDS, _with_spare(decals.packed()))
        self._rebuild()
        self._dirty.clear()

    # -- what there is ----------------------------------------------------------------------------------

    def __getitem__(self, number: int) -> Decals:
        """Give one decal, as `Decals` of length 1."""
        known = self._changed.get(number)
        if number not in self._changed and 0 <= number < len(self._first):
            known = self._first[number : number + 1]
        if known is None:
            raise InvalidDecals(f"expected the number of a decal, got {number}; it was deleted or never was")
        return known

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Numbers of the decals that there are, ascending."""
        there = np.ones(self._count, np.bool_)
        there[[number for number, decal in self._changed.items() if decal is None]] = False
        return np.flatnonzero(there)

    @property
    def decals(self) -> Decals:
        """All decals, in the order of `numbers`."""
        news = [decal for _, decal in sorted(self._changed.items()) if decal is not None]
        rows = [number for number, decal in sorted(self._changed.items()) if decal is not None]
        kept = np.setdiff1d(np.arange(len(self._first)), list(self._changed))
        order = np.argsort(np.concatenate([kept, rows]), kind="stable")
        return Decals.concatenate([self._first[kept], *news])[order.astype(np.intp)]

    @property
    def level_count(self) -> int:
        """Number of levels of the index."""
        return len(self._level_of)

    @property
    def layered(self) -> bool:
        """Whether decals lie over each other, or did."""
        ranks = self.arrays[LEVELS][: self.level_count, 2:].astype(np.int64)
        return bool((ranks != ranks.max(initial=0)).any() or (ranks & 3 != Interaction.CONTACT).any())

    @property
    def index(self) -> DecalIndex:
        """Give the index as it is now: no copy, so the next edit changes it."""
        return DecalIndex(self.arrays[LEVELS][: self.level_count], self.arrays[TABLE], self.arrays[IDS])

    # -- edits ------------------------------------------------------------------------------------------

    def add(self, one: Decals) -> int:
        """Add a decal on top of those of its rank; its number."""
        _check_one(one)
        number = self._count
        records = self.arrays[RECORDS]
        if RECORD * (number + 1) > len(records):
            self._put(RECORDS, _with_spare(records))
        self._count += 1
        self._insert(number, one)
        return number

    def change(self, number: int, **arrays: ArrayLike) -> None:
        """Exchange some of a decal's values (each an array of length 1, as in `Decals.replace`).

        Raises
        ------
        InvalidDecals
            No such decal, or values that are none; nothing changes then.
        """
        before = self[number]
        after = before.replace(**arrays)
        _check_one(after)
        self._remove(number)
        self._insert(number, after)

    def delete(self, number: int) -> None:
        """Delete a decal; its number is not used again."""
        self[number]
        self._remove(number)
        self._changed[number] = None

    def take_changes(self) -> dict[str, list[Range]]:
        """Rows of each array that changed since the last call: disjoint (first, past last), ascending."""
        changes = {name: _merged(ranges) for name, ranges in self._dirty.items()}
        self._dirty = {}
        return changes

    # -- how --------------------------------------------------------------------------------------------

    def _remove(self, number: int) -> None:
        exponent = self._exponent(number)
        arrays = [self._shared[name] for name in (RECORDS, TABLE, IDS)]
        where = [number, exponent, self._level_of[exponent]]
        wp.launch(kernels.take_out, 1, [*where, *arrays, self._wp_state, self._wp_ranges], device="cpu")
        self._note()

    def _insert(self, number: int, one: Decals) -> None:
        first = RECORD * number
        self.arrays[RECORDS][first : first + RECORD] = one.packed()
        self._mark(RECORDS, (first, first + RECORD))
        self._changed[number] = one
        exponent = self._exponent(number)
        self._widen(exponent, float(one.ranks[0]))
        arrays = [self._shared[name] for name in (RECORDS, TABLE, ROOMS, IDS)]
        where = [number, exponent, self._level_of[exponent]]
        inputs = [*where, *arrays, self._wp_state, self._wp_ranges, self._wp_slots]
        wp.launch(kernels.put_in, 1, inputs, device="cpu")
        if not self._state[3]:
            self._rebuild()
            return
        for slot in self._slots[: self._state[2]].tolist():
            if slot >= 0:
                self._mark(TABLE, (slot, slot + 1))
        self._note()

    def _widen(self, exponent: int, rank: float) -> None:
        """Make sure of a level for this size that knows of this rank."""
        levels = self.arrays[LEVELS]
        level = self._level_of.get(exponent)
        if level is None:
            level = self._level_of[exponent] = len(self._level_of)
            levels[level] = 2.0**-exponent, 2.0**exponent, rank, rank
        elif levels[level, 2] <= rank <= levels[level, 3]:
            return
        levels[level, 2:] = min(levels[level, 2], rank), max(levels[level, 3], rank)
        self._mark(LEVELS, (level, level + 1))

    def _exponent(self, number: int) -> int:
        """As `index_cells.cell_exponent`, from the record."""
        x, y, z, influence = self.arrays[RECORDS][RECORD * number].tolist()
        reach = influence * REACH_WITH_SLACK
        farthest = max(abs(x), abs(y), abs(z)) + reach
        return max(math.frexp(reach)[1], math.frexp(farthest)[1] - FINEST)

    def _rebuild(self) -> None:
        """Lay the index out anew, with spare room."""
        numbers = self.numbers
        records = self.arrays[RECORDS].reshape(-1, RECORD, 4)[numbers]
        ranks = np.floor(records[:, 1, 3]).astype(np.int32)
        index = DecalIndex.build(records[:, 0, :3], records[:, 0, 3], ranks)
        levels = np.zeros((MOST_LEVELS, 4), np.float32)
        levels[: index.level_count] = index.levels
        self._level_of = {round(math.log2(size)): i for i, size in enumerate(index.levels[:, 1].tolist())}
        table, ids = index.table.copy(), index.ids.copy()
        full = np.flatnonzero(table[:, 0] >= 0)
        heads = table[full, 3]
        rooms = np.zeros(len(table), np.int32)
        rooms[full] = ids[heads]
        listed = np.ones(len(ids), bool)
        listed[heads] = False
        ids[listed] = numbers[ids[listed]]
        self._state[:2] = len(ids), len(full)
        self._put(LEVELS, levels)
        self._put(TABLE, table)
        self._put(IDS, _with_spare(ids))
        _, self._shared[ROOMS] = _shared(rooms, wp.int32)

    def _put(self, name: str, array: NDArray[Any]) -> None:
        self.arrays[name], self._shared[name] = _shared(array, _TYPES[name])
        self._dirty[name] = [(0, len(array))]

    def _mark(self, name: str, rows: Range) -> None:
        self._dirty.setdefault(name, []).append(rows)

    def _note(self) -> None:
        for first, end in self._ranges[: self._state[2]].tolist():
            self._mark(IDS, (first, end))


def _shared(array: NDArray[Any], dtype: Any) -> tuple[NDArray[Any], Any]:
    """Give an array, and the same memory as Warp has it."""
    held = np.ascontiguousarray(array)
    return held, wp.array(held, dtype=dtype, device="cpu", copy=False)


def _with_spare(array: NDArray[Any]) -> NDArray[Any]:
    """Copy an array to one with spare rows."""
    grown = np.zeros((len(array) + max(SPARE, len(array) // 2), *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


def _merged(ranges: list[Range]) -> list[Range]:
    """Bring overlapping ranges together."""
    result: list[Range] = []
    for first, end in sorted(ranges):
        if result and first <= result[-1][1]:
            result[-1] = result[-1][0], max(end, result[-1][1])
        else:
            result.append((first, end))
    return result


def _check_one(one: Decals) -> None:
    if len(one) != 1:
        raise InvalidDecals(f"expected one decal, got {len(one)}; edit them one by one")
