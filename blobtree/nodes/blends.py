"""Blends of the literature: operators, and macros of them.

All fields are 0 far away, ½ on the surface and larger inside. Papers that put the surface elsewhere are
converted, and each formula states how.
"""

import math
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Annotated

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, UNBOUNDED, widened_range
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.operator import ManyOperands, Operator
from blobtree.nodes.tree import (
    Intersection,
    Macro,
    Sum,
    Union,
    difference_partials,
    exponent_field,
    intersection_partials,
    ricci_norm,
    ricci_partials,
    union_partials,
)

wp.set_module_options({"enable_backward": False})

WIDEST = 0.5
"""Largest width of a blend, in field values: from the surface to where a field ends."""

LARGEST_ANGLE = 44.0
"""Largest angle of a controllable blend, in degrees; at 45 it would be a union."""

NARROWEST_TURN = 1.0
"""Smallest difference of both angles of a gradient blend, in degrees."""

MOST_GROUPS = 1024
"""Most groups of a blend graph: each repeats its operands in the program."""

_width = partial(
    par.factor, "field values over which it blends", low=1e-4, high=WIDEST, hint="fields are ½ on surfaces"
)
_angle = partial(
    par.angle,
    "angle in degrees between an axis of the plane of field values and the blend",
    low=0.0,
    high=LARGEST_ANGLE,
    hint="for more use a union",
)


class SuperellipticBlend(Operator):
    """Blend within a width of the surfaces: F = l + (Σ (fᵢ − l)ⁿ)^(1/n), l = ½ − width (Rockwood 1989).

    An operand whose field is below l changes nothing there. With width ½ it is the `Ricci` blend.
    The width is one of field values; that of a `RoundUnion` is a length.

    Examples
    --------
    >>> from blobtree import Point, SuperellipticBlend
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1.5, 0, 0), radius=1.0)
    >>> blend = SuperellipticBlend(a, b, width=0.2, exponent=2.0)
    >>> blend([[0, 0, 1], [0.75, 0, 0.65]]).astype(float).round(3).tolist()
    [0.5, 0.591]
    """

    tag = "superelliptic_blend"
    like = "blend"
    monotone = True
    associative = True

    width: float = _width()
    exponent: float = exponent_field()

    @formula
    def partials(a: wp.float32, b: wp.float32, width: wp.float32, exponent: wp.float32) -> wp.vec3:
        """F = l + ((a − l)ⁿ + (b − l)ⁿ)^(1/n) with l = ½ − width; negative terms are 0 (Rockwood 1989).

        Rockwood's surfaces are P = 1 − Σ [1 − Pᵢ / rᵢ]₊ᵗ = 0 with Pᵢ = 0 on a surface. Here Pᵢ = ½ − fᵢ, r is
        the width and t = n. An operand that is below l changes nothing: width ½ is the blend of Ricci.
        """
        least = 0.5 - width
        if b <= least or a <= least:
            return union_partials(a, b)
        f = ricci_partials(a - least, b - least, exponent)
        return wp.vec3(least + f[0], f[1], f[2])

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, width: wp.float32, exponent: wp.float32) -> wp.float32:
        """Hölder, as in the blend of Ricci."""
        return ricci_norm(wp.max(rise[0], 0.0), wp.max(rise[1], 0.0), exponent)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, width: wp.float32, exponent: wp.float32) -> wp.int32:
        """Return the larger operand where the other one stays below its width."""
        least = 0.5 - width
        if b[1] <= 0.0 or b[1] <= wp.min(least, a[0]):
            return KEEP_LEFT
        if a[1] <= 0.0 or a[1] <= wp.min(least, b[0]):
            return KEEP_RIGHT
        return KEEP_BOTH


# R-functions (Pasko et al. 1995, with α = 0) join functions x, y that are 0 on surfaces: x ∨ y =
# x + y + √(x² + y²), x ∧ y = x + y − √(x² + y²), x \ y = x ∧ −y. Here x = φ(a) with φ(a) = 1 − 1/(2a) outside
# and 2a − 1 inside: φ rises, has a slope, and is −∞ where a = 0. So F = φ⁻¹(φ(a) ∨ φ(b)) is exactly a where b
# is 0, and 0 where both are. φ is written as a fraction n / d, so that nothing overflows.

R_NOTHING = wp.constant(1e-12)
"""Field below which an operand of an R-function counts as absent."""


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
def r_steepest(largest: wp.float32) -> wp.float32:
    """Return 1 + max(1, y²), y = φ of the other operand, which no partial derivative exceeds."""
    y = wp.max(2.0 * largest - 1.0, 1.0)
    return 1.0 + y * y


class RUnion(Operator):
    """Union of two operands by an R-function: smooth everywhere but at its crease (Pasko et al. 1995).

    Examples
    --------
    >>> from blobtree import Point, RUnion
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> RUnion(a, b)([[-1, 0, 0], [2, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    tag = "r_union"
    like = "blend"
    monotone = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = φ⁻¹(φ(a) ∨ φ(b)), x ∨ y = −(−x ∧ −y): a union, smooth everywhere but where a = b = ½."""
        if a <= R_NOTHING or b <= R_NOTHING:
            return union_partials(a, b)
        return r_met(a, b, -1.0, -1.0, -1.0)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """|F'| ≤ |∂F/∂a| |a'| + |∂F/∂b| |b'|."""
        return r_steepest(most[1]) * wp.max(rise[0], 0.0) + r_steepest(most[0]) * wp.max(rise[1], 0.0)


class RIntersection(Operator):
    """Intersection of two operands by an R-function: smooth but at its crease (Pasko et al. 1995).

    Examples
    --------
    >>> from blobtree import Point, RIntersection
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> RIntersection(a, b)([[0, 0, 0], [1, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    tag = "r_intersection"
    like = "intersection"
    monotone = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = φ⁻¹(φ(a) ∧ φ(b)): an intersection whose field is smooth everywhere but where a = b = ½."""
        if a <= R_NOTHING or b <= R_NOTHING:
            return intersection_partials(a, b)
        return r_met(a, b, 1.0, 1.0, 1.0)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """No partial derivative exceeds 2, for F ≤ a, b; their sum does not exceed 2 + √2."""
        total = wp.max(rise[0], 0.0) + wp.max(rise[1], 0.0)
        return wp.min(2.0 * total, 3.4143 * wp.max(wp.max(rise[0], rise[1]), 0.0))


class RDifference(Operator):
    """First operand without the second by an R-function: smooth but at its crease (Pasko et al. 1995).

    Examples
    --------
    >>> from blobtree import Point, RDifference
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> RDifference(solid, tool)([[-1, 0, 0], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    tag = "r_difference"
    like = "difference"
    monotone = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = φ⁻¹(φ(a) ∧ −φ(b)): a difference whose field is smooth everywhere but where a = b = ½."""
        if a <= R_NOTHING or b <= R_NOTHING:
            return wp.vec3(a, 1.0, 0.0)
        return r_met(a, b, 1.0, -1.0, 1.0)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """As in the intersection by a, and as in the union by b."""
        return 2.0 * rise[0] + r_steepest(most[0]) * rise[1]


@wp.func
def smooth_minimum(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.float32:
    """Return min(a, b), rounded by a parabola where |a − b| < width: (a + b)/2 − w/4 − (a − b)²/(4w)."""
    gap = a - b
    if wp.abs(gap) >= width:
        return wp.min(a, b)
    return 0.5 * (a + b) - 0.25 * width - 0.25 * gap * (gap / width)


class SmoothIntersection(Operator):
    """Intersection of two operands with a rounded edge.

    The width is one of field values; that of a `RoundIntersection` is a length.

    Examples
    --------
    >>> from blobtree import Point, SmoothIntersection
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> bool(SmoothIntersection(a, b, width=0.2)([[0.5, 0, 0.5]])[0] < (a & b)([[0.5, 0, 0.5]])[0])
    True
    """

    tag = "smooth_intersection"
    like = "intersection"
    monotone = True

    width: float = _width()

    @formula
    def partials(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.vec3:
        """F = smooth minimum of a and b, whose width k = w s / (s + 2w), s = a + b, vanishes with the fields.

        k ≤ s/2, so F is 0 where an operand is.
        """
        total = a + b
        k = width * (total / (total + 2.0 * width))
        if wp.abs(a - b) >= k:
            return intersection_partials(a, b)
        share = (a - b) / k
        growth = 2.0 * (k / total) * (k / total)
        fall = 0.25 * (1.0 - share * share) * growth
        return wp.vec3(smooth_minimum(a, b, k), 0.5 * (1.0 - share) - fall, 0.5 * (1.0 + share) - fall)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, width: wp.float32) -> wp.float32:
        """∂F/∂a and ∂F/∂b are not negative, and their sum lies between ¾ and 1."""
        larger = wp.max(rise[0], rise[1])
        if larger < 0.0:
            return 0.75 * larger
        return larger

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, width: wp.float32) -> wp.int32:
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
    """Return the complement of a tool of `difference_partials`, never below 0."""
    top = wp.max(a, 1.0)
    return wp.max(top - b * (2.0 * top - 1.0), 0.0)


@wp.func
def remainder_range(a: wp.vec2, b: wp.vec2) -> wp.vec2:
    """Return the range of the complement over ranges of a and b; it is linear in max(a, 1) and in b."""
    c0 = remainder(a[0], b[0])
    c1 = remainder(a[0], b[1])
    c2 = remainder(a[1], b[0])
    c3 = remainder(a[1], b[1])
    return wp.vec2(wp.min(wp.min(c0, c1), wp.min(c2, c3)), wp.max(wp.max(c0, c1), wp.max(c2, c3)))


@wp.func
def smooth_difference_width(total: wp.float32, b: wp.float32, width: wp.float32) -> wp.float32:
    """Return k with 1/k = 1/w + 2/s + 2/b: it vanishes with the tool, and with the solid."""
    if total <= 0.0 or b <= 0.0:
        return 0.0
    return 1.0 / (1.0 / width + 2.0 / total + 2.0 / b)


class SmoothDifference(Operator):
    """First operand without the second, with a rounded edge.

    The width is one of field values; that of a `RoundDifference` is a length.

    Examples
    --------
    >>> from blobtree import Point, SmoothDifference
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> cut = SmoothDifference(solid, tool, width=0.2)
    >>> bool(cut([[0.4, 0, 0.8]])[0] < (solid - tool)([[0.4, 0, 0.8]])[0])
    True
    """

    tag = "smooth_difference"
    like = "difference"

    width: float = _width()

    @formula
    def partials(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.vec3:
        """F = smooth minimum of a and the complement c of the tool; its width vanishes with the tool."""
        c = remainder(a, b)
        total = a + c
        k = smooth_difference_width(total, b, width)
        if wp.abs(a - c) >= k:
            return difference_partials(a, b)
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

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, width: wp.float32) -> wp.float32:
        """As in the difference, and at most ⅛ |b'| more, for k ≤ b/2."""
        if most[0] <= 1.0:
            return wp.max(rise[0], rise[1]) + 0.125 * rise[1]
        return rise[0] + (2.0 * most[0] - 0.875) * rise[1]

    @formula
    def interval(a: wp.vec2, b: wp.vec2, width: wp.float32) -> wp.vec2:
        """F rises with a and c and falls with k."""
        c = remainder_range(a, b)
        narrow = smooth_difference_width(a[0] + c[0], b[0], width)
        wide = smooth_difference_width(a[1] + c[1], b[1], width)
        return widened_range(
            wp.max(smooth_minimum(a[0], c[0], wide), 0.0), smooth_minimum(a[1], c[1], narrow)
        )

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, width: wp.float32) -> wp.int32:
        """Ignore a tool that does not cut, and whose width does not reach the solid."""
        if a[1] <= 0.0 or b[0] >= 1.0:
            return KEEP_NONE
        if b[1] <= 0.0 or (a[1] <= 1.0 and a[1] + b[1] + wp.min(width, 0.5 * b[1]) <= 1.0):
            return KEEP_LEFT
        return KEEP_BOTH


@wp.func
def inverse_distance(x: wp.float32) -> wp.float32:
    """Return 1 / |x|, or a large number at 0."""
    return 1.0 / wp.max(wp.abs(x), 1e-12)


class CleanUnion(Operator):
    """Union of two operands whose field is smooth everywhere but at its crease (after Gourmel et al. 2013).

    What is blended with a clean union shows no trace of a crease away from the surface's own.

    Examples
    --------
    >>> from blobtree import CleanUnion, Point
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> CleanUnion(a, b)([[-1, 0, 0], [2, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    tag = "clean_union"
    like = "blend"
    monotone = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = smooth maximum of a and b of width k, 2/k = 1/|½ − a| + 1/|½ − b| + 1/a + 1/b.

        Gourmel et al. (2013) use a union that is smooth everywhere but at the crease a = b = ½, and tabulate
        it. Here its level lines are rounded by parabolas. Their width vanishes where an operand is ½, so that
        the surface is that of the union, and where an operand is 0.
        """
        if b <= 0.0 or a <= 0.0:
            return union_partials(a, b)
        below_a = inverse_distance(0.5 - a)
        below_b = inverse_distance(0.5 - b)
        k = 2.0 / (below_a + below_b + 1.0 / a + 1.0 / b)
        if wp.abs(a - b) >= k:
            return union_partials(a, b)
        share = (a - b) / k
        side_a = wp.sign(0.5 - a)
        side_b = wp.sign(0.5 - b)
        k_by_a = 0.5 * ((k / a) * (k / a) - side_a * (k * below_a) * (k * below_a))
        k_by_b = 0.5 * ((k / b) * (k / b) - side_b * (k * below_b) * (k * below_b))
        bend = 0.25 * (1.0 - share * share)
        value = 0.5 * (a + b) + 0.25 * k + 0.25 * share * (a - b)
        return wp.vec3(value, 0.5 * (1.0 + share) + bend * k_by_a, 0.5 * (1.0 - share) + bend * k_by_b)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """∂F/∂a and ∂F/∂b lie between 0 and 1, and their sum between ¾ and 5/4."""
        larger = wp.max(rise[0], rise[1])
        if larger < 0.0:
            return 0.75 * larger
        return wp.min(1.25 * larger, wp.max(rise[0], 0.0) + wp.max(rise[1], 0.0))

    @formula
    def keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
        """Return an operand that is 1 + √2 times the other: then k ≤ 2 a b / (a + b) ≤ |a − b|."""
        if b[1] <= 0.0 or a[0] >= 2.4143 * b[1]:
            return KEEP_LEFT
        if a[1] <= 0.0 or b[0] >= 2.4143 * a[1]:
            return KEEP_RIGHT
        return KEEP_BOTH


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
def controllable_partials(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.vec3:
    """F = C, where an elliptical arc joins the lines of level C of both operands (Barthe et al. 2004).

    F is a where b ≤ a tan θ₁, and b where a ≤ b tan θ₂. Between these rays of the (a, b) plane the level
    line is the arc of an ellipse, ((a − C t₂) / (1 − t₂))² + ((b − C t₁) / (1 − t₁))² = C² with
    t = tan θ, which is tangent to both lines. The paper's soft objects have the same surface, ½.
    """
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
def controllable_slope(rise: wp.vec2, most: wp.vec2, left: wp.float32, right: wp.float32) -> wp.float32:
    """F is a norm of non-negative operands, so slopes combine by F itself."""
    return 1.00001 * controllable_value(wp.max(rise[0], 0.0), wp.max(rise[1], 0.0), left, right)


@wp.func
def controllable_keeps(a: wp.vec2, b: wp.vec2, left: wp.float32, right: wp.float32) -> wp.int32:
    """Return the operand outside whose ray the other one stays."""
    if b[1] <= left * a[0] or b[1] <= 0.0:
        return KEEP_LEFT
    if a[1] <= right * b[0] or a[1] <= 0.0:
        return KEEP_RIGHT
    return KEEP_BOTH


class ControllableBlend(Operator):
    """Blend of two operands between two angles (after Barthe, Wyvill & de Groot 2004).

    In the plane of the field values (f, g) an elliptical arc joins the surfaces between the ray at
    `left_angle` from the f axis and the ray at `right_angle` from the g axis. Outside it is the union. A
    larger angle keeps the blend nearer to the crease on the side of its operand.

    Examples
    --------
    >>> from blobtree import ControllableBlend, Point
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1.5, 0, 0), radius=1.0)
    >>> blend = ControllableBlend(a, b, left_angle=0.0, right_angle=30.0)
    >>> bool(blend([[0.75, 0, 0.7]])[0] > (a | b)([[0.75, 0, 0.7]])[0])
    True
    """

    tag = "controllable_blend"
    like = "blend"
    monotone = True
    partials = formula(controllable_partials)
    slope = formula(controllable_slope)
    keeps = formula(controllable_keeps)

    left_angle: float = _angle()
    right_angle: float = _angle()

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The tangents of the angles."""
        return math.tan(math.radians(self.left_angle)), math.tan(math.radians(self.right_angle))


FLAT = wp.constant(1.0 / 32.0)
"""Ratio of the lengths of two gradients below which the blend fades into the union."""


@wp.func
def cubic_step(t: wp.float32) -> wp.float32:
    """Return 3t² − 2t³ for t clamped to [0, 1]."""
    x = wp.clamp(t, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@wp.func
def inside_fade(a: wp.float32) -> wp.float32:
    """Return 1 up to a = ½, and then (1 − t²)², t = 2a − 1, down to 0 at a = 1."""
    t = wp.clamp(2.0 * a - 1.0, 0.0, 1.0)
    return (1.0 - t * t) * (1.0 - t * t)


@wp.func
def inside_fade_slope(a: wp.float32) -> wp.float32:
    """Return the derivative of `inside_fade`."""
    t = wp.clamp(2.0 * a - 1.0, 0.0, 1.0)
    return -8.0 * t * (1.0 - t * t)


@wp.func
def angle_between(u: wp.vec3, v: wp.vec3) -> wp.float32:
    """Return the angle between two unit vectors, exact also where it is small."""
    return wp.atan2(wp.length(wp.cross(u, v)), wp.dot(u, v))


@wp.func
def opening(direction_a: wp.vec3, direction_b: wp.vec3, first: wp.float32, last: wp.float32) -> wp.float32:
    """Return the opening o = tan(π/4 − θ): 0 for a union, 1 for a full blend.

    It is tan(π w/4), where w rises by a cubic from 0 at the angle `first` between the directions to 1 at
    `last`. Where one gradient is much shorter than the other, its direction means little: the opening fades.
    """
    length_a = wp.length(direction_a)
    length_b = wp.length(direction_b)
    shorter = wp.min(length_a, length_b)
    if shorter <= 0.0:
        return 0.0
    angle = angle_between(direction_a / length_a, direction_b / length_b)
    fade = cubic_step(shorter / (wp.max(length_a, length_b) * FLAT))
    return fade * wp.tan(0.78539816 * cubic_step((angle - first) / (last - first)))


@wp.func
def opened_partials(a: wp.float32, b: wp.float32, o: wp.float32) -> wp.vec3:
    """Return the blend of opening o, and its partial derivatives for a fixed opening."""
    total = a + b
    fade_a = inside_fade(a)
    fade_b = inside_fade(b)
    k = o * total * fade_a * fade_b
    if k <= 0.0 or wp.abs(a - b) >= k:
        return union_partials(a, b)
    share = (a - b) / k
    bend = 0.25 * (1.0 - share * share)
    k_by_a = o * fade_b * (fade_a + total * inside_fade_slope(a))
    k_by_b = o * fade_a * (fade_b + total * inside_fade_slope(b))
    value = 0.5 * total + 0.25 * k + 0.25 * share * (a - b)
    return wp.vec3(value, 0.5 * (1.0 + share) + bend * k_by_a, 0.5 * (1.0 - share) + bend * k_by_b)


class GradientBlend(Operator):
    """Blend of two operands where their surfaces meet at an angle (after Gourmel et al. 2013).

    The angle between the gradients of the operands opens the blend: up to `start_angle` it is the union, from
    `full_angle` on a full blend, and in between it opens smoothly. So no bulge shows where both surfaces run
    alike, and small details stay. Outside the support of an operand it is the other one.
    The formula differs from the paper's tables.

    The gradient of the field is exact. An operand should have a continuous gradient: where the gradient
    jumps, as at the crease of a union, the blend jumps too. Use `CleanUnion` there. The angle of an operand
    that is itself a gradient blend is measured with its openings held fixed. Such trees evaluate more
    slowly, compile kernels of their own, and their meshes get no creases.

    Examples
    --------
    >>> from blobtree import Box, GradientBlend, Segment
    >>> cube = Box((-1, 0, 0), (1.2, 0.8, 0.8), radius=0.1)
    >>> bar = Segment((-1, 0, 0), (2, 0, 0), radius=0.5)
    >>> flush = GradientBlend(cube, bar, start_angle=15, full_angle=75)
    >>> flush.start_angle, flush.full_angle
    (15.0, 75.0)
    """

    tag = "gradient_blend"
    like = "blend"

    start_angle: float = par.angle("angle between gradients up to which it is the union", low=0.0, high=179.0)
    full_angle: float = par.angle(
        "angle between gradients from which it is a full blend", low=1.0, high=180.0, natural=90.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.full_angle - self.start_angle < NARROWEST_TURN:
            raise InvalidNode(
                f"full_angle: expected at least {NARROWEST_TURN:g} degree more than start_angle = "
                f"{self.start_angle:g}, got {self.full_angle:g}"
            )

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The angles in radians."""
        return math.radians(self.start_angle), math.radians(self.full_angle)

    @formula
    def partials(
        a: wp.float32,
        b: wp.float32,
        direction_a: wp.vec3,
        direction_b: wp.vec3,
        first: wp.float32,
        last: wp.float32,
    ) -> wp.vec3:
        """F = (a + b)/2 + k/4 + (a − b)²/(4k) where |a − b| < k = o (a + b) c(a) c(b), and else max(a, b).

        The opening o is that of the angle between the gradients. In the plane of a and b the blend lies
        between the rays b = a tan θ and a = b tan θ (Gourmel et al. 2013, whose boundary functions are these
        rays up to ½). c keeps it from the inside: it is 1 up to ½ and 0 at 1. The paper tabulates its
        operators, which are smooth to any order. This one is a closed form whose derivative is continuous.
        """
        if b <= 0.0 or a <= 0.0:
            return union_partials(a, b)
        return opened_partials(a, b, opening(direction_a, direction_b, first, last))

    @formula
    def slope(
        rise: wp.vec2, most: wp.vec2, turn: wp.float32, first: wp.float32, last: wp.float32
    ) -> wp.float32:
        """|F'| ≤ |∂F/∂a| |a'| + |∂F/∂b| |b'| + |∂F/∂o| |o'|.

        Partial derivatives are at most 1, and up to ½ their sum is at most 3/2. |∂F/∂o| ≤ (a + b)/4. The
        opening changes by at most π/2 · 3/2 / (last − first) per radian, and where it fades by 3/2 more.
        """
        if most[1] <= 0.0:
            return rise[0]
        if most[0] <= 0.0:
            return rise[1]
        fixed = rise[0] + rise[1]
        if most[0] <= 0.5 and most[1] <= 0.5:
            fixed = wp.min(fixed, 1.5 * wp.max(rise[0], rise[1]))
        if turn >= UNBOUNDED:
            return UNBOUNDED
        return fixed + 0.25 * (most[0] + most[1]) * turn * (2.3562 / (last - first) + 1.5)

    @formula
    def interval(a: wp.vec2, b: wp.vec2, first: wp.float32, last: wp.float32) -> wp.vec2:
        """F lies between the union and the full blend without c, ¾(a + b) + ¼(a − b)²/(a + b): both rise."""
        total = a[1] + b[1]
        if total <= 0.0:
            return wp.vec2(0.0, 0.0)
        gap = a[1] - b[1]
        return widened_range(wp.max(a[0], b[0]), 0.75 * total + 0.25 * gap * (gap / total))


class Masked(Operator):
    """First operand times a mask: all of it within the second operand, and none where that is 0.

    Examples
    --------
    >>> from blobtree import Masked, Point
    >>> a, mask = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> Masked(a, mask)([[0.5, 0, 0], [-1.5, 0, 0]]).astype(float).round(3).tolist()
    [0.853, 0.0]
    """

    tag = "masked"
    like = "intersection"
    monotone = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = a s(2b), s(t) = 3t² − 2t³ up to t = 1: a within the surface of b, and none where b is 0."""
        t = wp.min(2.0 * b, 1.0)
        return wp.vec3(a * t * t * (3.0 - 2.0 * t), t * t * (3.0 - 2.0 * t), 12.0 * a * t * (1.0 - t))

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """|F'| ≤ s |a'| + 3 a |b'|."""
        t = wp.min(2.0 * most[1], 1.0)
        mask = t * t * (3.0 - 2.0 * t)
        return mask * wp.max(rise[0], 0.0) + 3.0 * most[0] * wp.max(rise[1], 0.0)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
        """Return a alone inside the surface of b, and nothing where an operand is absent."""
        if a[1] <= 0.0 or b[1] <= 0.0:
            return KEEP_NONE
        if b[0] >= 0.5:
            return KEEP_LEFT
        return KEEP_BOTH


class Unmasked(Operator):
    """First operand without what `Masked` keeps: none of it within the second operand, all where that is 0.

    Examples
    --------
    >>> from blobtree import Point, Unmasked
    >>> a, mask = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> Unmasked(a, mask)([[0.5, 0, 0], [-1.0, 0, 0]]).astype(float).round(3).tolist()
    [0.0, 0.5]
    """

    tag = "unmasked"
    like = "difference"
    monotone = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = a (1 − s(2b)), s as in `Masked`."""
        t = wp.min(2.0 * b, 1.0)
        shown = (1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t)
        return wp.vec3(a * shown, shown, -12.0 * a * t * (1.0 - t))

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """|F'| ≤ |a'| + 3 a |b'|."""
        return wp.max(rise[0], 0.0) + 3.0 * most[0] * wp.max(rise[1], 0.0)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
        """Return a alone where b is absent, and nothing inside the surface of b."""
        if a[1] <= 0.0 or b[0] >= 0.5:
            return KEEP_NONE
        if b[1] <= 0.0:
            return KEEP_LEFT
        return KEEP_BOTH


# -- macros ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Shell(Macro):
    """A hollow `child`: without its copy whose surface lies `thickness` farther in.

    Examples
    --------
    >>> from blobtree import Point, Shell
    >>> Shell(Point((0, 0, 0), radius=1.0), 0.2)([[1, 0, 0], [0.8, 0, 0], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "shell"

    child: Node
    thickness: Annotated[float, Parameter(Quantity.LENGTH, "distance between both surfaces")]

    @Lazy
    def expanded(self) -> Node:
        """Return the child without its smaller copy."""
        return self.child - self.child.offset(-self.thickness)


@dataclass(frozen=True, eq=False, repr=False)
class Mirror(Macro):
    """Sum of `child` and its mirror image beyond the plane through the origin across an axis.

    Examples
    --------
    >>> from blobtree import Mirror, Point
    >>> Mirror(Point((1, 0, 0), radius=0.5))([[1, 0, 0], [-1, 0, 0]]).tolist()
    [1.0, 1.0]
    """

    file_tag = "mirror"

    child: Node
    axis: Annotated[str, Parameter(Quantity.CHOICE, "axis across the plane", choices=("x", "y", "z"))] = "x"

    @property
    def reflection(self) -> Float64Array:
        """The map to the mirror image, float64[4, 4]."""
        return np.diag([-1.0 if name == self.axis else 1.0 for name in "xyzw"])

    @Lazy
    def expanded(self) -> Node:
        """Return the sum."""
        return self.child + self.child.transform(self.reflection)


@dataclass(frozen=True, eq=False, repr=False)
class SymmetricDifference(Macro):
    """What lies in one of two nodes alone: (first − second) | (second − first).

    Examples
    --------
    >>> from blobtree import Point, SymmetricDifference
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> (SymmetricDifference(a, b)([[-0.5, 0, 0], [0.5, 0, 0], [1.5, 0, 0]]) > 0.5).tolist()
    [True, False, True]
    """

    file_tag = "symmetric_difference"

    first: Node
    second: Node

    @Lazy
    def expanded(self) -> Node:
        """Return the union of both differences."""
        return (self.first - self.second) | (self.second - self.first)


@dataclass(frozen=True, eq=False, repr=False)
class LocalBlend(Macro):
    """Blend of two nodes in a region, and their union elsewhere (after Bernhardt et al. 2010).

    The paper places regions at the crease itself, and interpolates other operators. Here the region is a
    node with the field h: F = max(f, g) + s(2h) min(f, g), s(t) = 3t² − 2t³ up to t = 1. So it is
    the sum f + g within the region's surface, and the union where h = 0.

    Examples
    --------
    >>> from blobtree import LocalBlend, Point
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1.5, 0, 0), radius=1.0)
    >>> top = LocalBlend(a, b, Point((0.75, 0, 0.7), radius=0.4))
    >>> above, below = [[0.75, 0, 0.7]], [[0.75, 0, -0.7]]
    >>> bool(top(above) == (a + b)(above)), bool(top(below) == (a | b)(below))
    (True, True)
    """

    file_tag = "local_blend"

    first: Node
    second: Node
    region: Node

    @Lazy
    def expanded(self) -> Node:
        """Return the union plus the masked intersection."""
        both = (self.first, self.second)
        return Sum(Union(both), Masked(Intersection(both), self.region))


@dataclass(frozen=True, eq=False, repr=False)
class Transition(Macro):
    """`inside` within a region, `outside` beyond its influence, and a smooth change between them.

    F = (1 − s(2h)) f + s(2h) g, where h is the region's field and s(t) = 3t² − 2t³ up to t = 1. Two blends
    of the same operands give a blend whose width varies in space; the region may be any field.

    Examples
    --------
    >>> from blobtree import Point, RoundUnion, Transition
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1.5, 0, 0), radius=1.0)
    >>> region = Point((0.75, 0, 0.7), radius=0.4)
    >>> model = Transition(RoundUnion(a, b, width=0.1), RoundUnion(a, b, width=0.6), region)
    >>> above, below = [[0.75, 0, 0.7]], [[0.75, 0, -0.7]]
    >>> bool(model(above) == model.inside(above)), bool(model(below) == model.outside(below))
    (True, True)
    """

    file_tag = "transition"

    outside: Node
    inside: Node
    region: Node

    @Lazy
    def expanded(self) -> Node:
        """Return the sum of both parts."""
        return Sum(Unmasked(self.outside, self.region), Masked(self.inside, self.region))


@dataclass(frozen=True, eq=False, repr=False, init=False)
class BlendGraph(ManyOperands, Macro):
    """Operands of which only some pairs blend, as edges of a graph (Guy & Wyvill 1995).

    F is the largest sum over a group of operands, of which every two blend: F = max over maximal groups Q of
    Σ fᵢ, i in Q. So two operands unite where no edge joins them, also beside a third one that blends with
    both.

    Raises
    ------
    InvalidNode
        A name is used twice, there are more or fewer names than operands, a pair holds an unknown name or
        one name twice, or the graph has more than 1,024 maximal groups.

    Examples
    --------
    >>> from blobtree import BlendGraph, Point
    >>> arm, body, hip = (Point((x, 0, 0), radius=1.0) for x in (0, 1, 2))
    >>> model = BlendGraph(arm, body, hip, names=("arm", "body", "hip"), pairs=[("arm", "body")])
    >>> model == BlendGraph([arm, body, hip], names=("arm", "body", "hip"), pairs=(("arm", "body"),))
    True
    >>> bool(model([[0.5, 0, 0]]) == ((arm + body) | hip)([[0.5, 0, 0]]))
    True
    """

    file_tag = "blend_graph"

    _: KW_ONLY
    names: Annotated[tuple[str, ...], Parameter(Quantity.NAMES, "names of the operands, in their order")]
    pairs: Annotated[
        tuple[tuple[str, str], ...], Parameter(Quantity.NAME_PAIRS, "pairs of names of operands that blend")
    ]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.names) != len(self.operands):
            raise InvalidNode(
                f"names: expected one for each of {len(self.operands)} operands, got {len(self.names)}"
            )
        if len(set(self.names)) < len(self.names):
            raise InvalidNode(f"names: expected a different name for each operand, got {self.names}")
        for pair in self.pairs:
            for name in pair:
                if name not in self.names:
                    known = ", ".join(map(repr, self.names))
                    raise InvalidNode(f"pairs: no operand is named {name!r}; the names are {known}")

    @Lazy
    def expanded(self) -> Node:
        """Return the union of the sums over maximal groups."""
        places = {name: place for place, name in enumerate(self.names)}
        neighbors: list[set[int]] = [set() for _ in self.names]
        for first, second in self.pairs:
            neighbors[places[first]].add(places[second])
            neighbors[places[second]].add(places[first])
        groups: list[list[int]] = []
        for group in _maximal_groups(neighbors):
            groups.append(sorted(group))
            if len(groups) > MOST_GROUPS:
                raise InvalidNode(f"pairs: they form more than {MOST_GROUPS:,} groups; nest smaller graphs")
        sums = [Sum(tuple(self.operands[place] for place in group)) for group in sorted(groups)]
        return Union(tuple(sums)) if len(sums) > 1 else sums[0]


def _maximal_groups(neighbors: list[set[int]]) -> Iterator[set[int]]:
    """Yield the maximal cliques of a graph (Bron & Kerbosch 1973, with pivots)."""
    pending: list[tuple[set[int], set[int], set[int]]] = [(set(), set(range(len(neighbors))), set())]
    while pending:
        group, open_places, closed = pending.pop()
        if not open_places and not closed:
            yield group
            continue
        pivot = max(open_places | closed, key=lambda place: len(neighbors[place] & open_places))
        for place in sorted(open_places - neighbors[pivot]):
            pending.append(({*group, place}, open_places & neighbors[place], closed & neighbors[place]))
            open_places = open_places - {place}
            closed = closed | {place}
