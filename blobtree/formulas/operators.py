"""The operators of the core: the combination of two fields, as value and partial derivatives.

`declare.claims` states what the functions of an operator return.

Colours are averaged with the weights |∂F/∂a|·a and |∂F/∂b|·b: a sum mixes by strength, a union takes the
colour of the larger field, a difference paints the cut in the colour of its tool. Where the second operand is
exactly 0, every operator here returns the first, except the intersection, which is 0.

Operands are 0 or more, except those of a sum: only there do fields below 0, of primitives with a negative
weight, act. Programs raise the operands of other operators to 0 (`tape.program`), so that other formulas need
not know of them.
"""

import warp as wp

from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, OperatorRow
from blobtree.declare.registry import library_rows

wp.set_module_options({"enable_backward": False})


@wp.func
def sum_partials(a: wp.float32, b: wp.float32, exponent: wp.float32) -> wp.vec3:
    """F = a + b, the blend of Blinn and Wyvill."""
    return wp.vec3(a + b, 1.0, 1.0)


@wp.func
def sum_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, exponent: wp.float32
) -> wp.float32:
    """Bound the slope of a sum: |∇a + ∇b| ≤ |∇a| + |∇b|."""
    return slope_a + slope_b


@wp.func
def ricci_norm(a: wp.float32, b: wp.float32, exponent: wp.float32) -> wp.float32:
    """(aⁿ + bⁿ)^(1/n) for a, b ≥ 0, scaled by the larger so that no power overflows or vanishes."""
    larger = wp.max(a, b)
    if wp.min(a, b) <= 0.0:
        return larger
    return larger * wp.pow(1.0 + wp.pow(wp.min(a, b) / larger, exponent), 1.0 / exponent)


@wp.func
def ricci_partials(a: wp.float32, b: wp.float32, exponent: wp.float32) -> wp.vec3:
    """F = (aⁿ + bⁿ)^(1/n) (Ricci 1973): n = 1 is the sum, n → ∞ the union; ∂F/∂a = (a/F)^(n−1).

    Written in r = smaller / larger, because float32 cannot take (a/F) to a large power to more than 4 digits.
    """
    if b <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    if a <= 0.0:
        return wp.vec3(b, 0.0, 1.0)
    larger = wp.max(a, b)
    ratio = wp.min(a, b) / larger
    power = wp.pow(ratio, exponent)
    root = wp.pow(1.0 + power, 1.0 / exponent)
    by_larger = root / (1.0 + power)
    by_smaller = by_larger * power / ratio
    if a >= b:
        return wp.vec3(larger * root, by_larger, by_smaller)
    return wp.vec3(larger * root, by_smaller, by_larger)


@wp.func
def ricci_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, exponent: wp.float32
) -> wp.float32:
    """Hölder: the partials lie on the dual norm's unit sphere, so slopes combine by the norm itself."""
    return ricci_norm(wp.max(slope_a, 0.0), wp.max(slope_b, 0.0), exponent)


@wp.func
def union_partials(a: wp.float32, b: wp.float32, exponent: wp.float32) -> wp.vec3:
    """F = max(a, b)."""
    if a >= b:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(b, 0.0, 1.0)


@wp.func
def intersection_partials(a: wp.float32, b: wp.float32, exponent: wp.float32) -> wp.vec3:
    """F = min(a, b)."""
    if a <= b:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(b, 0.0, 1.0)


@wp.func
def extremum_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, exponent: wp.float32
) -> wp.float32:
    """|∇F| of max and min is that of one of the operands."""
    return wp.max(slope_a, slope_b)


@wp.func
def difference_partials(a: wp.float32, b: wp.float32, exponent: wp.float32) -> wp.vec3:
    """F = min(a, c) with the complement c = m − b(2m − 1), m = max(a, 1), never below 0.

    For a ≤ 1 this is min(a, 1 − b) of the literature (Wyvill 1999). Where fields add up to more than 1 the
    complement starts from a itself, so that a tool changes nothing outside its influence.
    """
    top = wp.max(a, 1.0)
    complement = top - b * (2.0 * top - 1.0)
    if a < complement or b <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    if complement <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    if a > 1.0:
        return wp.vec3(complement, 1.0 - 2.0 * b, 1.0 - 2.0 * a)
    return wp.vec3(complement, 0.0, -1.0)


@wp.func
def difference_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, exponent: wp.float32
) -> wp.float32:
    """Where a ≤ 1 either gradient; above, |1 − 2b| ≤ 1 as long as F > 0, and |1 − 2a| ≤ 2 max_a − 1."""
    if max_a <= 1.0:
        return wp.max(slope_a, slope_b)
    return slope_a + (2.0 * max_a - 1.0) * slope_b


@wp.func
def sum_range(a: wp.vec2, b: wp.vec2, exponent: wp.float32) -> wp.vec2:
    """F is monotone in both operands."""
    return a + b


@wp.func
def ricci_range(a: wp.vec2, b: wp.vec2, exponent: wp.float32) -> wp.vec2:
    """F is monotone in both operands."""
    return wp.vec2(ricci_norm(a[0], b[0], exponent), ricci_norm(a[1], b[1], exponent))


@wp.func
def union_range(a: wp.vec2, b: wp.vec2, exponent: wp.float32) -> wp.vec2:
    """F is monotone in both operands."""
    return wp.max(a, b)


@wp.func
def union_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of a union: on one operand where that one is always the larger."""
    if b[1] <= a[0]:
        return KEEP_LEFT
    if a[1] <= b[0]:
        return KEEP_RIGHT
    return KEEP_BOTH


@wp.func
def intersection_range(a: wp.vec2, b: wp.vec2, exponent: wp.float32) -> wp.vec2:
    """F is monotone in both operands."""
    return wp.min(a, b)


@wp.func
def intersection_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of an intersection: on the operand that is always the smaller."""
    if a[1] <= 0.0 or b[1] <= 0.0:
        return KEEP_NONE
    if a[1] <= b[0]:
        return KEEP_LEFT
    if b[1] <= a[0]:
        return KEEP_RIGHT
    return KEEP_BOTH


@wp.func
def difference_range(a: wp.vec2, b: wp.vec2, exponent: wp.float32) -> wp.vec2:
    """Bound a difference: the complement m − b(2m − 1) is linear in m and b, its extremes lie at corners."""
    low_top = wp.max(a[0], 1.0)
    high_top = wp.max(a[1], 1.0)
    c0 = low_top - b[0] * (2.0 * low_top - 1.0)
    c1 = low_top - b[1] * (2.0 * low_top - 1.0)
    c2 = high_top - b[0] * (2.0 * high_top - 1.0)
    c3 = high_top - b[1] * (2.0 * high_top - 1.0)
    smallest = wp.min(wp.min(c0, c1), wp.min(c2, c3))
    largest = wp.max(wp.max(c0, c1), wp.max(c2, c3))
    return wp.vec2(wp.max(wp.min(a[0], smallest), 0.0), wp.max(wp.min(a[1], largest), 0.0))


@wp.func
def difference_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of a difference: it ignores a tool that does not cut."""
    if a[1] <= 0.0 or b[0] >= 1.0:
        return KEEP_NONE
    if b[1] <= 0.0 or (a[1] <= 1.0 and a[1] + b[1] <= 1.0):
        return KEEP_LEFT
    return KEEP_BOTH


# -- the table ------------------------------------------------------------------------------------------

SUM = OperatorRow("sum", sum_partials, sum_slope, "blend", sum_range, monotone=True, signed=True)
RICCI = OperatorRow("ricci", ricci_partials, ricci_slope, "blend", ricci_range, monotone=True)
UNION = OperatorRow(
    "union", union_partials, extremum_slope, "blend", union_range, union_choice, monotone=True
)
INTERSECTION = OperatorRow(
    "intersection",
    intersection_partials,
    extremum_slope,
    "intersection",
    intersection_range,
    intersection_choice,
    monotone=True,
)
DIFFERENCE = OperatorRow(
    "difference",
    difference_partials,
    difference_slope,
    "difference",
    difference_range,
    difference_choice,
    commutes=False,
)

OPERATORS = (SUM, RICCI, UNION, INTERSECTION, DIFFERENCE)
"""Every operator; its index here is its code on the tape."""


@wp.func
def deepest_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of a minimum: on one operand where that one is always the smaller."""
    if a[1] <= b[0]:
        return KEEP_LEFT
    if b[1] <= a[0]:
        return KEEP_RIGHT
    return KEEP_BOTH


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

library_rows(DEEPEST)
