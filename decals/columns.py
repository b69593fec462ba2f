"""Checks of the arrays that describe decals: right shapes and kinds, finite, within range."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidDecals

ROUNDING = 1e-6
PARALLEL = 1e-3

Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Doubles = NDArray[np.float64]


def floats(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Doubles:
    """Copy to float64, checking shape (-1: any length) and refusing NaN and infinity."""
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidDecals(f"{name}: expected numbers, got {values!r:.80}") from error
    _check_shape(name, array.shape, shape)
    bad = ~np.isfinite(array)
    if bad.any():
        row = int(np.argwhere(bad)[0][0])
        raise InvalidDecals(
            f"{name}: expected finite numbers, got {array[row]} in row {row}; drop or repair it"
        )
    return array


def _check_shape(name: str, got: tuple[int, ...], expected: tuple[int, ...]) -> None:
    if len(got) != len(expected) or any(e not in (-1, g) for g, e in zip(got, expected, strict=True)):
        wanted = ", ".join("n" if e == -1 else str(e) for e in expected)
        raise InvalidDecals(f"{name}: expected shape [{wanted}], got {list(got)}; give one row per decal")


def check_range(
    name: str, values: Doubles, low: float, high: float, *, advice: str = "rescale the model"
) -> None:
    """Refuse values outside a range."""
    bad = (values < low) | (values > high)
    if bad.any():
        place = tuple(np.argwhere(bad)[0])
        raise InvalidDecals(
            f"{name}: expected values from {low:g} to {high:g}, got {values[place]:g} in row {place[0]};"
            f" {advice}"
        )


def unit(name: str, vectors: Doubles) -> Doubles:
    """Scale vectors to length 1; those that have it within rounding stay."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    if (largest == 0.0).any():
        row = int(np.argmin(largest))
        raise InvalidDecals(f"{name}: expected a direction, got a zero vector in row {row}; give it a length")
    scaled = vectors / largest[:, None]
    lengths = np.linalg.norm(scaled, axis=1) * largest
    keep = np.abs(lengths - 1.0) <= ROUNDING
    return np.where(keep[:, None], vectors, scaled / np.linalg.norm(scaled, axis=1, keepdims=True))


def orthogonal(tangents: Doubles, normals: Doubles) -> Doubles:
    """Turn unit tangents perpendicular to unit normals; those that are within rounding stay."""
    along = (tangents * normals).sum(axis=1)
    across = tangents - along[:, None] * normals
    lengths = np.linalg.norm(across, axis=1)
    if (lengths < PARALLEL).any():
        row = int(np.argmin(lengths))
        raise InvalidDecals(
            f"tangents: expected a direction across the normal, got {tangents[row]}"
            f" along normal {normals[row]} in row {row}; turn one of them"
        )
    keep = np.abs(along) <= ROUNDING
    return np.where(keep[:, None], tangents, across / np.maximum(lengths, PARALLEL)[:, None])


def whole(name: str, values: Any, count: int, *, low: int, high: int, default: int) -> Ints:
    """Copy whole numbers from low to high; the default everywhere where there are none."""
    array = np.full(count, default, np.int64) if values is None else np.array(values)
    _check_shape(name, array.shape, (count,))
    if count and array.dtype.kind not in "iu":
        raise InvalidDecals(f"{name}: expected whole numbers, got {array.dtype}; round or index first")
    bad = (array < low) | (array > high)
    if bad.any():
        row = int(np.argmax(bad))
        raise InvalidDecals(f"{name}: expected numbers from {low} to {high}, got {array[row]} in row {row}")
    return array.astype(np.int32)


def shares(name: str, values: Any, shape: tuple[int, ...]) -> Doubles:
    """Copy numbers from 0 to 1; ones where there are none."""
    array = floats(name, np.ones(shape) if values is None else values, shape)
    check_range(name, array, 0.0, 1.0, advice="divide colours in bytes by 255")
    return array


def flags(name: str, values: Any, count: int) -> Bools:
    """Copy truth values; False where there are none."""
    array = np.zeros(count, np.bool_) if values is None else np.array(values)
    _check_shape(name, array.shape, (count,))
    if count and array.dtype != np.bool_:
        raise InvalidDecals(f"{name}: expected True or False, got {array.dtype}; compare or cast it first")
    return array.astype(np.bool_)


def chosen_rows(rows: ArrayLike) -> NDArray[Any]:
    """Indices or a mask, also where there are none of either."""
    array = np.asarray(rows)
    return array.astype(np.intp) if array.size == 0 else array
