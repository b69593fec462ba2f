"""Checks of users' warps: samples in double precision that may contradict a definition."""

from collections.abc import Callable
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.checks import SEED, SLOPE_TOLERANCE, Trial, trials
from blobtree.declare.formula import Formula, shown
from blobtree.declare.parameters import Parameter
from blobtree.declare.readers import SIZES
from blobtree.declare.warp import WarpFormulas

POINTS = 30
"""Points per set of parameters."""

STEP = 1e-5
"""Step of differences, in extents."""

SINGULAR = 1e-6
"""Determinant of the Jacobian over the cube of its norm at which the Jacobian counts as singular."""

SINGLE_TOLERANCE = 1e-4
"""Relative error in single precision that is accepted."""


def check_warp(
    formulas: WarpFormulas, parameters: tuple[Parameter, ...], numbers_of: Callable[..., tuple[float, ...]]
) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim, or the Jacobian is singular at one.

    `numbers_of` returns the numbers of the formulas for values of the parameters.
    """
    size = sum(SIZES[kind] for kind in formulas.numbers.values())

    def packed(values: dict[str, Any]) -> dict[str, Any]:
        numbers = numbers_of(values)
        if len(numbers) != size:
            raise formulas.source.refusal(f"numbers: expected {size} in all, got {len(numbers)}")
        return formulas.values(numbers)

    rng = np.random.default_rng(SEED)
    step = STEP * formulas.extent
    for trial, points in trials(formulas.source, parameters, 3, formulas.extent, POINTS, rng, packed):
        images = np.array([trial.at(q) for q in points])
        _try_single_precision(trial, points, images)
        jacobians = [_jacobian(trial, q, image, step) for q, image in zip(points, images, strict=True)]
        smooth = [(q, j) for q, j in zip(points, jacobians, strict=True) if j is not None]
        _try_determinants(trial, smooth)
        if "pullback" in formulas.given:
            _try_pullback(trial, smooth, formulas.given["pullback"], rng)
        _try_lipschitz(trial, points, images, smooth, formulas, rng)
        _try_box(trial, formulas, rng)
        if "image_box" in formulas.given:
            _try_image_box(trial, formulas, rng)


def _try_single_precision(trial: Trial, points: Float64Array, images: Float64Array) -> None:
    for q, double in zip(points, images, strict=True):
        single = trial.at(q, np.float32)
        if np.abs(single - double).max() > SINGLE_TOLERANCE * (1.0 + np.abs(double).max()):
            raise trial.source.refusal(
                f"for q = {shown(q)} it returns {shown(single)} in single precision, {shown(double)} in "
                "double; avoid differences of large numbers and divisions by small ones"
            )


def _try_determinants(trial: Trial, smooth: list[tuple[Float64Array, Float64Array]]) -> None:
    """Check that the Jacobian is invertible, with determinants of one sign."""
    signs = set()
    for q, jacobian in smooth:
        determinant = float(np.linalg.det(jacobian))
        signs.add(determinant > 0.0)
        if abs(determinant) <= SINGULAR * float(np.linalg.norm(jacobian, 2)) ** 3 or len(signs) > 1:
            raise trial.source.refusal(
                f"its Jacobian is singular at or near q = {shown(q)} (determinant {determinant:.3g}), so "
                f"that it flattens or folds space{trial.with_values}; limit its parameters"
            )


def _try_pullback(
    trial: Trial,
    smooth: list[tuple[Float64Array, Float64Array]],
    pullback: Formula,
    rng: np.random.Generator,
) -> None:
    for q, jacobian in smooth:
        g = rng.normal(size=3)
        expected, seen = jacobian.T @ g, trial.call(pullback, (tuple(q), tuple(g)), 3)
        if np.abs(seen - expected).max() > 20.0 * SLOPE_TOLERANCE * (1.0 + np.abs(expected).max()):
            raise trial.source.refusal(
                f"pullback: for q = {shown(q)} and g = {shown(g)} it returns {shown(seen)}, but the "
                f"transposed Jacobian times g is {shown(expected)} by differences{trial.with_values}"
            )


def _try_lipschitz(
    trial: Trial,
    points: Float64Array,
    images: Float64Array,
    smooth: list[tuple[Float64Array, Float64Array]],
    formulas: WarpFormulas,
    rng: np.random.Generator,
) -> None:
    """Check the claimed bound at points, and between the centres of balls and points in them."""
    claim = formulas.given.get("lipschitz") or float(formulas.lipschitz)
    for q, jacobian in smooth:
        norm, bound = float(np.linalg.norm(jacobian, 2)), trial.bound(claim, q, 0.0)
        if norm > bound * (1.0 + SLOPE_TOLERANCE):
            raise trial.source.refusal(
                f"lipschitz: the norm of its Jacobian at q = {shown(q)} is {norm:.6g}, more than "
                f"{bound:.6g}{trial.with_values}"
            )
    others = rng.permutation(len(points))
    for q, image, other, other_image in zip(points, images, points[others], images[others], strict=True):
        apart = float(np.linalg.norm(other - q))
        moved, bound = float(np.linalg.norm(other_image - image)), 0.0
        if apart > 0.0:
            bound = trial.bound(claim, q, apart)
        if moved > bound * apart * (1.0 + SLOPE_TOLERANCE) + SLOPE_TOLERANCE:
            raise trial.source.refusal(
                f"lipschitz: {shown(q)} and {shown(other)} are {apart:.6g} apart, their images {moved:.6g}, "
                f"more than {bound:.6g} times as much{trial.with_values}; it may jump between them"
            )


def _try_box(trial: Trial, formulas: WarpFormulas, rng: np.random.Generator) -> None:
    """Check that no point outside the claimed box comes from the inner box."""
    slack = 1e-6 * formulas.extent
    for q in rng.uniform(-1.0, 1.0, (POINTS, 3)) * formulas.extent:
        image = trial.at(q)
        half = formulas.extent * rng.uniform(0.01, 0.5)
        lower, upper = formulas.box(image - half, image + half, trial.values)
        if (q < lower - slack).any() or (q > upper + slack).any():
            raise trial.source.refusal(
                f"{'motion' if formulas.outer_box is None else 'outer_box'}: {shown(image)} of the child "
                f"moves to {shown(q)}, but the claimed box {shown(lower)} to {shown(upper)} does not hold "
                f"it{trial.with_values}"
            )


def _try_image_box(trial: Trial, formulas: WarpFormulas, rng: np.random.Generator) -> None:
    """Check that images of points in boxes lie in the claimed boxes around the images of their middles."""
    slack = 1e-6 * formulas.extent
    for q in rng.uniform(-1.0, 1.0, (POINTS, 3)) * formulas.extent:
        half = formulas.extent * 10.0 ** rng.uniform(-3.0, 0.0, 3)
        claimed = trial.call(formulas.given["image_box"], (tuple(q), tuple(half)), 3)
        other = q + half * rng.uniform(-1.0, 1.0, 3)
        moved = np.abs(trial.at(other) - trial.at(q))
        if (moved > claimed * (1.0 + SLOPE_TOLERANCE) + slack).any():
            raise trial.source.refusal(
                f"image_box: the images of {shown(q)} and {shown(other)} are {shown(moved)} apart along the "
                f"axes, more than {shown(claimed)}{trial.with_values}"
            )


def _jacobian(trial: Trial, q: Float64Array, image: Float64Array, step: float) -> Float64Array | None:
    """Return the Jacobian at a point with this image by differences; None at a kink."""
    right = np.stack([trial.at(q + step * axis) - image for axis in np.eye(3)], axis=1) / step
    left = np.stack([image - trial.at(q - step * axis) for axis in np.eye(3)], axis=1) / step
    middle = 0.5 * (right + left)
    smooth = np.abs(right - left).max() <= 20.0 * SLOPE_TOLERANCE * (1.0 + np.abs(middle).max())
    return middle if smooth else None
