"""Meshes whose smooth surface and log maps are known, and values interpolated over triangles."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tests.decals.field import log_maps as analytic
from tests.decals.shapes import torus

Doubles = NDArray[np.float64]
Ints = NDArray[np.intp]
NEAREST = 12


@dataclass(frozen=True)
class SmoothMesh:
    """A mesh whose vertices lie on a smooth surface, and that surface's gradient."""

    vertices: Doubles
    faces: Ints
    gradient: Callable[[Doubles], Doubles]

    def normals(self, points: Doubles) -> Doubles:
        """Unit normals of the smooth surface."""
        return analytic.unit(self.gradient(points))

    def discs(
        self, rng: np.random.Generator, centres: Ints, radius: float, count: int
    ) -> tuple[Doubles, Doubles]:
        """Points around vertices, and their log maps, out to a radius: f64[c, count, 3] each.

        Geodesics are integrated, of evenly spread lengths and directions.
        """
        start = np.repeat(self.vertices[centres], count, axis=0)
        away = analytic.tangents(rng, self.normals(start))
        length = rng.uniform(0, radius, (len(start), 1))
        ends = analytic.walk(self.gradient, start, away, length)
        shape = len(centres), count, 3
        return ends.reshape(shape), (away * length).reshape(shape)


def torus_mesh(*, rows: int = 316) -> SmoothMesh:
    """Torus of radii 1 and 0.4, 100,000 faces."""
    shape = torus(rows=rows, columns=rows // 2)
    return SmoothMesh(shape.vertices.astype(np.float64), shape.faces.astype(np.intp), analytic.torus_gradient)


def ellipsoid_mesh(*, level: int = 6) -> SmoothMesh:
    """Ellipsoid of axes 1, 0.7 and 0.45, 82,000 faces."""
    ball = pv.Icosphere(nsub=level)
    vertices = analytic.unit(np.asarray(ball.points, np.float64)) * analytic.AXES
    return SmoothMesh(vertices, ball.regular_faces.astype(np.intp), analytic.ellipsoid_gradient)


class Locator:
    """Finds the triangle next to a point near the mesh, and the point's weights there."""

    def __init__(self, vertices: Doubles, faces: Ints) -> None:
        self._corners, self._faces = vertices[faces], faces
        self._tree = cKDTree(self._corners.mean(axis=1))

    def find(self, points: Doubles) -> tuple[Ints, Doubles]:
        """Vertices int[n, 3] of the triangles, and weights f64[n, 3]."""
        near = self._tree.query(points, k=NEAREST)[1]
        a, b, c = np.moveaxis(self._corners[near], 2, 0)
        e1, e2, w = b - a, c - a, points[:, None] - a
        d11, d12, d22 = _dots(e1, e1), _dots(e1, e2), _dots(e2, e2)
        d1, d2, area = _dots(w, e1), _dots(w, e2), d11 * d22 - d12 * d12
        v, u = (d22 * d1 - d12 * d2) / area, (d11 * d2 - d12 * d1) / area
        weights = np.stack([1 - v - u, v, u], axis=2)
        best = weights.min(axis=2).argmax(axis=1)
        rows = np.arange(len(points))
        return self._faces[near[rows, best]], weights[rows, best]

    def interpolate(self, values: Any, points: Doubles) -> Doubles:
        """Values per vertex [v, k], linear over the triangles, at points."""
        vertices, weights = self.find(points)
        result: Doubles = np.einsum("nc,nck->nk", weights, np.asarray(values)[vertices])
        return result


def _dots(a: Doubles, b: Doubles) -> Doubles:
    result: Doubles = (a * b).sum(axis=-1)
    return result
