"""Meshes of the demo and the gallery: an egg and a rounded box."""

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from decals.surfaces.mesh_file import MeshArrays

_SUBDIVISIONS = 5
_SQUARES = 48


def egg(center: ArrayLike, *, radius: float, height: float) -> MeshArrays:
    """Return an egg on its thick end: float32[10242, 3] vertices and int32[20480, 3] faces.

    Parameters
    ----------
    center : (3,)
        Middle of the egg.
    radius, height : float
        Half the largest width (approximately) and half the height.
    """
    directions, faces = _ball()
    taper = radius * (1.0 - 0.16 * directions[:, 1])
    scale = np.stack([taper, np.full_like(taper, height), taper], axis=-1)
    return (directions * scale + np.asarray(center)).astype(np.float32), faces


def rounded_box(center: ArrayLike, *, half: ArrayLike, rounding: float) -> MeshArrays:
    """Return a box with round edges: float32[13826, 3] vertices and int32[27648, 3] faces.

    Parameters
    ----------
    center, half : (3,)
        Middle of the box and half its sides.
    rounding : float
        Radius of the edges, at most the shortest half side.
    """
    cube, faces = _cube()
    sides = np.asarray(half, np.float64)
    core = sides - rounding
    # Half of the quads along a side cover its flat part, a quarter each of the two edges.
    inner = core * np.clip(2.0 * cube, -1.0, 1.0)
    outward = np.sign(cube) * np.tan(0.25 * np.pi * np.clip(2.0 * np.abs(cube) - 1.0, 0.0, 1.0))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    return (inner + rounding * outward + np.asarray(center)).astype(np.float32), faces


def _cube() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the surface of the cube from -1 to 1, in equal squares of two triangles."""
    grid = pv.ImageData(dimensions=(_SQUARES + 1,) * 3, spacing=(2.0 / _SQUARES,) * 3, origin=(-1.0,) * 3)
    surface = grid.extract_surface(algorithm="geometry").triangulate()  # the default algorithm leaves seams
    return np.asarray(surface.points, np.float64), surface.regular_faces.astype(np.int32)


def _ball() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    sphere = pv.Icosphere(nsub=_SUBDIVISIONS)
    points = np.asarray(sphere.points, np.float64)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    return directions, sphere.regular_faces.astype(np.int32)
