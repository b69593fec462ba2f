"""Signed distances of a grid's points to a triangle mesh, in a band around it."""

import sys
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Float32Array, Float64Array, FloatArray, Int32Array
from blobtree.device import known_device, launch
from blobtree.errors import InvalidNode
from blobtree.sampling.distance_kernels import measure_distances

COARSE = 4
"""Cells per cell of the coarse grid, which finds the points near the mesh."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """A triangle mesh: vertices (n, 3) and corner indices (m, 3)."""

    vertices: Float32Array
    faces: Int32Array

    @cached_property
    def lower(self) -> Float64Array:
        """Lower corner of the box."""
        return np.asarray(self._corners.reshape(-1, 3).min(axis=0))

    @cached_property
    def upper(self) -> Float64Array:
        """Upper corner of the box."""
        return np.asarray(self._corners.reshape(-1, 3).max(axis=0))

    @property
    def _corners(self) -> Float64Array:
        corners: Float64Array = self.vertices[self.faces].astype(np.float64)
        return corners

    def closed(self) -> "Triangles":
        """Return this mesh with its faces outward.

        Raises
        ------
        InvalidNode
            An edge is not used by as many triangles in one direction as in the other.
        """
        _, weld = np.unique(self.vertices, axis=0, return_inverse=True)
        faces = weld.ravel()[self.faces].astype(np.int64)
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        low, high = np.minimum(starts, ends), np.maximum(starts, ends)
        keys, edge = np.unique(low * (len(weld) + 1) + high, return_inverse=True)
        balance = np.bincount(edge.ravel(), np.where(starts < ends, 1, -1), len(keys))
        open_edges = int((balance != 0).sum())
        if not len(faces):
            raise InvalidNode("mesh: expected triangles with three different corners, got none")
        if open_edges:
            raise InvalidNode(
                f"mesh: expected a closed surface, got {open_edges} edges with a hole or a turned triangle "
                "beside them; close it, or pass radius=… for a shell around it"
            )
        a, b, c = np.moveaxis(self._corners, 1, 0)
        turned = float((a * np.cross(b, c)).sum()) < 0.0
        return Triangles(self.vertices, np.ascontiguousarray(self.faces[:, ::-1])) if turned else self


def triangles_of(mesh: Any) -> Triangles:
    """Return the triangles of a mesh of pyvista, of an object with vertices and faces, or of two arrays.

    Raises
    ------
    InvalidNode
        The argument is none of these, has no triangles, or its arrays are wrong.
    """
    pyvista = sys.modules.get("pyvista")
    if pyvista is not None and isinstance(mesh, pyvista.DataSet):
        surface = mesh if isinstance(mesh, pyvista.PolyData) else mesh.extract_surface(algorithm=None)
        triangulated = surface.triangulate()
        return _checked(triangulated.points, triangulated.regular_faces)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces") and not isinstance(mesh, type):
        return _checked(mesh.vertices, mesh.faces)
    if isinstance(mesh, tuple | list) and len(mesh) == 2:
        return _checked(*mesh)
    raise InvalidNode(
        "mesh: expected a pyvista mesh, a mesh with vertices and faces, or a pair of arrays, "
        f"got {type(mesh).__name__}"
    )


def _checked(vertices: Any, faces: Any) -> Triangles:
    try:
        points, corners = np.asarray(vertices, np.float32), np.asarray(faces)
    except (TypeError, ValueError) as error:
        raise InvalidNode(f"mesh: expected arrays of numbers: {error}") from None
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise InvalidNode(f"mesh: expected finite vertices of shape (n, 3), got {points.shape}")
    if corners.ndim != 2 or corners.shape[1] != 3 or not len(corners) or corners.dtype.kind not in "iu":
        raise InvalidNode(
            "mesh: expected triangles as whole numbers of shape (m, 3), "
            f"got {corners.dtype} of shape {corners.shape}"
        )
    if corners.min() < 0 or corners.max() >= len(points):
        raise InvalidNode(
            f"mesh: expected indices from 0 to {len(points) - 1}, got {corners.min()} to {corners.max()}"
        )
    return Triangles(np.ascontiguousarray(points), np.ascontiguousarray(corners, np.int32))


class DistanceMeter:
    """A triangle mesh on the current device, to which distances are measured.

    They are below 0 inside a closed mesh if `solid`.
    """

    def __init__(self, triangles: Triangles, *, solid: bool) -> None:
        self._device, self._solid = known_device(), solid
        points: Any = wp.array(triangles.vertices, dtype=wp.vec3, device=self._device)
        indices: Any = wp.array(triangles.faces.reshape(-1), dtype=wp.int32, device=self._device)
        self._mesh = wp.Mesh(points=points, indices=indices, support_winding_number=solid)

    def measure(self, points: FloatArray, farthest: float) -> Float32Array:
        """Return the distances (n,) of points (n, 3), which must lie within `farthest` of the mesh."""
        distances: Any = wp.empty(len(points), dtype=wp.float32, device=self._device)
        queries: Any = wp.array(points.astype(np.float32), dtype=wp.vec3, device=self._device)
        inputs = [self._mesh.id, queries, farthest, self._solid]
        launch(measure_distances, len(points), inputs, [distances], self._device)
        result: Float32Array = distances.numpy()
        return result


def mesh_distances(
    triangles: Triangles, corner: Float64Array, step: float, counts: Any, *, farthest: float, solid: bool
) -> Float32Array:
    """Return distances (nx, ny, nz) of grid points from a mesh, at most `farthest`.

    They are below 0 inside a closed mesh if `solid`. A distance changes by at most the way between two
    points. So a coarse grid shows which points are far away, and the others are measured.
    """
    meter = DistanceMeter(triangles, solid=solid)
    reach = 2.0 * float(np.linalg.norm(step * np.asarray(counts)))
    nodes = [-(-int(count - 1) // COARSE) + 1 for count in counts]
    coarse = meter.measure(grid_points(corner, COARSE * step, nodes), reach).reshape(nodes)
    nearest = [
        np.minimum((np.arange(count) + COARSE // 2) // COARSE, node - 1)
        for count, node in zip(counts, nodes, strict=True)
    ]
    estimate = coarse[np.ix_(*nearest)].ravel()
    distances = np.clip(estimate, -farthest, farthest)
    near = np.abs(estimate) - COARSE * step * np.sqrt(3.0) <= farthest
    fine = meter.measure(grid_points(corner, step, counts)[near], reach)
    distances[near] = np.clip(fine, -farthest, farthest)
    result: Float32Array = distances.reshape(counts).astype(np.float32)
    return result


def grid_points(corner: Float64Array, step: float, counts: Any) -> Float64Array:
    """Return the points (n, 3) of a grid, the last axis fastest."""
    axes = [corner[axis] + step * np.arange(counts[axis]) for axis in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
