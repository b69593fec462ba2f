"""`Recipe`: how the decals of a scene were made, as plain values that a scene file keeps."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import Enum
from typing import Any, Self

import numpy as np

from blobtree.identity import content_hash
from blobtree.validation import describe
from decals.errors import InvalidScene
from decals.model import Decals
from decals.scenes.objects import SceneObject, TreeObject
from decals.scenes.provenance import device_text, package_versions, provenance
from decals.validation import instance, whole_number

NEEDED = ("function", "parameters", "seed", "versions")
"""Parts that every file with a recipe has."""

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
        Versions of Python, this package and its dependencies.
    made : mapping of str
        Where it was made: time, platform, device, and the commit and state of a checkout.
    missing : sequence of str
        Parameters whose values are no plain ones, such as functions, and which ``parameters`` only describes.
    inputs : mapping of str to str
        Content hashes of the shapes of the objects, by their names.
    result : str
        Content hash of the decals.

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
    made: Mapping[str, Any] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    result: str = ""

    def __post_init__(self) -> None:
        instance("a recipe's function", self.function, str, InvalidScene, "such as 'decals.cover'")
        whole_number("a recipe's seed", self.seed, 0, None, InvalidScene)
        instance("a recipe's result", self.result, str, InvalidScene, "a content hash")
        object.__setattr__(self, "missing", tuple(map(str, self.missing)))
        for name in ("parameters", "versions", "made", "inputs"):
            values = getattr(self, name)
            if not isinstance(values, Mapping):
                raise InvalidScene(f"a recipe's {name}: expected a mapping, got {describe(values)}")
            object.__setattr__(self, name, {str(key): plain(value) for key, value in values.items()})

    @classmethod
    def of(cls, function: str, *, seed: int, **parameters: Any) -> Self:
        """Return the recipe of a call now: values that are not plain are described in words."""
        missing = tuple(name for name, value in parameters.items() if not is_plain(value))
        made = provenance(device_text(str(parameters.get("device") or "cpu")))
        return cls(function, parameters, seed, package_versions(), made, missing)

    def giving(self, decals: Decals, objects: Iterable[SceneObject]) -> Self:
        """Return the recipe with the content hashes of the decals that it gives, and of the objects below."""
        inputs = {item.name: shape_hash(item) for item in objects}
        return replace(self, inputs=inputs, result=decals.content_hash)

    @property
    def record(self) -> dict[str, Any]:
        """Its parts for a file, without those that are empty."""
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        return {name: value for name, value in parts.items() if value or name in NEEDED}


def shape_hash(item: SceneObject) -> str:
    """Return the content hash of what decals are scattered over: the shape of an object, and its place."""
    shape = item.tree if isinstance(item, TreeObject) else (item.vertices, item.faces)
    return content_hash((shape, item.origin))


def is_plain(value: Any) -> bool:
    """Return True if `plain` keeps a value, rather than describing it."""
    if isinstance(value, np.ndarray):
        return value.size <= MAX_ITEMS and value.dtype.kind in "biuf"
    if isinstance(value, Mapping):
        return all(map(is_plain, value.values()))
    if is_dataclass(value) and not isinstance(value, type):
        return is_plain(_values(value))
    if isinstance(value, list | tuple):
        return len(value) <= MAX_ITEMS and all(map(is_plain, value))
    return value is None or isinstance(value, str | bool | int | float | np.number | Enum)


def _values(record: Any) -> dict[str, Any]:
    """Return the values of a dataclass, which may have slots."""
    return {part.name: getattr(record, part.name) for part in fields(record)}


def plain(value: Any) -> Any:
    """Return a value of JSON: itself if it is one, else its description."""
    if isinstance(value, np.ndarray) and is_plain(value):
        return plain(value.tolist())
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
        return plain(_values(value))
    return getattr(value, "__qualname__", None) or describe(value)
