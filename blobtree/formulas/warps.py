"""Warps: maps of space under which a subtree is seen, other than affine ones (Barr 1984).

A warp T takes a point of the outer space to the subtree's own: F(q) = f(T(q)). It is three typed functions,
`p` being its parameters (·, p₁, p₂, p₃):

* `forward(q, p) -> T(q)`;
* `pullback(q, g, p) -> Jᵀ g`, which takes the subtree's gradient to the outer space;
* `stretch(q, reach, p)`: a bound on ‖J‖ over the ball of radius `reach` about q;

and `box(lower, upper, p)`, the outer space's box around what the inner box holds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

wp.set_module_options({"enable_backward": False})

Box = tuple[NDArray[np.float64], NDArray[np.float64]]


@wp.func
def twist_forward(q: wp.vec3, p: wp.vec4) -> wp.vec3:
    """Turn about z by −p₁·z."""
    c = wp.cos(p[1] * q[2])
    s = wp.sin(p[1] * q[2])
    return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])


@wp.func
def twist_pullback(q: wp.vec3, g: wp.vec3, p: wp.vec4) -> wp.vec3:
    """The turn undone, and what the change of the turn along z adds."""
    c = wp.cos(p[1] * q[2])
    s = wp.sin(p[1] * q[2])
    x = c * q[0] + s * q[1]
    y = c * q[1] - s * q[0]
    return wp.vec3(c * g[0] - s * g[1], s * g[0] + c * g[1], g[2] + p[1] * (y * g[0] - x * g[1]))


@wp.func
def twist_stretch(q: wp.vec3, reach: wp.float32, p: wp.vec4) -> wp.float32:
    """A turn is a rotation and a shear by k = |p₁| · distance from the axis: ‖J‖ = (k + √(k² + 4)) / 2."""
    k = wp.abs(p[1]) * (wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach)
    return 0.5 * (k + wp.sqrt(k * k + 4.0))


def twist_box(lower: NDArray[np.float64], upper: NDArray[np.float64], _parameters: tuple[float, ...]) -> Box:
    """The cylinder around the box."""
    radius = float(np.hypot(*np.maximum(np.abs(lower[:2]), np.abs(upper[:2]))))
    return np.array([-radius, -radius, lower[2]]), np.array([radius, radius, upper[2]])


@dataclass(frozen=True)
class SpaceWarp:
    """One row of the table."""

    name: str
    forward: wp.Function
    pullback: wp.Function
    stretch: wp.Function
    box: Callable[[NDArray[np.float64], NDArray[np.float64], tuple[float, ...]], Box]


TWIST = SpaceWarp("twist", twist_forward, twist_pullback, twist_stretch, twist_box)

WARPS = (TWIST,)
"""Every warp; its place here is its code on the tape."""
