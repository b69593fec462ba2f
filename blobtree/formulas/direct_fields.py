"""Direct fields of the library: superquadrics, gyroids and noise.

A gyroid and noise have no end of their own. They fill a box, with tape[at] = (its middle, fade) and
tape[at + 1] = (half lengths, the kind's first number), see `formulas.windows`.
"""

import math

import warp as wp

from blobtree.declare.registry import library_rows
from blobtree.formulas.falloff import RIM
from blobtree.formulas.fields import FieldKind
from blobtree.formulas.noise import LARGEST_NOISE, STEEPEST_NOISE, gradient_noise
from blobtree.formulas.operators import ricci_partials
from blobtree.formulas.windows import smooth_step, smooth_step_slope, steepest_smooth_step
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

NORM_MARGIN = wp.constant(4e-6)
"""Relative error of powers in float32."""

STEEPEST_GYROID = math.sqrt(3.0)
"""Largest |∇G| of G = sin x cos y + sin y cos z + sin z cos x."""

GYROID_SLOPE = 1.529
"""Mean |∇G| on the surface G = 0; it varies there from √2 to √3."""

LARGEST_GYROID = 1.5
"""Largest |G|."""


@wp.func
def signed(magnitude: wp.float32, number: wp.float32) -> wp.float32:
    """Return `magnitude` with the sign of `number`."""
    if number < 0.0:
        return -magnitude
    return magnitude


@wp.func
def superquadric_norm(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (h, ∇h) of h = ((|x/a|ᵐ + |y/b|ᵐ)^(n/m) + |z/c|ⁿ)^(1/n), which is 1 on the superquadric.

    This is Barr's inside–outside function to the power ε₁/2, with m = 2/ε₂ and n = 2/ε₁. As a norm it grows
    linearly along rays from the centre. tape[at] = (centre, m); tape[at + 1] = (1/a, 1/b, 1/c, n).
    """
    center = tape[at]
    inverse = tape[at + 1]
    x = (q[0] - center[0]) * inverse[0]
    y = (q[1] - center[1]) * inverse[1]
    z = (q[2] - center[2]) * inverse[2]
    across = ricci_partials(wp.abs(x), wp.abs(y), center[3])
    both = ricci_partials(across[0], wp.abs(z), inverse[3])
    return wp.vec4(
        both[0],
        signed(both[1] * across[1] * inverse[0], x),
        signed(both[1] * across[2] * inverse[1], y),
        signed(both[2] * inverse[2], z),
    )


@wp.func
def superquadric_distance(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of u = RIM · h."""
    return superquadric_norm(q, tape, at) * RIM


@wp.func
def superquadric_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball; tape[at + 2][0] is the largest slope of h, which is that of a norm."""
    steepest = RIM * tape[at + 2][0]
    u = RIM * superquadric_norm(center, tape, at)[0]
    nearest = u * (1.0 - NORM_MARGIN) - steepest * radius
    return wp.vec3(nearest, u * (1.0 + NORM_MARGIN) + steepest * radius, steepest)


@wp.func
def gyroid(x: wp.vec3, rate: wp.float32) -> wp.vec4:
    """Return (G, ∇G) of G = sin X cos Y + sin Y cos Z + sin Z cos X with X = rate · x (Schoen 1970)."""
    p = x * rate
    sx = wp.sin(p[0])
    sy = wp.sin(p[1])
    sz = wp.sin(p[2])
    cx = wp.cos(p[0])
    cy = wp.cos(p[1])
    cz = wp.cos(p[2])
    return wp.vec4(
        sx * cy + sy * cz + sz * cx,
        rate * (cx * cy - sz * sx),
        rate * (cy * cz - sx * sy),
        rate * (cz * cx - sy * sz),
    )


@wp.func
def gyroid_distance(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of u = |G| / s; tape[at + 1][3] = rate, tape[at + 2][0] = 1 / s."""
    middle = tape[at]
    u = gyroid(q - wp.vec3(middle[0], middle[1], middle[2]), tape[at + 1][3]) * tape[at + 2][0]
    if u[0] < 0.0:
        return -u
    return u


@wp.func
def gyroid_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball, in which |G| changes by at most √3 · rate · radius."""
    rate = tape[at + 2][0]
    steepest = STEEPEST_GYROID * tape[at + 1][3] * rate
    u = gyroid_distance(center, tape, at)[0]
    nearest = wp.max(u - steepest * radius, 0.0)
    farthest = wp.min(u + steepest * radius, LARGEST_GYROID * rate)
    return wp.vec3(nearest, wp.max(farthest, nearest), steepest)


@wp.func
def noise_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (f, ∇f) of f = s(½ + (n − level) / 2 softness), s being `smooth_step`.

    tape[at + 1][3] = 1 / wavelength; tape[at + 2] = (level, 1 / (2 softness), seed, 0).
    """
    middle = tape[at]
    rate = tape[at + 1][3]
    shape = tape[at + 2]
    n = gradient_noise((q - wp.vec3(middle[0], middle[1], middle[2])) * rate, int(shape[2]))
    t = 0.5 + (n[0] - shape[0]) * shape[1]
    slope = smooth_step_slope(t) * shape[1] * rate
    return wp.vec4(smooth_step(t), slope * n[1], slope * n[2], slope * n[3])


@wp.func
def noise_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound f over a ball, in which the noise changes by at most STEEPEST_NOISE · radius / wavelength."""
    middle = tape[at]
    rate = tape[at + 1][3]
    shape = tape[at + 2]
    n = gradient_noise((center - wp.vec3(middle[0], middle[1], middle[2])) * rate, int(shape[2]))[0]
    change = STEEPEST_NOISE * radius * rate
    low = 0.5 + (wp.max(n - change, -LARGEST_NOISE) - shape[0]) * shape[1]
    high = 0.5 + (wp.min(n + change, LARGEST_NOISE) - shape[0]) * shape[1]
    slope = STEEPEST_NOISE * rate * shape[1] * steepest_smooth_step(low, high)
    return wp.vec3(smooth_step(low), smooth_step(high), slope)


SUPERQUADRIC = FieldKind(
    "superquadric", superquadric_distance, superquadric_bounds, parameters=3, distance=True
)
GYROID = FieldKind("gyroid", gyroid_distance, gyroid_bounds, parameters=3, distance=True, windowed=True)
NOISE = FieldKind("noise", noise_value_gradient, noise_bounds, parameters=3, windowed=True)

library_rows(SUPERQUADRIC, GYROID, NOISE)
