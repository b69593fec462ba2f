"""Packing of rectangles into squares, by the skyline rule: each lies as low as it can, then as far left."""

import numpy as np

from blobtree._typing import Float64Array, Int64Array

SEARCH_STEPS = 14
"""Halvings of the interval in which the largest scale lies."""


def pack(sides: Float64Array, padding: float, tiles: int) -> tuple[float, Float64Array, Int64Array]:
    """Return the largest scale at which rectangles fit into unit squares, and where they lie.

    Parameters
    ----------
    sides : float64[n, 2]
        Widths and heights.
    padding : float
        Distance between rectangles, and half of that to the border of a square. It is not scaled.
    tiles : int
        Number of squares.

    Returns
    -------
    float
        The scale; 0 if even points do not fit.
    float64[n, 2]
        Lower corners.
    int64[n]
        The square of each.
    """
    order = np.lexsort((-sides[:, 0], -sides[:, 1]))
    low = 0.0
    high = float(np.sqrt(tiles / max(sides.prod(axis=1).sum(), 1e-30)))
    best = _placed(low * sides[order] + padding, padding, tiles)
    if best is None:
        return 0.0, np.zeros((len(sides), 2)), np.zeros(len(sides), np.int64)
    for _ in range(SEARCH_STEPS):
        middle = 0.5 * (low + high)
        placed = _placed(middle * sides[order] + padding, padding, tiles)
        if placed is None:
            high = middle
        else:
            low, best = middle, placed
    corners, squares = np.empty((len(sides), 2)), np.empty(len(sides), np.int64)
    corners[order], squares[order] = best
    return low, corners, squares


def _placed(sides: Float64Array, padding: float, tiles: int) -> tuple[Float64Array, Int64Array] | None:
    """Return lower corners and squares of rectangles in this order, or None if they do not fit."""
    begin, end = 0.5 * padding, 1.0 + 0.5 * padding  # the sides have a padding that may go beyond the border
    skylines = [[(begin, begin, end)] for _ in range(tiles)]  # (left, height, right)
    corners, squares = np.empty((len(sides), 2)), np.empty(len(sides), np.int64)
    for number, (width, height) in enumerate(sides.tolist()):
        for square, skyline in enumerate(skylines):
            place = _lowest(skyline, width, height, end)
            if place is not None:
                corners[number], squares[number] = place, square
                skylines[square] = _raised(skyline, *place, width, height)
                break
        else:
            return None
    return corners, squares


Skyline = list[tuple[float, float, float]]
"""Upper border of what is packed, from left to right: begin, height and end of each part."""


def _lowest(skyline: Skyline, width: float, height: float, end: float) -> tuple[float, float] | None:
    """Return the lowest place on a skyline that a rectangle has room at, the leftmost of several."""
    best: tuple[float, float] | None = None
    for first, (left, _, _) in enumerate(skyline):
        if left + width > end:
            break
        top = 0.0
        for _, level, right in skyline[first:]:
            top = max(top, level)
            if right >= left + width:
                break
        if top + height <= end and (best is None or top < best[1]):
            best = left, top
    return best


def _raised(skyline: Skyline, left: float, top: float, width: float, height: float) -> Skyline:
    """Return a skyline with a rectangle on it."""
    right = left + width
    before = [(a, level, min(b, left)) for a, level, b in skyline if a < left]
    after = [(max(a, right), level, b) for a, level, b in skyline if b > right]
    return [*before, (left, top + height, right), *after]
