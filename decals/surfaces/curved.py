"""Meshes of curved surfaces whose area is that of the surface, not that of the triangles."""

from typing import Any

import numpy as np

from blobtree import Mesh
from blobtree._typing import Float64Array, Int64Array
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.windings import MeshOrientation, Triangles, Windings

LEAST_COSINE = 0.5
"""Cosine of the angle between a face and the normal of a corner, below which there is a crease between."""


class CurvedMesh(MeshSurface):
    """Mesh that `polygonize` made, with the area of the surface on which its vertices lie.

    Samples are uniform by that area. Small round parts lose some of it to the chords of few triangles.
    """

    def __init__(self, mesh: Mesh, *, device: str) -> None:
        super().__init__(mesh.vertices, mesh.faces, device=device, orientation=MeshOrientation.KEEP)
        self._cumulative = np.cumsum(_curved_areas(mesh)[self.sound])

    def _same_vertices(self) -> Int64Array:
        """Return each vertex as its own."""
        return np.arange(len(self.vertices))

    def _windings(self, _triangles: Triangles, _rule: MeshOrientation) -> Windings:
        """Return no faces to turn: the mesh is closed and winds alike."""
        none = np.zeros(len(self.faces), np.bool_)
        return Windings(none, none, none, 0, 0)

    def __getstate__(self) -> dict[str, Any]:
        return super().__getstate__() | {"areas": self._cumulative}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._cumulative = state["areas"]


def _curved_areas(mesh: Mesh) -> Float64Array:
    """Return the areas (n,) of the surface above the faces.

    Four triangles between the corners and the middles of curved edges (Vlachos et al. 2001, *Curved PN
    triangles*) have a quarter of a face's error, and the rest is extrapolated (Richardson 1911).
    """
    corners = [mesh.vertices[column].astype(np.float64) for column in mesh.faces.T]
    flat = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    area = 0.5 * np.sqrt(_dot(flat, flat))
    flat /= np.maximum(2.0 * area, 1e-300)[:, None]
    normals = []
    for column in mesh.faces.T:
        own = mesh.normals[column].astype(np.float64)
        creased = _dot(own, flat) < LEAST_COSINE
        if mesh.sheet_counts is not None:
            creased |= mesh.sheet_counts[column] != 1
        normals.append(np.where(creased[:, None], flat, own))
    middles = []
    for a in range(3):
        b = (a + 1) % 3
        edge = corners[b] - corners[a]
        bulge = _dot(edge, normals[b])[:, None] * normals[b] - _dot(edge, normals[a])[:, None] * normals[a]
        middles.append(0.5 * (corners[a] + corners[b]) + 0.125 * bulge)
    divided = _area(*middles)
    for a in range(3):
        divided += _area(corners[a], middles[a], middles[a - 1])
    areas: Float64Array = divided + (divided - area) / 3.0
    return areas


def _dot(first: Float64Array, second: Float64Array) -> Float64Array:
    product: Float64Array = np.einsum("ij,ij->i", first, second)
    return product


def _area(a: Float64Array, b: Float64Array, c: Float64Array) -> Float64Array:
    """Return the areas of triangles with corners (n, 3)."""
    normal = np.cross(b - a, c - a)
    area: Float64Array = 0.5 * np.sqrt(_dot(normal, normal))
    return area
