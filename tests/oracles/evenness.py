"""Oracles of evenness in float64: all pairs of oriented points, without a search tree."""

from typing import Any, NamedTuple

import numpy as np

from decals.model import FACING_LIMIT


class Evenness(NamedTuple):
    least: float
    mean: float
    bond_order: float


def evenness(positions: Any, normals: Any, reach: float) -> Evenness:
    """Measure the nearest points that face the same way, within a reach."""
    p, n = np.asarray(positions, np.float64), np.asarray(normals, np.float64)
    distances = np.linalg.norm(p[:, None] - p, axis=2)
    distances[(n @ n.T <= FACING_LIMIT) | np.eye(len(p), dtype=bool) | (distances > reach)] = np.inf
    nearest = distances.min(axis=1)
    orders = []
    for row in range(len(p)):
        six = np.argsort(distances[row])[:6]
        if np.isfinite(distances[row, six]).all() and len(six) == 6:
            first = np.cross(n[row], np.roll(np.eye(3)[np.abs(n[row]).argmax()], 1))
            second = np.cross(n[row], first := first / np.linalg.norm(first))
            offsets = p[six] - p[row]
            angles = np.arctan2(offsets @ second, offsets @ first)
            orders.append(np.hypot(np.cos(6 * angles).sum(), np.sin(6 * angles).sum()) / 6)
    finite = nearest[np.isfinite(nearest)]
    return Evenness(float(finite.min()), float(finite.mean()), float(np.mean(orders)) if orders else np.nan)


def gap_widths(points: Any, centers: Any, radii: Any) -> np.ndarray:
    """Return the distances of points on a plane from the nearest of some discs; negative inside."""
    offsets = np.asarray(points, np.float64)[:, None] - np.asarray(centers, np.float64)
    return np.asarray((np.linalg.norm(offsets, axis=2) - np.asarray(radii, np.float64)).min(axis=1))
