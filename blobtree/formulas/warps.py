"""Warps: non-affine maps of space around a subtree (Barr 1984).

A warp T maps a point of the outer space to the subtree's space: F(q) = f(T(q)). It consists of typed
functions that read the parameters from tape[at] = (·, p₁, p₂, p₃), tape[at + 1] = (p₄, …) and so on:

* `forward(q, tape, at) -> T(q)`;
* `pullback(q, g, tape, at) -> Jᵀ g`, which takes the subtree's gradient to the outer space;
* `stretch(q, reach, tape, at)`: a bound on ‖J‖ over the ball of radius `reach` about q;
* `extent(q, half, tape, at)`, which is optional: half the size of a box about T(q) that holds the image of
  the box q ± half. It is worth its time for warps whose `stretch` is far above 1 in one direction alone;

and `box(lower, upper, (p₁, p₂, …))`, the outer space's box around what the inner box holds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from blobtree._typing import Box, Float64Array
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

UNKNOWN_EXTENT = wp.constant(1e18)
"""Size of a box that excludes nothing; its square is a float32."""


@wp.func
def twist_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Rotate about z by −p₁·z."""
    p = tape[at]
    c = wp.cos(p[1] * q[2])
    s = wp.sin(p[1] * q[2])
    return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])


@wp.func
def twist_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Rotate back, and add the change of the rotation along z."""
    p = tape[at]
    c = wp.cos(p[1] * q[2])
    s = wp.sin(p[1] * q[2])
    x = c * q[0] + s * q[1]
    y = c * q[1] - s * q[0]
    return wp.vec3(c * g[0] - s * g[1], s * g[0] + c * g[1], g[2] + p[1] * (y * g[0] - x * g[1]))


@wp.func
def twist_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return ‖J‖ = (k + √(k² + 4)) / 2: a rotation and a shear by k = |p₁| · distance from the axis."""
    k = wp.abs(tape[at][1]) * (wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach)
    return 0.5 * (k + wp.sqrt(k * k + 4.0))


def twist_box(lower: Float64Array, upper: Float64Array, _parameters: tuple[float, ...]) -> Box:
    """Return the box around the cylinder around a box."""
    radius = float(np.hypot(*np.maximum(np.abs(lower[:2]), np.abs(upper[:2]))))
    return np.array([-radius, -radius, lower[2]]), np.array([radius, radius, upper[2]])


@wp.func
def unknown_extent(q: wp.vec3, half: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return a large size: the ball that `stretch` gives is all that is known."""
    return wp.vec3(UNKNOWN_EXTENT, UNKNOWN_EXTENT, UNKNOWN_EXTENT)


@dataclass(frozen=True)
class SpaceWarp:
    """One row of the table: a warp's name and functions."""

    name: str
    forward: wp.Function
    pullback: wp.Function
    stretch: wp.Function
    box: Callable[[Float64Array, Float64Array, tuple[float, ...]], Box]
    room: Callable[[Float64Array, Float64Array, tuple[float, ...]], tuple[float, ...]] | None = None
    """Return further parameters, those that depend on the inner box outside of which the subtree is 0."""
    extent: wp.Function = unknown_extent
    digest: str = ""
    """Digest of the sources of a custom warp."""


TWIST = SpaceWarp("twist", twist_forward, twist_pullback, twist_stretch, twist_box)

WARPS = (TWIST,)
"""Every warp; its index here is its code on the tape."""
