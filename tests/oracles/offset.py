"""First hits of rays on surfaces that heights move along their normals, by short steps in float64."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[Any]
Heights = Callable[[Array, Array], Array]
"""Heights at points of a surface with their normals."""


class SumOfBalls:
    """The surface where a sum of (1 − |p − c|²/s²)³ is ½, for balls (c, visible radius)."""

    def __init__(self, *balls: tuple[tuple[float, float, float], float]) -> None:
        self.centers = np.array([center for center, _ in balls], float)
        self.squares = np.array([radius for _, radius in balls]) ** 2 / (1 - 2 ** (-1 / 3))
        rng = np.random.default_rng(0)
        starts = self.centers[rng.integers(0, len(balls), 20_000)]
        ways = rng.normal(size=(20_000, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        low, high = np.zeros(len(ways)), np.full(len(ways), 3 * np.sqrt(self.squares.max()))
        for _ in range(40):
            middle = 0.5 * (low + high)
            inside = self.terms(starts + middle[:, None] * ways)[0] > 0.5
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        self.points = starts + low[:, None] * ways
        self.tree = cKDTree(self.points)

    def terms(self, points: Array) -> tuple[Array, Array, Array]:
        """Value, gradient and Hessian of the sum."""
        away = points[:, None] - self.centers
        left = np.maximum(1 - (away**2).sum(-1) / self.squares, 0)
        slope = -6 * left**2 / self.squares
        bend = 24 * left / self.squares**2
        hessian = (slope.sum(1)[:, None, None] * np.eye(3)) + np.einsum("nk,nki,nkj->nij", bend, away, away)
        return (left**3).sum(1), np.einsum("nk,nki->ni", slope, away), hessian

    def feet(self, points: Array) -> tuple[Array, Array, Array]:
        """Closest points, normals there, and signed distances, by Newton's method."""
        feet = self.points[self.tree.query(points)[1]]
        _, gradient, _ = self.terms(feet)
        factor = ((points - feet) * gradient).sum(1) / (gradient**2).sum(1)
        for _ in range(6):
            value, gradient, hessian = self.terms(feet)
            matrix = np.zeros((len(points), 4, 4))
            matrix[:, :3, :3] = np.eye(3) + factor[:, None, None] * hessian
            matrix[:, :3, 3] = matrix[:, 3, :3] = gradient
            right = np.column_stack([points - feet - factor[:, None] * gradient, 0.5 - value])
            step = np.linalg.solve(matrix, right[..., None])[..., 0]
            feet = feet + step[:, :3]
            factor = factor + step[:, 3]
        normals = -gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
        distances: Array = ((points - feet) * normals).sum(1)
        return feet, normals, distances

    def first_hits(
        self, origins: Array, ways: Array, heights: Heights, low: float, high: float, *, step: float
    ) -> Array:
        """Distances along unit rays to the surface moved by heights in [low, high]; inf for a miss."""

        def gaps(points: Array) -> Array:
            feet, normals, distances = self.feet(points)
            return np.asarray(distances - heights(feet, normals))

        slack = 0.05
        reach = float(np.linalg.norm(self.points - self.points.mean(0), axis=1).max()) + high + slack
        middle = ((self.points.mean(0) - origins) * ways).sum(1)
        times = middle[:, None] + np.arange(-reach, reach, step)
        points = origins[:, None] + times[..., None] * ways[:, None]
        limit = max(high, -low) + slack
        near = self.tree.query(points.reshape(-1, 3), distance_upper_bound=limit)[0]
        inside = self.terms(points.reshape(-1, 3))[0] > 0.5
        gap = np.where(inside, -1.0, 1.0)
        rows = np.flatnonzero(np.isfinite(near))
        gap[rows] = gaps(points.reshape(-1, 3)[rows])
        met = (gap <= 0).reshape(times.shape)
        first = met.argmax(1)
        hit = met.any(1)
        rays = np.arange(len(ways))
        after = times[rays, first]
        before = after - step
        for _ in range(14):
            half = 0.5 * (before + after)
            below = np.zeros(len(ways), bool)
            below[hit] = gaps(origins[hit] + half[hit, None] * ways[hit]) <= 0
            before, after = np.where(below, before, half), np.where(below, half, after)
        return np.where(hit, after, np.inf)
