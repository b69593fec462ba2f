"""Nearest decals or particles that face the same way."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals.model import FACING_LIMIT
from decals.surfaces.surface import Floats

Indices = NDArray[np.int64]
Distances = NDArray[np.float64]

ALONE = 4000
"""Fewest points for which more than one thread is started."""

WIDENING = (4, 16, 64, 256)
"""How many neighbours are looked at, in turn, by the points that found too few facing ones among fewer."""


class FacingTree:
    """Search among oriented points for those on the same side of a wall.

    An oriented point q faces another p where the dot product of their normals is above `FACING_LIMIT`,
    the rule by which a decal at p colours q.
    """

    def __init__(self, positions: Floats, normals: Floats) -> None:
        self._tree = cKDTree(positions)
        self._normals = normals

    def nearest(
        self, points: Floats, normals: Floats, *, count: int = 1, skip_self: bool = False
    ) -> tuple[Distances, Indices]:
        """Distances to the `count` nearest facing points, and which they are, ``[n, count]`` each.

        Rows fill up with infinity and -1 where fewer than `count` face the point among the last of
        `WIDENING` nearest. With `skip_self` the points are the tree's own, and none is its own neighbour.
        """
        distances = np.full((len(points), count), np.inf)
        indices = np.full((len(points), count), -1, np.int64)
        open_rows = np.arange(len(points))
        for width in self._widths(count + skip_self):
            if len(open_rows) == 0:
                break
            found = self._among(
                points[open_rows], normals[open_rows], width, open_rows if skip_self else None
            )
            columns = slice(0, min(count, width))
            distances[open_rows, columns], indices[open_rows, columns] = (
                array[:, columns] for array in found
            )
            open_rows = open_rows[~np.isfinite(distances[open_rows, -1])]
        return distances, indices

    def _widths(self, least: int) -> list[int]:
        """Growing numbers of neighbours, none beyond the number of points."""
        total = int(self._tree.n)
        if total == 0:
            return []
        widths = [min(max(width, least + 3), total) for width in WIDENING]
        return widths[:1] + [wide for narrow, wide in pairwise(widths) if wide > narrow]

    def _among(
        self, points: Floats, normals: Floats, width: int, own: Indices | None
    ) -> tuple[Distances, Indices]:
        """Sort the facing ones to the front of the `width` nearest."""
        distances, indices = (
            array.reshape(len(points), width)
            for array in self._tree.query(points, k=np.arange(1, width + 1), workers=_workers(len(points)))
        )
        facing = np.einsum("nki,ni->nk", self._normals[indices], normals) > FACING_LIMIT
        if own is not None:
            facing &= indices != own[:, None]
        order = np.argsort(~facing, axis=1, kind="stable")
        facing = np.take_along_axis(facing, order, axis=1)
        distances = np.where(facing, np.take_along_axis(distances, order, axis=1), np.inf)
        indices = np.where(facing, np.take_along_axis(indices, order, axis=1), -1)
        return distances, indices


def _workers(points: int) -> int:
    return -1 if points >= ALONE else 1
