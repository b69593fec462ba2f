"""What a camera sees of a triangle mesh, by brute force in float64."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def cast(
    vertices: NDArray[np.float32], faces: NDArray[np.int32], origin: Floats, directions: Floats
) -> tuple[Floats, NDArray[np.int64], Floats]:
    """First hits of rays with triangles, both sides (Möller and Trumbore).

    Returns
    -------
    t
        Multiple of the direction, infinity for a miss, ``[n]``.
    face
        Index of the face, -1 for a miss.
    weights
        Barycentric coordinates in that face, ``[n, 3]``.
    """
    a, b, c = np.moveaxis(vertices.astype(np.float64)[faces], 1, 0)
    e1, e2, s = b - a, c - a, origin - a
    q = np.cross(s, e1)
    p = np.cross(directions[:, None], e2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.einsum("nfi,fi->nf", p, e1)
        u = np.einsum("nfi,fi->nf", p, s) * inverse
        v = directions @ q.T * inverse
        t = np.einsum("fi,fi->f", q, e2) * inverse
        t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    face = t.argmin(axis=1)
    row = np.arange(len(directions))
    first = t[row, face]
    weights = np.stack([1 - u[row, face] - v[row, face], u[row, face], v[row, face]], axis=1)
    return first, np.where(np.isfinite(first), face, -1), weights


def edges(mask: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels whose 3 × 3 neighbourhood is not uniform: where a rasteriser and a ray may differ."""
    padded = np.pad(mask, 1, mode="edge")
    shifts = [padded[i : i + mask.shape[0], j : j + mask.shape[1]] for i in range(3) for j in range(3)]
    differs: NDArray[np.bool_] = np.any([shift != mask for shift in shifts], axis=0)
    return differs
