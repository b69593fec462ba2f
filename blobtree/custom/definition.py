"""Definitions of custom kinds: parameters and claims read from typed functions, and a registry by name."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import make_dataclass
from typing import Annotated, Any, ClassVar

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


def tape_readings(
    parameters: tuple[Parameter, ...], first: int = 0, skipped: int = -1
) -> tuple[list[str], int]:
    """Return the expressions that read each parameter from texels t0, t1 and so on, and the number of texels.

    The numbers begin at the place `first`, in floats, and leave out the place `skipped`.
    """
    readings, place = [], first
    for parameter in parameters:
        components = []
        for _ in range(parameter.size):
            place += place == skipped
            components.append(f"t{place // 4}[{place % 4}]")
            place += 1
        if parameter.size > 1:
            readings.append(f"wp.vec{parameter.size}({', '.join(components)})")
        else:
            readings.append(f"int({components[0]})" if parameter.whole else components[0])
    return readings, -(-place // 4)


def texel_lines(count: int) -> str:
    """Return the lines of a generated function that read its texels."""
    return "".join(f"    t{i} = tape[at + {i}]\n" for i in range(count))


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


def node_class(
    kind: str, source: Formula, fields: list[Any], base: type[Node], namespace: dict[str, Any]
) -> Any:
    """Return a node class with these fields, in the module of the function."""
    options: dict[str, Any] = {"frozen": True, "eq": False, "repr": False}
    node_type = make_dataclass(class_name(kind), fields, bases=(base,), namespace=namespace, **options)
    node_type.__module__ = source.python.__module__
    return node_type


class CustomNode(metaclass=CustomKind):
    """A node of a user's function: what the classes of all definitions share."""

    kind: ClassVar[str]
    digest: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]

    @classmethod
    def content_key(cls) -> tuple[str, ...]:
        """Return what names the kind in content hashes: its name, and the digest of its functions."""
        return cls.__mro__[1].__name__, cls.kind, cls.digest

    @property
    def values(self) -> dict[str, Any]:
        """The function's parameters by name."""
        return {parameter.name: getattr(self, parameter.name) for parameter in self.parameters}


def defined_kind(
    base: type[Any],
    source: Formula,
    kind: str,
    digest: str,
    parameters: tuple[Parameter, ...],
    *,
    check: Callable[[], None],
    row: Callable[[], Mapping[str, Any]],
    fields: Sequence[Any] = (),
) -> Any:
    """Return the node class of a definition: the registered one, or a new one after `check`.

    `row` returns attributes of the class, such as the row of its table. `fields` follow the parameters.
    """
    known = CUSTOM_KINDS.get(kind)
    if known is not None and issubclass(known, base) and known.digest == digest:
        return known
    check()
    declared = [(parameter.name, Annotated[Any, parameter]) for parameter in parameters]
    described = source.python.__doc__ or f"A node of the custom kind {kind!r}."
    namespace = {"__doc__": described, "kind": kind, "digest": digest, "parameters": parameters, **row()}
    node: Any = node_class(kind, source, [*declared, *fields], base, namespace)
    CUSTOM_KINDS[kind] = node
    return node
