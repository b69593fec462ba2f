"""A torus knot as a triangle mesh."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.surfaces.mesh_file import MeshArrays

Floats = NDArray[np.floating[Any]]


def torus_knot(
    *,
    turns: int = 2,
    windings: int = 3,
    radius: float = 1.0,
    bend: float = 0.42,
    tube: float = 0.23,
    along: int = 480,
    around: int = 48,
) -> MeshArrays:
    """Make a closed tube around a torus knot.

    Parameters
    ----------
    turns, windings : int
        Turns of the knot around the axis of the torus and through its hole; coprime.
    radius, bend, tube : float
        Major and minor radius of the torus, and radius of the tube around the knot, in the model's units.
    along, around : int
        Quads along the knot and around its tube.

    Returns
    -------
    vertices : float32[along * around, 3]
    faces : int32[2 * along * around, 3]
        Counter-clockwise seen from outside.
    """  # fmt: skip
    t = np.arange(along) * (2.0 * np.pi / along)
    centre = _knot(t, turns, windings, radius, bend)
    ahead = _knot(t + 1e-4, turns, windings, radius, bend) - _knot(t - 1e-4, turns, windings, radius, bend)
    tangent = _unit(ahead)
    # The normal of the torus gives a frame that is periodic along the knot.
    out = _unit(centre - radius * np.stack([np.cos(turns * t), np.sin(turns * t), 0.0 * t], axis=-1))
    side = _unit(np.cross(tangent, out))
    out = np.cross(side, tangent)
    angle = np.arange(around) * (2.0 * np.pi / around)
    ring = np.cos(angle)[:, None] * out[:, None] + np.sin(angle)[:, None] * side[:, None]
    vertices = centre[:, None] + tube * ring
    return vertices.reshape(-1, 3).astype(np.float32), _grid_faces(along, around)


def _knot(t: Floats, turns: int, windings: int, radius: float, bend: float) -> Floats:
    ring = radius + bend * np.cos(windings * t)
    return np.stack(
        [ring * np.cos(turns * t), ring * np.sin(turns * t), bend * np.sin(windings * t)], axis=-1
    )


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _grid_faces(along: int, around: int) -> NDArray[np.int32]:
    """Return the triangles of a grid that is periodic in both directions."""
    i, j = (index.reshape(-1) for index in np.indices((along, around)))
    a, b = i * around + j, (i + 1) % along * around + j
    c, d = (i + 1) % along * around + (j + 1) % around, i * around + (j + 1) % around
    faces = np.concatenate([np.stack([a, c, b], axis=-1), np.stack([a, d, c], axis=-1)])
    return faces.astype(np.int32)
