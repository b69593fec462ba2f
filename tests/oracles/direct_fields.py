"""Parts of direct fields in float64 NumPy: windows, and gradient noise from its definition."""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def window(node: Any, q: Floats) -> Floats:
    """The window (n,) of a field in a box."""
    half = 0.5 * np.array(node.size)
    t = np.clip((1.0 - np.abs(q - np.array(node.center)) / half) / node.fade, 0.0, 1.0)
    product_of_sides: Floats = (t * t * (3.0 - 2.0 * t)).prod(axis=1)
    return product_of_sides


def gradient_noise(q: Floats, seed: int) -> Floats:
    """Perlin's noise (n,) over the hash (34 x + 10) x mod 289."""
    base = np.floor(q).astype(np.int64)
    inside = q - base
    blend = inside**3 * (inside * (6.0 * inside - 15.0) + 10.0)
    total = np.zeros(len(q))
    for corner in product((0, 1), repeat=3):
        hashed = np.full(len(q), seed)
        for axis in range(3):
            hashed = (hashed + base[:, axis] + corner[axis]) % 289
            hashed = (34 * hashed + 10) * hashed % 289
        weight = np.where(np.array(corner) == 1, blend, 1.0 - blend).prod(axis=1)
        total += weight * (DIRECTIONS[hashed % 12] * (inside - np.array(corner))).sum(axis=1)
    return total


_SIGNS = [(u, v) for v in (1.0, -1.0) for u in (1.0, -1.0)]
DIRECTIONS = np.array(
    [(0.0, u, v) for u, v in _SIGNS] + [(u, 0.0, v) for u, v in _SIGNS] + [(u, v, 0.0) for u, v in _SIGNS]
)
"""To the middles of a cube's edges."""
