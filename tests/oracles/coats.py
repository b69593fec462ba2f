"""What a coat of decals must be, checked pair by pair in float64."""

import numpy as np

FACING_LIMIT = -0.25


def covered(decals, points, normals):
    """Whether each oriented point lies within the radius of a decal that faces it."""
    result = np.zeros(len(points), bool)
    places, facing = np.asarray(points, float), np.asarray(normals, float)
    for position, normal, radius in zip(decals.positions, decals.normals, decals.radii, strict=True):
        near = np.linalg.norm(places - position, axis=1) < radius
        result |= near & (facing @ normal > FACING_LIMIT)
    return result


def nearest_facing(positions, normals):
    """Distance of each oriented point to the nearest other one that faces the same way."""
    places = np.asarray(positions, float)
    distances = np.linalg.norm(places[:, None] - places[None], axis=2)
    distances[np.asarray(normals, float) @ np.asarray(normals, float).T <= FACING_LIMIT] = np.inf
    np.fill_diagonal(distances, np.inf)
    return distances.min(axis=1)


def rho(positions, normals, area):
    """Least distance over that of a hexagonal tiling of the area, d_min / (2 r_max)."""
    r_max = np.sqrt(area / (2 * np.sqrt(3) * len(positions)))
    return nearest_facing(positions, normals).min() / (2 * r_max)
