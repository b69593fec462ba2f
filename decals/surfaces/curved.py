"""Meshes of curved surfaces whose area is that of the surface, not that of the triangles."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from blobtree import Mesh
from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.space_curve import curve_keys
from decals.surfaces.windings import MeshOrientation, Triangles, Windings

LEAST_COSINE = 0.5
"""Cosine of the angle between a face and the normal of a corner, below which there is a crease between."""


FLAT_SPAN, SHARP_SPAN = np.radians(8.0), np.radians(25.0)
"""Angles between the normals at a face's corners: up to the first it is flat, from the second on it may cut
off an edge."""

DIVISIONS = 4
"""Parts of the sides of faces that cut off edges, whose corners move onto the surface."""

EDGE_HEIGHT = 0.6
"""Largest distance of an edge from a face that cuts it off, over the longest side of the face."""

HALVINGS = 6
"""Bisection steps up to the surface above or below a face."""

Inside = Callable[[Float32Array], BoolArray]
"""True for each of the points[n, 3] where the field is at least the iso value."""


class CurvedMesh(MeshSurface):
    """Mesh that `polygonize` made, with the area of the surface on which its vertices lie.

    Samples are uniform by that area: small round parts lose some of it to the chords of few triangles, and
    sharp edges to the triangles that cut them off. Faces follow a curve through space, so each part gets its
    share of few samples.
    """

    def __init__(self, mesh: Mesh, inside_of: Inside, *, device: str) -> None:
        mesh = replace(mesh, faces=mesh.faces[np.argsort(curve_keys(mesh.vertices[mesh.faces[:, 0]]))])
        super().__init__(mesh.vertices, mesh.faces, device=device, orientation=MeshOrientation.KEEP)
        areas = _curved_areas(mesh)
        sharp = _edge_faces(mesh)
        areas[sharp] = _areas_at_edges(mesh, sharp, inside_of)
        self._cumulative = np.cumsum(areas[self.sound])

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


def _edge_faces(mesh: Mesh) -> Int64Array:
    """Return the faces that bend far beside flat ones: they may cut off an edge that is no crease."""
    normals = mesh.normals[mesh.faces].astype(np.float64)
    spans = np.arccos(np.min([_dot(normals[:, a], normals[:, a - 1]) for a in range(3)], axis=0).clip(-1, 1))
    least = np.full(len(mesh.vertices), np.inf)
    np.minimum.at(least, mesh.faces, spans[:, None])
    beside_flat = (least[mesh.faces] < FLAT_SPAN).any(axis=1)
    return np.flatnonzero((spans > SHARP_SPAN) & beside_flat)


def _areas_at_edges(mesh: Mesh, faces: Int64Array, inside_of: Inside) -> Float64Array:
    """Return the areas (n,) of the surface above faces that cut off edges.

    Each face is divided, and the new corners move onto the surface, at right angles to the face.
    """
    corners = mesh.vertices[mesh.faces[faces]].astype(np.float64)
    longest = np.sqrt(np.max([_dot(*2 * [corners[:, a] - corners[:, a - 1]]) for a in range(3)], axis=0))
    ways = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ways *= (EDGE_HEIGHT * longest / np.maximum(np.sqrt(_dot(ways, ways)), 1e-300))[:, None]
    lattice = {
        (i, j): np.einsum("c,nci->ni", np.array([DIVISIONS - i - j, i, j]) / DIVISIONS, corners)
        for i in range(DIVISIONS + 1)
        for j in range(DIVISIONS + 1 - i)
    }
    for place in lattice.keys() - {(0, 0), (DIVISIONS, 0), (0, DIVISIONS)}:
        lattice[place] = _onto_surface(lattice[place], ways, inside_of)
    total = np.zeros(len(faces))
    for i in range(DIVISIONS):
        for j in range(DIVISIONS - i):
            total += _area(lattice[i, j], lattice[i + 1, j], lattice[i, j + 1])
            if i + j < DIVISIONS - 1:
                total += _area(lattice[i + 1, j + 1], lattice[i, j + 1], lattice[i + 1, j])
    return total


def _onto_surface(points: Float64Array, ways: Float64Array, inside_of: Inside) -> Float64Array:
    """Return where ways from points inside, or against them from points outside, cross the surface.

    Points whose ways cross no surface stay.
    """
    inside = inside_of(points.astype(np.float32))
    ways = np.where(inside[:, None], ways, -ways)
    crossing = np.flatnonzero(inside_of((points + ways).astype(np.float32)) != inside)
    starts, ways, inside = points[crossing], ways[crossing], inside[crossing]
    low, high = np.zeros(len(starts)), np.ones(len(starts))
    for _halving in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = inside_of((starts + middle[:, None] * ways).astype(np.float32)) == inside
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    moved = points.copy()
    moved[crossing] += (0.5 * (low + high))[:, None] * ways
    return moved


def _dot(first: Float64Array, second: Float64Array) -> Float64Array:
    product: Float64Array = np.einsum("ij,ij->i", first, second)
    return product


def _area(a: Float64Array, b: Float64Array, c: Float64Array) -> Float64Array:
    """Return the areas of triangles with corners (n, 3)."""
    normal = np.cross(b - a, c - a)
    area: Float64Array = 0.5 * np.sqrt(_dot(normal, normal))
    return area
