"""Checks of arguments: each returns the checked value, or raises an error that says what was expected."""

import math
import os
import tempfile
from collections.abc import Callable, Collection
from contextlib import suppress
from enum import Enum, IntEnum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array
from blobtree.colors import color_rgb, is_named
from blobtree.files import is_folder, is_read_only, is_too_long
from blobtree.validation import (
    as_count,
    describe,
    finite_number,
    is_whole,
    real,
    real_number,
    with_article,
)
from decals.errors import ImplicitDecalsError, InvalidDecals, InvalidImage, InvalidScene, MissingPackage

T = TypeVar("T")
E = TypeVar("E", bound=Enum)

LENGTH_TOLERANCE = 1e-6
"""Vectors whose length, or whose cosine with the normal, is so near to 1 or 0 are kept bit for bit."""

MIN_TANGENT_SINE = 1e-3
"""Sine of the angle between a tangent and its normal below which the tangent is refused."""


# -- single values: the error is the caller's -----------------------------------------------------------


def instance(name: str, value: object, kind: type[T], error: type[ImplicitDecalsError], advice: str) -> T:
    """Return a value of a type; raise an error with advice for any other."""
    if not isinstance(value, kind):
        raise error(f"{name}: expected {with_article(kind.__name__)}, got {describe(value)}; {advice}")
    return value


def member(
    name: str, value: Any, kind: type[E], error: type[ImplicitDecalsError], among: Collection[E] = ()
) -> E:
    """Return a member of an enumeration, which may be given by its value, or by its name in any case.

    With ``among``, only these members are accepted.
    """
    if isinstance(value, kind) and value in (among or kind):
        return value
    words = {one: one.value if isinstance(one.value, str) else one.name.lower() for one in among or kind}
    if isinstance(value, str):
        for one, word in words.items():
            if value.strip().lower() in (word, one.name.lower()):
                return one
    choices = ", ".join(map(repr, words.values()))
    raise error(f"{name}: expected one of {choices}, got {describe(value)}")


def one_of(name: str, value: object, choices: Collection[str], error: type[ImplicitDecalsError]) -> str:
    """Return a text that is one of the choices."""
    if not isinstance(value, str) or value not in choices:
        raise error(f"{name}: expected one of {', '.join(choices)}, got {describe(value)}")
    return value


def whole_number(name: str, value: Any, low: int, high: int | None, error: type[ImplicitDecalsError]) -> int:
    """Return a whole number from low to high as an int; ``high`` None is no limit.

    If low is above high, no index is valid: the scene has no such part.
    """
    if is_whole(value) and low <= value and (high is None or value <= high):
        return int(value)
    if high is None:
        expected = f"a whole number from {low} upward"
    elif low <= high:
        expected = f"a whole number from {low} to {high}"
    else:
        expected = "no index, as the scene has none of these"
    raise error(f"{name}: expected {expected}, got {describe(value)}")


def count_number(name: str, value: Any, low: int, high: int | None, error: type[ImplicitDecalsError]) -> int:
    """Return a count as an int; like `whole_number`, but a float without a fraction counts too."""
    return whole_number(name, as_count(value), low, high, error)


def any_number(name: str, value: Any, error: type[ImplicitDecalsError]) -> float:
    """Return a finite number of any size, such as a pixel or a time, as a float."""
    return allowed_number(name, value, "a finite number", math.isfinite, error)


def number_of(name: str, value: Any, error: type[ImplicitDecalsError]) -> float:
    """Return a finite number that a form sent, as a number or as text."""
    with suppress(ValueError):
        value = float(value) if isinstance(value, str) else value
    return finite_number(name, value, error)


def allowed_number(
    name: str,
    value: Any,
    expected: str,
    allowed: Callable[[float], bool],
    error: type[ImplicitDecalsError],
) -> float:
    """Return a finite number that is allowed; ``expected`` describes such numbers in the message."""
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and allowed(number)):
        raise error(f"{name}: expected {expected}, got {describe(value)}")
    return number


MAX_STIFFNESS = 64.0
"""Greatest stiffness of elastic contact; beyond it, float32 does not resolve the width of the contact."""


def stiffness_number(value: Any, error: type[ImplicitDecalsError]) -> float:
    """Return a stiffness of elastic contact as a float."""
    expected = f"a number from 1 to {MAX_STIFFNESS:g}"
    return allowed_number("stiffness", value, expected, lambda number: 1.0 <= number <= MAX_STIFFNESS, error)


def real_array(
    name: str, values: ArrayLike, error: type[ImplicitDecalsError], *, truths: bool = False
) -> Float64Array:
    """Return numbers as an array of any shape; ``truths`` lets True and False count as 1 and 0."""
    try:
        array = np.asarray(values)
        return np.asarray(array if truths and array.dtype == np.bool_ else real(array), dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as reason:
        raise error(f"{name}: expected numbers, got {describe(values)}") from reason


def function_or_none(name: str, value: Any, error: type[ImplicitDecalsError]) -> None:
    """Raise an error unless the value is None or can be called."""
    if value is not None and not callable(value):
        raise error(f"{name}: expected a function or None, got {describe(value)}")


def function_values(
    name: str,
    function: Callable[..., ArrayLike],
    *arguments: Any,
    error: type[ImplicitDecalsError],
    truths: bool = False,
) -> Float64Array:
    """Return the numbers that a user's function returns; the error names a function that fails."""
    return real_array(name, called(name, function, *arguments, error=error), error, truths=truths)


def called(name: str, function: Callable[..., T], *arguments: Any, error: type[ImplicitDecalsError]) -> T:
    """Return what a user's function returns; the error names a function that fails."""
    try:
        return function(*arguments)
    except ImplicitDecalsError:
        raise
    except Exception as reason:
        raise error(
            f"{name}: expected numbers from the function, but it raised {type(reason).__name__}: {reason}"
        ) from reason


MAX_LIGHT = 65504.0
"""Brightest light of an image: the largest half float, which graphics cards store."""


def require_rgba(name: str, pixels: Any, error: type[ImplicitDecalsError] = InvalidImage) -> NDArray[Any]:
    """Return pixels that are ``uint8``, ``uint16`` or ``float32[h, w, 4]`` with h, w > 0, or raise an error.

    Floats are linear light from 0 to `MAX_LIGHT`, with alpha up to 1.
    """
    expected = f"{name}: expected uint8, uint16 or float32 pixels [h, w, 4]"
    if not isinstance(pixels, np.ndarray):
        raise error(f"{expected}, got {describe(pixels)}; use decals.DecalImage.load")
    kinds = np.uint8, np.uint16, np.float32
    native: NDArray[Any] = pixels.astype(pixels.dtype.newbyteorder("="), copy=False)
    if native.dtype not in kinds or native.ndim != 3 or native.shape[2] != 4 or 0 in native.shape:
        raise error(f"{expected}, got {native.dtype}{list(native.shape)}; use decals.DecalImage.load")
    if native.dtype == np.float32:
        low, high, alpha = (float(of) for of in (native.min(), native.max(), native[..., 3].max()))
        if not (low >= 0.0 and high <= MAX_LIGHT and alpha <= 1.0):
            raise error(
                f"{name}: expected linear light from 0 to {MAX_LIGHT:g} with alpha up to 1, got {low:g} to "
                f"{high:g} with alpha up to {alpha:g}; clip it"
            )
    return native


def is_unicode(text: str) -> bool:
    """Return True if a text has an encoding; False for the lone surrogates of undecodable file names."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def as_path(path: object, error: type[ImplicitDecalsError] = InvalidScene) -> Path:
    """Return the path of a file; raise an error for values of other types."""
    if isinstance(path, str) and not path:
        raise error("path: expected the path of a file, got an empty text")
    try:
        return Path(cast("str | os.PathLike[str]", path))
    except TypeError:
        raise error(f"path: expected the path of a file, got {describe(path)}; give a text") from None


def checked_path(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> Path:
    """Return the path of a file with one of these suffixes that can be written, or raise InvalidScene."""
    known = " or ".join(suffixes)
    if not isinstance(path, str | os.PathLike) or path == "":
        raise InvalidScene(f"path: expected the path of a {known} file, got {describe(path)}")
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise InvalidScene(f"path: expected a file that ends in {known}, got {str(path)!r}; rename it")
    if is_too_long(path):
        raise InvalidScene(f"path: expected a shorter name of a file, got {path.name!r:.80}; rename it")
    if is_folder(path):
        raise InvalidScene(f"path: expected a file, {str(path)!r} is a folder; add a file name")
    if is_read_only(path):
        raise InvalidScene(f"path: the file {str(path)!r} is read-only; choose another name")
    folder = path.parent
    if not is_folder(folder):
        raise InvalidScene(f"path: the folder {str(folder)!r} does not exist; create it first")
    try:
        tempfile.TemporaryFile(dir=folder).close()  # permissions alone are no proof
    except OSError as error:
        raise InvalidScene(
            f"path: the folder {str(folder)!r} cannot be written ({error.strerror}); choose another"
        ) from error
    return path


def optional_package(name: str, extra: str) -> ModuleType:
    """Return a package of an extra of this project; raise MissingPackage if it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingPackage(
            f"expected the package {name}, which is not installed; run pip install 'implicit-decals[{extra}]'"
        ) from error


# -- columns of decals: InvalidDecals -------------------------------------------------------------------


def finite_array(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Float64Array:
    """Return finite numbers of a shape (-1: any length) as a new float64 array."""
    try:
        array = np.array(real(values), np.float64)
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


def _check_shape(name: str, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
    if len(shape) != len(expected) or any(e not in (-1, s) for s, e in zip(shape, expected, strict=True)):
        lengths = ", ".join("n" if e == -1 else str(e) for e in expected)
        raise InvalidDecals(f"{name}: expected shape [{lengths}], got {list(shape)}; give one row per decal")


def check_range(
    name: str, values: Float64Array, low: float, high: float, *, advice: str = "rescale the model"
) -> None:
    """Raise InvalidDecals for values outside a range."""
    bad = (values < low) | (values > high)
    if bad.any():
        index = tuple(np.argwhere(bad)[0])
        if low > 0.0 >= values[index]:
            advice = "give positive numbers"
        raise InvalidDecals(
            f"{name}: expected values from {low:g} to {high:g}, got {values[index]:g} in row {index[0]};"
            f" {advice}"
        )


def unit_vectors(name: str, vectors: Float64Array) -> Float64Array:
    """Return vectors scaled to length 1; those that have it within rounding are kept."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    if (largest == 0.0).any():
        row = int(np.argmin(largest))
        raise InvalidDecals(f"{name}: expected a direction, got a zero vector in row {row}; give it a length")
    scaled = vectors / largest[:, None]
    lengths = np.linalg.norm(scaled, axis=1) * largest
    keep = np.abs(lengths - 1.0) <= LENGTH_TOLERANCE
    return np.where(keep[:, None], vectors, scaled / np.linalg.norm(scaled, axis=1, keepdims=True))


def orthogonal_vectors(tangents: Float64Array, normals: Float64Array) -> Float64Array:
    """Return unit tangents perpendicular to unit normals; those that are so within rounding are kept."""
    along = (tangents * normals).sum(axis=1)
    across = tangents - along[:, None] * normals
    lengths = np.linalg.norm(across, axis=1)
    if (lengths < MIN_TANGENT_SINE).any():
        row = int(np.argmin(lengths))
        raise InvalidDecals(
            f"tangents: expected a direction across the normal, got {tangents[row]}"
            f" along normal {normals[row]} in row {row}; turn one of them"
        )
    keep = np.abs(along) <= LENGTH_TOLERANCE
    return np.where(keep[:, None], tangents, across / np.maximum(lengths, MIN_TANGENT_SINE)[:, None])


def whole_array(name: str, values: Any, count: int, *, low: int, high: int) -> Int32Array:
    """Return whole numbers from low to high as a new array; one stands for all rows."""
    array = np.array(one_or_each(values, count))
    _check_shape(name, array.shape, (count,))
    if (count and array.dtype.kind not in "iu") or array.dtype.kind not in "iuf":
        first = f" such as {array[0]}" if count and array.dtype.kind == "f" else ""
        raise InvalidDecals(
            f"{name}: expected whole numbers, got {array.dtype.name}{first}; convert them with .astype(int)"
        )
    bad = (array < low) | (array > high)
    if bad.any():
        row = int(np.argmax(bad))
        raise InvalidDecals(f"{name}: expected numbers from {low} to {high}, got {array[row]} in row {row}")
    return array.astype(np.int32)


def member_array(name: str, values: Any, count: int, kind: type[IntEnum]) -> Int32Array:
    """Return members of an enumeration as a new array of their numbers.

    Members may be given by name. A single one stands for all rows.
    """
    if isinstance(values, str | kind):
        values = [values] * count
    values = _items(values)
    if isinstance(values, list | tuple):
        values = [member(name, one, kind, InvalidDecals) if isinstance(one, str) else one for one in values]
    return whole_array(name, values, count, low=min(kind), high=max(kind))


def color_values(name: str, values: Any, error: type[ImplicitDecalsError]) -> Any:
    """Return one colour, or colours, with three numbers for each name; other values as they are."""
    values = _items(values)
    if values is None or isinstance(values, np.ndarray):
        return values
    if is_named(values):
        return color_rgb(name, values, error)
    if isinstance(values, list | tuple):
        return [color_rgb(name, one, error) if is_named(one) else one for one in values]
    return values


def color_array(name: str, values: Any, count: int) -> Float32Array:
    """Return sRGB colours as a new array ``[count, 3]``; one stands for all rows."""
    numbers = color_values(name, values, InvalidDecals)
    channels = list(numbers) if isinstance(numbers, list | tuple) or np.ndim(numbers) == 1 else []
    single = len(channels) == 3 and all(isinstance(one, int | float | np.number) for one in channels)
    rows = np.tile(numbers, (count, 1)) if single else numbers
    return unit_interval(name, rows, (count, 3)).astype(np.float32)


def _items(values: Any) -> Any:
    """Return an array of texts or objects as a list, other values as they are."""
    return values.tolist() if isinstance(values, np.ndarray) and values.dtype.kind in "UO" else values


def one_or_each(values: Any, count: int) -> Any:
    """Return a single number as an array of so many equal numbers, and anything else as it is."""
    single = isinstance(values, int | float | np.number) or getattr(values, "ndim", None) == 0
    return np.full(count, values) if single else values


def unit_interval(name: str, values: Any, shape: tuple[int, ...]) -> Float64Array:
    """Return numbers from 0 to 1 as a new array."""
    array = finite_array(name, values, shape)
    check_range(name, array, 0.0, 1.0, advice="divide colours in bytes by 255")
    return array


def bool_array(name: str, values: Any, count: int) -> BoolArray:
    """Return truth values as a new array; one stands for all rows."""
    array = np.array(one_or_each(values, count))
    if not isinstance(values, str):
        _check_shape(name, array.shape, (count,))
    if count and array.dtype != np.bool_:
        raise InvalidDecals(f"{name}: expected True or False, got {array.dtype}; compare or cast it first")
    return array.astype(np.bool_)


def row_selection(rows: ArrayLike) -> NDArray[Any]:
    """Return indices or a mask as an array; an empty list selects no row."""
    array = np.asarray(rows)
    return array.astype(np.intp) if array.size == 0 else array


class KnownAttributes:
    """Base of classes with settings: an attribute that the class does not declare cannot be set.

    Public attributes are annotated in the class, or are properties. `_elsewhere` is the name of the attribute
    that has other settings.
    """

    _elsewhere = ""

    if not TYPE_CHECKING:  # else mypy accepts all names

        def __setattr__(self, name: str, value: Any) -> None:
            kind = type(self)
            if not (name.startswith("_") or name in kind.__annotations__ or hasattr(kind, name)):
                settings = ", ".join(key for key in dir(kind) if getattr(getattr(kind, key), "fset", None))
                message = f"expected one of the settings {settings}, got {name!r}"
                if self._elsewhere and hasattr(type(getattr(self, self._elsewhere)), name):
                    message += f"; set `{self._elsewhere}.{name}` instead"
                raise InvalidScene(message)
            super().__setattr__(name, value)
