"""Affine maps as float64[4, 4], columns are points."""

import numpy as np

from blobtree._typing import Float64Array
from blobtree.validation import Matrix

SIMILARITY_TOLERANCE = 1e-6
"""Relative deviation from rotation × scale below which a map counts as a similarity."""


def square(matrix: Matrix) -> Float64Array:
    """Return a 3×4 matrix as 4×4."""
    return np.vstack([np.array(matrix), (0.0, 0.0, 0.0, 1.0)])


def apply(matrix: Float64Array, points: Float64Array) -> Float64Array:
    """Return `points` (n, 3) under `matrix`."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def mean_scale(matrix: Float64Array) -> float:
    """Return the mean scale of lengths: the cube root of the scale of volumes."""
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))


def uniform_scale(matrix: Float64Array) -> float | None:
    """Return the scale of all lengths, None if the matrix stretches directions differently."""
    linear = matrix[:3, :3]
    gram = linear.T @ linear
    squared = float(np.trace(gram)) / 3.0
    if np.abs(gram - squared * np.eye(3)).max() > SIMILARITY_TOLERANCE * squared:
        return None
    return float(np.sqrt(squared))
