"""Checks of custom fields: samples in double precision that may contradict a definition."""

from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.checks import SEED, SLOPE_TOLERANCE, VALUE_TOLERANCE, Trial, trials
from blobtree.declare.formula import Formula, shown
from blobtree.declare.parameters import Parameter

POINTS = 40
"""Points per set of parameters."""

STEP = 1e-5
"""Step of differences, in extents."""

SINGLE_TOLERANCE = 1e-4
"""Relative error in single precision that is accepted."""


@dataclass(frozen=True)
class FieldClaims:
    """The claims of a definition about its field."""

    steepest: float | Formula
    interval: Formula | None
    extent: float
    derived: bool
    """True if the function returns its value alone, and its gradient is derived."""

    @property
    def digest(self) -> tuple[object, ...]:
        """What of the claims enters the kernels."""
        slope = self.steepest if isinstance(self.steepest, float) else self.steepest.digest
        return slope, self.interval and self.interval.digest


def check_field(source: Formula, parameters: tuple[Parameter, ...], claims: FieldClaims) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim, or a value is negative or not finite."""
    rng = np.random.default_rng(SEED)
    sampled = trials(source, parameters, 1 if claims.derived else 4, claims.extent, POINTS, rng)
    for trial, points in sampled:
        found = np.array([trial.at(q) for q in points])
        _try_values(trial, points, found)
        if found.shape[1] == 4:
            _try_gradients(trial, points, found, claims)
        _try_steepness(trial, points, found, claims, rng)
        if claims.interval is not None:
            _try_intervals(trial, points, claims, claims.interval, rng)


def _try_values(trial: Trial, points: Float64Array, found: Float64Array) -> None:
    for q, row in zip(points, found, strict=True):
        if row[0] < 0.0:
            raise trial.source.refusal(
                f"f({shown(q)}) = {row[0]:.6g} is negative, and a field is not; write wp.max(…, 0.0)"
            )
        single = float(trial.at(q, np.float32)[0])
        if abs(single - row[0]) > SINGLE_TOLERANCE * (1.0 + row[0]):
            raise trial.source.refusal(
                f"f({shown(q)}) is {single:.6g} in single precision, {row[0]:.6g} in double; "
                "avoid differences of large numbers and divisions by small ones"
            )


def _try_gradients(trial: Trial, points: Float64Array, found: Float64Array, claims: FieldClaims) -> None:
    """Check that the returned gradients are those of f, except at kinks."""
    step = STEP * claims.extent
    for q, row in zip(points, found, strict=True):
        for axis in range(3):
            offset = step * np.eye(3)[axis]
            right = (trial.at(q + offset)[0] - row[0]) / step
            left = (row[0] - trial.at(q - offset)[0]) / step
            scale = SLOPE_TOLERANCE * (1.0 + abs(row[1 + axis]) + row[0] / claims.extent)
            smooth = abs(right - left) <= 100.0 * scale
            if smooth and abs(row[1 + axis] - 0.5 * (right + left)) > 10.0 * scale:
                raise trial.source.refusal(
                    f"∂f/∂{'xyz'[axis]} at {shown(q)} is {0.5 * (right + left):.6g} by differences, but "
                    f"{row[1 + axis]:.6g} is returned"
                )


def _try_steepness(
    trial: Trial,
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
        bound = trial.bound(claims.steepest, q, distance)
        change = abs(trial.at(q + offset)[0] - row[0])
        if change > bound * distance * (1.0 + VALUE_TOLERANCE) + VALUE_TOLERANCE * (1.0 + row[0]):
            raise trial.source.refusal(
                f"f changes by {change:.6g} from {shown(q)} to {shown(q + offset)}, {distance:.6g} away, "
                f"more than steepest = {bound:.6g} allows{trial.with_values}; claim a larger slope"
            )


def _try_intervals(
    trial: Trial,
    points: Float64Array,
    claims: FieldClaims,
    interval: Formula,
    rng: np.random.Generator,
) -> None:
    """Check that values in balls lie in the claimed intervals."""
    for q in points:
        radius = claims.extent * 10.0 ** rng.uniform(-3.0, 0.0)
        bounds = trial.call(interval, (tuple(q), radius), 2)
        for direction in rng.normal(size=(3, 3)):
            p = q + direction * (radius * rng.uniform() / np.linalg.norm(direction))
            value = trial.at(p)[0]
            slack = VALUE_TOLERANCE * (1.0 + abs(value))
            if not bounds[0] - slack <= value <= bounds[1] + slack:
                raise trial.source.refusal(
                    f"interval: f({shown(p)}) = {value:.6g} is not between {bounds[0]:.6g} and "
                    f"{bounds[1]:.6g}, claimed for the ball of radius {radius:.6g} around {shown(q)}"
                    f"{trial.with_values}"
                )
