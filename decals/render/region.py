"""Which samples of a tile can show anything of what lies within some balls."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.render.entry import GROUP
from decals.render.parts import Rectangle
from decals.render.tile import Tile

Doubles = NDArray[np.float64]
Regions = tuple[Rectangle, ...]

ROUNDING = 2.0**-20
"""How far positions in the G-buffer may be off, relative to the largest number in their making."""
MANY = 32
"""Rectangles of which each is drawn on its own; more become one."""
MARGIN = 1.0
"""Samples around a ball: edges of triangles are put onto a grid finer than this."""


def ball_extents(matrix: Doubles, balls: ArrayLike) -> tuple[Doubles, Doubles] | None:
    """Give the boxes around the images of balls: least and largest x and y in clip space, ``float64[n, 2]``.

    With rows a, b of ``matrix`` for x and w, a ball lies where x/w ≤ c if its centre lies R |a − c b| before
    the plane a = c b; so the c where it touches solve a quadratic equation, in perspective and without
    (Mara and McGuire, 2D Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere, JCGT 2013).

    Parameters
    ----------
    matrix
        World to clip space, ``float64[4, 4]``, acting on columns.
    balls
        Centres and radii, ``float[n, 4]``.

    Returns
    -------
    None where a ball reaches behind the eye: it may be seen anywhere.
    """
    rows = np.asarray(balls, np.float64).reshape(-1, 4)
    squared = rows[:, 3:] ** 2
    places = rows[:, :3] @ matrix[:, :3].T + matrix[:, 3]
    across, depth = places[:, :2], places[:, 3:]
    slopes, away = matrix[:2, :3], matrix[3, :3]
    a = depth**2 - squared * (away @ away)
    if (depth <= 0.0).any() or (a <= 0.0).any():
        return None
    b = across * depth - squared * (slopes @ away)
    c = across**2 - squared * (slopes**2).sum(axis=1)
    half = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    return (b - half) / a, (b + half) / a


def regions_of(tile: Tile, balls: Doubles, span: float) -> Regions:
    """Give rectangles of a tile, counted from its own corner, outside of which no ball is seen.

    They are cut into whole groups of samples: some rasterisers filter images for several samples together,
    and take the derivatives of one of them.

    Parameters
    ----------
    tile
        What is drawn.
    balls
        Centres and radii, ``float64[n, 4]``.
    span
        The largest coordinate of what the tile shows.
    """
    span = max(span, float(np.abs(tile.picture.rays.origin).max()))
    extents = ball_extents(tile.matrix(), balls + np.array([0.0, 0.0, 0.0, ROUNDING * span]))
    if extents is None:
        return (Rectangle(0, 0, tile.width, tile.height),)
    size = np.array([tile.width, tile.height])
    low = np.floor(((0.5 * extents[0] + 0.5) * size - MARGIN) / GROUP) * GROUP
    high = np.ceil(((0.5 * extents[1] + 0.5) * size + MARGIN) / GROUP) * GROUP
    corners = np.clip(np.column_stack([low, high]), 0, np.tile(size, 2))
    corners = corners[(corners[:, 2:] > corners[:, :2]).all(axis=1)]
    if len(corners) > MANY:
        corners = np.concatenate([corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)])[None]
    rows = corners.astype(int).tolist()
    return joined([Rectangle(x, y, right - x, top - y) for x, y, right, top in rows])


def joined(rectangles: Sequence[Rectangle]) -> Regions:
    """Give fewer rectangles that hold the same samples: two become one where that takes no more samples."""
    result: list[Rectangle] = []
    for rectangle in rectangles:
        whole = rectangle
        for other in [*result]:
            both = whole.around(other)
            if both.area <= whole.area + other.area:
                result.remove(other)
                whole = both
        result.append(whole)
    return tuple(result)
