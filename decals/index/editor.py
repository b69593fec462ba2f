"""`DecalEditor`: decals and their index as arrays that change in place."""

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Int64Array
from blobtree.device import start_warp
from decals.errors import InvalidDecals
from decals.index.change_log import ChangeLog, DirtyBalls, Range
from decals.index.editable_index import IDS, LEVELS, TABLE, EditableIndex
from decals.index.index import DecalIndex, has_nested
from decals.index.rows import DIRECT, DecalRows, runs_of
from decals.model import RECORD, Decals, checked_column
from decals.receivers import codes_of
from decals.validation import instance

MAX_SINGLE_EDITS = 64
"""Number of decals that are inserted into the index one by one, however few decals there are."""

RECORDS, LIMITS = "decal_records", "decal_limits"

__all__ = ["IDS", "LEVELS", "LIMITS", "RECORDS", "TABLE", "DecalArrays", "DecalEditor"]


class DecalEditor:
    """Decals and their index as arrays of which an edit changes only the affected bytes.

    A decal keeps its number: a deleted one leaves a gap, which only `assign` fills again. Look-ups find the
    same decals as in an index that is built anew, though its cells may differ. An edit of many decals leaves
    the index to be rebuilt when it is next read. To edit for long without blocking others, `copy` the editor,
    edit the copy in any thread, read its `index` there, and `adopt` it.

    Parameters
    ----------
    decals : Decals
        Initial decals; their numbers are their rows.

    Raises
    ------
    InvalidDecals
        ``decals`` is no `Decals`.

    Examples
    --------
    >>> import decals
    >>> up, along = [[0, 0, 1]], [[1, 0, 0]]
    >>> one = decals.Decals(positions=[[0, 0, 0]], normals=up, tangents=along, radii=[1])
    >>> editor = decals.index.DecalEditor(one)
    >>> version = editor.version
    >>> editor.add(one.replace(positions=[[1, 0, 0]]))
    1
    >>> editor.change(0, radii=[0.5])
    >>> editor.changed_rows(since=version)["decal_records"]
    [(0, 8)]
    >>> editor.delete(0)
    >>> editor.numbers
    array([1])
    """

    def __init__(self, decals: Decals) -> None:
        start_warp()
        _require_decals(decals)
        self._start(DecalRows(decals))

    def _start(self, rows: DecalRows) -> None:
        self._rows, self._index = rows, EditableIndex()
        self._log, self._dirty = ChangeLog(), DirtyBalls()
        self._log.add(RECORDS, (0, len(rows.records)), new=True)
        self._log.add(LIMITS, (0, len(rows.limits)), new=True)

    def copy(self) -> Self:
        """Return an independent editor of the same decals under the same numbers."""
        twin = copy.copy(self)
        twin._start(self._rows.copy())
        return twin

    def adopt(self, other: "DecalEditor") -> None:
        """Take over decals and index of another editor, which must not be used afterwards.

        Versions go on from those of this editor. Its readers copy all arrays.
        """
        other._update_index()
        self._rows, self._index = other._rows, other._index
        for name, array in self.arrays.items():
            self._log.add(name, (0, len(array)), new=True)
        self._dirty.add_everywhere(self._log.version)

    # -- reading ----------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return self._rows.count

    def __getitem__(self, number: int) -> Decals:
        """Return one decal, as `Decals` of length 1."""
        return self._rows.take(number)

    def take(self, numbers: ArrayLike) -> Decals:
        """Return the decals of these numbers, in this order.

        Raises
        ------
        InvalidDecals
            A number without a decal, or one that occurs twice.
        """
        return self._rows.take(numbers)

    def has(self, numbers: ArrayLike) -> BoolArray:
        """Return True for each number that has a decal, ``bool[n]``."""
        return self._rows.contains(numbers)

    @property
    def numbers(self) -> Int64Array:
        """Numbers of the decals, ascending, ``int64[n]``."""
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
        """Return a copy of one array of all decals, such as "positions", in the order of `numbers`."""
        return self._rows.column(name, self.numbers)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays for devices: "decal_records", "decal_limits", "index_levels", "index_table" and "index_ids".

        `Decals.packed`, `Decals.limits` and `DecalIndex` describe them; here they have spare rows at the end.
        An edit may replace a full array by a larger one.
        """
        self._update_index()
        return {RECORDS: self._rows.records, LIMITS: self._rows.limits, **self._index.arrays}

    @property
    def level_count(self) -> int:
        """Number of levels of the index."""
        self._update_index()
        return self._index.level_count

    @property
    def layered(self) -> bool:
        """Truth of `Decals.layered`: the decals are not all contact decals of one layer."""
        return self._rows.layered

    @property
    def nested(self) -> bool:
        """True if contact decals have been nested since the index was read first."""
        return self._index.nested

    @property
    def limited(self) -> bool:
        """True if decals have had receivers, fades or sheets, see `Decals.limited`."""
        return self._rows.limited

    @property
    def limits(self) -> Float32Array:
        """`Decals.limits` of all numbers, with spare rows at the end."""
        return self._rows.limits

    @property
    def receiver_table(self) -> list[str]:
        """Receivers whose places `limits` holds; it only grows."""
        return self._rows.receiver_table

    @property
    def index(self) -> DecalIndex:
        """Current index in the editor's own memory; the next edit changes it."""
        arrays, count = self.arrays, self.next_number
        levels = arrays[LEVELS][: self.level_count]
        return DecalIndex(levels, arrays[TABLE], arrays[IDS], count, self._index.parity, self._index.floor)

    @property
    def max_influence(self) -> float:
        """Upper bound of the influence radii."""
        return float(self._rows.records[::RECORD, 3].max(initial=0.0))

    # -- edits ------------------------------------------------------------------------------------------

    def add(self, one: Decals) -> int:
        """Add a decal on top of those of its rank, and return its number."""
        _require_one(one)
        number = self.next_number
        self.assign([number], one)
        return number

    def change(self, number: int, **arrays: ArrayLike) -> None:
        """Replace some values of a decal, each an array of length 1 as in `Decals.replace`.

        Raises
        ------
        InvalidDecals
            The number has no decal, or a value is invalid. Nothing changes then.
        """
        rows = self._rows.require(number)
        if len(rows) == 1 and arrays.keys() <= DIRECT:
            columns = {name: checked_column(name, values, 1) for name, values in arrays.items()}
            if len(columns.get("positions", rows)) == 1:
                self._edit(rows, rows, lambda: self._write_columns(int(rows[0]), columns))
                return
        after = self._rows.take(number).replace(**arrays)
        _require_one(after)
        self.assign([number], after)

    def delete(self, numbers: ArrayLike) -> None:
        """Delete decals; `add` does not use their numbers again.

        Raises
        ------
        InvalidDecals
            A number has no decal, or occurs twice. Nothing changes then.
        """
        rows = self._rows.require(numbers)
        self._prepare_index(rows)
        self._dirty.add(self._log.version + 1, self._rows.balls(rows))
        self._remove_from_index(rows)
        self._rows.remove(rows)

    def assign(self, numbers: ArrayLike, decals: Decals) -> None:
        """Assign decals to numbers, which may have a decal, be deleted, or be new.

        Raises
        ------
        InvalidDecals
            Not one decal for each number, a number that occurs twice, one below 0, or one far past the end.
            Nothing changes then.
        """
        _require_decals(decals)
        rows = self._rows.require_assignable(numbers, len(decals))
        if decals.limited:
            codes_of(decals.receivers, self._rows.receiver_table)  # raises for too many different ones
        self._edit(rows, rows[self._rows.contains(rows)], lambda: self._write(rows, decals))

    def _edit(self, rows: Int64Array, existing: Int64Array, write: Callable[[], None]) -> None:
        """Write rows, of which some existed before, and bring the index up to date."""
        self._prepare_index(rows)
        version, balls_before = self._log.version + 1, self._rows.balls(existing)
        self._remove_from_index(existing)
        write()
        self._dirty.add(version, np.concatenate([balls_before, self._rows.balls(rows)]))
        if not self._index.stale:
            records = self._rows.records
            self._index.stale = not all(
                self._index.insert(records, number, rank, self._log)
                for number, rank in zip(rows.tolist(), self._rows.ranks(rows).tolist(), strict=True)
            )
        if not self._index.stale:
            self._index.check_nesting(self._rows.records, self.next_number)

    def load_kernels(self) -> None:
        """Load the kernels of all changes, so that none of them waits for a compilation."""
        self._index.load_kernels(ahead=True)

    # -- changes ----------------------------------------------------------------------------------------

    @property
    def version(self) -> int:
        """Number of changes of arrays so far; see `changed_rows`."""
        self._update_index()
        return self._log.version

    def changed_rows(self, since: int) -> dict[str, list[Range]]:
        """Return the rows of each array that changed since a version.

        Ranges are (first, past last), disjoint and ascending.
        """
        self._update_index()
        changes = self._log.since(since)
        if changes is None:
            return {name: [(0, len(array))] for name, array in self.arrays.items()}
        return changes

    def changed_balls(self, since: int) -> Float32Array | None:
        """Return the influence balls of all decals that changed since a version, before and after.

        Returns
        -------
        float32[n, 4] or None
            Centres and radii. None if any point may have changed: the version is too old, or sums over
            neighbours round otherwise.
        """
        self._update_index()
        return self._dirty.since(since)

    # -- index ------------------------------------------------------------------------------------------

    def _prepare_index(self, rows: Int64Array) -> None:
        """Load the kernels of a change; leave the index to be rebuilt if that costs less than a change."""
        self._index.stale = self._index.stale or len(rows) > max(MAX_SINGLE_EDITS, len(self) // 8)
        self._index.load_kernels()

    def _remove_from_index(self, rows: Int64Array) -> None:
        if not self._index.stale:
            for number in rows.tolist():
                self._index.remove(self._rows.records, number, self._log)

    def _write(self, rows: Int64Array, decals: Decals) -> None:
        records, limits = self._rows.records, self._rows.limits
        limited = self.limited and bool(limits[rows[rows < len(limits)]].any())
        self._rows.assign(rows, decals)
        if self._rows.records is not records:
            self._log.add(RECORDS, (0, len(self._rows.records)), new=True)
        if self._rows.limits is not limits:
            self._log.add(LIMITS, (0, len(self._rows.limits)), new=True)
        limited = limited or decals.limited
        for first, last in runs_of(rows):
            self._log.add(RECORDS, (RECORD * first, RECORD * (last + 1)))
            if limited:
                self._log.add(LIMITS, (first, last + 1))

    def _write_columns(self, row: int, columns: Mapping[str, NDArray[Any]]) -> None:
        self._rows.write(row, columns)
        self._log.add(RECORDS, (RECORD * row, RECORD * (row + 1)))

    def _update_index(self) -> None:
        """Rebuild a stale index, with spare room."""
        if self._index.stale and self._index.build(self._rows.records, self.numbers, self._log):
            self._dirty.add_everywhere(self._log.version)


def _require_decals(decals: Decals) -> None:
    instance("decals", decals, Decals, InvalidDecals, "a scene has .decals")


def _require_one(one: Decals) -> None:
    _require_decals(one)
    if len(one) != 1:
        raise InvalidDecals(f"expected one decal, got {len(one)}; `assign` takes several")


@dataclass(frozen=True, eq=False)
class DecalArrays:
    """Arrays of a set of decals, and what decides the form of a shader that reads them.

    Attributes
    ----------
    arrays
        Those of `DecalEditor.arrays`; an editor's change in place.
    index
        The index, for its number of levels and the mask of its table.
    layered, nested
        See `DecalEditor`.
    version
        Version of the editor, 0 without one.
    """

    arrays: dict[str, NDArray[Any]]
    index: DecalIndex
    layered: bool
    nested: bool
    version: int = 0

    @classmethod
    def of(cls, decals: Decals | DecalEditor) -> "DecalArrays":
        """Return the arrays of decals, or those in an editor's own memory."""
        if isinstance(decals, DecalEditor):
            return cls(decals.arrays, decals.index, decals.layered, decals.nested, decals.version)
        index, records = DecalIndex.of(decals), decals.packed()
        arrays: dict[str, NDArray[Any]] = {RECORDS: records, LIMITS: decals.limits}
        arrays |= {LEVELS: index.levels, TABLE: index.table, IDS: index.ids}
        indexed = index.on("cpu", records=records, layered=decals.layered, copy=False)
        return cls(arrays, index, decals.layered, has_nested(indexed, len(decals)))

    @property
    def uniforms(self) -> dict[str, int]:
        """Uniforms of the index, by their names."""
        return {"index_level_count": self.index.level_count, "index_mask": self.index.mask}
