"""Checks of custom warps: samples in double precision that may contradict a definition."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Box, Float64Array
from blobtree.declare.checks import SEED, SLOPE_TOLERANCE, Trial, trials
from blobtree.declare.formula import Formula, shown
from blobtree.declare.parameters import Parameter

POINTS = 30
"""Points per set of parameters."""

STEP = 1e-5
"""Step of differences, in extents."""

SINGULAR = 1e-6
"""Determinant of the Jacobian over the cube of its norm at which the Jacobian counts as singular."""

SINGLE_TOLERANCE = 1e-4
"""Relative error in single precision that is accepted."""


@dataclass(frozen=True)
class WarpClaims:
    """The claims of a definition about its warp."""

    stretch: float | Formula
    box: Callable[[Float64Array, Float64Array, tuple[float, ...]], Box]
    pullback: Formula | None
    extent: float

    @property
    def digest(self) -> tuple[object, ...]:
        """What of the claims enters the kernels."""
        stretch = self.stretch if isinstance(self.stretch, float) else self.stretch.digest
        return stretch, self.pullback and self.pullback.digest


def check_warp(source: Formula, parameters: tuple[Parameter, ...], claims: WarpClaims) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim, or the Jacobian is singular at one."""
    rng = np.random.default_rng(SEED)
    for trial, points in trials(source, parameters, 3, claims.extent, POINTS, rng):
        images = np.array([trial.at(q) for q in points])
        _try_single_precision(trial, points, images)
        step = STEP * claims.extent
        jacobians = [_jacobian(trial, q, image, step) for q, image in zip(points, images, strict=True)]
        smooth = [(q, j) for q, j in zip(points, jacobians, strict=True) if j is not None]
        _try_determinants(trial, smooth)
        if claims.pullback is not None:
            _try_pullback(trial, smooth, claims.pullback, rng)
        _try_stretch(trial, points, images, smooth, claims, rng)
        numbers = tuple(float(x) for item in parameters for x in item.components(trial.values[item.name]))
        _try_box(trial, claims, numbers, rng)


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


def _try_stretch(
    trial: Trial,
    points: Float64Array,
    images: Float64Array,
    smooth: list[tuple[Float64Array, Float64Array]],
    claims: WarpClaims,
    rng: np.random.Generator,
) -> None:
    """Check the claimed bound at points, and between the centres of balls and points in them."""
    for q, jacobian in smooth:
        norm, bound = float(np.linalg.norm(jacobian, 2)), trial.bound(claims.stretch, q, 0.0)
        if norm > bound * (1.0 + SLOPE_TOLERANCE):
            raise trial.source.refusal(
                f"stretch: the norm of its Jacobian at q = {shown(q)} is {norm:.6g}, more than "
                f"{bound:.6g}{trial.with_values}"
            )
    others = rng.permutation(len(points))
    for q, image, other, other_image in zip(points, images, points[others], images[others], strict=True):
        apart = float(np.linalg.norm(other - q))
        moved, bound = float(np.linalg.norm(other_image - image)), 0.0
        if apart > 0.0:
            bound = trial.bound(claims.stretch, q, apart)
        if moved > bound * apart * (1.0 + SLOPE_TOLERANCE) + SLOPE_TOLERANCE:
            raise trial.source.refusal(
                f"stretch: {shown(q)} and {shown(other)} are {apart:.6g} apart, their images {moved:.6g}, "
                f"more than {bound:.6g} times as much{trial.with_values}; it may jump between them"
            )


def _try_box(trial: Trial, claims: WarpClaims, numbers: tuple[float, ...], rng: np.random.Generator) -> None:
    """Check that no point outside the claimed box comes from the inner box."""
    for q in rng.uniform(-1.0, 1.0, (POINTS, 3)) * claims.extent:
        image = trial.at(q)
        half = claims.extent * rng.uniform(0.01, 0.5)
        lower, upper = claims.box(image - half, image + half, numbers)
        slack = 1e-6 * claims.extent
        if (q < lower - slack).any() or (q > upper + slack).any():
            raise trial.source.refusal(
                f"box: {shown(image)} of the child moves to {shown(q)}, but the claimed box "
                f"{shown(lower)} to {shown(upper)} does not hold it{trial.with_values}"
            )


def _jacobian(trial: Trial, q: Float64Array, image: Float64Array, step: float) -> Float64Array | None:
    """Return the Jacobian at a point with this image by differences; None at a kink."""
    right = np.stack([trial.at(q + step * axis) - image for axis in np.eye(3)], axis=1) / step
    left = np.stack([image - trial.at(q - step * axis) for axis in np.eye(3)], axis=1) / step
    middle = 0.5 * (right + left)
    smooth = np.abs(right - left).max() <= 20.0 * SLOPE_TOLERANCE * (1.0 + np.abs(middle).max())
    return middle if smooth else None
