"""Custom falloffs: a falloff from one typed function g.

@wp.func
def linear(d: wp.float32) -> wp.float32:
    return 1.0 - d

Linear = define_falloff(linear)
model = Point((0, 0, 0), radius=1.0, falloff=Linear)
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.custom.checks import result_of
from blobtree.custom.source import CustomSource, custom_source, derived, kind_name
from blobtree.formulas.falloff import ISO, Falloff
from blobtree.formulas.falloffs import FALLOFF_NAMES, MORE_FALLOFFS

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


def define_falloff(value: Any, slope: Any = None, *, name: str | None = None) -> Falloff:
    """Return a falloff from a function g.

    Parameters
    ----------
    value
        ``(d: wp.float32) -> wp.float32``, with or without ``@wp.func``: g(d) for 0 ≤ d ≤ 1. It falls from
        g(0) = 1 to g(1) = 0 without rising. A field is smooth where g'(0) = g'(1) = 0.
    slope
        The derivative g'(d), a function of the same type; by default it is derived from the source.
    name
        Name of the falloff in files; by default the name of `value`.

    Returns
    -------
    Falloff
        A value for the keyword `falloff` of primitives around a skeleton; so is its name.

    Raises
    ------
    InvalidDefinition
        A function has no types or no source, the name is that of a built-in falloff, or samples contradict
        the above. Nothing has been compiled by then.
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Point, define_falloff
    >>> @wp.func
    ... def linear(d: wp.float32) -> wp.float32:
    ...     return 1.0 - d
    >>> falloff = define_falloff(linear)
    >>> round(falloff.rim, 6)
    0.5
    >>> Point((0, 0, 0), radius=1.0, falloff=falloff)
    Point(center=(0.0, 0.0, 0.0), radius=1.0, color=(0.8, 0.8, 0.8), falloff='linear')
    """
    source = _of_distance(value)
    derivative = derived(source, list(source.parameters), _SLOPE) if slope is None else _of_distance(slope)
    kind = kind_name(source, name)
    if kind in {row.name for row in MORE_FALLOFFS} or kind == "wyvill":
        raise source.refusal(f"name: {kind!r} is a built-in falloff; choose another name")
    digest = source.digest_with(kind, derivative.digest)
    known = FALLOFF_NAMES.get(kind)
    if known is not None and known.digest == digest:
        return known
    g, g_slope = _sampled(source), _sampled(derivative)
    _check(source, derivative, g, g_slope)
    steepest_distance, steepest_slope = _steepest(g_slope)
    falloff = Falloff(
        kind,
        source.function,
        derivative.function,
        find_rim(g),
        steepest_distance,
        steepest_slope,
        digest,
        source.python.__module__,
    )
    FALLOFF_NAMES[kind] = falloff
    return falloff


_SLOPE = '''\
def {name}({typed}) -> wp.float32:
    """The derivative of the user's falloff."""
    value, slope = {partials}
    return slope
'''


def _of_distance(function: Any) -> CustomSource:
    """Return a user's function of the distance."""
    source = custom_source(function, returns=wp.float32)
    if list(source.parameters.values()) not in ([wp.float32], [float]):
        raise source.refusal("expected the distance `d: wp.float32` as its only parameter")
    return source


def _sampled(source: CustomSource) -> Sampled:
    """Return the function over arrays of distances."""
    reference = source.reference()

    def sampled(distances: Floats) -> Floats:
        results = [
            result_of(source, lambda d: np.ravel(reference(d)), [d], partial("d = {:.6g}".format, d), 1)
            for d in distances
        ]
        return np.concatenate(results)

    return sampled


def _check(source: CustomSource, derivative: CustomSource, g: Sampled, g_slope: Sampled) -> None:
    """Raise `InvalidDefinition` if samples show that g is no falloff, or that its derivative is wrong."""
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


def check_falling(source: CustomSource, distances: Floats, values: Floats, what: str) -> None:
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


def _check_single(source: CustomSource, distances: Floats, expected: Floats) -> None:
    """Check that results survive float32, in which devices compute."""
    reference = source.reference(np.float32)
    for d, value in zip(distances, expected, strict=True):
        arguments, where = [np.float32(d)], partial("d = {:.6g}".format, d)
        single = result_of(source, lambda x: np.ravel(reference(x)), arguments, where, 1)[0]
        if abs(single - value) > SLOPE_TOLERANCE * (1.0 + abs(value)):
            raise source.refusal(
                f"for d = {d:.6g} it returns {single:.6g} in single precision, {value:.6g} in double"
            )


def find_rim(g: Sampled) -> float:
    """Return the distance with g = ISO, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(53):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if g(np.array([middle]))[0] > ISO else (low, middle)
    return 0.5 * (low + high)


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
