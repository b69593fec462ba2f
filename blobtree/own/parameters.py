"""Typed parameters of own kinds: how values are checked, put on the tape, and drawn for trials."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree.errors import InvalidNode
from blobtree.nodes.tree import Node
from blobtree.own.source import OwnSource
from blobtree.validation import finite_number

_SIZES: dict[Any, int] = {
    wp.float32: 1,
    float: 1,
    wp.int32: 1,
    int: 1,
    wp.vec2: 2,
    wp.vec3: 3,
    wp.vec4: 4,
}

TRIAL_SPREAD = 2.0
"""How far from their limits, or from 0, numbers are drawn for trials."""

LARGEST_WHOLE = 1 << 24
"""Beyond it float32 skips whole numbers."""

Limits = tuple[float | None, float | None]


@dataclass(frozen=True)
class Parameter:
    """One parameter of an own kind."""

    name: str
    size: int
    """Components: 1 is a number, more a vector."""
    whole: bool
    low: float
    high: float
    """Where a number, or the length of a vector, may lie."""

    def checked(self, value: Any) -> Any:
        """`value` as a float, an int or a tuple of floats; InvalidNode where it is none, or off limits."""
        result: float | tuple[float, ...]
        if self.size == 1:
            number = finite_number(self.name, value)
            if self.whole and (number != int(number) or abs(number) > LARGEST_WHOLE):
                raise InvalidNode(f"{self.name}: expected a whole number, got {value!r}")
            measure, result = number, int(number) if self.whole else number
        else:
            try:
                components = tuple(finite_number(self.name, component) for component in value)
            except TypeError:
                components = ()
            if len(components) != self.size:
                raise InvalidNode(f"{self.name}: expected {self.size} finite numbers, got {value!r}")
            measure, result = math.hypot(*components), components
        if not self.low <= measure <= self.high:
            what = "a number" if self.size == 1 else "a vector of length"
            raise InvalidNode(f"{self.name}: expected {what} {self.range}, got {value!r}")
        return result

    @property
    def range(self) -> str:
        """The limits in words."""
        if self.high == math.inf:
            return f"from {self.low:g}"
        return f"from {self.low:g} to {self.high:g}" if self.low > -math.inf else f"up to {self.high:g}"

    def components(self, value: Any) -> tuple[float, ...]:
        """A checked value as floats."""
        return (float(value),) if self.size == 1 else tuple(value)

    def drawn(self, rng: np.random.Generator, trial: int) -> Any:
        """A value within the limits; the first trials take the plain ones, which people type."""
        if self.size == 1:
            return self._number(rng, trial)
        if trial < self.size + 1:
            vector = np.eye(self.size)[trial] if trial < self.size else np.zeros(self.size)
        else:
            vector = rng.uniform(-1.0, 1.0, self.size)
        length = float(np.linalg.norm(vector))
        wanted = min(max(length, self.low), self.high)
        if wanted == length:
            return tuple(vector.tolist())
        direction = vector / length if length > 0.0 else np.eye(self.size)[0]
        return tuple((direction * wanted * (1.0 + 1e-9)).tolist())

    def _number(self, rng: np.random.Generator, trial: int) -> float | int:
        low = self.low if self.low > -math.inf else min(self.high, TRIAL_SPREAD) - 2.0 * TRIAL_SPREAD
        high = self.high if self.high < math.inf else max(low, -TRIAL_SPREAD) + 2.0 * TRIAL_SPREAD
        near = min(high, low + TRIAL_SPREAD)
        number = (low, high, near, rng.uniform(low, high), rng.uniform(low, near))[trial % 5]
        return round(number) if self.whole else float(number)


def parameters_of(
    source: OwnSource, own: Sequence[str], limits: Mapping[str, Limits] | None, base: type[Node]
) -> tuple[Parameter, ...]:
    """The parameters `own` of a user's function.

    Raises
    ------
    InvalidDefinition
        One has a type that fits on no tape or a name that every node has, or limits that allow nothing.
    """
    taken = {"_", *dir(base), "radius", "color", "operands"}
    if not isinstance(limits, Mapping | None):
        raise source.refusal(
            f"limits: expected {{parameter: (smallest or None, largest or None), ...}}, got {limits!r}"
        )
    given = dict(limits or {})
    parameters = []
    for name in own:
        hint = source.parameters[name]
        if hint not in _SIZES:
            raise source.refusal(
                f"parameter {name!r}: expected wp.float32, wp.int32, wp.vec2, wp.vec3 or wp.vec4, "
                f"got {hint!r}"
            )
        if name in taken:
            raise source.refusal(f"parameter {name!r}: every node has one of that name; choose another")
        low, high = _limits(source, name, given.pop(name, (None, None)))
        parameters.append(Parameter(name, _SIZES[hint], hint in (wp.int32, int), low, high))
    if given:
        raise source.refusal(f"limits: it has no parameter {', '.join(map(repr, given))}")
    return tuple(parameters)


def _limits(source: OwnSource, name: str, limits: Limits) -> tuple[float, float]:
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
