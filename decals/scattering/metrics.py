"""Measures of how evenly points lie on a surface."""

from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from decals.scattering.neighbors import FacingTree

NEIGHBOR_REACH = 2.0
"""Largest distance of neighbours, in spacings."""


@dataclass(frozen=True)
class Spacing:
    """Measures of how evenly particles lie.

    Distances are straight, in units of the spacing that the density asks for, between particles within two
    spacings that face the same way: their normals' cosine is above `FACING_LIMIT`, the rule of decals.
    A particle alone on its side of a thin part has no such neighbour and is left out.

    Attributes
    ----------
    ideal
        Distance of neighbours if the visible area were one hexagonal tiling, sqrt(2 A / (sqrt(3) N)).
    mean
        Mean distance to the nearest neighbour.
    rho
        Least distance over the ideal one; 1 is the unreachable best (Lagae and Dutré 2008).
    cv
        Coefficient of variation of the distance to the nearest neighbour.
    cv6
        Coefficient of variation of the mean distance to six neighbours.
    ringed
        Share of the particles with six neighbours; the others lie at boundaries, tips and thin parts.
    """

    ideal: float
    mean: float
    rho: float
    cv: float
    cv6: float
    ringed: float = 1.0


def spacing_of_distances(distances: Float64Array, spacing: float) -> Spacing:
    """Measure the distances of each particle to its six nearest neighbours, ``[n, 6]``, ascending."""
    near = np.where(distances <= NEIGHBOR_REACH * spacing, distances, np.inf)
    nearest, six = near[:, 0], near.mean(axis=1)
    nearest, six = nearest[np.isfinite(nearest)], six[np.isfinite(six)]
    if len(nearest) == 0:
        return Spacing(spacing, np.inf, np.inf, 0.0, 0.0, 0.0)
    return Spacing(
        ideal=spacing,
        mean=float(nearest.mean()),
        rho=float(nearest.min()) / spacing,
        cv=_variation(nearest),
        cv6=_variation(six),
        ringed=len(six) / len(distances),
    )


def spacing_of_points(
    positions: Float32Array, normals: Float32Array, sizes: Float32Array, spacing: float
) -> Spacing:
    """Measure oriented points; `sizes` are the spacings asked for at each, and `spacing` a typical one."""
    tree = FacingTree(positions, normals)
    distances, indices = tree.nearest(positions, normals, count=6, skip_self=True)
    wide = sizes.astype(np.float64)
    distances /= 0.5 * (wide[:, None] + np.where(indices >= 0, wide[indices], 1.0))
    return spacing_of_distances(spacing * distances, spacing)


def ideal_spacing(area: float, count: int) -> float:
    """Return the distance of neighbours in a hexagonal tiling of an area."""
    return float(np.sqrt(2.0 * area / (np.sqrt(3.0) * max(count, 1))))


def _variation(values: Float64Array) -> float:
    return float(values.std() / values.mean()) if len(values) and values.mean() > 0 else 0.0
