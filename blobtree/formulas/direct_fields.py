"""Direct fields of the library: superquadrics."""

import warp as wp

from blobtree.formulas.falloff import RIM, falloff, falloff_derivative, falloff_steepest
from blobtree.formulas.fields import FieldKind
from blobtree.formulas.operators import ricci_partials

wp.set_module_options({"enable_backward": False})

NORM_MARGIN = wp.constant(4e-6)
"""Relative error of powers in float32."""


@wp.func
def signed(magnitude: wp.float32, number: wp.float32) -> wp.float32:
    """Return `magnitude` with the sign of `number`."""
    if number < 0.0:
        return -magnitude
    return magnitude


@wp.func
def superquadric_norm(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
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
def superquadric_value_gradient(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Return (f, ∇f) of f = g(RIM · h)."""
    h = superquadric_norm(q, tape, at)
    d = RIM * h[0]
    slope = 2.0 * RIM * d * falloff_derivative(d * d)
    return wp.vec4(falloff(d * d), slope * h[1], slope * h[2], slope * h[3])


@wp.func
def superquadric_bounds(
    center: wp.vec3, radius: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec3:
    """Bound f over a ball; tape[at + 2][0] is the largest slope of h, which is that of a norm."""
    steepest = RIM * tape[at + 2][0]
    d = RIM * superquadric_norm(center, tape, at)[0]
    nearest = wp.max(d * (1.0 - NORM_MARGIN) - steepest * radius, 0.0)
    farthest = d * (1.0 + NORM_MARGIN) + steepest * radius
    return wp.vec3(
        falloff(farthest * farthest),
        falloff(nearest * nearest),
        steepest * falloff_steepest(nearest, farthest),
    )


SUPERQUADRIC = FieldKind("superquadric", superquadric_value_gradient, superquadric_bounds, parameters=3)

DIRECT_FIELDS = (SUPERQUADRIC,)
"""Every direct field of this file."""
