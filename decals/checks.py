"""Checks of single values that people give: of the right type, finite, within range."""

import math
from enum import Enum
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from decals.errors import DecalsError

T = TypeVar("T")
E = TypeVar("E", bound=Enum)


def instance(name: str, value: object, kind: type[T], error: type[DecalsError], advice: str) -> T:
    """Give a value that must be of a type, or raise an error with advice."""
    if not isinstance(value, kind):
        raise error(f"{name}: expected a {kind.__name__}, got {shown(value)}; {advice}")
    return value


def member(name: str, value: Any, kind: type[E], error: type[DecalsError]) -> E:
    """Give one of an enumeration, which may come as its value, or raise an error that names all."""
    try:
        return kind(value)
    except ValueError:
        names = ", ".join(f"{kind.__name__}.{one.name}" for one in kind)
        raise error(f"{name}: expected one of {names}, got {shown(value)}") from None


def finite(name: str, value: Any, error: type[DecalsError]) -> float:
    """Give a finite number as a float, or raise an error."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number) or isinstance(value, str | bytes):
        raise error(f"{name}: expected a finite number, got {shown(value)}")
    return number


def whole(name: str, value: Any, low: int, high: int, error: type[DecalsError]) -> int:
    """Give a whole number from low to high as an int, or raise an error; none is where low is above high."""
    known = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not known or not low <= value <= high:
        wanted = f"a whole number from {low} to {high}" if low <= high else "nothing, as there is none"
        raise error(f"{name}: expected {wanted}, got {shown(value)}")
    return int(value)


def triple(name: str, value: Any, error: type[DecalsError]) -> NDArray[np.float64]:
    """Give three finite numbers as ``float64[3]``, or raise an error."""
    try:
        numbers = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.zeros(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise error(f"{name}: expected three finite numbers, got {shown(value)}")
    return numbers


def shown(value: object) -> str:
    """Show what came in a few words: numbers and text as they are, other things by their type."""
    if isinstance(value, int | float | str | bytes | list | tuple | np.number | np.ndarray) or value is None:
        return " ".join(f"{value!r:.60}".split())
    return f"a {type(value).__name__}"
