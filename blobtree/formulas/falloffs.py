"""Other falloffs of the literature, each g(d) on 0 ≤ d ≤ 1 with g(0) = 1 and g(1) = g'(1) = 0.

Their rims, the distances at which a field is half, differ. A primitive places each falloff so that its own
rim lies at the visible radius (`tape.evaluators.profile_distance`).
"""

import copyreg
import math
from typing import Any

import warp as wp

from blobtree.declare.registry import Definitions
from blobtree.formulas.falloff import WYVILL, Falloff

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


@wp.func
def soft_object_value(distance: wp.float32) -> wp.float32:
    """1 − 22/9 d² + 17/9 d⁴ − 4/9 d⁶ (Wyvill, McPheeters & Wyvill 1986), as (1 − d²)² (1 − 4/9 d²)."""
    z = distance * distance
    return (1.0 - z) * (1.0 - z) * (1.0 - z * (4.0 / 9.0))


@wp.func
def soft_object_slope(distance: wp.float32) -> wp.float32:
    """−4/9 d (1 − d²) (11 − 6 d²)."""
    z = distance * distance
    return distance * (-4.0 / 9.0) * (1.0 - z) * (11.0 - 6.0 * z)


@wp.func
def blanc_schlick_value(distance: wp.float32) -> wp.float32:
    """Piecewise rational in d² with hardness p (Blanc & Schlick 1995)."""
    z = distance * distance
    if z <= 0.25:
        return 1.0 - 9.0 * z * z / (HARDNESS + (4.5 - 4.0 * HARDNESS) * z)
    return (1.0 - z) * (1.0 - z) / (0.75 - HARDNESS + (1.5 + 4.0 * HARDNESS) * z)


@wp.func
def blanc_schlick_slope(distance: wp.float32) -> wp.float32:
    """Return its derivative by the quotient rule."""
    z = distance * distance
    if z <= 0.25:
        rate = 4.5 - 4.0 * HARDNESS
        below = HARDNESS + rate * z
        return -2.0 * distance * (9.0 * z * (2.0 * below - rate * z) / (below * below))
    rate = 1.5 + 4.0 * HARDNESS
    below = 0.75 - HARDNESS + rate * z
    return -2.0 * distance * ((1.0 - z) * (2.0 * below + (1.0 - z) * rate) / (below * below))


@wp.func
def metaball_value(distance: wp.float32) -> wp.float32:
    """1 − 3 d² up to d = 1/3, then 3/2 (1 − d)² (Nishimura et al. 1985)."""
    if distance <= 1.0 / 3.0:
        return 1.0 - 3.0 * distance * distance
    return 1.5 * (1.0 - distance) * (1.0 - distance)


@wp.func
def metaball_slope(distance: wp.float32) -> wp.float32:
    """−6 d up to d = 1/3, then −3 (1 − d)."""
    return wp.max(-6.0 * distance, -3.0 * (1.0 - distance))


@wp.func
def gaussian_value(distance: wp.float32) -> wp.float32:
    """exp(−4 d²) less its tangent in d² at d = 1, so that value and slope end at 0; scaled to g(0) = 1."""
    z = distance * distance
    return GAUSSIAN_SCALE * (wp.exp(-DECAY * z) - GAUSSIAN_END * (1.0 + DECAY * (1.0 - z)))


@wp.func
def gaussian_slope(distance: wp.float32) -> wp.float32:
    """Return its derivative."""
    return -2.0 * DECAY * GAUSSIAN_SCALE * distance * (wp.exp(-DECAY * distance * distance) - GAUSSIAN_END)


@wp.func
def cauchy_value(distance: wp.float32) -> wp.float32:
    """(1 + 4 d²)⁻² less its tangent in d² at d = 1, scaled to g(0) = 1."""
    z = distance * distance
    below = 1.0 + DECAY * z
    return CAUCHY_SCALE * (1.0 / (below * below) - CAUCHY_END + CAUCHY_END_SLOPE * (1.0 - z))


@wp.func
def cauchy_slope(distance: wp.float32) -> wp.float32:
    """Return its derivative."""
    below = 1.0 + DECAY * distance * distance
    slope = -2.0 * DECAY / (below * below * below)
    return 2.0 * CAUCHY_SCALE * distance * (slope - CAUCHY_END_SLOPE)


SOFT_OBJECT = Falloff("soft_object", soft_object_value, soft_object_slope, 0.5, 0.50346837, 1.5834298)
BLANC_SCHLICK = Falloff("blanc_schlick", blanc_schlick_value, blanc_schlick_slope, 0.5, 0.5, 26.0 / 9.0)
METABALL = Falloff("metaball", metaball_value, metaball_slope, 1.0 - math.sqrt(1.0 / 3.0), 1.0 / 3.0, 2.0)
GAUSSIAN = Falloff("gaussian", gaussian_value, gaussian_slope, 0.3958473699421793, 0.3482536, 1.8318721)
CAUCHY = Falloff("cauchy", cauchy_value, cauchy_slope, 0.29702345561972554, 0.2217635, 2.2789396)

MORE_FALLOFFS = (SOFT_OBJECT, BLANC_SCHLICK, METABALL, GAUSSIAN, CAUCHY)
"""The falloffs outside the core."""

FALLOFF_NAMES: Definitions[Falloff] = Definitions("falloff", "define_falloff for it")
"""Every falloff by its name in files; `define_falloff` adds to it."""

FALLOFF_NAMES.update({row.name: row for row in (WYVILL, *MORE_FALLOFFS)})


def _unpickled(name: str, module: str) -> Falloff:
    return FALLOFF_NAMES.unpickled(name, module)


def _pickled(falloff: Falloff) -> tuple[Any, ...]:
    return _unpickled, (falloff.name, falloff.module)


copyreg.pickle(Falloff, _pickled)
