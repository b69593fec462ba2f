"""Changes since a version: rows of arrays (`ChangeLog`), and regions in space (`DirtyBalls`).

A decal acts only on points within its neighbour reach. A point therefore shows the same, bit for bit, unless
it lies in the ball of a changed decal, before or after the change. `affected_balls` adds the images that
radial contact stretches.
"""

from collections import deque

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from decals.index.decal_cells import REACH_WITH_SLACK
from decals.record import RIM_RADIUS, Contact

Range = tuple[int, int]
"""First row, and the row after the last."""

MAX_LOG_ENTRIES = 1 << 13
MAX_DIRTY_BALLS = 4096
"""Limit of the number of balls, and of the number of edits."""

MAX_SIZE_RATIO = 100.0
"""Ratio of sizes up to which rounding cannot decide, in radial contact, whether a decal cuts a ray.

(It holds up to a ratio of about 2,000: the margin falls with the square of the ratio, to 2⁻²⁴ of float32.)
"""


class ChangeLog:
    """Ranges of rows in the order of their changes.

    Attributes
    ----------
    version : int
        Number of changes so far. A reader keeps it, and later asks for the changes `since`.
    """

    def __init__(self, max_entries: int = MAX_LOG_ENTRIES) -> None:
        self._entries: deque[tuple[str, Range, bool]] = deque(maxlen=max_entries)
        self.version = 0

    def add(self, name: str, rows: Range, *, new: bool = False) -> None:
        """Record that rows of an array changed, or that a new array of these rows replaced it."""
        self._entries.append((name, rows, new))
        self.version += 1

    def since(self, version: int) -> dict[str, list[Range]] | None:
        """Return the rows that changed since a version: disjoint ranges, ascending, by array.

        None if the version is older than the log.
        """
        count = self.version - version
        if not 0 <= count <= len(self._entries):
            return None
        changes: dict[str, list[Range]] = {}
        for back in range(count, 0, -1):
            name, rows, new = self._entries[-back]
            if new:
                changes[name] = []
            changes.setdefault(name, []).append(rows)
        return {name: _merge(ranges) for name, ranges in changes.items()}


def _merge(ranges: list[Range]) -> list[Range]:
    """Merge ranges that overlap or touch."""
    result: list[Range] = []
    for first, end in sorted(ranges):
        if result and first <= result[-1][1]:
            result[-1] = result[-1][0], max(end, result[-1][1])
        else:
            result.append((first, end))
    return result


class DirtyBalls:
    """Influence balls of changed decals, before and after each change, by the version of the change.

    Balls are ``float32[n, 4]``: centres and influence radii.
    """

    def __init__(self) -> None:
        self._entries: deque[tuple[int, Float32Array]] = deque()
        self._count = 0
        self._oldest = 0

    def add(self, version: int, balls: Float32Array) -> None:
        """Record the balls of an edit; drop the oldest entries beyond `MAX_DIRTY_BALLS`."""
        self._entries.append((version, balls))
        self._count += len(balls)
        while self._entries and (self._count > MAX_DIRTY_BALLS or len(self._entries) > MAX_DIRTY_BALLS):
            self._oldest, dropped = self._entries.popleft()
            self._count -= len(dropped)

    def add_everywhere(self, version: int) -> None:
        """Record an edit that may have changed any point."""
        self._entries.clear()
        self._count, self._oldest = 0, version

    def since(self, version: int) -> Float32Array | None:
        """Return the balls of all changes after a version; None if any point may have changed."""
        if version < self._oldest:
            return None
        balls = [balls for stamp, balls in self._entries if stamp > version]
        return np.concatenate(balls) if balls else np.zeros((0, 4), np.float32)


def affected_balls(balls: Float32Array, contact: object, max_influence: float) -> Float64Array | None:
    """Grow influence balls of changed decals to the balls in which points may show something else.

    In radial contact a decal stretches the images of its neighbours along whole rays, from the rim of the
    neighbour to its centre (`decals.field.radial.radial_complement`): as far as the largest visible radius.
    A decal that does not reach a neighbour's rim cuts no ray, unless it is so much smaller that rounding
    decides.

    Parameters
    ----------
    balls : float32[n, 4]
        Centres and influence radii.
    contact : Contact or ContactLaw
        Contact mode of the picture.
    max_influence : float
        Largest influence radius of any decal.

    Returns
    -------
    float64[n, 4] or None
        None if any point may show something else.
    """
    grown = balls.astype(np.float64)
    grown[:, 3] *= REACH_WITH_SLACK
    if contact is Contact.RADIAL and len(balls):
        widest = max(max_influence, float(balls[:, 3].max()))
        if widest > MAX_SIZE_RATIO * float(balls[:, 3].min()):
            return None
        grown[:, 3] += RIM_RADIUS * widest
    return grown
