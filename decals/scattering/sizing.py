"""Radii of decals: the rules, and those of touching decals and of the paper."""

from collections.abc import Callable
from enum import Enum
from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array
from blobtree.formulas.falloff import RIM
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree


class Sizing(Enum):
    """Rules for the radii of decals.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> ball = decals.surfaces.ImplicitSurface(Point((0, 0, 0), radius=1.0))
    >>> covering = decals.scatter(ball, count=40)
    >>> touching = decals.scatter(ball, count=40, sizing=decals.Sizing.TOUCHING)
    >>> bool(touching.radii.max() < covering.radii.min())
    True
    """

    COVERING = "covering"
    """Least radii that leave no gap."""
    TOUCHING = "touching"
    """Half the distance to the nearest neighbour: decals do not overlap."""
    DELAUNAY = "delaunay"
    """The paper's rule: the field ends at the farthest Delaunay neighbour. It leaves small gaps."""


EXPECTED_RADIUS = 0.6
"""Radius of a decal before it is measured, in spacings: that of a hexagonal tiling without gaps."""

WithNormals: TypeAlias = Callable[[OrientedPoints, Float32Array], OrientedPoints]
"""A function of centres and spacings there, to the centres with the normals of decals."""

Rule: TypeAlias = Callable[
    [Domain, OrientedPoints, Float32Array, BoolArray, OrientedPoints, WithNormals, int],
    tuple[OrientedPoints, Float64Array],
]
"""A function of a domain, of centres, with their spacings and True for those that may move, of samples of the
surfaces, of the normals of decals, and of a seed, to the decals and their radii."""


def touching_radii(decals: OrientedPoints) -> Float64Array:
    """Return half the distance to the nearest facing decal; the median radius without such a decal."""
    tree = FacingTree(decals.positions, decals.normals)
    nearest = tree.nearest(decals.positions, decals.normals, skip_self=True)[0][:, 0]
    return _with_median(0.5 * nearest)


def delaunay_radii(decals: OrientedPoints, samples: OrientedPoints) -> Float64Array:
    """Return radii by the paper's rule (section 3.3): influence up to the farthest Delaunay neighbour.

    Two decals are neighbours in the surface's own Delaunay triangulation if their Voronoi cells meet: if a
    sample is nearest to the one and next nearest to the other.
    """
    tree = FacingTree(decals.positions, decals.normals)
    nearest = tree.nearest(samples.positions, samples.normals, count=2)[1]
    pairs = nearest[(nearest >= 0).all(axis=1)]
    starts, ends = decals.positions[pairs[:, 0]], decals.positions[pairs[:, 1]]
    lengths = np.linalg.norm(starts.astype(np.float64) - ends, axis=1)
    farthest = np.full(len(decals), -np.inf)
    for side in (0, 1):
        np.maximum.at(farthest, pairs[:, side], lengths)
    return float(RIM) * _with_median(farthest)


def _with_median(radii: Float64Array) -> Float64Array:
    """Replace values that are not finite or not above zero by the median of the others, or 1."""
    valid = np.isfinite(radii) & (radii > 0)
    return np.where(valid, radii, float(np.median(radii[valid])) if valid.any() else 1.0)
