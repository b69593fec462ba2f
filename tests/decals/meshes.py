"""Small meshes for tests of surfaces and scattering, made with NumPy alone to run without other packages."""

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from decals.surfaces import MeshSurface


def icosphere(level: int) -> Any:
    """Vertices and outward faces of an icosahedron on the unit ball, each face divided in four so often."""
    golden = (1 + 5**0.5) / 2
    vertices = np.array([np.roll([0, a, b * golden], k) for a in (-1, 1) for b in (-1, 1) for k in range(3)])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    inward = np.linalg.det(vertices[faces]) < 0
    faces[inward] = faces[inward, ::-1]
    for _ in range(level):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, middles = np.unique(sides, axis=0, return_inverse=True)
        middles = len(vertices) + middles.reshape(-1, 3)
        halves = vertices[edges].sum(axis=1)
        vertices = np.concatenate([vertices, halves / np.linalg.norm(halves, axis=1, keepdims=True)])
        corners = [np.stack([faces[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
        faces = np.concatenate([*corners, middles])
    return vertices, faces


def sphere(radius: float = 1.0, center: Any = (0.0, 0.0, 0.0), level: int = 4) -> MeshSurface:
    vertices, faces = icosphere(level)
    return MeshSurface(radius * vertices + np.asarray(center), faces)


def plane(size: float = 1.0) -> MeshSurface:
    """An open square in the plane z = 0, its normal along +z."""
    half = size / 2
    corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]
    return MeshSurface(corners, [[0, 1, 2], [0, 2, 3]])


def box(size: Any = (1.0, 1.0, 1.0), center: Any = (0.0, 0.0, 0.0)) -> MeshSurface:
    """A closed box of twelve triangles."""
    half = np.asarray(size) / 2
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]
    return MeshSurface(signs * half + center, faces)


def star() -> MeshSurface:
    """A ball with six sharp thorns and a thin fin around it: what folds away within a spacing."""
    unit, faces = icosphere(5)
    thorns = np.abs(unit).max(axis=1)
    fin = np.exp(-((unit @ (0.48, 0.6, 0.64) / 0.03) ** 2))
    heights = 1.0 + 1.0 * np.exp((thorns - 1.0) / 0.01) + 0.5 * fin
    return MeshSurface(unit * heights[:, None], faces)
