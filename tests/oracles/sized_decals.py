"""Coverage and spacing of decals, checked pair by pair in float64."""

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float64Array
from decals import Decals

FACING_LIMIT = -0.25


def covered(decals: Decals, points: ArrayLike, normals: ArrayLike) -> BoolArray:
    """True for each oriented point within the radius of a decal that faces it."""
    positions, facing = np.asarray(points, float), np.asarray(normals, float)
    result = np.zeros(len(positions), np.bool_)
    for position, normal, radius in zip(decals.positions, decals.normals, decals.radii, strict=True):
        near = np.linalg.norm(positions - position, axis=1) < radius
        result |= near & (facing @ normal > FACING_LIMIT)
    return result


def nearest_facing(positions: ArrayLike, normals: ArrayLike) -> Float64Array:
    """Distance of each oriented point to the nearest other one that faces the same way."""
    points = np.asarray(positions, float)
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    distances[np.asarray(normals, float) @ np.asarray(normals, float).T <= FACING_LIMIT] = np.inf
    np.fill_diagonal(distances, np.inf)
    nearest: Float64Array = distances.min(axis=1)
    return nearest


def rho(positions: ArrayLike, normals: ArrayLike, area: float) -> float:
    """Least distance over that of a hexagonal tiling of the area, d_min / (2 r_max)."""
    r_max = np.sqrt(area / (2 * np.sqrt(3) * len(np.asarray(positions))))
    return float(nearest_facing(positions, normals).min() / (2 * r_max))
