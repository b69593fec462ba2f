"""Meshes that the demo makes for itself."""

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from decals.scenes.mesh_file import MeshArrays

_SUBDIVISIONS = 5


def egg(center: ArrayLike, *, radius: float, height: float) -> MeshArrays:
    """Make an egg that stands on its thick end: float32[10242, 3] and int32[20480, 3].

    Parameters
    ----------
    center : (3,)
        Middle of the egg.
    radius, height : float
        Half the largest width, about, and half the height.
    """
    directions, faces = _ball()
    taper = radius * (1.0 - 0.16 * directions[:, 1])
    scale = np.stack([taper, np.full_like(taper, height), taper], axis=-1)
    return (directions * scale + np.asarray(center)).astype(np.float32), faces


def rounded_box(center: ArrayLike, *, half: ArrayLike, exponent: float = 6.0) -> MeshArrays:
    """Make a box with round edges, a superellipsoid: float32[10242, 3] and int32[20480, 3].

    Parameters
    ----------
    center, half : (3,)
        Middle of the box and half its sides.
    exponent : float
        2 makes an ellipsoid, more a sharper box.
    """
    directions, faces = _ball()
    norm = (np.abs(directions) ** exponent).sum(axis=1, keepdims=True) ** (1.0 / exponent)
    return (directions / norm * np.asarray(half) + np.asarray(center)).astype(np.float32), faces


def _ball() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    sphere = pv.Icosphere(nsub=_SUBDIVISIONS)
    points = np.asarray(sphere.points, np.float64)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    return directions, sphere.regular_faces.astype(np.int32)
