"""Other falloffs of the literature, each g(d) on 0 ≤ d ≤ 1 with g(0) = 1 and g(1) = g'(1) = 0.

Their rims, the distances at which a field is half, differ. A primitive places each falloff so that its own
rim lies at the visible radius (`tape.evaluators.profile_distance`).
"""

import math

import warp as wp

from blobtree.declare.falloff import FALLOFF_NAMES, Falloff, unpickled
from blobtree.declare.formula import formula

wp.set_module_options({"enable_backward": False})

HARDNESS = 0.5
"""Hardness p of the falloff by Blanc & Schlick: from 0, soft, to about 1, a plateau with a steep edge."""

DECAY = 4.0
"""Exponent of the Gaussian at its rim, and s² of the Cauchy kernel (Sherstyuk 1999)."""

GAUSSIAN_END = math.exp(-DECAY)
GAUSSIAN_SCALE = 1.0 / (1.0 - (1.0 + DECAY) * GAUSSIAN_END)
CAUCHY_END = (1.0 + DECAY) ** -2
CAUCHY_END_SLOPE = -2.0 * DECAY * (1.0 + DECAY) ** -3
CAUCHY_SCALE = 1.0 / (1.0 - CAUCHY_END + CAUCHY_END_SLOPE)


class SoftObject(Falloff):
    """1 − 22/9 d² + 17/9 d⁴ − 4/9 d⁶ (Wyvill, McPheeters & Wyvill 1986), as (1 − d²)² (1 − 4/9 d²)."""

    numbers = 0.5, 0.50346837, 1.5834298

    @formula
    def value(distance: wp.float32) -> wp.float32:
        z = distance * distance
        return (1.0 - z) * (1.0 - z) * (1.0 - z * (4.0 / 9.0))

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """−4/9 d (1 − d²) (11 − 6 d²)."""
        z = distance * distance
        return distance * (-4.0 / 9.0) * (1.0 - z) * (11.0 - 6.0 * z)


class BlancSchlick(Falloff):
    """Piecewise rational in d² with hardness p (Blanc & Schlick 1995)."""

    numbers = 0.5, 0.5, 26.0 / 9.0

    @formula
    def value(distance: wp.float32) -> wp.float32:
        z = distance * distance
        if z <= 0.25:
            return 1.0 - 9.0 * z * z / (HARDNESS + (4.5 - 4.0 * HARDNESS) * z)
        return (1.0 - z) * (1.0 - z) / (0.75 - HARDNESS + (1.5 + 4.0 * HARDNESS) * z)

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """Return its derivative by the quotient rule."""
        z = distance * distance
        if z <= 0.25:
            rate = 4.5 - 4.0 * HARDNESS
            below = HARDNESS + rate * z
            return -2.0 * distance * (9.0 * z * (2.0 * below - rate * z) / (below * below))
        rate = 1.5 + 4.0 * HARDNESS
        below = 0.75 - HARDNESS + rate * z
        return -2.0 * distance * ((1.0 - z) * (2.0 * below + (1.0 - z) * rate) / (below * below))


class Metaball(Falloff):
    """1 − 3 d² up to d = 1/3, then 3/2 (1 − d)² (Nishimura et al. 1985)."""

    numbers = 1.0 - math.sqrt(1.0 / 3.0), 1.0 / 3.0, 2.0

    @formula
    def value(distance: wp.float32) -> wp.float32:
        if distance <= 1.0 / 3.0:
            return 1.0 - 3.0 * distance * distance
        return 1.5 * (1.0 - distance) * (1.0 - distance)

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """−6 d up to d = 1/3, then −3 (1 − d)."""
        return wp.max(-6.0 * distance, -3.0 * (1.0 - distance))


class Gaussian(Falloff):
    """exp(−4 d²) less its tangent in d² at d = 1, so that value and slope end at 0; scaled to g(0) = 1."""

    numbers = 0.3958473699421793, 0.3482536, 1.8318721

    @formula
    def value(distance: wp.float32) -> wp.float32:
        z = distance * distance
        return GAUSSIAN_SCALE * (wp.exp(-DECAY * z) - GAUSSIAN_END * (1.0 + DECAY * (1.0 - z)))

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """Return its derivative."""
        rate = wp.exp(-DECAY * distance * distance) - GAUSSIAN_END
        return -2.0 * DECAY * GAUSSIAN_SCALE * distance * rate


class Cauchy(Falloff):
    """(1 + 4 d²)⁻² less its tangent in d² at d = 1, scaled to g(0) = 1."""

    numbers = 0.29702345561972554, 0.2217635, 2.2789396

    @formula
    def value(distance: wp.float32) -> wp.float32:
        z = distance * distance
        below = 1.0 + DECAY * z
        return CAUCHY_SCALE * (1.0 / (below * below) - CAUCHY_END + CAUCHY_END_SLOPE * (1.0 - z))

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """Return its derivative."""
        below = 1.0 + DECAY * distance * distance
        slope = -2.0 * DECAY / (below * below * below)
        return 2.0 * CAUCHY_SCALE * distance * (slope - CAUCHY_END_SLOPE)


__all__ = ["FALLOFF_NAMES"]

_unpickled = unpickled
"""Pickles of earlier versions name it."""
