"""Definitions of custom kinds: parameters and claims read from typed functions, and a registry by name."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import warp as wp

from blobtree.declare.formula import Formula, class_name, formula, formula_of
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.declare.readers import SIZES
from blobtree.declare.registry import CUSTOM_KINDS as CUSTOM_KINDS
from blobtree.declare.registry import CustomKind
from blobtree.declare.registry import unpickled_kind as _unpickled  # noqa: F401  (old pickles name it here)
from blobtree.nodes.declared import DeclaredNode
from blobtree.nodes.node import Node

Limits = tuple[float | None, float | None]
"""Smallest and largest value of a parameter, None for no limit; of the length of a vector."""


def custom_parameters(
    source: Formula, names: Sequence[str], limits: Mapping[str, Limits] | None, base: type[Node]
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
        if hint not in SIZES:
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
                size=SIZES[hint],
                whole=hint in (wp.int32, int),
                low=low,
                high=high,
            )
        )
    if remaining:
        raise source.refusal(f"limits: it has no parameter {', '.join(map(repr, remaining))}")
    return tuple(parameters)


def _limits(source: Formula, name: str, limits: Limits) -> tuple[float, float]:
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


def point_function(function: Any, returns: Any) -> tuple[Formula, list[str]]:
    """Return a user's function of a point, and the names of its other parameters.

    Raises
    ------
    InvalidDefinition
        It is no typed function with this result, or its first parameter is no point.
    """
    source = formula_of(function, returns=returns)
    first, *names = list(source.parameters) or [""]
    if source.parameters.get(first) is not wp.vec3:
        raise source.refusal("expected the point `q: wp.vec3` as its first parameter")
    return source, names


def short_form(
    base: type[DeclaredNode],
    kind: str,
    source: Formula,
    parameters: tuple[Parameter, ...],
    parts: Mapping[str, Any],
    **claims: Any,
) -> Any:
    """Return the class of a definition: the registered one of the same formulas, or a new one.

    Parts are formulas, or numbers, by their names in classes; None for none.
    """
    given = {name: part for name, part in parts.items() if part is not None}
    body: dict[str, Any] = {
        "tag": kind,
        "__annotations__": {parameter.name: Annotated[Any, parameter] for parameter in parameters},
        "__module__": source.python.__module__,
        "__doc__": source.python.__doc__ or f"A node of the custom kind {kind!r}.",
        **claims,
        **{name: p if name == "lipschitz" and not callable(p) else formula(p) for name, p in given.items()},
    }
    known: Any = CUSTOM_KINDS.get(kind)
    made: Any = CustomKind(class_name(kind), (base,), body)
    same = issubclass(known or object, base) and known.digest == made.digest
    CUSTOM_KINDS[kind] = known if same else made
    return CUSTOM_KINDS[kind]
