"""Checks of wishes for seeds: numbers, functions and devices; `InvalidSeeding` says what was expected."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.errors import InvalidDevice as UnknownDevice
from blobtree.launch import known_device
from decals.checks import shown
from decals.errors import DecalsError, InvalidDevice, InvalidSeeding


def whole(name: str, value: Any, least: int = 0, *, most: int | None = None) -> int:
    """`value` as a whole number within a range; `InvalidSeeding` otherwise."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
        raise InvalidSeeding(f"{name}: expected a whole number, got {shown(value)}")
    if value < least:
        raise InvalidSeeding(f"{name}: expected at least {least}, got {value}")
    if most is not None and value > most:
        raise InvalidSeeding(f"{name}: expected at most {most:,}, got {shown(value)}")
    return int(value)


def number(name: str, value: Any, expected: str, allowed: Callable[[float], bool]) -> float:
    """`value` as a number that is allowed; `InvalidSeeding` says in words what is expected otherwise."""
    try:
        found = np.nan if isinstance(value, str | bytes | bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = np.nan
    if not (np.isfinite(found) and allowed(found)):
        raise InvalidSeeding(f"{name}: expected {expected}, got {shown(value)}")
    return found


def numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """`values` as an array of any shape; `InvalidSeeding` for what holds no numbers."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidSeeding(f"{name}: expected numbers, got {shown(values)}") from error


def function_or_none(name: str, value: Any) -> None:
    """`InvalidSeeding` unless the value is None or can be called."""
    if value is not None and not callable(value):
        raise InvalidSeeding(f"{name}: expected a function or None, got {shown(value)}")


def answers(name: str, function: Callable[..., ArrayLike], *given: Any) -> NDArray[np.float64]:
    """Numbers that a user's function returns; `InvalidSeeding` names the function that fails, and how."""
    try:
        found = function(*given)
    except DecalsError:
        raise
    except Exception as error:
        raise InvalidSeeding(
            f"{name}: expected numbers from the function, but it raised {type(error).__name__}: {error}"
        ) from error
    return numbers(name, found)


def device_or_error(device: Any) -> str:
    """The name of a Warp device; `InvalidDevice` for one that there is not."""
    try:
        return known_device(device)
    except UnknownDevice as error:
        raise InvalidDevice(str(error)) from None
