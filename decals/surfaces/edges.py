"""Edges of a mesh, vertices at the same place counting as one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decals.surfaces.mesh import MeshSurface

Wide = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Edges:
    """Edges of the faces that have area.

    Attributes
    ----------
    vertices
        Welded, ``float64[n, 3]``.
    ends
        Vertices of each edge, the lower first, ``int64[k, 2]``.
    counts
        How many faces each has, ``int64[k]``: 1 on a rim.
    normals
        Unit normals of the first and the last of them, ``float64[k, 2, 3]``.
    apexes
        Vertex of the first of them that is not on the edge, ``int64[k]``.
    """

    vertices: Wide
    ends: Rows
    counts: Rows
    normals: Wide
    apexes: Rows


def edges_of(surface: MeshSurface) -> Edges:
    """Weld vertices and collect edges; those without length are left out."""
    vertices, welded = np.unique(surface.vertices + np.float32(0), axis=0, return_inverse=True)
    corners = welded.reshape(-1)[surface.faces[surface.sound]].astype(np.int64)
    wide = vertices.astype(np.float64)
    a, b, c = np.moveaxis(wide[corners], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    apexes = np.roll(corners, -2, axis=1).reshape(-1)
    edges, which, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(which.reshape(-1), kind="stable")
    first, last = order[np.cumsum(counts) - counts], order[np.cumsum(counts) - 1]
    sides = np.stack([normals[first // 3], normals[last // 3]], axis=1)
    long = edges[:, 0] != edges[:, 1]
    return Edges(wide, edges[long], counts[long], sides[long], apexes[first][long])
