"""Texels beyond seams: the surface goes on there as it does on the other side.

A program mixes texels from both sides of the border of a chart. Beyond a seam, texels show the surface on the
other side, turned about the seam into the plane of the face (`points_beyond`). Both sides of a seam then show
one picture, sampled at other places.
"""

from typing import NamedTuple

import numpy as np

from blobtree._typing import Int32Array, Int64Array
from decals.baking.seams import Seams


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
        cls,
        seams: Seams,
        texels: Int64Array,
        edges: Int64Array,
        sides: Int64Array,
        number: int,
        tile: int,
        size: int,
    ) -> "Beyond":
        """Return those of some texels beyond seams that belong to mesh ``number`` on one of the textures.

        ``edges`` and ``sides`` are the closest seam of each texel, and the side of it on which the texel is.
        """
        own = np.flatnonzero((texels // size**2 == tile) & (seams.meshes[edges] == number))
        edge, here = edges[own], sides[own]
        corners = seams.corners
        return cls(
            texels[own] % size**2, corners[edge, here], corners[edge, 1 - here], seams.faces[edge, 1 - here]
        )

    def chosen(self, rows: Int32Array) -> "Beyond":
        """Return some of the texels."""
        return Beyond(*(each[rows] for each in self))
