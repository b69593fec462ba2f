"""Storage of an editor's decals: packed records in an array that grows, one row for each number."""

import copy
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Int32Array, Int64Array
from decals.errors import InvalidDecals
from decals.model import LAYER_LIMIT, RECORD, Decals, Interaction, influence_of

MIN_SPARE_ROWS = 1024
"""Smallest number of spare rows of an array; arrays grow by half."""

KEPT = "radii", "tints", "receivers", "fade_angles", "fade_depths", "single_sheets"
"""Columns with arrays of their own."""

DIRECT = frozenset(("positions", "radii", "images", "opacities"))
"""Columns that `DecalRows.write` writes: no rank, limit or other column depends on them."""

INTERACTION_MASK = 3
"""Mask of a rank's `Interaction`."""


class DecalRows:
    """Decals by number; a deleted number leaves a gap, which may be filled again.

    The packed records are the store, so that nothing is copied for devices. The columns of KEPT have arrays
    of their own: a record holds other forms of them, such as the influence radius and the linear tint.

    Attributes
    ----------
    records : float32[4 * capacity, 4]
        Records of all numbers, as `Decals.packed` lays them out, with spare rows at the end.
    limits : float32[capacity, 4]
        `Decals.limits` of all numbers.
    receiver_table : list of str
        Receivers whose places the limits hold; it only grows.
    limited : bool
        True if decals have had receivers or fades, or kept to their sheets.
    count : int
        Number of decals.
    end : int
        One more than the largest number that was ever used.
    """

    def __init__(self, decals: Decals) -> None:
        self.count = self.end = len(decals)
        self.records = _records_with_spare(decals.packed(), len(decals))
        self.receiver_table = [""]
        self.limits = with_spare(decals.limits_of(self.receiver_table))
        self.limited = decals.limited
        self._kept = {name: with_spare(getattr(decals, name)) for name in KEPT}
        self._present = with_spare(np.ones(len(decals), np.bool_))
        self._rank_counts: Counter[int] = Counter(decals.ranks.tolist())

    def copy(self) -> Self:
        """Return the same decals under the same numbers, in arrays of their own."""
        twin = copy.copy(self)
        twin.records, twin._present = self.records.copy(), self._present.copy()
        twin.limits, twin.receiver_table = self.limits.copy(), self.receiver_table.copy()
        twin._kept = {name: array.copy() for name, array in self._kept.items()}
        twin._rank_counts = self._rank_counts.copy()
        return twin

    @property
    def numbers(self) -> Int64Array:
        """Numbers of the decals, ascending."""
        return np.flatnonzero(self._present[: self.end])

    @property
    def layered(self) -> bool:
        """Truth of `Decals.layered`: the decals are not all contact decals of one layer."""
        ranks = [rank for rank, count in self._rank_counts.items() if count]
        return len(ranks) > 1 or any(rank & INTERACTION_MASK != Interaction.PUSH for rank in ranks)

    def contains(self, numbers: ArrayLike) -> BoolArray:
        """Return True for each number that has a decal, ``bool[n]``."""
        return self._contains(as_numbers(numbers))

    def _contains(self, rows: Int64Array) -> BoolArray:
        inside = (rows >= 0) & (rows < self.end)
        present: BoolArray = inside & self._present[np.where(inside, rows, 0)]
        return present

    def require(self, numbers: ArrayLike) -> Int64Array:
        """Return numbers of existing decals, each at most once; raise `InvalidDecals` otherwise."""
        rows = as_numbers(numbers)
        missing = ~self._contains(rows)
        if missing.any():
            number = int(rows[missing][0])
            raise InvalidDecals(f"expected the number of a decal, got {number}; it was deleted or never was")
        return _require_unique(rows)

    def require_assignable(self, numbers: ArrayLike, count: int) -> Int64Array:
        """Return distinct numbers for this many decals, none far past the end, or raise `InvalidDecals`."""
        rows = as_numbers(numbers)
        if len(rows) != count:
            raise InvalidDecals(f"expected a decal for each of {len(rows)} numbers, got {count}")
        limit = self.end + count
        wrong = rows[(rows < 0) | (rows >= limit)]
        if len(wrong):
            raise InvalidDecals(f"expected numbers from 0 to {limit - 1}, got {wrong[0]}")
        return _require_unique(rows)

    def take(self, numbers: ArrayLike) -> Decals:
        """Return the decals of these numbers, in this order."""
        rows = self.require(numbers)
        packed = self.records.reshape(-1, RECORD, 4)[rows]  # one copy of all columns
        columns = {name: form(packed[place]) for name, (place, form) in _PACKED.items()}
        return Decals.of_rows({**columns, **{name: array[rows] for name, array in self._kept.items()}})

    def column(self, name: str, rows: Int64Array) -> NDArray[Any]:
        """Return one array of `Decals` for these rows."""
        if name in KEPT:
            return self._kept[name][rows]
        place, form = _PACKED[name]
        return form(self.records.reshape(-1, RECORD, 4)[place][rows])

    def balls(self, rows: Int64Array) -> Float32Array:
        """Return centres and influence radii, ``float32[n, 4]``."""
        return self.records[RECORD * rows]

    def assign(self, rows: Int64Array, decals: Decals) -> None:
        """Write decals into rows, which may lie past the end.

        Raises
        ------
        InvalidDecals
            The decals have too many different receivers. Nothing changes then.
        """
        limits = decals.limits_of(self.receiver_table)
        self.limited = self.limited or decals.limited
        self.end = max(self.end, int(rows.max(initial=-1)) + 1)
        if self.end > len(self._present):
            self._kept = {name: with_spare(array, self.end) for name, array in self._kept.items()}
            self.limits = with_spare(self.limits, self.end)
            self._present = with_spare(self._present, self.end)
        if RECORD * self.end > len(self.records):
            self.records = _records_with_spare(self.records, self.end)
        self._uncount(rows)
        self.records.reshape(-1, RECORD, 4)[rows] = decals.packed().reshape(-1, RECORD, 4)
        self.limits[rows] = limits
        for name, array in self._kept.items():
            array[rows] = getattr(decals, name)
        self._rank_counts.update(decals.ranks.tolist())
        self.count += int((~self._present[rows]).sum())
        self._present[rows] = True

    def write(self, row: int, columns: Mapping[str, NDArray[Any]]) -> None:
        """Write checked values (1, …) of columns of DIRECT for a decal that exists."""
        record = self.records[RECORD * row : RECORD * (row + 1)]
        for name, values in columns.items():
            match name:
                case "positions":
                    record[0, :3] = values[0]
                case "radii":
                    self._kept["radii"][row] = values[0]
                    record[0, 3] = influence_of(values)[0]
                case "images":
                    record[2, 3] = values[0]
                case "opacities":
                    record[3, 3] = values[0]

    def remove(self, rows: Int64Array) -> None:
        """Leave gaps in these rows."""
        self._uncount(rows)
        self.count -= int(self._present[rows].sum())
        self._present[rows] = False

    def ranks(self, rows: Int64Array) -> Int32Array:
        """Return `Decals.ranks` for these rows."""
        return _whole_ranks(self.records[RECORD * rows + 1, 3])

    def _uncount(self, rows: Int64Array) -> None:
        """Subtract the decals in these rows from the counts of ranks."""
        self._rank_counts.subtract(Counter(self.ranks(rows[self._present[rows]]).tolist()))


def _whole_ranks(ranks: Float32Array) -> Int32Array:
    """Return the ranks of records, which have a half more for decals that spill."""
    whole: Int32Array = np.floor(ranks).astype(np.int32)
    return whole


_PACKED: dict[str, tuple[Any, Callable[[Float32Array], NDArray[Any]]]] = {
    "positions": (np.s_[:, 0, :3], np.ascontiguousarray),
    "normals": (np.s_[:, 1, :3], np.ascontiguousarray),
    "tangents": (np.s_[:, 2, :3], np.ascontiguousarray),
    "images": (np.s_[:, 2, 3], lambda images: images.astype(np.int32)),
    "spill": (np.s_[:, 1, 3], lambda ranks: ranks % 1.0 > 0.25),
    "interactions": (np.s_[:, 1, 3], lambda ranks: _whole_ranks(ranks) & INTERACTION_MASK),
    "layers": (np.s_[:, 1, 3], lambda ranks: (_whole_ranks(ranks) >> 2) - LAYER_LIMIT),
    "opacities": (np.s_[:, 3, 3], np.ascontiguousarray),
}
"""Where in records (n, RECORD, 4) the other columns lie, and how they are read from there."""


def as_numbers(numbers: ArrayLike) -> Int64Array:
    """Return whole numbers as ``int64[n]``, or raise `InvalidDecals`."""
    try:
        array = np.atleast_1d(np.asarray(numbers))
    except ValueError as error:
        raise InvalidDecals(f"expected numbers of decals, got {numbers!r:.80}") from error
    if array.size == 0:
        return np.zeros(0, np.int64)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise InvalidDecals(f"expected numbers of decals, got {numbers!r:.80}")
    return array.astype(np.int64)


def _require_unique(numbers: Int64Array) -> Int64Array:
    if len(numbers) > 1 and len(np.unique(numbers)) < len(numbers):
        raise InvalidDecals(f"expected each number once, got {numbers.tolist()!s:.80}; drop the repeats")
    return numbers


def with_spare(array: NDArray[Any], min_rows: int = 0) -> NDArray[Any]:
    """Copy an array to one with spare rows, at least ``min_rows`` in all."""
    size = max(len(array) + max(MIN_SPARE_ROWS, len(array) // 2), min_rows)
    grown = np.zeros((size, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


def _records_with_spare(records: Float32Array, min_decals: int) -> Float32Array:
    return with_spare(records.reshape(-1, RECORD, 4), min_decals).reshape(-1, 4)


def runs_of(rows: Int64Array) -> list[tuple[int, int]]:
    """Return the first and last number of each run of consecutive numbers."""
    if len(rows) < 2:
        return [(row, row) for row in rows.tolist()]
    ordered = np.sort(rows)
    breaks = np.flatnonzero(np.diff(ordered) > 1)
    firsts = ordered[np.concatenate([[0], breaks + 1])]
    lasts = ordered[np.concatenate([breaks, [-1]])]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
