"""Checks of custom kinds: samples in double precision that may contradict a definition.

They cannot prove a claim, but a wrong function seldom passes.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.formula import Formula, result_of, shown
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.transpile.python import Precision, Vector

TRIAL_SPREAD = 2.0
"""Distance from their limits, or from 0, up to which numbers are drawn for trials."""

LEAST_LENGTH = 1e-3
"""Least length that is drawn for trials."""

LENGTHS = (Quantity.EXTENTS, Quantity.SEMI_AXES)
VECTORS = (Quantity.POINT, Quantity.DIRECTION, *LENGTHS)
"""Quantities of three numbers, some of which are lengths."""

SEED = 20
TRIALS = 14
"""Number of sets of parameters."""

SLOPE_TOLERANCE = 1e-4
VALUE_TOLERANCE = 1e-6


Packed = Callable[[dict[str, Any]], dict[str, Any]]
"""A function from values of parameters to the numbers that formulas take, by name."""


def trial_value(parameter: Parameter, rng: np.random.Generator, trial: int) -> Any:
    """Return a value within the limits for a trial; the first trials take axes, zeros and limits."""
    size = 3 if parameter.quantity in VECTORS else parameter.size
    if size == 1:
        return _trial_number(parameter, rng, trial)
    low, high = parameter.low, parameter.high
    if trial < size + 1:
        vector = np.eye(size)[trial] if trial < size else np.zeros(size)
    else:
        vector = rng.uniform(-1.0, 1.0, size)
    if parameter.quantity in LENGTHS:
        vector = np.abs(vector) + LEAST_LENGTH
    elif parameter.quantity is Quantity.DIRECTION:
        vector /= float(np.linalg.norm(vector)) or math.inf
        vector = vector if vector.any() else np.eye(3)[0]
    length = float(np.linalg.norm(vector))
    allowed = min(max(length, low), high)
    if allowed == length:
        return tuple(vector.tolist())
    direction = vector / length if length > 0.0 else np.eye(size)[0]
    return tuple((direction * allowed * (1.0 + 1e-9)).tolist())


def _trial_number(parameter: Parameter, rng: np.random.Generator, trial: int) -> float | int:
    low, high = parameter.low, parameter.high
    if parameter.quantity in (Quantity.LENGTH, Quantity.RADIUS):
        low = max(low, LEAST_LENGTH)
    low = low if low > -math.inf else min(high, TRIAL_SPREAD) - 2.0 * TRIAL_SPREAD
    high = high if high < math.inf else max(low, -TRIAL_SPREAD) + 2.0 * TRIAL_SPREAD
    near = min(high, low + TRIAL_SPREAD)
    number = (low, high, near, rng.uniform(low, high), rng.uniform(low, near))[trial % 5]
    return round(number) if parameter.whole else float(number)


def in_precision(value: Any, precision: Precision) -> Any:
    """Return a number or a vector in a floating-point type; whole numbers stay as they are."""
    if isinstance(value, tuple):
        return np.array(value, precision).view(Vector)
    return precision(value) if isinstance(value, float) else value


@dataclass(frozen=True)
class Trial:
    """A user's function of a point, with one set of values of its other parameters."""

    source: Formula
    values: dict[str, Any]
    size: int
    """Number of numbers that it returns."""

    def call(
        self, function: Formula, leading: tuple[Any, ...], size: int, precision: Precision = np.float64
    ) -> Float64Array:
        """Return the result (size,) of a function of leading arguments, the point first, and the values."""
        arguments = [in_precision(value, precision) for value in (*leading, *self.values.values())]
        return result_of(
            function, function.reference(precision), arguments, lambda: self.where(leading), size
        )

    def where(self, leading: tuple[Any, ...]) -> str:
        """Return the arguments of a call as messages show them."""
        values = ", ".join(f"{name} = {shown(value)}" for name, value in self.values.items())
        point = f"q = {shown(leading[0])}" if leading else "these parameters"
        return point + (f" with {values}" if values else "")

    @property
    def with_values(self) -> str:
        """The values as messages end with them; empty without any."""
        return f", with {self.values}" if self.values else ""

    def at(self, q: Float64Array, precision: Precision = np.float64) -> Float64Array:
        """Return the function's result at a point."""
        return self.call(self.source, (tuple(q),), self.size, precision)

    def bound(self, claim: float | Formula, center: Float64Array, radius: float) -> float:
        """Return a claimed bound in a ball."""
        if isinstance(claim, float):
            return claim
        ball = (tuple(center), radius) if len(claim.parameters) > len(self.values) else ()
        return float(self.call(claim, ball, 1)[0])


def trials(
    source: Formula,
    parameters: tuple[Parameter, ...],
    size: int,
    extent: float,
    points: int,
    rng: np.random.Generator,
    packed: Packed = dict,
) -> Iterator[tuple[Trial, Float64Array]]:
    """Yield trials with values within the limits, each with points (n, 3) around the origin."""
    for number in range(TRIALS if parameters else 2):
        values = {parameter.name: trial_value(parameter, rng, number) for parameter in parameters}
        spread = extent * rng.choice([0.1, 0.4, 1.0], (points, 1))
        yield Trial(source, packed(values), size), rng.uniform(-1.0, 1.0, (points, 3)) * spread
