"""Parameters and registry of custom kinds: read from typed functions, found by name."""

import copyreg
import importlib
import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import warp as wp

from blobtree.custom.source import CustomSource
from blobtree.errors import UnknownKind
from blobtree.nodes.parameters import Parameter, Quantity
from blobtree.nodes.tree import Node

_SIZES: dict[Any, int] = {
    wp.float32: 1,
    float: 1,
    wp.int32: 1,
    int: 1,
    wp.vec2: 2,
    wp.vec3: 3,
    wp.vec4: 4,
}

Limits = tuple[float | None, float | None]
"""Smallest and largest value of a parameter, None for no limit; of the length of a vector."""


def custom_parameters(
    source: CustomSource, names: Sequence[str], limits: Mapping[str, Limits] | None, base: type[Node]
) -> tuple[Parameter, ...]:
    """Return the named parameters of a user's function.

    Raises
    ------
    InvalidDefinition
        A parameter has a type that fits on no tape, the name of an attribute of every node, or limits that
        allow no value.
    """
    taken = {"_", *dir(base), *getattr(base, "__dataclass_fields__", ()), "radius", "color", "operands"}
    if not isinstance(limits, Mapping | None):
        raise source.refusal(
            f"limits: expected {{parameter: (smallest or None, largest or None), ...}}, got {limits!r}"
        )
    remaining = dict(limits or {})
    parameters = []
    for name in names:
        hint = source.parameters[name]
        if hint not in _SIZES:
            raise source.refusal(
                f"parameter {name!r}: expected wp.float32, wp.int32, wp.vec2, wp.vec3 or wp.vec4, "
                f"got {hint!r}"
            )
        if name in taken:
            raise source.refusal(
                f"parameter {name!r}: every node of this sort has an attribute of that name; choose another"
            )
        low, high = _limits(source, name, remaining.pop(name, (None, None)))
        parameters.append(
            Parameter(
                Quantity.NUMBERS,
                name=name,
                size=_SIZES[hint],
                whole=hint in (wp.int32, int),
                low=low,
                high=high,
            )
        )
    if remaining:
        raise source.refusal(f"limits: it has no parameter {', '.join(map(repr, remaining))}")
    return tuple(parameters)


def _limits(source: CustomSource, name: str, limits: Limits) -> tuple[float, float]:
    try:
        low, high = limits
        low, high = (-math.inf if low is None else float(low)), (math.inf if high is None else float(high))
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not low <= high:
        raise source.refusal(
            f"limits of {name!r}: expected (smallest or None, largest or None), got {limits!r}"
        )
    return low, high


class CustomKind(type):
    """The type of node classes that definitions make."""

    kind: str
    digest: str
    parameters: tuple[Any, ...]


class CustomNode(metaclass=CustomKind):
    """A node of a user's function: what the classes of all definitions share."""

    kind: ClassVar[str]
    digest: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]

    @property
    def values(self) -> dict[str, Any]:
        """The function's parameters by name."""
        return {parameter.name: getattr(self, parameter.name) for parameter in self.parameters}


_KINDS: dict[str, CustomKind] = {}


def register(kind: CustomKind) -> None:
    """Register a kind under its name, in place of an earlier one."""
    _KINDS[kind.kind] = kind


def registered(name: str) -> CustomKind | None:
    """Return the kind of this name, None if it is not defined."""
    return _KINDS.get(name)


def custom_kinds() -> tuple[CustomKind, ...]:
    """Return all kinds that are defined in this process, in the order of their definition."""
    return tuple(_KINDS.values())


def find_kind(name: str) -> CustomKind:
    """Return the kind of this name.

    Raises
    ------
    UnknownKind
        It is not defined in this process.
    """
    if name not in _KINDS:
        known = ", ".join(sorted(_KINDS)) or "none"
        raise UnknownKind(
            f"custom kind {name!r} is not defined in this process (defined: {known}); import the module that "
            "calls define_skeleton, define_operator, define_field or define_warp for it "
            "(on the command line: --define), then try again"
        )
    return _KINDS[name]


def _unpickled(name: str, module: str) -> CustomKind:
    """Return the kind of this name; import its module first if it is not defined yet."""
    if name not in _KINDS and module != "__main__":
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise UnknownKind(
                f"custom kind {name!r}: its module {module!r} cannot be imported: {error}"
            ) from None
    return find_kind(name)


def _pickled(kind: CustomKind) -> tuple[Any, ...]:
    return _unpickled, (kind.kind, kind.__module__)


copyreg.pickle(CustomKind, _pickled)
