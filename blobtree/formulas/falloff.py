"""The falloff of the core, from normalised distance to field: g(d) = (1 − d²)³ on [0, 1], 0 beyond.

Source: Wyvill's field function, eq. 2 of the Implicit Decals paper. Its support is compact: outside its
influence radius a skeleton contributes exactly 0, so evaluation can skip it.

Primitives have this one unless they name another (`formulas.falloffs`).
"""

import math

import warp as wp

from blobtree.declare.falloff import Falloff
from blobtree.declare.formula import formula
from blobtree.iso import ISO as ISO

wp.set_module_options({"enable_backward": False})

RIM = math.sqrt(1.0 - 2.0 ** (-1.0 / 3.0))
"""Visible radius / influence radius: the normalised distance at which an isolated falloff equals ISO."""

STEEPEST_DISTANCE = 1.0 / math.sqrt(5.0)
"""Normalised distance at which |g'| is largest."""

STEEPEST_SLOPE = 6.0 * STEEPEST_DISTANCE * (1.0 - STEEPEST_DISTANCE**2) ** 2
"""max |g'| = 1.7173, the Lipschitz constant of g."""


@wp.func
def falloff(squared_distance: wp.float32) -> wp.float32:
    """Return g as a function of d², which needs no square root."""
    t = wp.max(1.0 - squared_distance, 0.0)
    return t * t * t


@wp.func
def falloff_derivative(squared_distance: wp.float32) -> wp.float32:
    """∂g/∂(d²) = −3 (1 − d²)²."""
    t = wp.max(1.0 - squared_distance, 0.0)
    return -3.0 * t * t


@wp.func
def falloff_steepness(distance: wp.float32) -> wp.float32:
    """|g'(d)| = 6 d (1 − d²)², 0 beyond the support."""
    d = wp.min(distance, 1.0)
    t = 1.0 - d * d
    return 6.0 * d * t * t


@wp.func
def falloff_slope_bound(distance: wp.float32, reach: wp.float32) -> wp.float32:
    """Return the largest |g'| over [distance − reach, distance + reach]."""
    return falloff_steepest(wp.max(distance - reach, 0.0), distance + reach)


@wp.func
def falloff_steepest(nearest: wp.float32, farthest: wp.float32) -> wp.float32:
    """Return the largest |g'| over [nearest, farthest].

    |g'| rises up to STEEPEST_DISTANCE and falls after it, so its maximum over an interval lies at the
    point of the interval that is nearest to STEEPEST_DISTANCE.
    """
    return falloff_steepness(wp.clamp(STEEPEST_DISTANCE, nearest, farthest))


@wp.func
def falloff_shallowest(nearest: wp.float32, farthest: wp.float32) -> wp.float32:
    """Return the smallest |g'| over [nearest, farthest], which lies at an end."""
    return wp.min(falloff_steepness(nearest), falloff_steepness(farthest))


@wp.func
def falloff_range(nearest: wp.float32, farthest: wp.float32) -> wp.vec2:
    """Return the smallest and largest g(d) over squared distances from `nearest` to `farthest`."""
    return wp.vec2(falloff(farthest), falloff(nearest))


class Wyvill(Falloff):
    """(1 − d²)³ (eq. 2 of the Implicit Decals paper); kernels of trees with this one alone take d²."""

    numbers = RIM, STEEPEST_DISTANCE, STEEPEST_SLOPE

    @formula
    def value(distance: wp.float32) -> wp.float32:
        """Return g(d) = (1 − d²)³, 0 ≤ d ≤ 1."""
        return falloff(distance * distance)

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """Return g'(d) = −6 d (1 − d²)²."""
        return -falloff_steepness(distance)


WYVILL = Wyvill()

FALLOFFS: tuple[Falloff, ...] = (WYVILL,)
"""The falloffs of the core; the index of one here is its code on the tape."""
