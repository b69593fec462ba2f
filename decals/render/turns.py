"""Stacks of decals so deep that a driver would cut off the loops over them, without a word."""

import numpy as np

from decals.errors import TooMuchData
from decals.grid.index import DecalIndex, Wide

WALKS, SEARCH = 8, 3
"""Walks over all candidates of a pixel, at most; turns of a search beside its halvings."""


class Turns:
    """The most turns of loops that a pixel may take; nothing is asked where there is no limit.

    Reading all lists takes as long as many edits, so what was found holds for as many changes as cannot reach
    the limit: each makes a list longer by one at most.
    """

    def __init__(self, most: int | None) -> None:
        self._most = most
        self._table = np.zeros((0, 4), np.int32)
        self._shape = (0, False)
        self._until = 0

    def check(self, index: DecalIndex, *, layered: bool, version: int = 0) -> None:
        """Refuse an index with `TooMuchData`; version counts the changes since it was laid out."""
        shape = index.level_count, layered
        checked = index.table is self._table and shape == self._shape and version <= self._until
        if self._most is None or checked:
            return
        lists = index.longest_lists
        candidates, allowed = int(lists.sum()), self._most // _each(lists, layered=layered)
        if candidates > allowed:
            raise TooMuchData(
                f"{candidates:,} decals reach the same place; expected at most {allowed:,}: "
                "software rendering cuts off the rest; spread them, draw on a graphics card, or use evaluate"
            )
        spare = allowed - candidates
        while spare and _each(lists + spare, layered=layered) * (candidates + spare) > self._most:
            spare //= 2
        self._table, self._shape, self._until = index.table, shape, version + spare


def _each(lists: Wide, *, layered: bool) -> int:
    """Turns for each candidate; where there are layers, a search in each list for each from the top down."""
    return WALKS + sum(int(count).bit_length() + SEARCH for count in lists) * layered
