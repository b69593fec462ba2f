"""Decals for measurements: spread evenly in seconds, and at any count covering the surface equally often."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals.coat.orientation import tangents
from decals.model import Decals
from decals.surfaces.surface import Surface

COVERAGE = 1.6
"""Area of all rims together over the area of the surface: about what gap-free seeding comes to."""

STEPS = 4
"""Steps of repulsion: enough to part neighbours that lie by chance on one spot."""

_NEIGHBOURS = 7


def even_coat(surface: Surface, *, count: int, seed: int = 0) -> Decals:
    """Spread equal decals over a surface.

    `decals.seed` lays them more evenly and without gaps, but takes minutes for 100,000.
    """
    positions, normals = surface.sample(count, seed)
    spacing = np.sqrt(2.0 * surface.area / (np.sqrt(3.0) * max(count, 1)))
    for _ in range(STEPS if count > _NEIGHBOURS else 0):
        positions, normals = surface.project(positions + _moves(positions, spacing))
    radius = np.sqrt(COVERAGE * surface.area / (np.pi * max(count, 1)))
    return Decals(
        positions=positions,
        normals=normals,
        tangents=tangents(positions, normals, None, seed),
        radii=np.full(count, radius, np.float32),
    )


def _moves(positions: NDArray[np.float32], spacing: float) -> NDArray[np.float32]:
    """Half the way by which each point and its neighbours are too close."""
    distances, others = cKDTree(positions).query(positions, k=_NEIGHBOURS)
    away = positions[:, None] - positions[others]
    gaps = np.maximum(distances, 1e-6 * spacing)
    push = np.where(others == np.arange(len(positions))[:, None], 0.0, np.maximum(spacing - gaps, 0.0) / gaps)
    return np.asarray(0.25 * (push[..., None] * away).sum(axis=1), np.float32)
