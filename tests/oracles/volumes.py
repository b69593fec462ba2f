"""Volumes in float64: SciPy interpolates the distances, and the box of the grid ends the solid."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from blobtree import Volume

Floats = NDArray[np.float64]


def distance(node: Volume, points: NDArray[Any]) -> Floats:
    """The signed distances (n,) at points (n, 3)."""
    cells = _cells(node, points)
    last = np.subtract(node.samples.shape, 1)
    inside = np.clip(cells, 0, last)
    sampled = map_coordinates(node.samples.array.astype(np.float64), inside.T, order=1)
    beyond = np.abs(cells - last / 2) - last / 2
    box = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    return np.asarray(np.maximum(sampled, box) * node.spacing - node.growth)


def clearance(node: Volume, points: NDArray[Any]) -> Floats:
    """Distances (n,) in cells from the nearest face of a cell, where gradients jump."""
    cells = _cells(node, points)
    away: Floats = np.abs(cells - np.round(cells)).min(axis=1)
    return away


def _cells(node: Volume, points: NDArray[Any]) -> Floats:
    return np.asarray((points.astype(np.float64) - np.array(node.corner)) / node.spacing)
