"""Contact between decals: how neighbours push the rim of the decal that owns a point.

As printed, with denominator 1 − f_k, equation 5 of the paper breaks its own constraints. Here it is repaired.
With owner k, the decal of highest field at q,

    F = ½ + (f_k − ½) ∏_{i≠k} h_i
    h_i = 1 where f_i + f_k ≤ 1, else 1 − u^{1/(1−f_k)},  u = (f_i + f_k − 1)/(2 f_k − 1)

meets the four constraints of section 3.2: F = f_k where no f_i + f_k > 1; F = 1 where f_k = 1; F = ½ where
f_i = f_k > ½; F is continuous elsewhere.

Near a centre, float32 cannot represent 1 − f. These functions therefore compute complements: e = 1 − f,
E = 1 − F, and push = 1 − ∏ h_i in place of the product.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.formulas.falloff import RIM
from decals.record import Contact

wp.set_module_options({"enable_backward": False})


SERIES_LIMIT = 0.02
"""Argument below which `log_one_minus` is a power series."""

MIN_SPAN = 1.0e-7
MIN_COMPLEMENT = 1.0e-37
"""Smallest divisor whose reciprocal is finite, and which no graphics card flushes to 0."""

ALMOST_ONE = 0.99999994
"""Largest float32 below 1."""


@wp.func
def log_one_minus(w: wp.float32) -> wp.float32:
    """Return log(1 − w) for 0 ≤ w < 1, to full relative precision also for small w."""
    if w < SERIES_LIMIT:
        return -w * (1.0 + w * (0.5 + w * (0.33333333 + w * (0.25 + w * 0.2))))
    return wp.log(1.0 - w)


@wp.func
def contact_push(e_i: wp.float32, e_k: wp.float32) -> wp.float32:
    """Return the push φ_i = 1 − h_i of neighbour i on the owner k, from 0 (none) to 1 (onto the rim)."""
    w = (e_i - e_k) / wp.max(1.0 - 2.0 * e_k, MIN_SPAN)
    if w >= 1.0:
        return 0.0
    return wp.exp(log_one_minus(w) / wp.max(e_k, MIN_COMPLEMENT))


@wp.func
def add_push(push: wp.float32, phi: wp.float32, contact: wp.int32) -> wp.float32:
    """Extend 1 − ∏(1 − φ), or the largest φ in `Contact.MIN`, by one more neighbour."""
    if contact == Contact.MIN:
        return wp.max(push, phi)
    return push + phi * (1.0 - push)


@wp.func
def push_of(e: wp.float32, least: wp.float32, per_span: wp.float32, per_least: wp.float32) -> wp.float32:
    """Return the push φ of a neighbour (`contact_push` with given reciprocals); 0 for the owner."""
    if e <= least or e + least >= 1.0:
        return 0.0
    return wp.exp(log_one_minus(wp.min((e - least) * per_span, ALMOST_ONE)) * per_least)


@wp.func
def add_pushes(
    push: wp.float32,
    e: wp.vec4,
    least: wp.float32,
    per_span: wp.float32,
    per_least: wp.float32,
    contact: wp.int32,
) -> wp.float32:
    """Extend 1 − ∏(1 − φ), or the largest φ in `Contact.MIN`, by four neighbours."""
    first = add_push(push, push_of(e[0], least, per_span, per_least), contact)
    second = add_push(first, push_of(e[1], least, per_span, per_least), contact)
    third = add_push(second, push_of(e[2], least, per_span, per_least), contact)
    return add_push(third, push_of(e[3], least, per_span, per_least), contact)


@wp.func
def contact_complement(e_k: wp.float32, push: wp.float32) -> wp.float32:
    """Return E = 1 − F of the owner after all pushes: ½ on its rim and on every contact line."""
    return e_k + (0.5 - e_k) * push


@wp.func
def rim_distance(complement: wp.float32) -> wp.float32:
    """Return the distance r / r_h with r = g⁻¹(1 − E): 0 at the centre, 1 on the rim."""
    c = wp.pow(1.0 - complement, 0.33333333)
    return wp.min(wp.sqrt(complement / (1.0 + c + c * c)) / RIM, 1.0)


@wp.func
def contact_uv(offset: wp.vec2, rim: wp.float32) -> wp.vec2:
    """Return image coordinates at r/r_h = rim in the direction of a tangent offset."""
    largest = wp.max(wp.abs(offset[0]), wp.abs(offset[1]))
    if largest == 0.0:
        return wp.vec2(0.5, 0.5)
    x = offset[0] / largest
    y = offset[1] / largest
    scale = 0.5 * rim / wp.sqrt(x * x + y * y)
    return wp.vec2(0.5 + scale * x, 0.5 + scale * y)
