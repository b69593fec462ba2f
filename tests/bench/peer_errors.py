"""Errors of image coordinates of decals, by each method of `decal_peers`.

A method is a function of a mesh, a vertex of it as the centre, points around the vertex, and the radius. It
returns coordinates float64[n, 2] of the points in the frame of `frame_at`. They are compared with log maps
from integrated geodesics, on a torus and an ellipsoid.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals import Decals, ImageMapping, evaluate
from decals.field import Walks
from decals.surfaces import MeshSurface
from tests.bench import implicit_uvs
from tests.bench.exponential_maps import ExponentialMaps
from tests.decals.field import log_maps as analytic
from tests.decals.field import unfolding
from tests.decals.shapes import torus
from tests.vectors import unit

Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.intp]
Figures = dict[str, float]
NEAREST = 12
"""Triangles among which the one of a point is searched."""

RADII = {"large": 0.5, "small": 0.1}
"""Radii of the decals on the torus (tube 0.4) and the ellipsoid (1, 0.7, 0.45)."""


@dataclass(frozen=True)
class SmoothMesh:
    """A mesh with its vertices on a smooth surface, and that surface's field and its gradient's direction."""

    vertices: Float64Array
    faces: IndexArray
    gradient: Callable[[Float64Array], Float64Array]
    field: implicit_uvs.Field

    def normals(self, points: Float64Array) -> Float64Array:
        """Return unit normals of the smooth surface."""
        normals: Float64Array = unit(self.gradient(points))
        return normals

    def discs(
        self, rng: np.random.Generator, centres: IndexArray, radius: float, count: int
    ) -> tuple[Float64Array, Float64Array]:
        """Sample points around vertices, and their log maps, out to a radius: float64[c, count, 3] each.

        The points are ends of integrated geodesics of uniform lengths and directions.
        """
        start = np.repeat(self.vertices[centres], count, axis=0)
        directions = analytic.tangents(rng, self.normals(start))
        length = rng.uniform(0, radius, (len(start), 1))
        ends = analytic.walk(self.gradient, start, directions, length)
        shape = len(centres), count, 3
        return ends.reshape(shape), (directions * length).reshape(shape)


def torus_field(points: Float64Array) -> Float64Array:
    """Return signed distances of points from the torus of radii 1 and 0.4."""
    ring = np.hypot(points[:, 0], points[:, 1]) - 1
    result: Float64Array = np.hypot(ring, points[:, 2]) - 0.4
    return result


def ellipsoid_field(points: Float64Array) -> Float64Array:
    """Return a field that is zero on the ellipsoid of axes 1, 0.7 and 0.45, and not a distance elsewhere."""
    result: Float64Array = np.linalg.norm(points / analytic.AXES, axis=1) - 1
    return result


def torus_mesh(*, rows: int = 316) -> SmoothMesh:
    """Return a torus of radii 1 and 0.4 with 100,000 faces."""
    shape = torus(rows=rows, columns=rows // 2)
    return SmoothMesh(
        shape.vertices.astype(np.float64), shape.faces.astype(np.intp), analytic.torus_gradient, torus_field
    )


def ellipsoid_mesh(*, level: int = 6) -> SmoothMesh:
    """Return an ellipsoid of axes 1, 0.7 and 0.45 with 82,000 faces."""
    ball = pv.Icosphere(nsub=level)
    vertices = unit(np.asarray(ball.points, np.float64)) * analytic.AXES
    faces = ball.regular_faces.astype(np.intp)
    return SmoothMesh(vertices, faces, analytic.ellipsoid_gradient, ellipsoid_field)


class Locator:
    """Search for the triangle next to a point, and the point's barycentric weights."""

    def __init__(self, vertices: Float64Array, faces: IndexArray) -> None:
        self._corners, self._faces = vertices[faces], faces
        self._tree = cKDTree(self._corners.mean(axis=1))

    def find(self, points: Float64Array) -> tuple[IndexArray, Float64Array]:
        """Return the vertices int[n, 3] of the triangles, and the weights float64[n, 3]."""
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

    def interpolate(self, values: Any, points: Float64Array) -> Float64Array:
        """Return values per vertex [v, k], interpolated linearly at points."""
        vertices, weights = self.find(points)
        result: Float64Array = np.einsum("nc,nck->nk", weights, np.asarray(values)[vertices])
        return result


def _dots(a: Float64Array, b: Float64Array) -> Float64Array:
    result: Float64Array = (a * b).sum(axis=-1)
    return result


def frame_at(mesh: SmoothMesh, vertex: int) -> Float64Array:
    """Return two tangents and the normal at a vertex: rows of float64[3, 3]."""
    normal = mesh.normals(mesh.vertices[vertex : vertex + 1])[0]
    u = np.cross(normal, [0.36, 0.48, 0.8])
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u), normal])


def planar(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the coordinates of points in the box of a mesh-clipped decal.

    They are linear in each triangle, so those of the clipped mesh are equal.
    """
    coordinates: Float64Array = (points - mesh.vertices[vertex]) @ frame_at(mesh, vertex)[:2].T
    return coordinates


def implicit(
    mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float, **options: Any
) -> Float64Array:
    """Return the coordinates that the decal pass draws."""
    u, _, normal = frame_at(mesh, vertex)
    decal = Decals(mesh.vertices[vertex : vertex + 1], [normal], [u], [radius])
    uv = evaluate(decal, points, mesh.normals(points), device="cpu", **options).uv
    return 2 * radius * (uv.astype(np.float64) - 0.5)


def implicit_walked(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the coordinates that the decal pass draws by the walked mapping."""
    u, _, normal = frame_at(mesh, vertex)
    decal = Decals(mesh.vertices[vertex : vertex + 1], [normal], [u], [radius])
    walks = Walks.over(decal, [MeshSurface(mesh.vertices, mesh.faces)])
    return implicit(mesh, vertex, points, radius, mapping=ImageMapping.WALKED, walks=walks)


def by_walk_to_seed(
    mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float, *, steps: int = implicit_uvs.STEPS
) -> Float64Array:
    """Return the coordinates of Implicit UVs around one seed."""
    offsets = implicit_uvs.log_maps(mesh.field, points, mesh.vertices[vertex], steps=steps)
    coordinates: Float64Array = offsets @ frame_at(mesh, vertex)[:2].T
    return coordinates


def at_vertices(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the decal pass's coordinates at the vertices, interpolated linearly."""
    near = np.linalg.norm(mesh.vertices - mesh.vertices[vertex], axis=1) < 1.5 * radius
    values = np.zeros((len(mesh.vertices), 2))
    values[near] = implicit(mesh, vertex, mesh.vertices[near], 2 * radius)
    return Locator(mesh.vertices, mesh.faces).interpolate(values, points)


@dataclass
class LogMaps:
    """Log maps of potpourri3d by the affine heat method.

    The strategy is the default, `AffineLocal`. `AffineAdaptive` was not more exact and factors a matrix per
    decal. `VectorHeat` is about as fast, with errors of 7 to 11 % for decals of a tenth of the model's size.
    """

    module: Any
    version: str

    def solver(self, vertices: Any, faces: Any) -> Any:
        """Return the solver of a mesh; its first log map completes the set-up."""
        return self.module.MeshVectorHeatSolver(
            np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces)
        )

    def log_map(self, solver: Any, vertex: int) -> Float64Array:
        """Return the log map at all vertices, in the solver's frame."""
        result: Float64Array = solver.compute_log_map(int(vertex), strategy="AffineLocal")
        return result

    def offsets(self, mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
        """Return the interpolated log map, rotated into the frame of `frame_at`."""
        solver = self._solver_of(mesh)
        x, y, _ = (np.asarray(axis)[vertex] for axis in solver.get_tangent_frames())
        flat = self.log_map(solver, vertex)
        world = flat[:, :1] * x + flat[:, 1:] * y
        return Locator(mesh.vertices, mesh.faces).interpolate(world @ frame_at(mesh, vertex)[:2].T, points)

    def _solver_of(self, mesh: SmoothMesh) -> Any:
        cached = getattr(self, "_cached", None)
        if cached is None or cached[0] is not mesh:
            cached = self._cached = mesh, self.solver(mesh.vertices, mesh.faces)
        return cached[1]


def exponential_map(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the discrete exponential map of the vertices around a vertex, interpolated linearly."""
    maps = ExponentialMaps.of(mesh.vertices, mesh.faces, mesh.normals(mesh.vertices))
    reached, offsets = maps.map(vertex, 1.5 * radius)
    values = np.zeros((len(mesh.vertices), 2))
    values[reached] = offsets @ frame_at(mesh, vertex)[:2].T
    return Locator(mesh.vertices, mesh.faces).interpolate(values, points)


def potpourri() -> LogMaps | None:
    """Return the log maps of potpourri3d, or None if it is not installed."""
    try:
        return LogMaps(import_module("potpourri3d"), version("potpourri3d"))
    except (ImportError, PackageNotFoundError, OSError):
        return None


@cache
def errors_of(offsets: Callable[[SmoothMesh, int, Any, float], Any], decals: int = 6) -> Figures:
    """Return the RMS errors against the log map over the radius, on both surfaces and for both radii."""
    results: Figures = {}
    for name, mesh in (("torus", torus_mesh()), ("ellipsoid", ellipsoid_mesh())):
        for size, radius in RADII.items():
            rng = np.random.default_rng(0)
            centres = rng.integers(0, len(mesh.vertices), decals)
            points, logs = mesh.discs(rng, centres, radius, 300)
            squares = [
                ((offsets(mesh, vertex, q, radius) - log @ frame_at(mesh, vertex)[:2].T) ** 2).sum(1)
                for vertex, q, log in zip(centres.tolist(), points, logs, strict=True)
            ]
            results[f"{name}_{size}"] = float(np.sqrt(np.mean(squares)) / radius)
    return results


def bumpy_error(seed: int) -> float:
    """Return the RMS error of Implicit UVs on the bumpy sphere, over the radius."""

    def field(points: Float64Array) -> Float64Array:
        waves = np.sin(unfolding.WAVES * points).prod(axis=1)
        result: Float64Array = np.linalg.norm(points, axis=1) - 1 - unfolding.BUMPS * waves
        return result

    patch = unfolding.bumpy(seed, 0.5, level=1)
    frame = np.stack([np.ravel(patch.tangent), np.cross(patch.normal, np.ravel(patch.tangent))])
    found = implicit_uvs.log_maps(field, patch.points, patch.centre) @ frame.T
    return unfolding.rms(np.linalg.norm(found - patch.log, axis=1)) / 0.5


def edge_field(points: Float64Array) -> Float64Array:
    """Return a field that is zero on two faces, whose edge at x = 0.3 has an angle of 90°."""
    result: Float64Array = np.maximum(points[:, 0] - 0.3, points[:, 2])
    return result
