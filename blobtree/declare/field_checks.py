"""Checks of users' direct fields: samples in double precision that may contradict a definition."""

from collections.abc import Callable
from typing import Any

import numpy as np

from blobtree._typing import Box, Float64Array
from blobtree.declare.checks import (
    SEED,
    SLOPE_TOLERANCE,
    TRIALS,
    VALUE_TOLERANCE,
    Packed,
    Trial,
    trial_value,
    trials,
)
from blobtree.declare.field import FieldFormulas
from blobtree.declare.formula import shown
from blobtree.declare.parameters import Parameter

BoxOf = Callable[[dict[str, Any]], Box]

POINTS = 40
"""Points per set of parameters."""

STEP = 1e-5
"""Step of differences, in extents."""

SINGLE_TOLERANCE = 1e-4
"""Relative error in single precision that is accepted."""


def check_field(formulas: FieldFormulas, parameters: tuple[Parameter, ...], packed: Packed) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim, or a value is negative or not finite."""
    rng = np.random.default_rng(SEED)
    given, extent = formulas.given, formulas.extent
    sampled = trials(formulas.source, parameters, formulas.size, extent, POINTS, rng, packed)
    for trial, points in sampled:
        found = np.array([trial.at(q) for q in points])
        _try_values(trial, points, found)
        if found.shape[1] == 4:
            _try_gradients(trial, points, found, extent)
        _try_steepness(trial, points, found, formulas, rng)
        if "bounds" in given or "interval" in given:
            _try_intervals(trial, points, formulas, rng)


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


def _try_gradients(trial: Trial, points: Float64Array, found: Float64Array, extent: float) -> None:
    """Check that the returned gradients are those of f, except at kinks."""
    step = STEP * extent
    for q, row in zip(points, found, strict=True):
        for axis in range(3):
            offset = step * np.eye(3)[axis]
            right = (trial.at(q + offset)[0] - row[0]) / step
            left = (row[0] - trial.at(q - offset)[0]) / step
            scale = SLOPE_TOLERANCE * (1.0 + abs(row[1 + axis]) + row[0] / extent)
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
    formulas: FieldFormulas,
    rng: np.random.Generator,
) -> None:
    """Check that f changes no faster than `steepest` says, so that it does not jump."""
    for q, row in zip(points, found, strict=True):
        offset = rng.normal(size=3)
        offset *= formulas.extent * 10.0 ** rng.uniform(-4.0, 0.0) / np.linalg.norm(offset)
        distance = float(np.linalg.norm(offset))
        bound = _slope(trial, formulas, q, distance)
        change = abs(trial.at(q + offset)[0] - row[0])
        if change > bound * distance * (1.0 + VALUE_TOLERANCE) + VALUE_TOLERANCE * (1.0 + row[0]):
            raise trial.source.refusal(
                f"f changes by {change:.6g} from {shown(q)} to {shown(q + offset)}, {distance:.6g} away, "
                f"more than lipschitz = {bound:.6g} allows{trial.with_values}; claim a larger slope"
            )


def _try_intervals(
    trial: Trial,
    points: Float64Array,
    formulas: FieldFormulas,
    rng: np.random.Generator,
) -> None:
    """Check that values in balls lie in the claimed intervals."""
    given = formulas.given
    claim = given.get("bounds") or given["interval"]
    for q in points:
        radius = formulas.extent * 10.0 ** rng.uniform(-3.0, 0.0)
        bounds = trial.call(claim, (tuple(q), radius), 3 if claim is given.get("bounds") else 2)
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


def _slope(trial: Trial, formulas: FieldFormulas, center: Float64Array, radius: float) -> float:
    """Return the claimed slope in a ball."""
    if "bounds" in formulas.given:
        return float(trial.call(formulas.given["bounds"], (tuple(center), radius), 3)[2])
    return trial.bound(formulas.given.get("lipschitz") or float(formulas.lipschitz), center, radius)


def check_box(formulas: FieldFormulas, parameters: tuple[Parameter, ...], packed: Packed, box: BoxOf) -> None:
    """Raise `InvalidDefinition` if samples show a field outside its box, which `box` returns for values."""
    rng = np.random.default_rng(SEED)
    for number in range(TRIALS if parameters else 1):
        values = {parameter.name: trial_value(parameter, rng, number) for parameter in parameters}
        trial = Trial(formulas.source, packed(values), formulas.size)
        (lower,), (upper,) = box(values)
        size = upper - lower
        points = rng.uniform(lower - size, upper + size, (POINTS, 3))
        for q in points[((points < lower) | (points > upper)).any(axis=1)]:
            value = trial.at(q)[0]
            if value > 0.0:
                raise trial.source.refusal(
                    f"box: f({shown(q)}) = {value:.6g} outside the box from {shown(lower)} to {shown(upper)}"
                    f"{trial.with_values}"
                )
