"""Deformations: nodes that warp their child (Barr 1984), with noise and curve warps.

Each acts along the z axis of its space: transform a model first to deform it along another line. The methods
of `Node` with the same names make them. Below the lower one of two limits nothing moves. Above the upper one
the motion is rigid, or a scale across z for a taper.

A bend maps neighbours far apart at the axis about which it turns, and at the cut: the half-plane from the
axis in the middle opposite to the arc. The tree must be empty there; `Bend.outer_box` raises `InvalidNode` if
it is not.
"""

import math
from itertools import product
from typing import Annotated

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Box, Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import LARGEST_INTEGER, Parameter, Quantity
from blobtree.declare.warp import UNKNOWN_EXTENT
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.tree import cylinder_box
from blobtree.nodes.warp import Warp
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

Points = tuple[Vector, ...]

LARGEST_FACTOR = 1e3
"""Largest factor of a taper or a stretch; the smallest is its reciprocal."""

WAVES = 8
"""Plane waves in a noise warp."""

WAVELENGTH_SPREAD = 1.5
"""Longest wavelength of a noise warp over the given one, and that one over the shortest."""

MAX_CURVE_POINTS = 256

FOLD_SAMPLES = 16
"""Samples along each axis at which a curve warp is checked for folds."""

CLEARANCE = 0.05
"""Smallest distance from the axis and the cut of a bend at which the tree may have a field.

It is a share of the radius of the bend. ‖J‖ is at most its reciprocal there."""

STEEPEST_WENDLAND = 0.25
"""Distance at which the slope of Wendland's function is largest."""

MOTION_SAMPLES = 24
"""Samples of a curve warp's motion along each axis."""

LARGEST_CONDITION = 1e8
"""Largest condition number of the interpolation; beyond it points are too close together."""

LOW = "height below which nothing moves"
HIGH = "height above which the deformation does not grow"


@wp.func
def within_limits(z: wp.float32, reach: wp.float32, low: wp.float32, high: wp.float32) -> wp.float32:
    """Return 1 if [z − reach, z + reach] meets the open interval (low, high), else 0."""
    if z + reach > low and z - reach < high:
        return 1.0
    return 0.0


@wp.func
def shear_norm(diagonal: wp.float32, k: wp.float32) -> wp.float32:
    """Return the norm of the matrix (diagonal, k; 0, 1)."""
    a = diagonal * diagonal
    s = a + k * k + 1.0
    return wp.sqrt(0.5 * (s + wp.sqrt(wp.max(s * s - 4.0 * a, 0.0))))


class Deformation(Warp):
    """A node that warps its child between two heights, `low` and `high`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = (getattr(self, name) for name in ("low", "high"))
        if not low < high:
            raise InvalidNode(f"high: expected a height above low = {low:g}, got {high:g}")


@wp.func
def taper_scale(z: wp.float32, rate: wp.float32, low: wp.float32, high: wp.float32) -> wp.float32:
    """Return the scale across z at height z: 1 below `low`, then 1 + rate (z − low) as far as `high`."""
    return 1.0 + rate * (wp.clamp(z, low, high) - low)


class Taper(Deformation):
    """`child` with cross-sections that grow linearly with the height, up to `factor` (Barr 1984, sec. 3.1).

    Examples
    --------
    >>> from blobtree import Segment, Taper
    >>> Taper(Segment((0, 0, 0), (0, 0, 2), radius=0.5), 0.5, 0, 2)([[0.25, 0, 2]]).round(3).tolist()
    [0.5]
    """

    tag = "taper"

    factor: float = par.factor(
        "scale across z at the height `high`",
        low=1.0 / LARGEST_FACTOR,
        high=LARGEST_FACTOR,
        hint="move the limits apart, or scale the model",
    )
    low: float = par.distance(LOW)
    high: float = par.distance(HIGH)

    @classmethod
    def numbers(cls, factor: float, low: float, high: float) -> tuple[float, ...]:
        """Return the growth per unit of height, and the limits."""
        return (factor - 1.0) / (high - low), low, high

    @formula
    def forward(q: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32) -> wp.vec3:
        """Divide x and y by the scale."""
        r = taper_scale(q[2], rate, low, high)
        return wp.vec3(q[0] / r, q[1] / r, q[2])

    @formula
    def pullback(q: wp.vec3, g: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32) -> wp.vec3:
        """Divide by the scale too, and add its change along z."""
        r = taper_scale(q[2], rate, low, high)
        change = rate * within_limits(q[2], 0.0, low, high) / (r * r)
        return wp.vec3(g[0] / r, g[1] / r, g[2] - change * (q[0] * g[0] + q[1] * g[1]))

    @formula
    def lipschitz(
        q: wp.vec3, reach: wp.float32, rate: wp.float32, low: wp.float32, high: wp.float32
    ) -> wp.float32:
        """Return the norm at the smallest scale, and at the largest distance from the axis."""
        r = wp.min(taper_scale(q[2] - reach, rate, low, high), taper_scale(q[2] + reach, rate, low, high))
        far = wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach
        k = wp.abs(rate) * within_limits(q[2], reach, low, high)
        return shear_norm(1.0 / r, k * far / (r * r))

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, rate: float, low: float, high: float) -> Box:
        """Return the box around a box whose cross-sections are scaled."""
        scales = 1.0 + rate * (np.clip([lower[2], upper[2]], low, high) - low)
        corners = np.concatenate([scale * np.array([lower[:2], upper[:2]]) for scale in scales])
        return np.append(corners.min(axis=0), lower[2]), np.append(corners.max(axis=0), upper[2])


class Shear(Deformation):
    """`child` with cross-sections that move sideways in proportion to the height.

    Examples
    --------
    >>> from blobtree import Point, Shear
    >>> Shear(Point((0, 0, 1), radius=0.5), 0.5, 0, 0, 2)([[0.5, 0, 1]]).round(3).tolist()
    [1.0]
    """

    tag = "shear"

    slope_x: float = par.factor("motion along x per unit of height")
    slope_y: float = par.factor("motion along y per unit of height")
    low: float = par.distance(LOW)
    high: float = par.distance(HIGH)

    @formula
    def forward(
        q: wp.vec3, slope_x: wp.float32, slope_y: wp.float32, low: wp.float32, high: wp.float32
    ) -> wp.vec3:
        """Move by −(slope_x, slope_y) per unit of height between the limits."""
        rise = wp.clamp(q[2], low, high) - low
        return wp.vec3(q[0] - slope_x * rise, q[1] - slope_y * rise, q[2])

    @formula
    def pullback(
        q: wp.vec3, g: wp.vec3, slope_x: wp.float32, slope_y: wp.float32, low: wp.float32, high: wp.float32
    ) -> wp.vec3:
        """Add the change of the motion along z."""
        inside = within_limits(q[2], 0.0, low, high)
        return wp.vec3(g[0], g[1], g[2] - inside * (slope_x * g[0] + slope_y * g[1]))

    @formula
    def lipschitz(
        q: wp.vec3,
        reach: wp.float32,
        slope_x: wp.float32,
        slope_y: wp.float32,
        low: wp.float32,
        high: wp.float32,
    ) -> wp.float32:
        """Return the norm of a shear."""
        inside = within_limits(q[2], reach, low, high)
        return shear_norm(1.0, inside * wp.sqrt(slope_x * slope_x + slope_y * slope_y))

    @classmethod
    def outer_box(
        cls,
        lower: Float64Array,
        upper: Float64Array,
        slope_x: float,
        slope_y: float,
        low: float,
        high: float,
    ) -> Box:
        """Return the box around a box whose cross-sections move."""
        rises = np.clip([lower[2], upper[2]], low, high) - low
        moves = rises[:, None] * np.array([slope_x, slope_y])
        return (
            np.append(lower[:2] + moves.min(axis=0), lower[2]),
            np.append(upper[:2] + moves.max(axis=0), upper[2]),
        )


class Stretch(Deformation):
    """`child` with the part between two heights longer by a factor; what is above moves with it.

    Examples
    --------
    >>> from blobtree import Point, Stretch
    >>> Stretch(Point((0, 0, 2), radius=0.5), 3, 0, 1)([[0, 0, 4]]).round(3).tolist()
    [1.0]
    """

    tag = "stretch"

    factor: float = par.factor(
        "new length of the part over its old length",
        low=1.0 / LARGEST_FACTOR,
        high=LARGEST_FACTOR,
        hint="scale the model",
    )
    low: float = par.distance(LOW)
    high: float = par.distance("height where the part ends, before the stretch")

    @classmethod
    def numbers(cls, factor: float, low: float, high: float) -> tuple[float, ...]:
        """Return 1 − 1 / factor, and the limits after the stretch."""
        return 1.0 - 1.0 / factor, low, low + factor * (high - low)

    @formula
    def forward(q: wp.vec3, shrinkage: wp.float32, low: wp.float32, high: wp.float32) -> wp.vec3:
        """Move by −shrinkage per unit of height between the limits."""
        return wp.vec3(q[0], q[1], q[2] - shrinkage * (wp.clamp(q[2], low, high) - low))

    @formula
    def pullback(q: wp.vec3, g: wp.vec3, shrinkage: wp.float32, low: wp.float32, high: wp.float32) -> wp.vec3:
        """Divide the part along z by the factor."""
        return wp.vec3(g[0], g[1], g[2] * (1.0 - shrinkage * within_limits(q[2], 0.0, low, high)))

    @formula
    def lipschitz(
        q: wp.vec3, reach: wp.float32, shrinkage: wp.float32, low: wp.float32, high: wp.float32
    ) -> wp.float32:
        """Return 1 / factor, or 1 if that is more."""
        return wp.max(1.0, 1.0 - shrinkage * within_limits(q[2], reach, low, high))

    @classmethod
    def outer_box(
        cls, lower: Float64Array, upper: Float64Array, shrinkage: float, low: float, high: float
    ) -> Box:
        """Return the longer or shorter box."""
        factor = 1.0 / (1.0 - shrinkage)
        inner_high = low + (high - low) / factor

        def outer(z: float) -> float:
            return z + (factor - 1.0) * (min(max(z, low), inner_high) - low)

        return (
            np.array([lower[0], lower[1], outer(float(lower[2]))]),
            np.array([upper[0], upper[1], outer(float(upper[2]))]),
        )


class LimitedTwist(Deformation):
    """`child` turned about the z axis by an angle that grows with the height between two limits (Barr 1984).

    Examples
    --------
    >>> from blobtree import LimitedTwist, Point
    >>> LimitedTwist(Point((1, 0, 5), radius=0.5), 90, 0, 1)([[0, 1, 5]]).round(3).tolist()
    [1.0]
    """

    tag = "limited_twist"

    degrees: float = par.angle("degrees per model unit of height, counter-clockwise from above")
    low: float = par.distance(LOW)
    high: float = par.distance(HIGH)

    @classmethod
    def numbers(cls, degrees: float, low: float, high: float) -> tuple[float, ...]:
        """Return the angle per unit of height in radians, and the limits."""
        return math.radians(degrees), low, high

    @formula
    def forward(q: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32) -> wp.vec3:
        """Rotate about z by −rate per unit of height between the limits."""
        angle = rate * (wp.clamp(q[2], low, high) - low)
        c = wp.cos(angle)
        s = wp.sin(angle)
        return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])

    @formula
    def pullback(q: wp.vec3, g: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32) -> wp.vec3:
        """Rotate back, and add the change of the rotation along z."""
        angle = rate * (wp.clamp(q[2], low, high) - low)
        c = wp.cos(angle)
        s = wp.sin(angle)
        x = c * q[0] + s * q[1]
        y = c * q[1] - s * q[0]
        change = rate * within_limits(q[2], 0.0, low, high)
        return wp.vec3(c * g[0] - s * g[1], s * g[0] + c * g[1], g[2] + change * (y * g[0] - x * g[1]))

    @formula
    def lipschitz(
        q: wp.vec3, reach: wp.float32, rate: wp.float32, low: wp.float32, high: wp.float32
    ) -> wp.float32:
        """Return the norm of the shear by |rate| · distance from the axis."""
        far = wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach
        return shear_norm(1.0, wp.abs(rate) * far * within_limits(q[2], reach, low, high))

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, rate: float, low: float, high: float) -> Box:
        """Return the box around the cylinder around a box; a box below the limits stays as it is."""
        return (lower, upper) if upper[2] <= low else cylinder_box(lower, upper)


@wp.func
def bend_place(q: wp.vec3, rate: wp.float32, low: wp.float32, half: wp.vec3) -> wp.vec4:
    """Return (x and z from the axis, distance beyond the arc, distance from the axis) over the bend's radius.

    The middle of the arc is at x = 1, z = 0. The distance beyond the arc is that from the line through the
    axis and the nearer end of the arc; it is below 0 within the arc. `half` is (·, cosine, sine) of half the
    angle of the arc.
    """
    k = wp.abs(rate)
    w = 1.0 - k * q[0] * wp.sign(rate)
    v = k * (q[2] - low)
    x = w * half[1] + v * half[2]
    z = v * half[1] - w * half[2]
    return wp.vec4(x, z, wp.abs(z) * half[1] - x * half[2], wp.sqrt(w * w + v * v))


@wp.func
def bend_turn(place: wp.vec4, half: wp.vec3) -> wp.vec2:
    """Return (cos, sin) of the angle by which a bend turns the tree at a place."""
    if place[2] < 0.0:
        rho = wp.max(place[3], 1.0e-6)
        x = place[0] / rho
        z = place[1] / rho
        return wp.vec2(x * half[1] - z * half[2], z * half[1] + x * half[2])
    if place[1] < 0.0:
        return wp.vec2(1.0, 0.0)
    return wp.vec2(half[1] * half[1] - half[2] * half[2], 2.0 * half[1] * half[2])


@wp.func
def bend_to_cut(place: wp.vec4) -> wp.float32:
    """Return the distance from the cut over the radius of the bend."""
    if place[0] < 0.0:
        return wp.abs(place[1])
    return place[3]


class Bend(Deformation):
    """`child` bent about an axis parallel to y; beyond the limits it stays rigid (Barr 1984, sec. 3.3).

    The z axis becomes a circle of radius 1 / rate toward +x, or toward −x for a negative rate. The field of
    the child must leave room around the axis of that circle, and its ends may not meet: `support` raises
    `InvalidNode` otherwise.

    Examples
    --------
    >>> from blobtree import Bend, Segment
    >>> arc = Bend(Segment((0, 0, 0), (0, 0, 3), radius=0.2), 30, 0, 3)
    >>> radius = 180 / 3.14159265 / 30
    >>> arc([[radius, 0, radius - 0.2]]).round(3).tolist()
    [0.5]
    """

    tag = "bend"

    degrees: float = par.angle("degrees per model unit of height, from z toward x")
    low: float = par.distance(LOW)
    high: float = par.distance("height where the bend ends, before it is bent")

    def __post_init__(self) -> None:
        super().__post_init__()
        total = abs(self.degrees) * (self.high - self.low)
        if total >= 360.0:
            raise InvalidNode(
                f"degrees: expected less than 360 between the limits, got {total:g}; "
                "use fewer degrees, or move the limits together"
            )

    @classmethod
    def numbers(cls, degrees: float, low: float, high: float) -> tuple[float, ...]:
        """Return the angle per unit of height in radians, and the limits."""
        return math.radians(degrees), low, high

    @formula
    def forward(q: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32, half: wp.vec3) -> wp.vec3:
        """Unroll the arc about y through rate per unit of height between the limits."""
        k = wp.abs(rate)
        if k == 0.0:
            return q
        place = bend_place(q, rate, low, half)
        side = wp.sign(rate)
        x = q[0] * side
        v = q[2] - low
        if place[2] < 0.0:
            inner = (2.0 * x - k * (x * x + v * v)) / (1.0 + place[3])
            return wp.vec3(side * inner, q[1], 0.5 * (low + high) + wp.atan2(place[1], place[0]) / k)
        if place[1] < 0.0:
            return q
        turn = bend_turn(place, half)
        inner = 2.0 * half[2] * half[2] / k + x * turn[0] - v * turn[1]
        return wp.vec3(side * inner, q[1], high + v * turn[0] - turn[1] / k + x * turn[1])

    @formula
    def pullback(
        q: wp.vec3, g: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32, half: wp.vec3
    ) -> wp.vec3:
        """Turn back; in the arc, heights change faster near the axis."""
        if rate == 0.0:
            return g
        place = bend_place(q, rate, low, half)
        turn = bend_turn(place, half)
        along = g[2]
        if place[2] < 0.0:
            along = g[2] / wp.max(place[3], CLEARANCE)
        side = wp.sign(rate)
        across = side * g[0]
        return wp.vec3(side * (turn[0] * across + turn[1] * along), g[1], turn[0] * along - turn[1] * across)

    @formula
    def lipschitz(
        q: wp.vec3, reach: wp.float32, rate: wp.float32, low: wp.float32, high: wp.float32, half: wp.vec3
    ) -> wp.float32:
        """Return radius of the bend / distance from its axis, bounded because the tree is empty near it.

        A ball around the axis, or across the cut, holds points whose images lie far apart. The bound is then
        so large that the ball of that many times the reach holds them all.
        """
        k = wp.abs(rate)
        if k == 0.0:
            return 1.0
        empty = half[0]
        place = bend_place(q, rate, low, half)
        rho = place[3]
        e = k * reach
        near = wp.max(rho - e, 0.7 * empty)  # lines between points with a field pass the axis no nearer
        bound = wp.max(1.0, 1.0 / near)
        if rho + e <= empty:
            return bound
        if e > rho or e > bend_to_cut(place) + CLEARANCE:
            bound = wp.max(bound, (2.0 * rho + e + k * (high - low)) / e)
        return bound

    @formula
    def image_box(
        q: wp.vec3, half_size: wp.vec3, rate: wp.float32, low: wp.float32, high: wp.float32, half: wp.vec3
    ) -> wp.vec3:
        """Bound the image of a box within the arc, or beyond one of its ends, and of no other box.

        At q, a is the extent of the box away from the axis and b across, over the radius of the bend.
        """
        k = wp.abs(rate)
        if k == 0.0:
            return half_size
        place = bend_place(q, rate, low, half)
        turn = bend_turn(place, half)
        c = wp.abs(turn[0])
        s = wp.abs(turn[1])
        rho = place[3]
        a = k * (c * half_size[0] + s * half_size[2])
        b = k * (s * half_size[0] + c * half_size[2])
        e = wp.sqrt(a * a + b * b)
        if rho > e and place[2] < -e:
            farthest = wp.sqrt((rho + a) * (rho + a) + b * b) - rho
            return wp.vec3(wp.max(a, farthest) / k, half_size[1], wp.atan2(b, rho - a) / k)
        if place[2] > e and bend_to_cut(place) > e:
            return wp.vec3(a / k, half_size[1], b / k)
        return wp.vec3(UNKNOWN_EXTENT, UNKNOWN_EXTENT, UNKNOWN_EXTENT)

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, rate: float, low: float, high: float) -> Box:
        """Return the box around a bent box.

        Raises
        ------
        InvalidNode
            The inner box reaches the axis of the bend, or what lies beyond one limit meets the other end.
        """
        if rate == 0.0:
            return lower, upper
        k = abs(rate)
        x_range = sorted(
            [float(lower[0]) * math.copysign(1.0, rate), float(upper[0]) * math.copysign(1.0, rate)]
        )
        _require_room(x_range[1], lower[2], upper[2], k, low, high)
        parts = []
        if lower[2] < low:
            parts += list(product(x_range, (float(lower[2]), min(float(upper[2]), low))))
        if upper[2] > low and lower[2] < high:
            first, last = k * (max(lower[2], low) - low), k * (min(upper[2], high) - low)
            quarters = [0.5 * math.pi * number for number in range(5)]
            angles = [first, last, *(angle for angle in quarters if first < angle < last)]
            parts += [_on_arc(x, angle, k, low) for x, angle in product(x_range, angles)]
        if upper[2] > high:
            full = k * (high - low)
            c, s = math.cos(full), math.sin(full)
            for x, beyond in product(x_range, (max(lower[2] - high, 0.0), upper[2] - high)):
                foot = _on_arc(x, full, k, low)
                parts.append((foot[0] + s * beyond, foot[1] + c * beyond))
        corners = np.array(parts)
        corners[:, 0] *= math.copysign(1.0, rate)
        (x_low, z_low), (x_high, z_high) = corners.min(axis=0), corners.max(axis=0)
        return np.array([x_low, lower[1], z_low]), np.array([x_high, upper[1], z_high])

    @classmethod
    def room(
        cls, lower: Float64Array, upper: Float64Array, rate: float, low: float, high: float
    ) -> tuple[float, ...]:
        """Return the distance from the axis at which the inner box begins, over the radius of the bend.

        Then follow the cosine and the sine of half the angle of the arc.
        """
        toward = float(upper[0]) if rate >= 0.0 else -float(lower[0])
        empty = 1.0
        if rate != 0.0 and toward > 0.0:
            empty = max(0.999 * (1.0 - abs(rate) * toward), CLEARANCE)
        half = 0.5 * abs(rate) * (high - low)
        return empty, math.cos(half), math.sin(half)


def _on_arc(x: float, angle: float, k: float, low: float) -> tuple[float, float]:
    """Return (x, z) of a bent point at `angle`, from its x toward the axis."""
    half = math.sin(0.5 * angle)
    return 2.0 * half * half / k + x * math.cos(angle), low + (1.0 / k - x) * math.sin(angle)


def _require_room(nearest: float, bottom: float, top: float, k: float, low: float, high: float) -> None:
    if nearest > (1.0 - CLEARANCE) / k:
        raise InvalidNode(
            f"bend: its axis is {1.0 / k:.4g} from the z axis, and the field of its child reaches "
            f"{nearest:.4g} toward it, at most {(1.0 - CLEARANCE) / k:.4g} may; bend by fewer degrees per "
            "unit, or move the child away from the axis"
        )
    rest = math.pi - 0.5 * k * (high - low)
    for beyond in (low - bottom, top - high):
        to_cut = (1.0 - k * nearest) * math.sin(rest) - k * max(beyond, 0.0) * math.cos(rest)
        if rest < 0.5 * math.pi and to_cut < CLEARANCE:
            raise InvalidNode(
                f"bend: the field of its child reaches {max(beyond, 0.0):.4g} beyond the limits, so that its "
                "ends would meet; bend by fewer degrees, or move the limits apart"
            )


class NoiseWarp(Warp):
    """`child` displaced by smooth noise: the sum of plane waves of random directions (Saupe 1988).

    Displacements are normal to the wave vectors, so that volumes stay the same to first order.

    Examples
    --------
    >>> from blobtree import NoiseWarp, Point
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> rough = NoiseWarp(ball, 0.2, 1.0, seed=3)
    >>> bool(abs(rough([[1, 0, 0]]) - ball([[1, 0, 0]]))[0] > 1e-3)
    True
    """

    tag = "noise_warp"

    amplitude: float = par.length("bound on the displacement")
    wavelength: float = par.length("mean length of the waves, at least the amplitude")
    seed: int = par.whole("number of the noise", low=0, high=LARGEST_INTEGER, default=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.amplitude > self.wavelength:
            raise InvalidNode(
                f"amplitude: expected at most the wavelength {self.wavelength:g}, got {self.amplitude:g}; "
                "larger displacements fold the model"
            )

    @classmethod
    def numbers(cls, amplitude: float, wavelength: float, seed: int) -> tuple[float, ...]:
        """Return the number of waves, and (ω, phase), (d, steepness) of each."""
        rng = np.random.default_rng(seed)
        z, turn, phase, side = rng.random((4, WAVES))
        across = np.sqrt(1.0 - (2.0 * z - 1.0) ** 2)
        angle = 2.0 * np.pi * turn
        directions = np.stack([across * np.cos(angle), across * np.sin(angle), 2.0 * z - 1.0], axis=1)
        lengths = wavelength * WAVELENGTH_SPREAD ** np.linspace(-1.0, 1.0, WAVES)
        omegas = 2.0 * np.pi * directions / lengths[:, None]
        helper = np.eye(3)[np.abs(directions).argmin(axis=1)]
        first = np.cross(directions, helper)
        first /= np.linalg.norm(first, axis=1)[:, None]
        second = np.cross(directions, first)
        side = 2.0 * np.pi * side
        motions = first * np.cos(side)[:, None] + second * np.sin(side)[:, None]
        motions *= amplitude / WAVES
        steepness = np.linalg.norm(omegas, axis=1) * amplitude / WAVES
        waves = np.column_stack([omegas, 2.0 * np.pi * phase, motions, steepness])
        return (float(WAVES), 0.0, 0.0, *waves.ravel().tolist())

    @formula
    def forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
        """Add p₁ plane waves d sin(ω · q + phase); each is two texels, (ω, phase) and (d, |d| |ω|)."""
        moved = q
        for i in range(int(tape[at][1])):
            wave = tape[at + 1 + 2 * i]
            d = tape[at + 2 + 2 * i]
            angle = wp.dot(wp.vec3(wave[0], wave[1], wave[2]), q) + wave[3]
            moved += wp.vec3(d[0], d[1], d[2]) * wp.sin(angle)
        return moved

    @formula
    def pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
        """Add ω (d · g) cos(ω · q + phase) of each wave."""
        pulled = g
        for i in range(int(tape[at][1])):
            wave = tape[at + 1 + 2 * i]
            d = tape[at + 2 + 2 * i]
            omega = wp.vec3(wave[0], wave[1], wave[2])
            angle = wp.dot(omega, q) + wave[3]
            pulled += omega * (wp.dot(wp.vec3(d[0], d[1], d[2]), g) * wp.cos(angle))
        return pulled

    @formula
    def lipschitz(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
        """Return 1 + Σ |d| |ω| · the largest |cos|, which changes by at most |ω| per unit."""
        bound = float(1.0)
        for i in range(int(tape[at][1])):
            wave = tape[at + 1 + 2 * i]
            d = tape[at + 2 + 2 * i]
            omega = wp.vec3(wave[0], wave[1], wave[2])
            angle = wp.dot(omega, q) + wave[3]
            bound += d[3] * wp.min(wp.abs(wp.cos(angle)) + wp.length(omega) * reach, 1.0)
        return bound

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, numbers: tuple[float, ...]) -> Box:
        """Return the box widened by the sum of the waves' amplitudes."""
        waves = np.array(numbers[3:]).reshape(-1, 2, 4)
        margin = np.abs(waves[:, 1, :3]).sum(axis=0)
        return lower - margin, upper + margin


@wp.func
def wendland(distance: wp.float32) -> wp.float32:
    """Wendland's C² function (1 − s)⁴ (4 s + 1), 0 from s = 1 on."""
    s = wp.min(distance, 1.0)
    t = (1.0 - s) * (1.0 - s)
    return t * t * (4.0 * s + 1.0)


@wp.func
def wendland_steepness(distance: wp.float32) -> wp.float32:
    """|φ'| / s = 20 (1 − s)³, 0 from s = 1 on."""
    t = 1.0 - wp.min(distance, 1.0)
    return 20.0 * t * t * t


class CurveWarp(Warp):
    """`child` deformed so that points of a curve move to points of another (Sugihara et al. 2010).

    Points of `source` move to the points of `target`, one for one. Between and around them the motion is
    interpolated by Wendland's C² radial function. Beyond `reach` from the target nothing moves.

    Examples
    --------
    >>> from blobtree import CurveWarp, Segment
    >>> rod = Segment((-1, 0, 0), (1, 0, 0), radius=0.2)
    >>> source = [(-1, 0, 0), (0, 0, 0), (1, 0, 0)]
    >>> arched = CurveWarp(rod, source, [(-1, 0, 0), (0, 0, 0.3), (1, 0, 0)], reach=1.5)
    >>> arched([[0, 0, 0.3]]).round(3).tolist()
    [1.0]
    """

    tag = "curve_warp"

    source: Annotated[Points, Parameter(Quantity.POINTS, "points of the curve before the deformation")]
    target: Annotated[Points, Parameter(Quantity.POINTS, "the same points after it")]
    reach: float = par.length("distance from the target up to which space moves")

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.target)
        if not 1 <= len(self.source) <= MAX_CURVE_POINTS:
            raise InvalidNode(f"source: expected 1 to {MAX_CURVE_POINTS} points, got {len(self.source)}")
        if count != len(self.source):
            raise InvalidNode(
                f"target: expected one point per point of source, {len(self.source)}, got {count}"
            )
        if not np.isfinite(self._weights).all():
            raise InvalidNode("target: expected distinct points, got some too close together for the reach")
        if self._smallest_determinant() <= 0.0:
            raise InvalidNode(
                "target: the motion folds space; use a larger reach, or points nearer to the source"
            )

    @Lazy
    def _weights(self) -> Float64Array:
        """Return the weights (n, 3) of the radial functions that interpolate source − target."""
        source, target = np.array(self.source), np.array(self.target)
        distances = np.linalg.norm(target[:, None] - target, axis=2) / self.reach
        matrix = np.maximum(1.0 - distances, 0.0) ** 4 * (4.0 * distances + 1.0)
        if np.linalg.cond(matrix) > LARGEST_CONDITION:
            return np.full_like(target, np.nan)
        weights: Float64Array = np.linalg.solve(matrix, source - target)
        return weights

    def _smallest_determinant(self) -> float:
        """Return the smallest determinant of the Jacobian at samples around the target."""
        centers = np.array(self.target)
        first, last = centers.min(axis=0) - self.reach, centers.max(axis=0) + self.reach
        steps = [np.linspace(a, b, FOLD_SAMPLES) for a, b in zip(first, last, strict=True)]
        grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        away = (np.concatenate([grid, centers])[:, None] - centers) / self.reach
        slopes = -20.0 * np.maximum(1.0 - np.linalg.norm(away, axis=2), 0.0) ** 3 / self.reach
        jacobians = np.eye(3) + np.einsum("jc,njd->ncd", self._weights, slopes[..., None] * away)
        return float(np.linalg.det(jacobians).min())

    @Lazy
    def warp_parameters(self) -> tuple[float, ...]:
        """Return the number of points, 1 / reach, and (centre, 0), (weight, its length) of each."""
        lengths = np.linalg.norm(self._weights, axis=1)
        texels = np.column_stack([np.array(self.target), np.zeros(len(lengths)), self._weights, lengths])
        return (float(len(lengths)), 1.0 / self.reach, 0.0, *texels.ravel().tolist())

    @formula
    def forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
        """Add Σ w φ(|q − c| p₂) over p₁ centres c; each is two texels, (c, 0) and (w, |w|)."""
        p = tape[at]
        moved = q
        for i in range(int(p[1])):
            center = tape[at + 1 + 2 * i]
            w = tape[at + 2 + 2 * i]
            s = wp.length(q - wp.vec3(center[0], center[1], center[2])) * p[2]
            moved += wp.vec3(w[0], w[1], w[2]) * wendland(s)
        return moved

    @formula
    def pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
        """Add ∇φ (w · g) of each centre."""
        p = tape[at]
        pulled = g
        for i in range(int(p[1])):
            center = tape[at + 1 + 2 * i]
            w = tape[at + 2 + 2 * i]
            away = (q - wp.vec3(center[0], center[1], center[2])) * p[2]
            steepness = wendland_steepness(wp.length(away)) * p[2]
            pulled -= away * (steepness * wp.dot(wp.vec3(w[0], w[1], w[2]), g))
        return pulled

    @formula
    def lipschitz(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
        """Return 1 + Σ |w| · the largest slope of φ within reach; it is largest at STEEPEST_WENDLAND."""
        p = tape[at]
        bound = float(1.0)
        for i in range(int(p[1])):
            center = tape[at + 1 + 2 * i]
            s = wp.length(q - wp.vec3(center[0], center[1], center[2])) * p[2]
            nearest = wp.max(s - reach * p[2], 0.0)
            steepest = wp.clamp(STEEPEST_WENDLAND, nearest, s + reach * p[2])
            bound += tape[at + 2 + 2 * i][3] * p[2] * steepest * wendland_steepness(steepest)
        return bound

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, numbers: tuple[float, ...]) -> Box:
        """Return the box, and around the centres the box widened by the largest motion there."""
        texels = np.array(numbers[3:]).reshape(-1, 2, 4)
        centers, weights, radius = texels[:, 0, :3], texels[:, 1, :3], 1.0 / numbers[1]
        first, last = centers.min(axis=0) - radius, centers.max(axis=0) + radius
        margin = largest_motion(centers, weights, radius)
        near = np.maximum(lower - margin, first), np.minimum(upper + margin, last)
        if np.any(near[0] > near[1]):
            return lower, upper
        return np.minimum(lower, near[0]), np.maximum(upper, near[1])


def largest_motion(centers: Float64Array, weights: Float64Array, radius: float) -> Float64Array:
    """Return a bound (3,) on |Σ w φ| along each axis, from samples and the slopes around them."""
    first, last = centers.min(axis=0) - radius, centers.max(axis=0) + radius
    steps = [np.linspace(a, b, MOTION_SAMPLES) for a, b in zip(first, last, strict=True)]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    half_cell = 0.5 * float(np.linalg.norm((last - first) / (MOTION_SAMPLES - 1))) / radius
    s = np.linalg.norm(points - centers, axis=2) / radius
    values = np.maximum(1.0 - s, 0.0) ** 4 * (4.0 * s + 1.0)
    steepest = np.clip(STEEPEST_WENDLAND, np.maximum(s - half_cell, 0.0), s + half_cell)
    slopes = 20.0 * steepest * np.maximum(1.0 - steepest, 0.0) ** 3
    bounds: Float64Array = np.abs(values @ weights) + slopes @ np.abs(weights) * half_cell
    return bounds.max(axis=0)
