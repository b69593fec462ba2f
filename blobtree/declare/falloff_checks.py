"""Samples of a falloff: where it is ½, where it is steepest, and whether it falls from 1 to 0."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from blobtree.declare.formula import Formula, result_of
from blobtree.iso import ISO

SAMPLES = 2001
TOLERANCE = 1e-5
SLOPE_TOLERANCE = 1e-3
STEP = 1e-6
"""Step of the distance in finite differences."""

FLATTEST_RIM = 1e-3
"""Smallest slope at the rim: a flatter falloff has no definite surface."""

BOUND_MARGIN = 1.02
"""Widening of the steepest sampled slope of a falloff with several steep parts."""

MAX_KINK_SHARE = 0.05

Floats = NDArray[np.float64]
Sampled = Callable[[Floats], Floats]


def _sampled(source: Formula) -> Sampled:
    """Return the function over arrays of distances."""
    reference = source.reference()

    def sampled(distances: Floats) -> Floats:
        results = [result_of(source, reference, [d], partial("d = {:.6g}".format, d), 1) for d in distances]
        return np.concatenate(results)

    return sampled


def check_falloff(source: Formula, derivative: Formula) -> None:
    """Raise `InvalidDefinition` if samples show that g is no falloff, or that its derivative is wrong."""
    g, g_slope = _sampled(source), _sampled(derivative)
    distances = np.linspace(0.0, 1.0, SAMPLES)
    values, slopes = g(distances), g_slope(distances)
    check_falling(source, distances, values, "a falloff")
    inner = distances[1:-1]
    right, left = (g(inner + STEP) - g(inner)) / STEP, (g(inner) - g(inner - STEP)) / STEP
    smooth = np.abs(right - left) <= SLOPE_TOLERANCE * (1.0 + np.abs(slopes[1:-1]))
    measured = 0.5 * (right + left)
    wrong = smooth & (np.abs(slopes[1:-1] - measured) > SLOPE_TOLERANCE * (1.0 + np.abs(measured)))
    if wrong.any():
        worst = int(np.argmax(wrong))
        raise derivative.refusal(
            f"g'({inner[worst]:.6g}) is {measured[worst]:.6g} by differences, "
            f"but {slopes[worst + 1]:.6g} is returned"
        )
    if (~smooth).mean() > MAX_KINK_SHARE:
        raise source.refusal("g has so many kinks or jumps that its derivative cannot be tried")
    rim = find_rim(g)
    if float(-g_slope(np.array([rim]))[0]) < FLATTEST_RIM:
        raise source.refusal(
            f"g is flat where it is {ISO:g}, at d = {rim:.6g}, so it has no definite surface"
        )
    _check_single(source, distances, values)
    _check_single(derivative, distances, slopes)


def check_falling(source: Formula, distances: Floats, values: Floats, what: str) -> None:
    """Raise `InvalidDefinition` unless samples of g fall from 1 to 0 without rising."""
    for place, expected in ((0, 1.0), (-1, 0.0)):
        if abs(values[place] - expected) > TOLERANCE:
            raise source.refusal(
                f"g({distances[place]:g}) = {values[place]:.6g}, expected {expected:g}; shift and scale it"
            )
    rises = np.diff(values)
    if rises.max() > TOLERANCE:
        worst = int(rises.argmax())
        raise source.refusal(
            f"g rises from {values[worst]:.6g} at d = {distances[worst]:.6g} to {values[worst + 1]:.6g}; "
            f"{what} never rises"
        )


def _check_single(source: Formula, distances: Floats, expected: Floats) -> None:
    """Check that results survive float32, in which devices compute."""
    reference = source.reference(np.float32)
    for d, value in zip(distances, expected, strict=True):
        arguments, where = [np.float32(d)], partial("d = {:.6g}".format, d)
        single = result_of(source, reference, arguments, where, 1)[0]
        if abs(single - value) > SLOPE_TOLERANCE * (1.0 + abs(value)):
            raise source.refusal(
                f"for d = {d:.6g} it returns {single:.6g} in single precision, {value:.6g} in double"
            )


def find_distance(g: Callable[[float], float], level: float) -> float:
    """Return the distance with g = level, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(53):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if g(middle) > level else (low, middle)
    return 0.5 * (low + high)


def find_rim(g: Sampled) -> float:
    """Return the distance with g = ISO."""
    return find_distance(lambda d: float(g(np.array([d]))[0]), ISO)


def find_numbers(source: Formula, derivative: Formula) -> tuple[float, float, float]:
    """Return the rim of a falloff, where it is steepest, and how steep."""
    return find_rim(_sampled(source)), *_steepest(_sampled(derivative))


def _steepest(g_slope: Sampled) -> tuple[float, float]:
    """Return where |g'| is largest and how large, −1 for the place if it has several peaks."""
    distances = np.linspace(0.0, 1.0, SAMPLES)
    steepness = -g_slope(distances)
    peak = int(steepness.argmax())
    changes = np.diff(steepness)
    if changes[:peak].min(initial=0.0) < -TOLERANCE or changes[peak:].max(initial=0.0) > TOLERANCE:
        return -1.0, BOUND_MARGIN * float(steepness[peak])
    place = distances[peak]
    for width in (1e-3, 1e-5):
        nearby = np.clip(place + np.linspace(-width, width, 201), 0.0, 1.0)
        place = nearby[int((-g_slope(nearby)).argmax())]
    return float(place), float(-g_slope(np.array([place]))[0])
