"""Contact between decals: how neighbours push the rim of the decal that owns a point.

The paper's equation 5, repaired: as printed, with denominator 1 − f_k, it breaks its own constraints.
With k the decal of highest field at q,

    F = ½ + (f_k − ½) ∏_{i≠k} h_i
    h_i = 1 where f_i + f_k ≤ 1, else 1 − u^{1/(1−f_k)},  u = (f_i + f_k − 1)/(2 f_k − 1)

meets all four of section 3.2: F = f_k where no f_i + f_k > 1; F = 1 where f_k = 1; F = ½ where
f_i = f_k > ½; F is continuous elsewhere.

float32 loses everything in 1 − f near a centre, so these functions carry complements: e = 1 − f,
E = 1 − F, and push = 1 − ∏ h_i in place of the product. All are in the subset that becomes GLSL.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

from enum import IntEnum

import warp as wp

from blobtree.formulas.kernels import RIM

wp.set_module_options({"enable_backward": False})


class Contact(IntEnum):
    """How neighbours push the decal that owns a point."""

    PAPER = 0
    """Equation 5, repaired: neighbours' factors h multiply."""
    SMOOTH = 1
    """The strongest push alone, min h: no image is torn where three decals meet."""
    RADIAL = 2
    """Along the ray from the centre alone, in convex cells: never folds (decals/field/radial.py)."""


REACH = 0.575
"""Neighbours act within this many influence radii; one beyond would move r by less than 7e-5 of the rim."""

NOWHERE = 2.0
"""Complement of a decal that does not act at all: above every e."""

SERIES_BELOW = 0.02
SMALLEST_SPAN = 1.0e-7
SMALLEST_COMPLEMENT = 1.0e-37
"""Above the numbers that graphics cards may take for 0, and with a reciprocal that they can hold."""


@wp.func
def field_complement(z: wp.float32) -> wp.float32:
    """Complement e = 1 − g(d) of z = d² = |q − p|²/s², to full relative precision near z = 0 too."""
    t = wp.min(z, 1.0)
    return t * (3.0 - t * (3.0 - t))


@wp.func
def log_of_rest(w: wp.float32) -> wp.float32:
    """log(1 − w) for 0 ≤ w < 1, to full relative precision for small w too."""
    if w < SERIES_BELOW:
        return -w * (1.0 + w * (0.5 + w * (0.33333333 + w * (0.25 + w * 0.2))))
    return wp.log(1.0 - w)


@wp.func
def contact_push(e_i: wp.float32, e_k: wp.float32) -> wp.float32:
    """φ_i = 1 − h_i: how far neighbour i pushes the owner k towards its rim at this point, from 0 to 1."""
    w = (e_i - e_k) / wp.max(1.0 - 2.0 * e_k, SMALLEST_SPAN)
    if w >= 1.0:
        return 0.0
    return wp.exp(log_of_rest(w) / wp.max(e_k, SMALLEST_COMPLEMENT))


@wp.func
def add_push(push: wp.float32, phi: wp.float32, contact: wp.int32) -> wp.float32:
    """1 − ∏(1 − φ), or the largest φ, extended by one more neighbour."""
    if contact == Contact.SMOOTH:
        return wp.max(push, phi)
    return push + phi * (1.0 - push)


@wp.func
def contact_complement(e_k: wp.float32, push: wp.float32) -> wp.float32:
    """E = 1 − F of the owner after all pushes: ½ on its rim and on every contact line."""
    return e_k + (0.5 - e_k) * push


@wp.func
def rim_distance(complement: wp.float32) -> wp.float32:
    """Distance r / r_h with r = g⁻¹(1 − E): 0 at the centre, 1 on the rim."""
    c = wp.pow(1.0 - complement, 0.33333333)
    return wp.min(wp.sqrt(complement / (1.0 + c + c * c)) / RIM, 1.0)


@wp.func
def contact_uv(offset: wp.vec2, rim: wp.float32) -> wp.vec2:
    """Image coordinates at r/r_h = rim in the direction of a tangent offset; no angle, so no seam."""
    largest = wp.max(wp.abs(offset[0]), wp.abs(offset[1]))
    if largest == 0.0:
        return wp.vec2(0.5, 0.5)
    x = offset[0] / largest
    y = offset[1] / largest
    scale = 0.5 * rim / wp.sqrt(x * x + y * y)
    return wp.vec2(0.5 + scale * x, 0.5 + scale * y)
