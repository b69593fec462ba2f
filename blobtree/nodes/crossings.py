"""Edges of polygons that meet where they should not: a sweep along their corners (Shamos & Hoey 1976).

Corners are visited from left to right. `status` holds the edges at the current corner from below to above.
Two edges that meet are neighbours in it before they do, unless two others meet earlier. So it is enough to
try neighbours, and n corners take time in proportion to n log n.
"""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from blobtree._typing import Float64Array

TOUCH = 1e-12
"""Cross product of vectors, in units of the polygons' size, up to which three points are on a line."""

Corner = list[float]


def meeting_edges(points: Float64Array, counts: Sequence[int] = ()) -> tuple[int, int] | None:
    """Return the first corners of two edges of polygons that meet where they should not, None if none do.

    `points` are the corners (n, 2) in units of the size: of one polygon, or of several with `counts` of
    corners. Edges that share a corner meet if that corner is repeated, or if one runs back along the other.
    """
    corners: list[Corner] = points.tolist()
    loops = np.split(np.arange(len(corners)), np.cumsum(counts)[:-1])
    after = np.concatenate([np.roll(loop, -1) for loop in loops]).tolist()
    before = np.concatenate([np.roll(loop, 1) for loop in loops]).tolist()
    order = np.lexsort((points[:, 1], points[:, 0])).tolist()
    rank = {corner: place for place, corner in enumerate(order)}
    for first, second in pairwise(order):
        if corners[first] == corners[second]:
            return min(first, second), max(first, second)
    for first, second in enumerate(after):
        a, b, c = (corners[corner] for corner in (first, second, after[second]))
        if _side(a, b, c) == 0.0 and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0.0:
            return min(first, second), max(first, second)
    ends = [sorted(edge, key=rank.__getitem__) for edge in enumerate(after)]
    status: list[int] = []

    def meeting(place: int) -> tuple[int, int] | None:
        """Return an edge of the status and the one below, if they meet."""
        if not 0 < place < len(status):
            return None
        pair = min(status[place - 1 : place + 1]), max(status[place - 1 : place + 1])
        apart = after[pair[0]] != pair[1] and after[pair[1]] != pair[0]
        return pair if apart and _meet(*(corners[end] for edge in pair for end in ends[edge])) else None

    for corner in order:
        p = corners[corner]

        def is_above(edge: int, p: Corner = p) -> bool:
            start, end = (corners[place] for place in ends[edge])
            return _cross(start, end, p) <= 0.0

        edges = [before[corner], corner]
        for edge in edges:
            if ends[edge][1] == corner:
                place = _place(status, edge, bisect_left(status, True, key=is_above))
                del status[place]
                if found := meeting(place):
                    return found
        starting = [edge for edge in edges if ends[edge][0] == corner]
        if len(starting) == 2 and _cross(p, *(corners[ends[edge][1]] for edge in starting)) > 0.0:
            starting.reverse()
        for edge in starting:  # the upper one first
            place = bisect_left(status, True, key=is_above)
            status.insert(place, edge)
            if found := meeting(place) or meeting(place + 1):
                return found
    return None


def cross_products(a: Any, b: Any) -> Any:
    """Return the cross products of vectors (…, 2) in the plane."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def area_of(points: Any) -> float:
    """Return the area of a polygon, below 0 for a clockwise one."""
    spokes = points - points[0]
    return 0.5 * float(cross_products(spokes, np.roll(spokes, -1, axis=0)).sum())


def _place(status: list[int], edge: int, near: int) -> int:
    """Return the place of an edge, which rounding may move a little from where it is looked for."""
    start = max(near - 2, 0)
    nearby = status[start : near + 3]
    return start + nearby.index(edge) if edge in nearby else status.index(edge)


def _cross(a: Corner, b: Corner, c: Corner) -> float:
    """Return the cross product of the ways from a to b and to c."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _side(a: Corner, b: Corner, c: Corner) -> float:
    """Return the cross product, 0 if it is within rounding of that."""
    cross = _cross(a, b, c)
    return 0.0 if abs(cross) <= TOUCH else cross


def _meet(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Return True if the edges from a to b and from c to d have a point in common."""
    for axis in range(2):
        if max(a[axis], b[axis]) < min(c[axis], d[axis]) or max(c[axis], d[axis]) < min(a[axis], b[axis]):
            return False
    return _side(a, b, c) * _side(a, b, d) <= 0.0 and _side(c, d, a) * _side(c, d, b) <= 0.0
