"""Falloffs in float64, as their sources write them, normalised from g(0) to 1 and from g(1) to 0."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Floats = NDArray[np.float64]


def _wyvill(d: Floats) -> Floats:
    return np.asarray((1.0 - d**2) ** 3)


def _soft_object(d: Floats) -> Floats:
    return np.asarray(1.0 - 22.0 / 9.0 * d**2 + 17.0 / 9.0 * d**4 - 4.0 / 9.0 * d**6)


def _blanc_schlick(d: Floats) -> Floats:
    z, p = d**2, 0.5
    near = 1.0 - (3.0 * z) ** 2 / (p + (4.5 - 4.0 * p) * z)
    far = (1.0 - z) ** 2 / (0.75 - p + (1.5 + 4.0 * p) * z)
    return np.where(d <= 0.5, near, far)


def _metaball(d: Floats) -> Floats:
    return np.where(d <= 1.0 / 3.0, 1.0 - 3.0 * d**2, 1.5 * (1.0 - d) ** 2)


def _without_tangent(kernel: Callable[[Any], Any]) -> Callable[[Floats], Floats]:
    """The kernel, a function of d², less its tangent at 1, scaled to 1 at 0."""
    step = 1e-5
    end = float(kernel(1.0))
    slope = (kernel(1.0 - 2.0 * step) - 8.0 * kernel(1.0 - step) + 8.0 * kernel(1.0 + step)) / (12.0 * step)
    slope -= kernel(1.0 + 2.0 * step) / (12.0 * step)

    def value(d: Floats) -> Floats:
        z = d**2
        return np.asarray((kernel(z) - end - slope * (z - 1.0)) / (kernel(0.0) - end + slope))

    return value


_FORMULAS: dict[str, Callable[[Floats], Floats]] = {
    "wyvill": _wyvill,
    "soft_object": _soft_object,
    "blanc_schlick": _blanc_schlick,
    "metaball": _metaball,
    "gaussian": _without_tangent(lambda z: np.exp(-4.0 * z)),
    "cauchy": _without_tangent(lambda z: (1.0 + 4.0 * z) ** -2.0),
    "staircase": lambda d: np.asarray(1.0 - d + np.sin(6.0 * np.pi * d) / (6.0 * np.pi)),
    "tent": lambda d: np.asarray(1.0 - d),
}
"""`staircase` and `tent` are custom falloffs of tests."""


def value(name: str, d: Floats) -> Floats:
    """g(d) for 0 ≤ d ≤ 1."""
    return np.where(d >= 1.0, 0.0, _FORMULAS[name](d))


@cache
def rim(name: str) -> float:
    """The distance at which g is half."""
    return float(brentq(lambda d: float(value(name, np.array([d]))[0]) - 0.5, 0.0, 1.0, xtol=1e-15))
