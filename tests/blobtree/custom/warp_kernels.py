"""Typed functions of custom warps, right ones and wrong ones."""

from typing import Any

import numpy as np
import warp as wp

from blobtree import Warp, formula, par
from blobtree._typing import Float64Array
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})


@wp.func
def sway(q: wp.vec3, width: wp.float32, rate: wp.float32) -> wp.vec3:
    """Cross-sections that swing along x."""
    return wp.vec3(q[0] - width * wp.sin(rate * q[2]), q[1], q[2])


@wp.func
def sway_stretch(width: wp.float32, rate: wp.float32) -> wp.float32:
    return 1.0 + wp.abs(width * rate)


@wp.func
def sway_pullback(q: wp.vec3, g: wp.vec3, width: wp.float32, rate: wp.float32) -> wp.vec3:
    return wp.vec3(g[0], g[1], g[2] - width * rate * wp.cos(rate * q[2]) * g[0])


class Swirl(Warp):
    """Turn about z by an angle that falls with the distance from a point of the axis."""

    axis: Vector = par.point("point of the axis")
    turns: int = par.whole("angle at that point, in fifths of a radian", low=-5, high=5)

    @classmethod
    def numbers(cls, axis: Vector, turns: int) -> tuple[float, ...]:
        return (*axis, 0.2 * turns)

    @formula
    def forward(q: wp.vec3, axis: wp.vec3, most: wp.float32) -> wp.vec3:
        w = q - axis
        angle = most * wp.exp(-wp.dot(w, w))
        c = wp.cos(angle)
        s = wp.sin(angle)
        return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])

    @formula
    def lipschitz(q: wp.vec3, reach: wp.float32, axis: wp.vec3, most: wp.float32) -> wp.float32:
        return 1.0 + wp.abs(most) * 0.86 * (wp.length(q) + reach)

    @formula
    def image_box(q: wp.vec3, half: wp.vec3, axis: wp.vec3, most: wp.float32) -> wp.vec3:
        radius = wp.length(wp.vec2(q[0], q[1])) + wp.length(wp.vec2(half[0], half[1]))
        return wp.vec3(2.0 * radius, 2.0 * radius, half[2])

    @classmethod
    def outer_box(
        cls, lower: Float64Array, upper: Float64Array, axis: Vector, most: float
    ) -> tuple[Any, Any]:
        radius = np.hypot(*np.maximum(np.abs(lower[:2]), np.abs(upper[:2])))
        return (-radius, -radius, lower[2]), (radius, radius, upper[2])


@wp.func
def flat(q: wp.vec3) -> wp.vec3:
    return wp.vec3(q[0], q[1], 0.0)


@wp.func
def folded(q: wp.vec3) -> wp.vec3:
    return wp.vec3(q[0], q[1], q[2] * q[2])


@wp.func
def torn(q: wp.vec3) -> wp.vec3:
    if q[0] > 0.0:
        return q + wp.vec3(1.0, 0.0, 0.0)
    return q


@wp.func
def broken(q: wp.vec3) -> wp.vec3:
    return q / (q[0] - q[0])


@wp.func
def wrong_pullback(q: wp.vec3, g: wp.vec3, width: wp.float32, rate: wp.float32) -> wp.vec3:
    return g


@wp.func
def same_size(q: wp.vec3, half: wp.vec3, axis: wp.vec3, most: wp.float32) -> wp.vec3:
    return half


@wp.func
def wrong_stretch(width: wp.float32) -> wp.float32:
    return 2.0
