"""Where creases truly are, in float64, for shapes made of balls and cylinders."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Circle:
    """Where two spheres meet."""

    center: Floats
    axis: Floats
    radius: float

    def distances(self, points: ArrayLike) -> Floats:
        """Of `points` (n, 3) to the circle."""
        offsets = np.asarray(points, np.float64) - self.center
        heights = offsets @ self.axis
        radii = np.linalg.norm(offsets - heights[:, None] * self.axis, axis=1)
        return np.hypot(heights, radii - self.radius)


def circle(center: ArrayLike, radius: float, other_center: ArrayLike, other_radius: float) -> Circle:
    """The circle that two spheres have in common."""
    a, b = np.asarray(center, np.float64), np.asarray(other_center, np.float64)
    distance = float(np.linalg.norm(b - a))
    along = (distance**2 + radius**2 - other_radius**2) / (2.0 * distance)
    axis = (b - a) / distance
    return Circle(a + along * axis, axis, float(np.sqrt(radius**2 - along**2)))


def meeting_points(centers: ArrayLike, radii: ArrayLike) -> Floats:
    """The two points (2, 3) that three spheres have in common."""
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


def to_two_surfaces(first: Floats, second: Floats, cosines: Floats) -> Floats:
    """Distances to the crease of two surfaces from those to the surfaces and the cosine between normals."""
    squares = first**2 + second**2 - 2.0 * cosines * first * second
    return np.asarray(np.sqrt(squares / (1.0 - cosines**2)))
