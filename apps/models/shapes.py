"""Meshes that the demo makes for itself."""

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from decals.scenes.mesh_file import MeshArrays

_SUBDIVISIONS = 5
_SQUARES = 48


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


def rounded_box(center: ArrayLike, *, half: ArrayLike, rounding: float) -> MeshArrays:
    """Make a box with flat sides and round edges: float32[13826, 3] and int32[27648, 3].

    Parameters
    ----------
    center, half : (3,)
        Middle of the box and half its sides.
    rounding : float
        Radius of its edges, at most the shortest half side.
    """
    cube, faces = _cube()
    sides = np.asarray(half, np.float64)
    core = sides - rounding
    # Half the quads of a side go to its flat part and a quarter to either edge.
    inner = core * np.clip(2.0 * cube, -1.0, 1.0)
    outward = np.sign(cube) * np.tan(0.25 * np.pi * np.clip(2.0 * np.abs(cube) - 1.0, 0.0, 1.0))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    return (inner + rounding * outward + np.asarray(center)).astype(np.float32), faces


def _cube() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Surface of the cube from -1 to 1, in equal squares each cut in two."""
    grid = pv.ImageData(dimensions=(_SQUARES + 1,) * 3, spacing=(2.0 / _SQUARES,) * 3, origin=(-1.0,) * 3)
    surface = grid.extract_surface(algorithm="geometry").triangulate()  # the other one leaves seams
    return np.asarray(surface.points, np.float64), surface.regular_faces.astype(np.int32)


def _ball() -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    sphere = pv.Icosphere(nsub=_SUBDIVISIONS)
    points = np.asarray(sphere.points, np.float64)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    return directions, sphere.regular_faces.astype(np.int32)
