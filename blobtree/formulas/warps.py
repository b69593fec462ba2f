"""The warp of the core, which kernels of all trees read: a row has the form of `blobtree.declare.warp`."""

import numpy as np
import warp as wp

from blobtree._typing import Box, Float64Array
from blobtree.declare.warp import SpaceWarp
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})


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


def twist_box(lower: Float64Array, upper: Float64Array, _numbers: tuple[float, ...] = ()) -> Box:
    """Return the box around the cylinder around a box."""
    radius = float(np.hypot(*np.maximum(np.abs(lower[:2]), np.abs(upper[:2]))))
    return np.array([-radius, -radius, lower[2]]), np.array([radius, radius, upper[2]])


TWIST = SpaceWarp("twist", twist_forward, twist_pullback, twist_stretch, twist_box)

WARPS = (TWIST,)
"""Every warp; its index here is its code on the tape."""
