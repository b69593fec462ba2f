"""Which way the images of decals point."""

from collections.abc import Callable
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.coat.fields import curvature_directions, smooth_crosses
from decals.errors import InvalidSeeding
from decals.surfaces.surface import Floats, unit_rows
from decals.wishes import answers, numbers


class Orientation(Enum):
    """Directions that follow the surface itself."""

    CURVATURE = "curvature"
    """Along the principal curvature of larger magnitude: around a limb."""
    CROSS = "cross"
    """Like `CURVATURE`, but smooth: up to quarter turns, neighbours agree."""


Direction = ArrayLike | Callable[[Floats], ArrayLike] | Orientation | None
"""None (random), one vector for all decals, a function of ``points[n, 3]`` to ``vectors[n, 3]`` (as
`gradient_of` makes them), or an `Orientation`."""

VANISHING = 1e-3
"""A direction whose tangential part is below this share of its length has none."""


def tangents(positions: Floats, normals: Floats, direction: Direction, seed: int) -> Floats:
    """Choose unit tangents, ``float32[n, 3]``: random, or along a direction as far as the surface allows.

    Where the direction vanishes or stands upright on the surface, the tangent is a fixed function of
    the normal. `InvalidSeeding` for directions of a wrong shape or that are not finite.
    """
    wide = unit_rows(normals).astype(np.float64)
    stable = _stable_tangents(wide)
    if direction is None:
        angles = np.random.default_rng(seed).random((len(normals), 1)) * (2.0 * np.pi)
        return unit_rows(np.cos(angles) * stable + np.sin(angles) * np.cross(wide, stable))
    if isinstance(direction, Orientation):
        vectors = _along_surface(direction, positions, normals)
    else:
        vectors = _directions(direction, positions)
    tangential = vectors - np.einsum("ni,ni->n", vectors, wide)[:, None] * wide
    gone = np.linalg.norm(tangential, axis=1) <= VANISHING * np.linalg.norm(vectors, axis=1)
    return unit_rows(np.where(gone[:, None], stable, tangential))


def _stable_tangents(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tangent closest to the x axis, or to the y axis where the normal is near x."""
    axes = np.where(np.abs(normals[:, :1]) > 0.8, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    tangents: NDArray[np.float64] = axes - np.einsum("ni,ni->n", axes, normals)[:, None] * normals
    return tangents


def _along_surface(orientation: Orientation, positions: Floats, normals: Floats) -> NDArray[np.float64]:
    """Directions that the surface gives, signs and quarter turns aside."""
    if len(positions) == 0:
        return np.zeros((0, 3))
    curved = curvature_directions(positions, normals)
    if orientation is Orientation.CURVATURE:
        return curved
    return smooth_crosses(positions, normals, curved)


def check_direction(direction: Direction) -> None:
    """Raise `InvalidSeeding` for what can be no direction; a function is known only once it is asked."""
    if direction is not None and not isinstance(direction, Orientation) and not callable(direction):
        _checked(numbers("direction", direction), (3,))


def _directions(
    direction: ArrayLike | Callable[[Floats], ArrayLike], positions: Floats
) -> NDArray[np.float64]:
    """One finite vector for each position, of length 1 or 0."""
    if callable(direction):
        vectors = _checked(answers("direction", direction, positions), positions.shape)
    else:
        vectors = _checked(numbers("direction", direction), (3,))
    rows = np.broadcast_to(vectors, positions.shape)
    largest = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    scaled: NDArray[np.float64] = rows / np.where(largest > 0, largest, 1.0)
    return scaled


def _checked(vectors: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    if vectors.shape != shape:
        raise InvalidSeeding(f"direction: expected shape {list(shape)}, got {list(vectors.shape)}")
    if not np.isfinite(vectors).all():
        raise InvalidSeeding(
            "direction: expected finite numbers, got NaN or infinity; return zeros where there is none"
        )
    return vectors
