"""`Recipe`: how the decals of a scene were made, as plain values that a scene file keeps."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from enum import Enum
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Self

import numpy as np

from decals._version import __version__
from decals.errors import InvalidScene
from decals.validation import describe, instance, whole_number

PACKAGES = ("numpy", "warp-lang", "pyvista")
"""Packages whose versions a recipe names, beside this one and Python."""

MAX_ITEMS = 1000
"""Longest list that a recipe keeps."""


@dataclass(frozen=True)
class Recipe:
    """How the decals of a scene were made; a text for people, and enough to make them again.

    Parameters
    ----------
    function : str
        Name of the function, such as ``"decals.cover"``.
    parameters : mapping of str
        Its arguments but the seed: numbers, texts, booleans, None, and lists and mappings of them.
    seed : int
        Its seed.
    versions : mapping of str to str
        Versions of Python and the packages.

    Raises
    ------
    InvalidScene
        If a value is of another type.

    Examples
    --------
    >>> import blobtree, decals
    >>> recipe = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12, seed=3).recipe
    >>> recipe.function, recipe.parameters["count"], recipe.seed
    ('decals.cover', 12, 3)
    """

    function: str
    parameters: Mapping[str, Any]
    seed: int
    versions: Mapping[str, str]

    def __post_init__(self) -> None:
        instance("a recipe's function", self.function, str, InvalidScene, "such as 'decals.cover'")
        whole_number("a recipe's seed", self.seed, 0, None, InvalidScene)
        for name in ("parameters", "versions"):
            values = getattr(self, name)
            if not isinstance(values, Mapping):
                raise InvalidScene(f"a recipe's {name}: expected a mapping, got {describe(values)}")
            object.__setattr__(self, name, {str(key): plain(value) for key, value in values.items()})

    @classmethod
    def of(cls, function: str, *, seed: int, **parameters: Any) -> Self:
        """Return the recipe of a call now: values that are not plain are described in words."""
        return cls(function, parameters, seed, _versions())


def plain(value: Any) -> Any:
    """Return a value of JSON: itself if it is one, else its description."""
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float | np.number):
        number = value.item() if isinstance(value, np.number) else value
        return number if np.isfinite(number) else str(number)
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple) and len(value) <= MAX_ITEMS:
        return [plain(item) for item in value]
    if isinstance(value, Enum):
        return plain(value.value)
    if is_dataclass(value) and not isinstance(value, type):
        return plain(vars(value))
    return getattr(value, "__qualname__", None) or describe(value)


def _versions() -> dict[str, str]:
    versions = {"implicit-decals": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions
