"""Checks of custom fields: samples in double precision that may contradict a definition."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.custom.checks import SEED, SLOPE_TOLERANCE, TRIALS, VALUE_TOLERANCE, trial_value
from blobtree.custom.source import CustomSource
from blobtree.nodes.parameters import Parameter
from blobtree.transpile.python import Precision, vector

POINTS = 40
"""Points per set of parameters."""

STEP = 1e-5
"""Step of differences, in extents."""

SINGLE_TOLERANCE = 1e-4
"""Relative error in single precision that is accepted."""


@dataclass(frozen=True)
class FieldClaims:
    """The claims of a definition about its field."""

    steepest: float | CustomSource
    interval: CustomSource | None
    extent: float
    derived: bool
    """True if the function returns its value alone, and its gradient is derived."""

    @property
    def digest(self) -> tuple[object, ...]:
        """What of the claims enters the kernels."""
        slope = self.steepest if isinstance(self.steepest, float) else self.steepest.digest
        return slope, self.interval and self.interval.digest


@dataclass(frozen=True)
class _Trial:
    """A field with one set of values of its parameters."""

    source: CustomSource
    values: dict[str, Any]

    def call(self, function: CustomSource, leading: tuple[Any, ...], precision: Precision) -> Float64Array:
        """Return the results of a function as numbers (k,)."""
        arguments = [_typed(value, precision) for value in (*leading, *self.values.values())]
        try:
            with np.errstate(all="ignore"):
                result = np.atleast_1d(np.asarray(function.reference(precision)(*arguments), np.float64))
        except Exception as error:  # the function is the user's own
            raise function.refusal(
                f"for {self.where(leading)} it fails: {type(error).__name__}: {error}"
            ) from error
        if result.ndim != 1 or not np.isfinite(result).all():
            raise function.refusal(
                f"for {self.where(leading)} it returns {_shown(result)}; expected finite numbers"
            )
        return result

    def where(self, leading: tuple[Any, ...]) -> str:
        shown = ", ".join(f"{name} = {_shown(value)}" for name, value in self.values.items())
        point = f"q = {_shown(leading[0])}" if leading else "these parameters"
        return point + (f" with {shown}" if shown else "")

    def at(self, q: Float64Array, precision: Precision = np.float64) -> Float64Array:
        """Return (f,), or (f, ∂x, ∂y, ∂z)."""
        return self.call(self.source, (tuple(q),), precision)

    def value(self, q: Float64Array) -> float:
        return float(self.at(q)[0])

    def slope(self, claim: float | CustomSource, center: Float64Array, radius: float) -> float:
        """Return the claimed bound of the slope in a ball."""
        if isinstance(claim, float):
            return claim
        ball = (tuple(center), radius) if len(claim.parameters) > len(self.values) else ()
        return float(self.call(claim, ball, np.float64)[0])


def check_field(source: CustomSource, parameters: tuple[Parameter, ...], claims: FieldClaims) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim, or a value is negative or not finite."""
    rng = np.random.default_rng(SEED)
    for trial_number in range(TRIALS if parameters else 2):
        values = {p.name: trial_value(p, rng, trial_number) for p in parameters}
        trial = _Trial(source, values)
        spread = claims.extent * rng.choice([0.1, 0.4, 1.0], (POINTS, 1))
        points = rng.uniform(-1.0, 1.0, (POINTS, 3)) * spread
        found = np.array([trial.at(q) for q in points])
        _try_values(trial, points, found)
        if found.shape[1] == 4:
            _try_gradients(trial, points, found, claims)
        _try_steepness(trial, points, found, claims, rng)
        if claims.interval is not None:
            _try_intervals(trial, points, claims, claims.interval, rng)


def _try_values(trial: _Trial, points: Float64Array, found: Float64Array) -> None:
    for q, row in zip(points, found, strict=True):
        if row[0] < 0.0:
            raise trial.source.refusal(
                f"f({_shown(q)}) = {row[0]:.6g} is negative, and a field is not; write wp.max(…, 0.0)"
            )
        single = float(trial.at(q, np.float32)[0])
        if abs(single - row[0]) > SINGLE_TOLERANCE * (1.0 + row[0]):
            raise trial.source.refusal(
                f"f({_shown(q)}) is {single:.6g} in single precision, {row[0]:.6g} in double; "
                "avoid differences of large numbers and divisions by small ones"
            )


def _try_gradients(trial: _Trial, points: Float64Array, found: Float64Array, claims: FieldClaims) -> None:
    """Check that the returned gradients are those of f, except at kinks."""
    step = STEP * claims.extent
    for q, row in zip(points, found, strict=True):
        for axis in range(3):
            offset = step * np.eye(3)[axis]
            right = (trial.value(q + offset) - row[0]) / step
            left = (row[0] - trial.value(q - offset)) / step
            scale = SLOPE_TOLERANCE * (1.0 + abs(row[1 + axis]) + row[0] / claims.extent)
            smooth = abs(right - left) <= 100.0 * scale
            if smooth and abs(row[1 + axis] - 0.5 * (right + left)) > 10.0 * scale:
                raise trial.source.refusal(
                    f"∂f/∂{'xyz'[axis]} at {_shown(q)} is {0.5 * (right + left):.6g} by differences, but "
                    f"{row[1 + axis]:.6g} is returned"
                )


def _try_steepness(
    trial: _Trial,
    points: Float64Array,
    found: Float64Array,
    claims: FieldClaims,
    rng: np.random.Generator,
) -> None:
    """Check that f changes no faster than `steepest` says, so that it does not jump."""
    for q, row in zip(points, found, strict=True):
        offset = rng.normal(size=3)
        offset *= claims.extent * 10.0 ** rng.uniform(-4.0, 0.0) / np.linalg.norm(offset)
        distance = float(np.linalg.norm(offset))
        bound = trial.slope(claims.steepest, q, distance)
        change = abs(trial.value(q + offset) - row[0])
        if change > bound * distance * (1.0 + VALUE_TOLERANCE) + VALUE_TOLERANCE * (1.0 + row[0]):
            raise trial.source.refusal(
                f"f changes by {change:.6g} from {_shown(q)} to {_shown(q + offset)}, {distance:.6g} away, "
                f"more than steepest = {bound:.6g} allows{_with(trial)}; claim a larger slope"
            )


def _try_intervals(
    trial: _Trial,
    points: Float64Array,
    claims: FieldClaims,
    interval: CustomSource,
    rng: np.random.Generator,
) -> None:
    """Check that values in balls lie in the claimed intervals."""
    for q in points:
        radius = claims.extent * 10.0 ** rng.uniform(-3.0, 0.0)
        bounds = trial.call(interval, (tuple(q), radius), np.float64)
        for direction in rng.normal(size=(3, 3)):
            p = q + direction * (radius * rng.uniform() / np.linalg.norm(direction))
            value = trial.value(p)
            slack = VALUE_TOLERANCE * (1.0 + abs(value))
            if not bounds[0] - slack <= value <= bounds[1] + slack:
                raise trial.source.refusal(
                    f"interval: f({_shown(p)}) = {value:.6g} is not between {bounds[0]:.6g} and "
                    f"{bounds[1]:.6g}, claimed for the ball of radius {radius:.6g} around {_shown(q)}"
                    f"{_with(trial)}"
                )


def _with(trial: _Trial) -> str:
    return f", with {trial.values}" if trial.values else ""


def _typed(value: Any, precision: Precision) -> Any:
    if isinstance(value, tuple):
        return vector(*value, precision=precision)
    return precision(value) if isinstance(value, float) else value


def _shown(numbers: Any) -> str:
    flat = np.ravel(np.asarray(numbers, np.float64)).tolist()
    text = ", ".join(f"{number:.6g}" for number in flat)
    return f"({text})" if len(flat) != 1 else text
