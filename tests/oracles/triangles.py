"""Closest points and ray hits of triangles by brute force, in float64."""

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array


def closest_points(points: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> Float64Array:
    """Distance of each point to the nearest triangle: inside the triangle's prism, or on one of its edges."""
    points, corners = np.asarray(points, float), np.asarray(vertices, float)[np.asarray(faces)]
    best = np.full(len(points), np.inf)
    for a, b, c in corners:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        inside = np.ones(len(points), bool)
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= (points - start) @ np.cross(normal, end - start) >= 0
            along = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
            best = np.minimum(best, np.linalg.norm(points - start - along[:, None] * (end - start), axis=1))
        best = np.where(inside, np.minimum(best, np.abs((points - a) @ normal)), best)
    return best


def first_hits(
    origins: Float64Array, directions: Float64Array, vertices: ArrayLike, faces: ArrayLike
) -> Float64Array:
    """Distance along unit directions to the nearest triangle, from either side; infinity for a miss."""
    best = np.full(len(origins), np.inf)
    for a, b, c in np.asarray(vertices, float)[np.asarray(faces)]:
        normal = np.cross(b - a, c - a)
        steep = directions @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((a - origins) @ normal) / steep
            q = origins + t[:, None] * directions
            inside = t >= 0
            for start, end in ((a, b), (b, c), (c, a)):
                inside &= (q - start) @ np.cross(normal, end - start) >= 0
        best = np.where(inside, np.fmin(best, t), best)
    return best
