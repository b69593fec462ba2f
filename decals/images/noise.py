"""Deterministic noise on the plane: the same integers on every machine, no random state."""

import numpy as np
from numpy.typing import NDArray

from .canvas import Field

_U = np.uint32


def _hash(ix: NDArray[np.int32], iy: NDArray[np.int32], seed: int) -> Field:
    """Scramble lattice coordinates into numbers in [0, 1)."""
    h = ix.astype(_U) * _U(0x8DA6B343) ^ iy.astype(_U) * _U(0xD8163841) ^ _U(seed * 0x9E3779B1 & 0xFFFFFFFF)
    h = (h ^ (h >> _U(15))) * _U(0x2C1B3C6D)
    h = (h ^ (h >> _U(12))) * _U(0x297A2D39)
    h ^= h >> _U(15)
    return np.asarray((h >> _U(8)).astype(np.float32) * np.float32(2.0**-24), dtype=np.float32)


def value_noise(x: Field, y: Field, *, seed: int) -> Field:
    """Smooth noise in [0, 1] whose features are one unit wide."""
    ix, iy = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    fx, fy = x - np.floor(x), y - np.floor(y)
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    low = _hash(ix, iy, seed) * (1.0 - fx) + _hash(ix + 1, iy, seed) * fx
    high = _hash(ix, iy + 1, seed) * (1.0 - fx) + _hash(ix + 1, iy + 1, seed) * fx
    return np.asarray(low * (1.0 - fy) + high * fy, dtype=np.float32)


def fractal_noise(x: Field, y: Field, *, octaves: int, seed: int) -> Field:
    """Sum of noises, each half as high and about twice as fine as the one before; in [0, 1]."""
    total = np.zeros_like(x)
    weight, norm = 1.0, 0.0
    for octave in range(octaves):
        total += np.float32(weight) * value_noise(x, y, seed=seed + octave)
        norm += weight
        # Turning and shifting each octave hides the lattice.
        x, y = 1.6 * x - 1.2 * y + 7.3, 1.2 * x + 1.6 * y - 3.1
        weight *= 0.5
    return np.asarray(total / np.float32(norm), dtype=np.float32)


def cell_noise(x: Field, y: Field, *, seed: int) -> tuple[Field, Field]:
    """Distances to the nearest and second nearest of one scattered point per unit square (Worley 1996)."""
    ix, iy = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    first, second = np.full_like(x, 9.0), np.full_like(x, 9.0)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            px, py = ix + np.int32(dx), iy + np.int32(dy)
            gap_x = px.astype(np.float32) + _hash(px, py, seed) - x
            gap_y = py.astype(np.float32) + _hash(px, py, seed + 1) - y
            gap = np.hypot(gap_x, gap_y)
            second = np.minimum(second, np.maximum(first, gap))
            first = np.minimum(first, gap)
    return first, second
