"""Affine maps as float64[4, 4], columns are points."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from blobtree.validation import Matrix

SIMILARITY_TOLERANCE = 1e-6
"""Relative deviation from rotation × scale below which a map counts as one."""


def square(matrix: "Matrix") -> NDArray[np.float64]:
    """The 3×4 `matrix` as 4×4."""
    return np.vstack([np.array(matrix), (0.0, 0.0, 0.0, 1.0)])


def apply(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """`points` (n, 3) under `matrix`."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def mean_scale(matrix: NDArray[np.float64]) -> float:
    """The factor by which `matrix` scales lengths on average: the cube root of what it does to volumes."""
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))


def uniform_scale(matrix: NDArray[np.float64]) -> float | None:
    """The factor by which `matrix` scales every length, None where it stretches directions differently."""
    linear = matrix[:3, :3]
    gram = linear.T @ linear
    squared = float(np.trace(gram)) / 3.0
    if np.abs(gram - squared * np.eye(3)).max() > SIMILARITY_TOLERANCE * squared:
        return None
    return float(np.sqrt(squared))
