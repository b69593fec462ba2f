"""Checks of arguments: each returns the value as plain finite numbers, or raises an error that says more."""

import math
import reprlib
from collections.abc import Iterable
from typing import Any, TypeGuard, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array
from blobtree.errors import ImplicitDecalsError, InvalidNode, InvalidPoints

Vector = tuple[float, float, float]
Matrix = tuple[tuple[float, ...], ...]
"""Three rows of a row-major affine map: the linear part beside its translation."""

LARGEST_NUMBER = 1e18
"""Beyond it float32 squares overflow."""
SMALLEST_NUMBER = 1e-18
"""Below it float32 squares vanish."""
LIMIT = f"none may be beyond {LARGEST_NUMBER:g}"


def describe(value: object) -> str:
    """Return a value in a few words: numbers and text as they are, other objects by their type."""
    if isinstance(value, int | float | str | bytes | list | tuple | np.number | np.ndarray) or value is None:
        try:
            return " ".join(f"{value!r:.60}".split())
        except ValueError:  # a whole number of thousands of digits
            return f"a {type(value).__name__} of very many digits"
        except Exception:  # of any kind, by a class of the user
            pass
    return with_article(type(value).__name__)


def with_article(noun: str) -> str:
    """Return a noun after "a" or "an"."""
    return f"{'an' if noun[0] in 'AEIOUaeiou' else 'a'} {noun}"


def items(value: object) -> tuple[Any, ...] | None:
    """Return what an iterable holds; None for anything else, such as an array without axes."""
    try:
        return tuple(cast(Iterable[Any], value))
    except TypeError:
        return None


def axis_count(value: Any) -> int:
    """Return the number of axes of an array or of nested lists."""
    if hasattr(value, "ndim"):
        return int(value.ndim) + len(getattr(value.dtype, "_shape_", ()))  # of Warp's vectors
    listed = items(value) if isinstance(value, list | tuple) else None
    return 0 if listed is None else 1 + max(map(axis_count, listed[:1]), default=1)


def real(values: Any) -> NDArray[Any]:
    """Return values as an array; raise `TypeError` for texts, truth values and complex numbers.

    NumPy would read digits in texts, count True as 1, and drop imaginary parts.
    """
    array = np.asarray(values)
    if array.size and array.dtype.kind not in "iufO":
        raise TypeError(f"no real numbers: {array.dtype}")
    return array


def real_number(value: Any) -> float:
    """Return a number as a float; raise `TypeError` for lists, texts, truth values and complex numbers."""
    if isinstance(value, float | int) and not isinstance(value, bool):
        return float(value)
    array = real(value)
    if array.ndim or isinstance(value, str | bytes | bool):
        raise TypeError(f"no real number: {type(value).__name__}")
    return float(array)


def is_whole(value: object) -> TypeGuard[int | np.integer]:
    """Return True for a whole number of Python or NumPy; True and False are none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def as_count(value: object) -> object:
    """Return a float without a fraction, such as 1e3, as an int; any other value as it is."""
    return int(value) if isinstance(value, float | np.floating) and value.is_integer() else value


def positive_count(name: str, value: object, error: type[ImplicitDecalsError]) -> int:
    """Return a count from 1; raise `error` for other values."""
    count = as_count(value)
    if not is_whole(count) or count < 1:
        raise error(f"{name}: expected a whole number from 1, got {describe(value)}")
    return int(count)


def finite_vector(name: str, value: object, error: type[ImplicitDecalsError] = InvalidNode) -> Vector:
    """Return `value` as three floats; raise an error if it is not three finite numbers."""
    try:
        values = real(value) if isinstance(value, np.ndarray) else cast(Iterable[Any], value)
        numbers = tuple(map(real_number, values))
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != 3 or not all(abs(number) <= LARGEST_NUMBER for number in numbers):
        raise error(f"{name}: expected three finite numbers (x, y, z), got {describe(value)}; {LIMIT}")
    return numbers


def finite_points(name: str, value: object) -> tuple[Vector, ...]:
    """Return `value` as points of three floats; raise `InvalidNode` if they are no rows of finite numbers."""
    try:
        values = real(value).tolist() if isinstance(value, np.ndarray) else value
        rows = tuple(cast(Iterable[Any], values))
    except TypeError:
        raise InvalidNode(f"{name}: expected points (x, y, z), got {reprlib.repr(value)}") from None
    return tuple(finite_vector(f"{name}[{place}]", row) for place, row in enumerate(rows))


def positive_numbers(name: str, value: object) -> tuple[float, ...]:
    """Return `value` as floats above 0, a single number as one; raise `InvalidNode` otherwise."""
    numbers = items(value)
    if numbers is None:
        return (positive_number(name, value),)
    return tuple(positive_number(f"{name}[{place}]", number) for place, number in enumerate(numbers))


def name_pairs(name: str, value: object) -> tuple[tuple[str, ...], ...]:
    """Return `value` as a tuple of pairs of different texts; raise `InvalidNode` otherwise."""
    try:
        pairs = tuple(texts(name, pair) for pair in cast(Iterable[Any], value))
    except (TypeError, InvalidNode):
        pairs = (("",),)
    if isinstance(value, str) or any(len(pair) != 2 or pair[0] == pair[1] for pair in pairs):
        raise InvalidNode(f"{name}: expected pairs of two different names, got {describe(value)}")
    return pairs


def nonzero_vector(name: str, value: object) -> Vector:
    """Return `value` as three floats that are not all 0; raise `InvalidNode` otherwise."""
    vector = finite_vector(name, value)
    if not any(vector):
        raise InvalidNode(f"{name}: expected a direction, got the zero vector")
    return vector


def non_negative_vector(name: str, value: object) -> Vector:
    """Return `value` as three floats from 0; raise `InvalidNode` otherwise."""
    vector = finite_vector(name, value)
    if min(vector) < 0.0:
        raise InvalidNode(f"{name}: expected three numbers from 0, got {describe(value)}")
    return vector


def positive_vector(name: str, value: object) -> Vector:
    """Return `value` as three floats above 0; raise `InvalidNode` otherwise."""
    vector = finite_vector(name, value)
    if min(vector) <= 0.0:
        raise InvalidNode(f"{name}: expected three numbers above 0, got {describe(value)}")
    for number in vector:
        _check_size(name, number)
    return vector


def positive_number(name: str, value: object) -> float:
    """Return `value` as a finite float above 0; raise `InvalidNode` otherwise."""
    number = finite_number(name, value)
    if number <= 0.0:
        raise InvalidNode(f"{name}: expected a number above 0, got {describe(value)}")
    _check_size(name, number)
    return number


def _check_size(name: str, number: float) -> None:
    if number < SMALLEST_NUMBER:
        raise InvalidNode(f"{name}: expected at least {SMALLEST_NUMBER:g}, got {number:g}; rescale the model")


def finite_number(name: str, value: object, error: type[ImplicitDecalsError] = InvalidNode) -> float:
    """Return `value` as a finite float; raise an error otherwise."""
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not abs(number) <= LARGEST_NUMBER:
        raise error(f"{name}: expected a finite number, got {describe(value)}; {LIMIT}")
    return number


def finite_numbers(name: str, value: object) -> tuple[float, ...]:
    """Return a number, numbers, or rows of numbers as finite floats; raise `InvalidNode` otherwise."""
    try:
        numbers = np.asarray(real(value), np.float64).ravel().tolist()
    except (TypeError, ValueError, OverflowError):
        numbers = [math.nan]
    if not all(abs(number) <= LARGEST_NUMBER for number in numbers):
        raise InvalidNode(f"{name}: expected finite numbers, got {describe(value)}; {LIMIT}")
    return tuple(numbers)


def truth(name: str, value: object, error: type[ImplicitDecalsError]) -> bool:
    """Return True or False; raise `error` for any other value."""
    if not isinstance(value, bool | np.bool_):
        raise error(f"{name}: expected True or False, got {describe(value)}")
    return bool(value)


def texts(name: str, value: object) -> tuple[str, ...]:
    """Return several texts; raise `InvalidNode` if an item is empty or no text."""
    found = None if isinstance(value, str) else items(value)
    if found is None or not all(isinstance(item, str) and item for item in found):
        raise InvalidNode(f"{name}: expected texts that are not empty, got {describe(value)}")
    return found


def affine_matrix(value: ArrayLike) -> Matrix:
    """Return `value` (3×4 or 4×4) as an invertible affine map; raise `InvalidNode` otherwise."""
    try:
        matrix = np.asarray(real(value), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape == (4, 4) and np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        matrix = matrix[:3]
    if matrix.shape != (3, 4) or not np.all(np.abs(matrix) <= LARGEST_NUMBER):
        raise InvalidNode(f"matrix: expected a finite 3×4 or affine 4×4 matrix, got {describe(value)}")
    singular_values = np.linalg.svd(matrix[:, :3], compute_uv=False)
    if singular_values[-1] <= 1e-6 * singular_values[0]:
        raise InvalidNode(
            f"matrix: expected an invertible map, got one that flattens space: {describe(value)}"
        )
    return tuple(tuple(float(number) for number in row) for row in matrix)


def point_array(
    points: ArrayLike,
    name: str = "points",
    error: type[ImplicitDecalsError] = InvalidPoints,
    limit: float = LARGEST_NUMBER,
) -> Float32Array:
    """Return points as contiguous float32[n, 3], finite up to a limit; raise an error otherwise."""
    try:
        with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinity, refused below
            array = np.ascontiguousarray(real(points), dtype=np.float32)
    except (TypeError, ValueError, OverflowError):
        raise error(f"{name}: expected an array of shape (n, 3), got {reprlib.repr(points)}") from None
    if array.shape == (0,):
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise error(f"{name}: expected an array of shape (n, 3), got shape {np.shape(points)}")
    bad = ~(np.abs(array) <= limit).all(axis=1)
    if bad.any():
        row = int(bad.argmax())
        raise error(
            f"{name}: expected finite coordinates within ±{limit:g}, got {array[row]} in row {row}; "
            "drop such rows, or rescale the model"
        )
    return array


def points_or_point(points: ArrayLike) -> tuple[Float32Array, bool]:
    """Return points as `point_array` does, and True if they are a single point of shape (3,)."""
    try:
        single = np.shape(points) == (3,)
    except ValueError:  # rows of different lengths, which `point_array` refuses
        single = False
    return point_array(cast(ArrayLike, [points]) if single else points), single
