"""Which rows of which arrays changed, for any number of copies that are kept up."""

from collections import deque

Range = tuple[int, int]

MOST = 1 << 16
"""Entries that are kept; who asks for older ones is told to copy everything."""


class Journal:
    """Ranges of rows in the order in which they changed.

    Attributes
    ----------
    version
        Counts the entries; a copy remembers it, and asks for what came `since`.
    """

    def __init__(self, most: int = MOST) -> None:
        self._entries: deque[tuple[str, Range, bool]] = deque(maxlen=most)
        self.version = 0

    def add(self, name: str, rows: Range, *, new: bool = False) -> None:
        """Note that rows of an array changed, or that it is a new array of these rows."""
        self._entries.append((name, rows, new))
        self.version += 1

    def since(self, version: int) -> dict[str, list[Range]] | None:
        """Rows that changed since a version: disjoint (first, past last), ascending; None: too long ago."""
        count = self.version - version
        if not 0 <= count <= len(self._entries):
            return None
        found: dict[str, list[Range]] = {}
        for back in range(count, 0, -1):
            name, rows, new = self._entries[-back]
            if new:
                found[name] = []
            found.setdefault(name, []).append(rows)
        return {name: merged(ranges) for name, ranges in found.items()}


def merged(ranges: list[Range]) -> list[Range]:
    """Bring overlapping ranges together."""
    result: list[Range] = []
    for first, end in sorted(ranges):
        if result and first <= result[-1][1]:
            result[-1] = result[-1][0], max(end, result[-1][1])
        else:
            result.append((first, end))
    return result
