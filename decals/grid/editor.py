"""Editing some decals among many: records and index change by their own bytes, in memory and on the card.

    editor = DecalEditor(decals)
    number = editor.add(one)                       one: Decals of length 1
    editor.change(number, positions=[[1, 2, 3]])   move, resize, re-layer, ...
    editor.delete(number)
    editor.changes(since=version)                  {"index_ids": [(first, past last), ...], ...}

Look-ups find the decals that act at a point, as in an index that is built anew; cells may differ from its.
Numbers stay: a deleted decal leaves a gap, which `put` alone fills again. What takes long can be done
elsewhere: `copy`, change the copy in any thread, ask it for its index there, and `adopt` it.
"""

import math
from typing import Any, Self

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals.checks import instance
from decals.errors import InvalidDecals
from decals.grid import edit_kernels as kernels
from decals.grid.cells import ALONE, FINEST, NEIGHBOURHOOD, REACH_WITH_SLACK
from decals.grid.index import DecalIndex
from decals.grid.journal import Journal, Range
from decals.grid.rows import DecalRows, records_with_spare, runs_of, with_spare
from decals.grid.trail import Balls, Trail, same_order
from decals.model import RECORD, Decals

MOST_LEVELS = 128
FEW = 64
"""So many decals are always put into the index one by one."""

RECORDS, LEVELS, TABLE, IDS = "decal_records", "index_levels", "index_table", "index_ids"
ROOMS = "rooms"
_TYPES = {RECORDS: wp.vec4, LEVELS: wp.vec4, TABLE: wp.vec4i, IDS: wp.int32}


class DecalEditor:
    """Decals and their index as arrays that change in place.

    Parameters
    ----------
    decals
        What there is at first; their numbers are their rows.

    Where many change at once the index is laid out anew, but not before somebody asks for it.
    """

    def __init__(self, decals: Decals) -> None:
        _check(decals)
        self._begin(DecalRows(decals), records_with_spare(decals.packed(), len(decals)))

    def _begin(self, rows: DecalRows, records: NDArray[np.float32]) -> None:
        self._rows = rows
        self._arrays: dict[str, NDArray[Any]] = {}
        self._journal, self._trail = Journal(), Trail()
        self._parity, self._level_of = ALONE, dict[int, int]()
        self._shared: dict[str, Any] = {}
        self._state, self._wp_state = _shared(np.zeros(4, np.int32), wp.int32)
        self._ranges, self._wp_ranges = _shared(np.zeros((NEIGHBOURHOOD, 2), np.int32), wp.vec2i)
        self._slots, self._wp_slots = _shared(np.zeros(NEIGHBOURHOOD, np.int32), wp.int32)
        self._put(RECORDS, records)
        self._behind = True

    # -- elsewhere --------------------------------------------------------------------------------------

    def copy(self) -> Self:
        """Give the same decals under the same numbers, to be changed on their own."""
        made = type(self).__new__(type(self))
        made._begin(self._rows.copy(), self._arrays[RECORDS].copy())
        return made

    def adopt(self, other: "DecalEditor") -> None:
        """Become another editor, which nobody may use any more; who follows this one copies everything."""
        journal, trail, arrays = self._journal, self._trail, other.arrays
        vars(self).update(vars(other))
        self._journal, self._trail = journal, trail
        for name, array in arrays.items():
            journal.add(name, (0, len(array)), new=True)
        trail.everywhere(journal.version)

    # -- what there is ----------------------------------------------------------------------------------

    def __len__(self) -> int:
        return self._rows.count

    def __getitem__(self, number: int) -> Decals:
        """Give one decal, as `Decals` of length 1."""
        return self._rows.take(number)

    def take(self, numbers: ArrayLike) -> Decals:
        """Give the decals of these numbers, in their order."""
        return self._rows.take(numbers)

    def has(self, numbers: ArrayLike) -> NDArray[np.bool_]:
        """Whether there is a decal of each of these numbers, ``bool[n]``."""
        return self._rows.there(numbers)

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Numbers of the decals that there are, ascending."""
        return self._rows.numbers

    @property
    def next_number(self) -> int:
        """Number of the next decal that is added."""
        return self._rows.end

    @property
    def decals(self) -> Decals:
        """All decals, in the order of `numbers`."""
        return self._rows.take(self.numbers)

    def column(self, name: str) -> NDArray[Any]:
        """Copy one array of all decals, such as "positions", in the order of `numbers`."""
        return self._rows.column(name)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Give "decal_records", "index_levels", "index_table" and "index_ids", with spare rows at the end.

        They are as `Decals.packed` and `DecalIndex` lay them out. An edit may put another array in place of
        a full one.
        """
        self._catch_up()
        return self._arrays

    @property
    def level_count(self) -> int:
        """Number of levels of the index."""
        self._catch_up()
        return len(self._level_of)

    @property
    def layered(self) -> bool:
        """Whether decals lie over each other, as `Decals.layered`."""
        return self._rows.layered

    @property
    def index(self) -> DecalIndex:
        """Give the index as it is now: no copy, so the next edit changes it."""
        arrays = self.arrays
        return DecalIndex(
            arrays[LEVELS][: self.level_count], arrays[TABLE], arrays[IDS], self.next_number, self._parity
        )

    # -- edits ------------------------------------------------------------------------------------------

    def add(self, one: Decals) -> int:
        """Add a decal on top of those of its rank; its number."""
        _check_one(one)
        number = self.next_number
        self.put([number], one)
        return number

    def change(self, number: int, **arrays: ArrayLike) -> None:
        """Exchange some of a decal's values (each an array of length 1, as in `Decals.replace`).

        Raises
        ------
        InvalidDecals
            No such decal, or values that are none; nothing changes then.
        """
        after = self[number].replace(**arrays)
        _check_one(after)
        self.put([number], after)

    def delete(self, numbers: ArrayLike) -> None:
        """Delete decals; `add` does not use their numbers again.

        Raises
        ------
        InvalidDecals
            One of them is not there; nothing changes then.
        """
        rows = self._rows.check(numbers)
        self._note_many(rows)
        self._trail.add(self._journal.version + 1, self._balls(rows))
        if not self._behind:
            for number in rows.tolist():
                self._take_out(number)
        self._rows.drop(rows)

    def put(self, numbers: ArrayLike, decals: Decals) -> None:
        """Give these numbers these decals, whether they had one before, were deleted, or are new.

        Raises
        ------
        InvalidDecals
            Not a decal for each number, a number twice, one below 0, or one far beyond the last; nothing
            changes then.
        """
        _check(decals)
        rows = self._rows.fitting(numbers, len(decals))
        self._note_many(rows)
        version, known = self._journal.version + 1, rows[self._rows.there(rows)]
        left = self._balls(known)
        if not self._behind:
            for number in known.tolist():
                self._take_out(number)
        self._write_records(rows, decals)
        self._rows.put(rows, decals)
        self._trail.add(version, np.concatenate([left, self._balls(rows)]))
        if not self._behind:
            self._behind = not all(map(self._put_in, rows.tolist(), decals.ranks.tolist()))

    @property
    def version(self) -> int:
        """Counts the changes of arrays; see `changes`."""
        self._catch_up()
        return self._journal.version

    def changes(self, since: int) -> dict[str, list[Range]]:
        """Rows of each array that changed since a version: disjoint (first, past last), ascending."""
        self._catch_up()
        known = self._journal.since(since)
        return {name: [(0, len(array))] for name, array in self.arrays.items()} if known is None else known

    def touched(self, since: int) -> Balls | None:
        """Balls of influence, ``float32[n, 4]``, of all decals that changed since a version, then and now.

        None where anything may show otherwise: too much changed, or sums over neighbours round otherwise.
        """
        self._catch_up()
        return self._trail.since(since)

    @property
    def largest_influence(self) -> float:
        """At least the largest radius of influence of the decals that there are."""
        return float(self._arrays[RECORDS][::RECORD, 3].max(initial=0.0))

    # -- how --------------------------------------------------------------------------------------------

    def _balls(self, rows: NDArray[np.int64]) -> Balls:
        """Centres and influence of decals."""
        return self._arrays[RECORDS][RECORD * rows]

    def _note_many(self, rows: NDArray[np.int64]) -> None:
        """Leave the index behind where a new one costs less than one change after another."""
        self._behind = self._behind or len(rows) > max(FEW, len(self) // 8)

    def _take_out(self, number: int) -> None:
        exponent = self._exponent(number)
        arrays = [self._shared[name] for name in (RECORDS, TABLE, IDS)]
        where = [number, exponent, self._level_of[exponent]]
        wp.launch(kernels.take_out, 1, [*where, *arrays, self._wp_state, self._wp_ranges], device="cpu")
        self._note()

    def _write_records(self, rows: NDArray[np.int64], decals: Decals) -> None:
        count = int(rows.max(initial=-1)) + 1
        if RECORD * count > len(self._arrays[RECORDS]):
            self._put(RECORDS, records_with_spare(self._arrays[RECORDS], count))
        self._arrays[RECORDS].reshape(-1, RECORD, 4)[rows] = decals.packed().reshape(-1, RECORD, 4)
        for first, last in runs_of(rows):
            self._journal.add(RECORDS, (RECORD * first, RECORD * (last + 1)))

    def _put_in(self, number: int, rank: int) -> bool:
        """Put a decal into the lists of the index; False where they have no room for it."""
        exponent = self._exponent(number)
        self._widen(exponent, float(rank))
        arrays = [self._shared[name] for name in (RECORDS, TABLE, ROOMS, IDS)]
        where = [number, exponent, self._level_of[exponent]]
        inputs = [*where, *arrays, self._wp_state, self._wp_ranges, self._wp_slots]
        wp.launch(kernels.put_in, 1, inputs, device="cpu")
        if not self._state[3]:
            return False
        for slot in self._slots[: self._state[2]].tolist():
            if slot >= 0:
                self._journal.add(TABLE, (slot, slot + 1))
        self._note()
        return True

    def _widen(self, exponent: int, rank: float) -> None:
        """Make sure of a level for this size that knows of this rank."""
        levels = self._arrays[LEVELS]
        level = self._level_of.get(exponent)
        if level is None:
            level = self._level_of[exponent] = len(self._level_of)
            levels[level] = 2.0**-exponent, 2.0**exponent, rank, rank
        elif levels[level, 2] <= rank <= levels[level, 3]:
            return
        levels[level, 2:] = min(levels[level, 2], rank), max(levels[level, 3], rank)
        self._journal.add(LEVELS, (level, level + 1))

    def _exponent(self, number: int) -> int:
        """As `cells.cell_exponent`, from the record."""
        x, y, z, influence = self._arrays[RECORDS][RECORD * number].tolist()
        reach = influence * REACH_WITH_SLACK
        farthest = max(abs(x), abs(y), abs(z)) + reach
        own = math.frexp(reach)[1]
        joins = self._parity != ALONE and own % 2 != self._parity
        return max(own - joins, math.frexp(farthest)[1] - FINEST)

    def _catch_up(self) -> None:
        """Lay the index out anew where it was left behind, with spare room."""
        if not self._behind:
            return
        self._behind = False
        numbers = self.numbers
        records = self._arrays[RECORDS].reshape(-1, RECORD, 4)[numbers]
        ranks = np.floor(records[:, 1, 3]).astype(np.int32)
        index = DecalIndex.build(records[:, 0, :3], records[:, 0, 3], ranks)
        levels = np.zeros((MOST_LEVELS, 4), np.float32)
        levels[: index.level_count] = index.levels
        level_of = {round(math.log2(size)): i for i, size in enumerate(index.levels[:, 1].tolist())}
        reordered = index.parity != self._parity or not same_order(self._level_of, level_of)
        self._parity, self._level_of = index.parity, level_of
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
        self._put(IDS, with_spare(ids))
        _, self._shared[ROOMS] = _shared(rooms, wp.int32)
        if reordered:
            self._trail.everywhere(self._journal.version)

    def _put(self, name: str, array: NDArray[Any]) -> None:
        self._arrays[name], self._shared[name] = _shared(array, _TYPES[name])
        self._journal.add(name, (0, len(array)), new=True)

    def _note(self) -> None:
        for first, end in self._ranges[: self._state[2]].tolist():
            self._journal.add(IDS, (first, end))


def _shared(array: NDArray[Any], dtype: Any) -> tuple[NDArray[Any], Any]:
    """Give an array, and the same memory as Warp has it."""
    held = np.ascontiguousarray(array)
    return held, wp.array(held, dtype=dtype, device="cpu", copy=False)


def _check(decals: Decals) -> None:
    instance("decals", decals, Decals, InvalidDecals, "a scene has .decals")


def _check_one(one: Decals) -> None:
    _check(one)
    if len(one) != 1:
        raise InvalidDecals(f"expected one decal, got {len(one)}; `put` takes several")
