"""How evenly points lie on a surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decals.seeds.neighbours import FacingTree
from decals.surfaces.surface import Floats

BEYOND = 2.0
"""Particles farther than this many spacings are no neighbours when evenness is measured."""


@dataclass(frozen=True)
class Spacing:
    """How evenly particles lie.

    Distances are straight, in units of the spacing wished for there, between particles within two spacings
    that face the same way: their normals' cosine is above `FACING_LIMIT`, the rule by which decals act.
    A particle alone on its side of a thin part has no such neighbour; what it lacks is left out.

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
        Part of the particles that have six neighbours: the others lie on rims, tips and thin parts.
    """

    ideal: float
    mean: float
    rho: float
    cv: float
    cv6: float
    ringed: float = 1.0


def evenness(distances: NDArray[np.float64], spacing: float) -> Spacing:
    """Figures of the distances of each particle to its six nearest neighbours, ``[n, 6]``, ascending."""
    near = np.where(distances <= BEYOND * spacing, distances, np.inf)
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


def evenness_of(positions: Floats, normals: Floats, sizes: Floats, spacing: float) -> Spacing:
    """Figures of oriented points where `sizes` are the spacings wished for, and `spacing` a typical one."""
    tree = FacingTree(positions, normals)
    distances, indices = tree.nearest(positions, normals, count=6, skip_self=True)
    wide = sizes.astype(np.float64)
    distances /= 0.5 * (wide[:, None] + np.where(indices >= 0, wide[indices], 1.0))
    return evenness(spacing * distances, spacing)


def ideal_spacing(area: float, count: int) -> float:
    """Distance of neighbours in the hexagonal tiling of an area by so many points."""
    return float(np.sqrt(2.0 * area / (np.sqrt(3.0) * max(count, 1))))


def _variation(values: NDArray[np.float64]) -> float:
    return float(values.std() / values.mean()) if len(values) and values.mean() > 0 else 0.0
