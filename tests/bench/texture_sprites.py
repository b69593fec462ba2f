"""Texture sprites (Lefebvre, Hornus and Neyret 2005, "Texture Sprites: Texture Elements Splatted on
Surfaces"), for the comparison of methods.

A sprite is a box around a point of the surface, with planar coordinates. A tree of voxels lists the sprites
whose boxes reach into each leaf, at most eight. A voxel with more is divided, down to a quarter of the
smallest radius. A point shows the last sprite of its leaf whose box contains it and that faces it.

The tree divides voxels in two along each axis. Full leaves keep the last sprites, which are drawn on top:
the best choice for opaque ones. The test of box and voxel leaves out the axes of crossed edges, so a few
leaves list a sprite too many. Left out: deformed sprites, blending modes, and animation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals import Decals
from tests.bench.clipped_decals import box_coordinates
from tests.bench.paper_octree import LEAF_DECALS, MAX_DEPTH, Octree

Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.int64]
SMALLEST = 0.25
"""Side of the smallest voxel over the smallest radius, at least."""

RECORD_BYTES = 64
"""Position, frame, size and image of a sprite."""


@dataclass(frozen=True)
class Sprites:
    """Decals as sprites, and the tree of their boxes."""

    decals: Decals
    tree: Octree

    @classmethod
    def of(cls, decals: Decals) -> "Sprites":
        """Insert the boxes of all decals: cubes with sides of twice the radius."""
        centres, radii = decals.positions.astype(np.float64), decals.radii.astype(np.float64)
        frames = np.stack([decals.tangents, decals.bitangents, decals.normals], axis=1).astype(np.float64)
        reach = radii * np.abs(frames).sum(axis=1).max(axis=1)
        size = float(((centres + reach[:, None]).max(axis=0) - (centres - reach[:, None]).min(axis=0)).max())
        depth = int(np.clip(np.floor(np.log2(size / (SMALLEST * radii.min()))), 0, MAX_DEPTH))

        def touches(sprite: IndexArray, low: Float64Array, width: float) -> NDArray[np.bool_]:
            half, r = width / 2, radii[sprite, None]
            offset = centres[sprite] - low - half
            extent = np.abs(frames[sprite])
            along = np.abs(np.einsum("nki,ni->nk", frames[sprite], offset))
            result: NDArray[np.bool_] = (np.abs(offset) <= half + r * extent.sum(axis=1)).all(axis=1)
            result &= (along <= r + half * extent.sum(axis=2)).all(axis=1)
            return result

        return cls(decals, Octree.build(centres, reach, depth=depth, touches=touches, last=True))

    @property
    def nbytes(self) -> int:
        """Memory of the tree, whose eight textures have one value for each voxel, and of the records."""
        return self.tree.bytes + RECORD_BYTES * len(self.decals)

    @property
    def leaves(self) -> float:
        """Leaves that list a sprite, on average: those to write when one is removed or inserted."""
        return float((self.tree.decals[self.tree.children < 0] >= 0).sum() / len(self.decals))

    def shown(self, points: Float64Array, normals: Float64Array) -> tuple[IndexArray, float]:
        """Return the sprite at each point (−1: none), and the voxels read for a point on average."""
        listed, steps = self.tree.find(points)
        flat = listed.reshape(-1)
        many = (np.repeat(array, LEAF_DECALS, axis=0) for array in (points, normals))
        covered = covers(self.decals, flat, *many) & (flat >= 0)
        owner: IndexArray = np.where(covered, flat, -1).reshape(-1, LEAF_DECALS).max(axis=1)
        return owner, float(steps.mean())


def covers(
    decals: Decals, decal: IndexArray, points: Float64Array, normals: Float64Array
) -> NDArray[np.bool_]:
    """Return whether points lie in the boxes of decals that face them."""
    inside = (np.abs(box_coordinates(decals, decal, points[:, None])[:, 0]) <= 1).all(axis=1)
    result: NDArray[np.bool_] = inside & ((decals.normals[decal] * normals).sum(axis=1) > 0)
    return result


def shown_by_all(
    decals: Decals, points: Float64Array, normals: Float64Array
) -> tuple[IndexArray, IndexArray]:
    """Return the last sprite of all at each point (−1: none), and the number of sprites there."""
    owner, count = np.full(len(points), -1, np.int64), np.zeros(len(points), np.int64)
    reach = np.sqrt(3.0) * decals.radii.astype(np.float64)
    for decal, near in enumerate(cKDTree(points).query_ball_point(decals.positions, reach)):
        some = np.asarray(near, np.int64)
        some = some[covers(decals, np.full(len(some), decal), points[some], normals[some])]
        owner[some] = decal
        count[some] += 1
    return owner, count
