"""Small meshes for the tests of surfaces and seeds."""

import numpy as np
import pyvista as pv

from decals.surfaces.mesh import MeshSurface


def mesh(data: pv.PolyData) -> MeshSurface:
    return MeshSurface(data.points, data.regular_faces)


def sphere(radius: float = 1.0, center=(0.0, 0.0, 0.0), level: int = 4) -> MeshSurface:
    return mesh(pv.Icosphere(radius=radius, center=center, nsub=level))


def plane(size: float = 1.0) -> MeshSurface:
    """An open square in the plane z = 0, its normal along +z."""
    half = size / 2
    corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]
    return MeshSurface(corners, [[0, 1, 2], [0, 2, 3]])


def box(size=(1.0, 1.0, 1.0), center=(0.0, 0.0, 0.0)) -> MeshSurface:
    """A closed box of twelve triangles."""
    half = np.asarray(size) / 2
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]
    return MeshSurface(signs * half + center, faces)


def star() -> MeshSurface:
    """A ball with six sharp thorns and a thin fin around it: what folds away within a spacing."""
    ball = pv.Icosphere(radius=1.0, nsub=5)
    unit = ball.points.astype(float)
    thorns = np.abs(unit).max(axis=1)
    fin = np.exp(-((unit @ (0.48, 0.6, 0.64) / 0.03) ** 2))
    ball.points = (unit * (1.0 + 1.0 * np.exp((thorns - 1.0) / 0.01) + 0.5 * fin)[:, None]).astype(np.float32)
    return mesh(ball)
