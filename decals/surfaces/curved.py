"""Meshes of curved surfaces whose area is that of the surface, not that of the triangles."""

import numpy as np

from blobtree import Mesh
from blobtree._typing import Float64Array
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.windings import MeshOrientation

LEAST_COSINE = 0.5
"""Cosine of the angle between a face and the normal of a corner, below which there is a crease between."""


class CurvedMesh(MeshSurface):
    """Mesh of a smooth surface whose vertices lie on it, with normals; samples are uniform on the surface.

    Small round parts lose some of their area to the chords of few triangles.
    """

    def __init__(self, mesh: Mesh, *, device: str) -> None:
        super().__init__(mesh.vertices, mesh.faces, device=device, orientation=MeshOrientation.KEEP)
        self._cumulative = np.cumsum(_curved_areas(mesh)[self.sound])


def _curved_areas(mesh: Mesh) -> Float64Array:
    """Return the areas (n,) of the surface above the faces.

    Four triangles between the corners and the middles of curved edges (Vlachos et al. 2001, *Curved PN
    triangles*) have a quarter of a face's error, and the rest is extrapolated (Richardson 1911).
    """
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    normals = mesh.normals.astype(np.float64)[mesh.faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(crosses, axis=1)
    own = crosses / np.maximum(doubled, 1e-300)[:, None]
    creased = np.einsum("nij,nj->ni", normals, own) < LEAST_COSINE
    if mesh.sheet_counts is not None:
        creased |= mesh.sheet_counts[mesh.faces] != 1
    normals = np.where(creased[:, :, None], own[:, None], normals)
    following = np.roll(corners, -1, axis=1)
    edges = following - corners
    rise = np.einsum("nij,nij->ni", edges, normals)[:, :, None] * normals
    next_normals = np.roll(normals, -1, axis=1)
    fall = np.einsum("nij,nij->ni", edges, next_normals)[:, :, None] * next_normals
    middles = 0.5 * (corners + following) + 0.125 * (fall - rise)
    before = np.roll(middles, 1, axis=1)
    outer = np.linalg.norm(np.cross(middles - corners, before - corners), axis=2).sum(axis=1)
    inner = np.linalg.norm(np.cross(middles[:, 1] - middles[:, 0], middles[:, 2] - middles[:, 0]), axis=1)
    divided = 0.5 * (outer + inner)
    areas: Float64Array = divided + (divided - 0.5 * doubled) / 3.0
    return areas
