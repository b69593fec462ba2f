"""Morton's space-filling curve: points next to each other along it lie near each other."""

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Float64Array, Int64Array

CURVE_BITS = 16
"""Bits of each coordinate."""


def curve_keys(positions: Float32Array | Float64Array) -> Int64Array:
    """Return numbers (n,) that put points (n, 3) in the order of the curve through their box."""
    lower = positions.min(axis=0, initial=np.inf)
    extent = max(float((positions - lower).max(initial=0.0)), 1e-30)
    cells = ((positions - lower) * ((1 << CURVE_BITS) - 1) / extent).astype(np.int64)
    keys: NDArray[np.int64] = np.zeros(len(positions), np.int64)
    for bit in range(CURVE_BITS):
        for axis in range(3):
            keys |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return keys
