"""Where one would otherwise get texture coordinates from: where each way puts a point in a decal's image."""

from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.field.evaluate import evaluate
from decals.field.mapping import Mapping
from decals.model import Decals
from tests.bench.on_meshes import Locator, SmoothMesh

Doubles = NDArray[np.float64]
Ints = NDArray[np.intp]


def frame_at(mesh: SmoothMesh, vertex: int) -> Doubles:
    """Axes of the tangent plane at a vertex, and the normal: rows of f64[3, 3]."""
    normal = mesh.normals(mesh.vertices[vertex : vertex + 1])[0]
    u = np.cross(normal, [0.36, 0.48, 0.8])
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u), normal])


def planar(mesh: SmoothMesh, vertex: int, points: Doubles, radius: float) -> Doubles:
    """Place in the box of a mesh-clipped decal; linear in each triangle, so the clipped mesh has the same."""
    return (points - mesh.vertices[vertex]) @ frame_at(mesh, vertex)[:2].T


def drawn(mesh: SmoothMesh, vertex: int, points: Doubles, radius: float, **options: Any) -> Doubles:
    """What our decal pass draws."""
    u, _, normal = frame_at(mesh, vertex)
    one = Decals(mesh.vertices[vertex : vertex + 1], [normal], [u], [radius])
    uv = evaluate(one, points, mesh.normals(points), device="cpu", **options).uv
    return 2 * radius * (uv.astype(np.float64) - 0.5)


def drawn_by_chord(mesh: SmoothMesh, vertex: int, points: Doubles, radius: float) -> Doubles:
    """The paper's own mapping."""
    return drawn(mesh, vertex, points, radius, mapping=Mapping.CHORD)


def interpolated(mesh: SmoothMesh, vertex: int, points: Doubles, radius: float) -> Doubles:
    """Our texture coordinates at the vertices alone, linear between them."""
    near = np.linalg.norm(mesh.vertices - mesh.vertices[vertex], axis=1) < 1.5 * radius
    at = np.zeros((len(mesh.vertices), 2))
    at[near] = drawn(mesh, vertex, mesh.vertices[near], 2 * radius)
    return Locator(mesh.vertices, mesh.faces).interpolate(at, points)


@dataclass
class LogMaps:
    """potpourri3d's log maps by the affine heat method.

    `AffineLocal` is its default. `AffineAdaptive` was no more exact here and factors a matrix a decal;
    `VectorHeat` is about as fast, and errs by 7 to 11 % on decals a tenth of the model's size.
    """

    module: Any
    version: str

    def solver(self, vertices: Any, faces: Any) -> Any:
        """Set a mesh up; the first log map sets up the rest."""
        return self.module.MeshVectorHeatSolver(
            np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces)
        )

    def log_map(self, solver: Any, vertex: int) -> Doubles:
        """Log map at all vertices, in the solver's own frame."""
        result: Doubles = solver.compute_log_map(int(vertex), strategy="AffineLocal")
        return result

    def offsets(self, mesh: SmoothMesh, vertex: int, points: Doubles, radius: float) -> Doubles:
        """Interpolated log map, turned into our frame."""
        solver = self._solver_of(mesh)
        x, y, _ = (np.asarray(axis)[vertex] for axis in solver.get_tangent_frames())
        flat = self.log_map(solver, vertex)
        world = flat[:, :1] * x + flat[:, 1:] * y
        return Locator(mesh.vertices, mesh.faces).interpolate(world @ frame_at(mesh, vertex)[:2].T, points)

    def _solver_of(self, mesh: SmoothMesh) -> Any:
        known = getattr(self, "_known", None)
        if known is None or known[0] is not mesh:
            known = self._known = mesh, self.solver(mesh.vertices, mesh.faces)
        return known[1]


def log_maps() -> LogMaps | None:
    """potpourri3d; None where it is not installed."""
    try:
        return LogMaps(import_module("potpourri3d"), version("potpourri3d"))
    except (ImportError, PackageNotFoundError, OSError):
        return None
