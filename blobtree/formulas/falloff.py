"""The falloff from normalised distance to field: g(d) = (1 − d²)³ on [0, 1], 0 beyond.

Source: Wyvill's field function, eq. 2 of the Implicit Decals paper. Its support is compact: outside its
influence radius a skeleton contributes exactly 0, so evaluation can skip it.

`Falloff` is a row of the table of falloffs. Primitives read this one unless they name another
(`formulas.falloffs`).
"""

import math
from dataclasses import dataclass

import warp as wp

from blobtree.identity import content_hash

wp.set_module_options({"enable_backward": False})

ISO = 0.5
"""Field value on the surface; the field is larger inside."""

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


# -- the table ------------------------------------------------------------------------------------------


@wp.func
def wyvill_value(distance: wp.float32) -> wp.float32:
    """Return g(d) = (1 − d²)³, 0 ≤ d ≤ 1."""
    return falloff(distance * distance)


@wp.func
def wyvill_slope(distance: wp.float32) -> wp.float32:
    """Return g'(d) = −6 d (1 − d²)²."""
    return -falloff_steepness(distance)


@dataclass(frozen=True, eq=False, repr=False)
class Falloff:
    """A falloff: a field over the normalised distance d, which falls from g(0) = 1 to g(1) = 0.

    Primitives take one as `falloff`, by name or as an object. The built-in ones are in `FALLOFF_NAMES`;
    `define_falloff` makes others.

    Attributes
    ----------
    name
        Its name in files.
    value, slope
        Typed functions of the distance from 0 to 1: g ≥ 0 and g' ≤ 0.
    rim
        The distance with g = ISO. A primitive of visible radius r reads the distance r there.
    steepest_distance
        Where the slope is steepest, if it rises up to there and falls after it; otherwise −1.
    steepest_slope
        A bound on the magnitude of the slope.
    digest
        Digest of the sources of a custom falloff.
    module
        Module that defines a custom falloff.

    Examples
    --------
    >>> from blobtree import Point
    >>> Point((0, 0, 0), radius=1.0, falloff="gaussian").falloff.name
    'gaussian'
    """

    name: str
    value: wp.Function
    slope: wp.Function
    rim: float
    steepest_distance: float
    steepest_slope: float
    digest: str = ""
    module: str = ""

    def __repr__(self) -> str:
        return repr(self.name)

    @property
    def content_hash(self) -> str:
        """Content hash, see `blobtree.content_hash`: that of its name, and of the source of a custom one."""
        return content_hash((type(self).__name__, self.name, self.digest))

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Rim, steepest distance and steepest slope."""
        return self.rim, self.steepest_distance, self.steepest_slope


WYVILL = Falloff("wyvill", wyvill_value, wyvill_slope, RIM, STEEPEST_DISTANCE, STEEPEST_SLOPE)

FALLOFFS = (WYVILL,)
"""The falloffs of the core; the index of one here is its code on the tape."""
