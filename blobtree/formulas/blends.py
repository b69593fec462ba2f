"""Blends of the literature, for the library: rows of operators as in `operators`.

All fields are 0 far away, ½ on the surface and larger inside. Papers that put the surface elsewhere are
converted, and each function states how. Operators with several parameters read them from the tape.
"""

import warp as wp

from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, OperatorRow, widened_range
from blobtree.declare.registry import library_rows
from blobtree.formulas.operators import (
    difference_partials,
    extremum_slope,
    intersection_partials,
    intersection_range,
    ricci_norm,
    ricci_partials,
    union_partials,
)
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

R_NOTHING = wp.constant(1e-12)
"""Field below which an operand of an R-function counts as absent."""


# -- super-elliptic blend -------------------------------------------------------------------------------


@wp.func
def superelliptic_partials(a: wp.float32, b: wp.float32, parameter: wp.float32, tape: Texels) -> wp.vec3:
    """F = l + ((a − l)ⁿ + (b − l)ⁿ)^(1/n) with l = ½ − width; negative terms are 0 (Rockwood 1989).

    Rockwood's surfaces are P = 1 − Σ [1 − Pᵢ / rᵢ]₊ᵗ = 0 with Pᵢ = 0 on a surface. Here Pᵢ = ½ − fᵢ, r is
    the width and t = n. An operand that is below l changes nothing: width ½ is the blend of Ricci.
    """
    p = tape[int(parameter)]
    least = 0.5 - p[0]
    if b <= least or a <= least:
        return union_partials(a, b, 0.0)
    f = ricci_partials(a - least, b - least, p[1])
    return wp.vec3(least + f[0], f[1], f[2])


@wp.func
def superelliptic_slope(
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
) -> wp.float32:
    """Hölder, as in the blend of Ricci."""
    exponent = tape[int(parameter)][1]
    return ricci_norm(wp.max(slope_a, 0.0), wp.max(slope_b, 0.0), exponent)


@wp.func
def superelliptic_choice(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.int32:
    """Return the larger operand where the other one stays below its width."""
    least = 0.5 - tape[int(parameter)][0]
    if b[1] <= 0.0 or b[1] <= wp.min(least, a[0]):
        return KEEP_LEFT
    if a[1] <= 0.0 or a[1] <= wp.min(least, b[0]):
        return KEEP_RIGHT
    return KEEP_BOTH


# -- R-functions ----------------------------------------------------------------------------------------
#
# R-functions (Pasko et al. 1995, with α = 0) join functions x, y that are 0 on surfaces: x ∨ y =
# x + y + √(x² + y²), x ∧ y = x + y − √(x² + y²), x \ y = x ∧ −y. Here x = φ(a) with φ(a) = 1 − 1/(2a) outside
# and 2a − 1 inside: φ rises, has a slope, and is −∞ where a = 0. So F = φ⁻¹(φ(a) ∨ φ(b)) is exactly a where b
# is 0, and 0 where both are. φ is written as a fraction n / d, so that nothing overflows.


@wp.func
def r_length(x: wp.float32, y: wp.float32) -> wp.float32:
    """Return √(x² + y²), also for numbers whose squares vanish."""
    larger = wp.max(wp.abs(x), wp.abs(y))
    if larger <= 0.0:
        return 0.0
    return larger * wp.sqrt((x / larger) * (x / larger) + (y / larger) * (y / larger))


@wp.func
def r_meet(x: wp.float32, y: wp.float32) -> wp.float32:
    """Return x ∧ y = x + y − √(x² + y²) without a difference of equal numbers."""
    length = r_length(x, y)
    if x < 0.0 and y < 0.0:
        return x + y - length
    if x < 0.0:
        return x - x * (x / (length + y))
    if y < 0.0:
        return y - y * (y / (length + x))
    if length <= 0.0:
        return 0.0
    return 2.0 * x * (y / (x + y + length))


@wp.func
def r_weight(x: wp.float32, y: wp.float32) -> wp.float32:
    """Return the derivative 1 − x / √(x² + y²) of x ∧ y by x."""
    length = r_length(x, y)
    if length <= 0.0:
        return 1.0
    if x > 0.0:
        return (y / length) * (y / (length + x))
    return (length - x) / length


@wp.func
def r_field(numerator: wp.float32, d: wp.float32, e: wp.float32) -> wp.float32:
    """Return φ⁻¹ of the fraction numerator / (d e)."""
    if numerator >= 0.0:
        return 0.5 + 0.5 * numerator / (d * e)
    return 0.5 * d * (e / (d * e - numerator))


@wp.func
def r_partial(numerator: wp.float32, d: wp.float32, e: wp.float32, weight: wp.float32) -> wp.float32:
    """Return ∂F/∂a from the derivative `weight` of the joined function by x = n / d."""
    if numerator >= 0.0:
        return weight / (d * d)
    ratio = e / (d * e - numerator)
    return ratio * ratio * weight


@wp.func
def r_met(a: wp.float32, b: wp.float32, side_a: wp.float32, side_b: wp.float32, side: wp.float32) -> wp.vec3:
    """Return F = φ⁻¹(z) and its partial derivatives; side · z = side_a φ(a) ∧ side_b φ(b), sides are ±1."""
    d = wp.min(2.0 * a, 1.0)
    e = wp.min(2.0 * b, 1.0)
    x = side_a * (2.0 * a - 1.0) * e
    y = side_b * (2.0 * b - 1.0) * d
    met = side * r_meet(x, y)
    by_a = side * side_a * r_partial(met, d, e, r_weight(x, y))
    return wp.vec3(r_field(met, d, e), by_a, side * side_b * r_partial(met, e, d, r_weight(y, x)))


@wp.func
def r_union_partials(a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """F = φ⁻¹(φ(a) ∨ φ(b)), x ∨ y = −(−x ∧ −y): a union, smooth everywhere but where a = b = ½."""
    if a <= R_NOTHING or b <= R_NOTHING:
        return union_partials(a, b, 0.0)
    return r_met(a, b, -1.0, -1.0, -1.0)


@wp.func
def r_intersection_partials(a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """F = φ⁻¹(φ(a) ∧ φ(b)): an intersection whose field is smooth everywhere but where a = b = ½."""
    if a <= R_NOTHING or b <= R_NOTHING:
        return intersection_partials(a, b, 0.0)
    return r_met(a, b, 1.0, 1.0, 1.0)


@wp.func
def r_difference_partials(a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """F = φ⁻¹(φ(a) ∧ −φ(b)): a difference whose field is smooth everywhere but where a = b = ½."""
    if a <= R_NOTHING or b <= R_NOTHING:
        return wp.vec3(a, 1.0, 0.0)
    return r_met(a, b, 1.0, -1.0, 1.0)


@wp.func
def r_steepest(largest: wp.float32) -> wp.float32:
    """Return 1 + max(1, y²), y = φ of the other operand, which no partial derivative exceeds."""
    y = wp.max(2.0 * largest - 1.0, 1.0)
    return 1.0 + y * y


@wp.func
def r_union_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, parameter: wp.float32
) -> wp.float32:
    """|F'| ≤ |∂F/∂a| |a'| + |∂F/∂b| |b'|."""
    return r_steepest(max_b) * wp.max(slope_a, 0.0) + r_steepest(max_a) * wp.max(slope_b, 0.0)


@wp.func
def r_intersection_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, parameter: wp.float32
) -> wp.float32:
    """No partial derivative exceeds 2, for F ≤ a, b; their sum does not exceed 2 + √2."""
    total = wp.max(slope_a, 0.0) + wp.max(slope_b, 0.0)
    return wp.min(2.0 * total, 3.4143 * wp.max(wp.max(slope_a, slope_b), 0.0))


@wp.func
def r_difference_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, parameter: wp.float32
) -> wp.float32:
    """As in the intersection by a, and as in the union by b."""
    return 2.0 * slope_a + r_steepest(max_a) * slope_b


# -- smooth extremes ------------------------------------------------------------------------------------


@wp.func
def smooth_minimum(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.float32:
    """Return min(a, b), rounded by a parabola where |a − b| < width: (a + b)/2 − w/4 − (a − b)²/(4w)."""
    gap = a - b
    if wp.abs(gap) >= width:
        return wp.min(a, b)
    return 0.5 * (a + b) - 0.25 * width - 0.25 * gap * (gap / width)


@wp.func
def smooth_intersection_partials(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.vec3:
    """F = smooth minimum of a and b, whose width k = w s / (s + 2w), s = a + b, vanishes with the fields.

    k ≤ s/2, so F is 0 where an operand is.
    """
    total = a + b
    k = width * (total / (total + 2.0 * width))
    if wp.abs(a - b) >= k:
        return intersection_partials(a, b, 0.0)
    share = (a - b) / k
    growth = 2.0 * (k / total) * (k / total)
    fall = 0.25 * (1.0 - share * share) * growth
    return wp.vec3(smooth_minimum(a, b, k), 0.5 * (1.0 - share) - fall, 0.5 * (1.0 + share) - fall)


@wp.func
def smooth_intersection_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, width: wp.float32
) -> wp.float32:
    """∂F/∂a and ∂F/∂b are not negative, and their sum lies between ¾ and 1."""
    larger = wp.max(slope_a, slope_b)
    if larger < 0.0:
        return 0.75 * larger
    return larger


@wp.func
def smooth_intersection_choice(a: wp.vec2, b: wp.vec2, width: wp.float32) -> wp.int32:
    """Return the operand that is smaller by more than the width, which is at most half the sum."""
    if a[1] <= 0.0 or b[1] <= 0.0:
        return KEEP_NONE
    if b[0] - a[1] >= width or b[0] >= 3.0 * a[1]:
        return KEEP_LEFT
    if a[0] - b[1] >= width or a[0] >= 3.0 * b[1]:
        return KEEP_RIGHT
    return KEEP_BOTH


@wp.func
def remainder(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return the complement of a tool of `operators.difference_partials`, never below 0."""
    top = wp.max(a, 1.0)
    return wp.max(top - b * (2.0 * top - 1.0), 0.0)


@wp.func
def smooth_difference_width(total: wp.float32, b: wp.float32, width: wp.float32) -> wp.float32:
    """Return k with 1/k = 1/w + 2/s + 2/b: it vanishes with the tool, and with the solid."""
    if total <= 0.0 or b <= 0.0:
        return 0.0
    return 1.0 / (1.0 / width + 2.0 / total + 2.0 / b)


@wp.func
def smooth_difference_partials(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.vec3:
    """F = smooth minimum of a and the complement c of the tool, of a width that vanishes with the tool."""
    c = remainder(a, b)
    total = a + c
    k = smooth_difference_width(total, b, width)
    if wp.abs(a - c) >= k:
        return difference_partials(a, b, 0.0)
    share = (a - c) / k
    by_c = 0.5 * (1.0 + share)
    by_k = -0.25 * (1.0 - share * share)
    c_by_a = float(0.0)
    c_by_b = float(-1.0)
    if a > 1.0:
        c_by_a = 1.0 - 2.0 * b
        c_by_b = 1.0 - 2.0 * a
    k_by_total = 2.0 * (k / total) * (k / total)
    k_by_b = 2.0 * (k / b) * (k / b)
    by_a = 0.5 * (1.0 - share) + by_c * c_by_a + by_k * k_by_total * (1.0 + c_by_a)
    by_b = by_c * c_by_b + by_k * (k_by_total * c_by_b + k_by_b)
    return wp.vec3(smooth_minimum(a, c, k), by_a, by_b)


@wp.func
def smooth_difference_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, width: wp.float32
) -> wp.float32:
    """As in the difference, and at most ⅛ |b'| more, for k ≤ b/2."""
    if max_a <= 1.0:
        return wp.max(slope_a, slope_b) + 0.125 * slope_b
    return slope_a + (2.0 * max_a - 0.875) * slope_b


@wp.func
def smooth_difference_range(a: wp.vec2, b: wp.vec2, width: wp.float32) -> wp.vec2:
    """F rises with a and c and falls with k; c is linear in max(a, 1) and in b."""
    c0 = remainder(a[0], b[0])
    c1 = remainder(a[0], b[1])
    c2 = remainder(a[1], b[0])
    c3 = remainder(a[1], b[1])
    low = wp.min(wp.min(c0, c1), wp.min(c2, c3))
    high = wp.max(wp.max(c0, c1), wp.max(c2, c3))
    narrow = smooth_difference_width(a[0] + low, b[0], width)
    wide = smooth_difference_width(a[1] + high, b[1], width)
    return widened_range(wp.max(smooth_minimum(a[0], low, wide), 0.0), smooth_minimum(a[1], high, narrow))


@wp.func
def smooth_difference_choice(a: wp.vec2, b: wp.vec2, width: wp.float32) -> wp.int32:
    """Ignore a tool that does not cut, and whose width does not reach the solid."""
    if a[1] <= 0.0 or b[0] >= 1.0:
        return KEEP_NONE
    if b[1] <= 0.0 or (a[1] <= 1.0 and a[1] + b[1] + wp.min(width, 0.5 * b[1]) <= 1.0):
        return KEEP_LEFT
    return KEEP_BOTH


# -- clean union ----------------------------------------------------------------------------------------


@wp.func
def inverse_distance(x: wp.float32) -> wp.float32:
    """Return 1 / |x|, or a large number at 0."""
    return 1.0 / wp.max(wp.abs(x), 1e-12)


@wp.func
def clean_union_partials(a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """F = smooth maximum of a and b of width k, 2/k = 1/|½ − a| + 1/|½ − b| + 1/a + 1/b.

    Gourmel et al. (2013) use a union that is smooth everywhere but at the crease a = b = ½, and tabulate it.
    Here its level lines are rounded by parabolas. Their width vanishes where an operand is ½, so that the
    surface is that of the union, and where an operand is 0.
    """
    if b <= 0.0 or a <= 0.0:
        return union_partials(a, b, 0.0)
    below_a = inverse_distance(0.5 - a)
    below_b = inverse_distance(0.5 - b)
    k = 2.0 / (below_a + below_b + 1.0 / a + 1.0 / b)
    if wp.abs(a - b) >= k:
        return union_partials(a, b, 0.0)
    share = (a - b) / k
    side_a = wp.sign(0.5 - a)
    side_b = wp.sign(0.5 - b)
    k_by_a = 0.5 * ((k / a) * (k / a) - side_a * (k * below_a) * (k * below_a))
    k_by_b = 0.5 * ((k / b) * (k / b) - side_b * (k * below_b) * (k * below_b))
    bend = 0.25 * (1.0 - share * share)
    value = 0.5 * (a + b) + 0.25 * k + 0.25 * share * (a - b)
    return wp.vec3(value, 0.5 * (1.0 + share) + bend * k_by_a, 0.5 * (1.0 - share) + bend * k_by_b)


@wp.func
def clean_union_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, parameter: wp.float32
) -> wp.float32:
    """∂F/∂a and ∂F/∂b lie between 0 and 1, and their sum between ¾ and 5/4."""
    larger = wp.max(slope_a, slope_b)
    if larger < 0.0:
        return 0.75 * larger
    return wp.min(1.25 * larger, wp.max(slope_a, 0.0) + wp.max(slope_b, 0.0))


@wp.func
def clean_union_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return an operand that is 1 + √2 times the other: then k ≤ 2 a b / (a + b) ≤ |a − b|."""
    if b[1] <= 0.0 or a[0] >= 2.4143 * b[1]:
        return KEEP_LEFT
    if a[1] <= 0.0 or b[0] >= 2.4143 * a[1]:
        return KEEP_RIGHT
    return KEEP_BOTH


# -- controllable blend ---------------------------------------------------------------------------------


@wp.func
def controllable_value(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.float32:
    """Return F of `controllable_partials`; (left, right) are the tangents of the two angles."""
    if b <= left * a:
        return a
    if a <= right * b:
        return b
    u = wp.vec2(right / (1.0 - right), left / (1.0 - left))
    v = wp.vec2(a / (1.0 - right), b / (1.0 - left))
    return wp.dot(v, v) / (wp.dot(u, v) + controllable_root(a, b, left, right))


@wp.func
def controllable_root(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.float32:
    """Return √((u·v)² − (|u|² − 1) |v|²), by Lagrange's identity √(|v|² − (u × v)²)."""
    v = wp.vec2(a / (1.0 - right), b / (1.0 - left))
    cross = (right * b - left * a) / ((1.0 - right) * (1.0 - left))
    return wp.sqrt(wp.max(wp.dot(v, v) - cross * cross, 1e-30))


@wp.func
def controllable_partials(a: wp.float32, b: wp.float32, parameter: wp.float32, tape: Texels) -> wp.vec3:
    """F = C, where an elliptical arc joins the lines of level C of both operands (Barthe et al. 2004).

    F is a where b ≤ a tan θ₁, and b where a ≤ b tan θ₂. Between these rays of the (a, b) plane the level line
    is the arc of an ellipse, ((a − C t₂) / (1 − t₂))² + ((b − C t₁) / (1 − t₁))² = C² with t = tan θ, which
    is tangent to both lines. The paper's soft objects have the same surface, ½.
    """
    p = tape[int(parameter)]
    left = p[0]
    right = p[1]
    if b <= left * a:
        return wp.vec3(a, 1.0, 0.0)
    if a <= right * b:
        return wp.vec3(b, 0.0, 1.0)
    value = controllable_value(a, b, left, right)
    root = controllable_root(a, b, left, right)
    by_a = (a - right * value) / ((1.0 - right) * (1.0 - right) * root)
    by_b = (b - left * value) / ((1.0 - left) * (1.0 - left) * root)
    return wp.vec3(value, wp.clamp(by_a, 0.0, 1.0), wp.clamp(by_b, 0.0, 1.0))


@wp.func
def controllable_slope(
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
) -> wp.float32:
    """F is a norm of non-negative operands, so slopes combine by F itself."""
    p = tape[int(parameter)]
    return 1.00001 * controllable_value(wp.max(slope_a, 0.0), wp.max(slope_b, 0.0), p[0], p[1])


@wp.func
def controllable_choice(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.int32:
    """Return the operand outside whose ray the other one stays."""
    p = tape[int(parameter)]
    if b[1] <= p[0] * a[0] or b[1] <= 0.0:
        return KEEP_LEFT
    if a[1] <= p[1] * b[0] or a[1] <= 0.0:
        return KEEP_RIGHT
    return KEEP_BOTH


# -- mask -----------------------------------------------------------------------------------------------


@wp.func
def masked_partials(a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """F = a s(2b), s(t) = 3t² − 2t³ up to t = 1: all of a within the surface of b, and none where b is 0."""
    t = wp.min(2.0 * b, 1.0)
    return wp.vec3(a * t * t * (3.0 - 2.0 * t), t * t * (3.0 - 2.0 * t), 12.0 * a * t * (1.0 - t))


@wp.func
def masked_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, parameter: wp.float32
) -> wp.float32:
    """|F'| ≤ s |a'| + 3 a |b'|."""
    mask = masked_partials(1.0, max_b, 0.0)[0]
    return mask * wp.max(slope_a, 0.0) + 3.0 * max_a * wp.max(slope_b, 0.0)


@wp.func
def masked_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return a alone inside the surface of b, and nothing where an operand is absent."""
    if a[1] <= 0.0 or b[1] <= 0.0:
        return KEEP_NONE
    if b[0] >= 0.5:
        return KEEP_LEFT
    return KEEP_BOTH


@wp.func
def deepest_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of a minimum: on one operand where that one is always the smaller."""
    if a[1] <= b[0]:
        return KEEP_LEFT
    if b[1] <= a[0]:
        return KEEP_RIGHT
    return KEEP_BOTH


# -- the table ------------------------------------------------------------------------------------------

SUPERELLIPTIC = OperatorRow(
    "superelliptic",
    superelliptic_partials,
    superelliptic_slope,
    "blend",
    choice=superelliptic_choice,
    monotone=True,
)
R_UNION = OperatorRow("r_union", r_union_partials, r_union_slope, "blend", commutes=False, monotone=True)
R_INTERSECTION = OperatorRow(
    "r_intersection",
    r_intersection_partials,
    r_intersection_slope,
    "intersection",
    commutes=False,
    monotone=True,
)
R_DIFFERENCE = OperatorRow(
    "r_difference",
    r_difference_partials,
    r_difference_slope,
    "difference",
    commutes=False,
)
SMOOTH_INTERSECTION = OperatorRow(
    "smooth_intersection",
    smooth_intersection_partials,
    smooth_intersection_slope,
    "intersection",
    choice=smooth_intersection_choice,
    commutes=False,
    monotone=True,
)
SMOOTH_DIFFERENCE = OperatorRow(
    "smooth_difference",
    smooth_difference_partials,
    smooth_difference_slope,
    "difference",
    smooth_difference_range,
    smooth_difference_choice,
    commutes=False,
)
CLEAN_UNION = OperatorRow(
    "clean_union",
    clean_union_partials,
    clean_union_slope,
    "blend",
    choice=clean_union_choice,
    commutes=False,
    monotone=True,
)
CONTROLLABLE = OperatorRow(
    "controllable",
    controllable_partials,
    controllable_slope,
    "blend",
    choice=controllable_choice,
    commutes=False,
    monotone=True,
)
MASKED = OperatorRow(
    "masked",
    masked_partials,
    masked_slope,
    "intersection",
    choice=masked_choice,
    commutes=False,
    monotone=True,
)

DEEPEST = OperatorRow(
    "deepest",
    intersection_partials,
    extremum_slope,
    "blend",
    intersection_range,
    deepest_choice,
    monotone=True,
    signed=True,
)
"""min(f, g) of fields that are 0 or less: the union of pieces with a negative weight."""

BLENDS = library_rows(
    SUPERELLIPTIC,
    R_UNION,
    R_INTERSECTION,
    R_DIFFERENCE,
    SMOOTH_INTERSECTION,
    SMOOTH_DIFFERENCE,
    CLEAN_UNION,
    CONTROLLABLE,
    MASKED,
    DEEPEST,
)
"""Every operator of this file."""
