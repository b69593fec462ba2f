"""Tile trees (Lefebvre and Dachsbacher 2007, "TileTrees"), for the comparison of methods.

The leaves of an octree around the surface carry square texture tiles on their faces. A point is projected
onto the face next to its normal, along one axis, and reads one tile. A leaf is divided while two sheets of
surface fall onto the same part of a tile.

The surface is a set of samples. Two sheets are found where depths differ by more than the slope of one sheet
allows, in 16 × 16 parts of a tile. Left out: interpolation across tiles, the smaller tiles of even regions,
and packing of tiles into a map.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.int64]
PARTS = 16
"""Parts of a tile along each side, in which sheets are told apart."""

MAX_DEPTH = 10


@dataclass(frozen=True)
class TileTree:
    """Tiles around samples of a surface.

    Attributes
    ----------
    tile : int64[n]
        Tile of each sample.
    place : float64[n, 2]
        Place of each sample in its tile, in [0, 1]².
    cosine : float64[n]
        Area on the tile over area on the surface.
    width : float64[t]
        Side of each tile.
    voxels : int
        Inner voxels and leaves.
    reads : float
        Voxels read for a sample on average.
    """

    tile: IndexArray
    place: Float64Array
    cosine: Float64Array
    width: Float64Array
    voxels: int
    reads: float

    @classmethod
    def of(cls, points: Float64Array, normals: Float64Array, *, least: int = 0) -> "TileTree":
        """Divide the bounding cube of samples with unit normals, at least a number of times."""
        low = points.min(axis=0)
        size = float(np.ptp(points, axis=0).max()) * (1 + 1e-9)
        rows = np.arange(len(points))
        axis = np.abs(normals).argmax(axis=1)
        side = 2 * axis + (normals[rows, axis] < 0)
        others = np.array([[1, 2], [2, 0], [0, 1]])[axis]
        corner, level = np.zeros(points.shape, np.int64), np.zeros(len(points), np.int64)
        active, voxels = rows, 1
        for depth in range(MAX_DEPTH):
            scaled = (points[active] - low) / size * 2**depth
            corner[active], level[active] = scaled, depth
            local = scaled - corner[active]
            each = np.arange(len(active))
            part = (PARTS * local[each[:, None], others[active]]).astype(np.int64)
            voxel = np.unique(corner[active], axis=0, return_inverse=True)[1].reshape(-1)
            bucket = ((6 * voxel + side[active]) * PARTS + part[:, 0]) * PARTS + part[:, 1]
            order = np.argsort(bucket, kind="stable")
            first = np.flatnonzero(np.diff(bucket[order], prepend=-1))
            heights = local[each, axis[active]][order]
            spread = np.maximum.reduceat(heights, first) - np.minimum.reduceat(heights, first)
            several = voxel[order[first[spread > 2.0 / PARTS]]]  # slope √2 across a part's diagonal
            divided = np.unique(voxel if depth < least else several)
            if not len(divided):
                break
            voxels += 8 * len(divided)
            active = active[np.isin(voxel, divided)]
        keys = np.column_stack([level, corner, side])
        tiles, tile = np.unique(keys, axis=0, return_inverse=True)
        place = (points - low) / size * 2.0 ** level[:, None] - corner
        return cls(
            tile=tile.reshape(-1),
            place=place[rows[:, None], others],
            cosine=np.abs(normals[rows, axis]),
            width=size * 0.5 ** tiles[:, 0],
            voxels=voxels,
            reads=float(level.mean()) + 1,
        )

    def texels(self, density: float) -> float:
        """Return the texels of all tiles, with a border, for a number of texels per unit of length."""
        return float(((np.ceil(self.width * density) + 1) ** 2).sum())
