"""Vectors of length 1, in any number of dimensions of an array; the last one is that of space."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def unit(vectors: NDArray[Any]) -> NDArray[Any]:
    """Return vectors at length 1."""
    units: NDArray[Any] = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return units


def random_units(rng: np.random.Generator, *shape: int) -> NDArray[np.float64]:
    """Return random vectors of length 1 in space, by default one."""
    return unit(rng.normal(size=(*shape, 3)))
