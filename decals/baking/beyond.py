"""Texels beyond seams: the surface goes on there as it does on the other side.

A program mixes texels from both sides of the border of a chart. Beyond a seam, texels show the surface on the
other side, turned about the seam into the plane of the face (`points_beyond`). Both sides of a seam then show
one picture, sampled at other places.
"""

from typing import NamedTuple

import numpy as np

from blobtree._typing import Float64Array, Int32Array, Int64Array
from decals.baking.seams import Seams, bilinear_texels
from decals.sorting import stable_order

FINENESS = 1 << 10
"""Steps into which the square of a texel's width is divided."""

MAX_SQUARE = 4
"""Squares of distances from the middles of texels are below this; the four around a place are within 2."""


class Beyond(NamedTuple):
    """Texels that are mixed along seams of a mesh on one texture.

    Attributes
    ----------
    texels : int64[n]
        Indices into the texture.
    here, there : int64[n, 3]
        Corners of the two faces at the nearest seam among the unwrapped vertices: both ends, and the third
        one. The texels lie beyond the face ``here``.
    faces : int64[n]
        The faces ``there``.
    """

    texels: Int64Array
    here: Int64Array
    there: Int64Array
    faces: Int64Array

    @classmethod
    def of(
        cls, seams: Seams, rows: Int64Array, places: Float64Array, number: int, tile: int, size: int
    ) -> "Beyond":
        """Return the texels along the seams of mesh ``number`` on a texture; points are `Seams.points`."""
        found = []
        for side in (0, 1):
            own = np.flatnonzero((seams.meshes[rows] == number) & (seams.tiles[rows, side] == tile))
            at = places[own, side]
            texels = bilinear_texels(at, np.zeros(len(own), np.int64), size)
            columns, lines = texels % size + 0.5 - at[:, :1], texels // size + 0.5 - at[:, 1:]
            away = np.minimum((columns**2 + lines**2) * FINENESS, FINENESS * MAX_SQUARE - 1)
            keys = texels * (FINENESS * MAX_SQUARE) + away.astype(np.int64)
            found.append((keys.reshape(-1), np.repeat(2 * rows[own] + side, texels.shape[1])))
        keys, edges = (np.concatenate(each) for each in zip(*found, strict=True))
        order = stable_order(keys)
        texels = keys[order] // (FINENESS * MAX_SQUARE)
        first = np.flatnonzero(np.diff(texels, prepend=-1))
        edge, here = np.divmod(edges[order[first]], 2)
        corners = seams.corners
        return cls(texels[first], corners[edge, here], corners[edge, 1 - here], seams.faces[edge, 1 - here])

    def chosen(self, rows: Int32Array) -> "Beyond":
        """Return some of the texels."""
        return Beyond(*(each[rows] for each in self))
