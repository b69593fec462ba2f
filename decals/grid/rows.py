"""Decals in arrays that grow, each in a row of its own for good: what an editor holds."""

from collections import Counter
from dataclasses import fields
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidDecals
from decals.model import RECORD, Decals, Interaction

Numbers = NDArray[np.int64]

SPARE = 1024
"""Least spare rows of an array; arrays grow by half."""

KINDS = 3
"""Mask of a rank's `Interaction`."""

_FIELDS = tuple(field.name for field in fields(Decals))


class DecalRows:
    """Decals by number; a number that is dropped leaves a gap, and may be filled again."""

    def __init__(self, decals: Decals) -> None:
        self._columns = {name: with_spare(getattr(decals, name)) for name in _FIELDS}
        self._there = with_spare(np.ones(len(decals), np.bool_))
        self._sheets: Counter[int] = Counter(decals.ranks.tolist())
        self.count = len(decals)
        self.end = len(decals)

    def copy(self) -> Self:
        """Give the same decals again, in arrays of their own."""
        made = type(self).__new__(type(self))
        made._columns = {name: column.copy() for name, column in self._columns.items()}
        made._there, made._sheets = self._there.copy(), self._sheets.copy()
        made.count, made.end = self.count, self.end
        return made

    @property
    def numbers(self) -> Numbers:
        """Numbers of the decals that there are, ascending."""
        return np.flatnonzero(self._there[: self.end])

    @property
    def layered(self) -> bool:
        """Whether decals lie over each other: they are not all contact decals of one layer."""
        ranks = [rank for rank, count in self._sheets.items() if count]
        return len(ranks) > 1 or any(rank & KINDS != Interaction.CONTACT for rank in ranks)

    def there(self, numbers: ArrayLike) -> NDArray[np.bool_]:
        """Whether there is a decal of each number, ``bool[n]``."""
        asked = as_numbers(numbers)
        inside = (asked >= 0) & (asked < self.end)
        found: NDArray[np.bool_] = inside & self._there[np.where(inside, asked, 0)]
        return found

    def check(self, numbers: ArrayLike) -> Numbers:
        """Give numbers of decals that there are, each once, or `InvalidDecals`."""
        asked = as_numbers(numbers)
        missing = ~self.there(asked)
        if missing.any():
            number = int(asked[missing][0])
            raise InvalidDecals(f"expected the number of a decal, got {number}; it was deleted or never was")
        return _each_once(asked)

    def fitting(self, numbers: ArrayLike, count: int) -> Numbers:
        """Give numbers for so many decals, each once and none far beyond the last, or `InvalidDecals`."""
        asked = as_numbers(numbers)
        if len(asked) != count:
            raise InvalidDecals(f"expected a decal for each of {len(asked)} numbers, got {count}")
        most = self.end + count
        wrong = asked[(asked < 0) | (asked >= most)]
        if len(wrong):
            raise InvalidDecals(f"expected numbers from 0 to {most - 1}, got {wrong[0]}")
        return _each_once(asked)

    def take(self, numbers: ArrayLike) -> Decals:
        """Decals of these numbers, in their order."""
        rows = self.check(numbers)
        return Decals.of_rows({name: column[rows] for name, column in self._columns.items()})

    def column(self, name: str) -> NDArray[Any]:
        """One of the arrays of all decals, in the order of `numbers`."""
        return self._columns[name][self.numbers]

    def put(self, numbers: Numbers, decals: Decals) -> None:
        """Put decals into rows, which may be past the end."""
        self.end = max(self.end, int(numbers.max(initial=-1)) + 1)
        if self.end > len(self._there):
            self._columns = {name: with_spare(column, self.end) for name, column in self._columns.items()}
            self._there = with_spare(self._there, self.end)
        self._forget(numbers)
        for name, column in self._columns.items():
            column[numbers] = getattr(decals, name)
        self._sheets.update(decals.ranks.tolist())
        self.count += int((~self._there[numbers]).sum())
        self._there[numbers] = True

    def drop(self, numbers: Numbers) -> None:
        """Leave gaps in these rows."""
        self._forget(numbers)
        self.count -= int(self._there[numbers].sum())
        self._there[numbers] = False

    def _forget(self, numbers: Numbers) -> None:
        """Take the decals that lie in these rows off the count of ranks."""
        self._sheets.subtract(self.take(numbers[self._there[numbers]]).ranks.tolist())


def as_numbers(numbers: ArrayLike) -> Numbers:
    """Give whole numbers as ``int64[n]``, or `InvalidDecals`."""
    try:
        array = np.atleast_1d(np.asarray(numbers))
    except ValueError as error:
        raise InvalidDecals(f"expected numbers of decals, got {numbers!r:.80}") from error
    if array.size == 0:
        return np.zeros(0, np.int64)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise InvalidDecals(f"expected numbers of decals, got {numbers!r:.80}")
    return array.astype(np.int64)


def _each_once(numbers: Numbers) -> Numbers:
    """Give numbers of which none comes twice, or `InvalidDecals`."""
    if len(np.unique(numbers)) < len(numbers):
        raise InvalidDecals(f"expected each number once, got {numbers.tolist()!s:.80}; drop the repeats")
    return numbers


def with_spare(array: NDArray[Any], least: int = 0) -> NDArray[Any]:
    """Copy an array to one with spare rows, at least so many in all."""
    size = max(len(array) + max(SPARE, len(array) // 2), least)
    grown = np.zeros((size, *array.shape[1:]), array.dtype)
    grown[: len(array)] = array
    return grown


def records_with_spare(array: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """Copy records to more of them, at least so many."""
    return with_spare(array.reshape(-1, RECORD, 4), count).reshape(-1, 4)


def runs_of(rows: NDArray[np.int64]) -> list[tuple[int, int]]:
    """First and last number of each run of numbers that follow each other."""
    ordered = np.sort(rows)
    breaks = np.flatnonzero(np.diff(ordered) > 1)
    firsts = ordered[np.concatenate([[0], breaks + 1])] if len(ordered) else ordered
    lasts = ordered[np.concatenate([breaks, [-1]])] if len(ordered) else ordered
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
