"""Exact creases of balls and cylinders, in float64."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array


@dataclass(frozen=True)
class Circle:
    """The intersection of two spheres."""

    center: Float64Array
    axis: Float64Array
    radius: float

    def distances(self, points: ArrayLike) -> Float64Array:
        """Return the distances (n,) of `points` (n, 3) to the circle."""
        offsets = np.asarray(points, np.float64) - self.center
        heights = offsets @ self.axis
        radii = np.linalg.norm(offsets - heights[:, None] * self.axis, axis=1)
        return np.asarray(np.hypot(heights, radii - self.radius))


def circle(center: ArrayLike, radius: float, other_center: ArrayLike, other_radius: float) -> Circle:
    """Return the circle that two spheres have in common."""
    a, b = np.asarray(center, np.float64), np.asarray(other_center, np.float64)
    distance = float(np.linalg.norm(b - a))
    along = (distance**2 + radius**2 - other_radius**2) / (2.0 * distance)
    axis = (b - a) / distance
    return Circle(a + along * axis, axis, float(np.sqrt(radius**2 - along**2)))


def sphere_intersections(centers: ArrayLike, radii: ArrayLike) -> Float64Array:
    """Return the two points (2, 3) that three spheres have in common."""
    a, b, c = np.asarray(centers, np.float64)
    r, s, t = np.asarray(radii, np.float64)
    x = (b - a) / np.linalg.norm(b - a)
    i = x @ (c - a)
    y = (c - a) - i * x
    y /= np.linalg.norm(y)
    d, j = np.linalg.norm(b - a), y @ (c - a)
    p = (r**2 - s**2 + d**2) / (2.0 * d)
    q = (r**2 - t**2 + i**2 + j**2) / (2.0 * j) - i / j * p
    height = np.sqrt(r**2 - p**2 - q**2)
    middle = a + p * x + q * y
    return np.array([middle + height * np.cross(x, y), middle - height * np.cross(x, y)])


def distance_to_crease(first: Float64Array, second: Float64Array, cosines: Float64Array) -> Float64Array:
    """Return distances to the crease of two surfaces from those to the surfaces and the normals' cosine."""
    squares = first**2 + second**2 - 2.0 * cosines * first * second
    return np.asarray(np.sqrt(squares / (1.0 - cosines**2)))
