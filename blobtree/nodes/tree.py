"""Core kinds of nodes above others: operators and maps, with their formulas.

Colours are averaged with the weights |∂F/∂a|·a and |∂F/∂b|·b: a sum mixes by strength, a union takes the
colour of the larger field, a difference paints the cut in the colour of its tool. Where the second operand is
exactly 0, every operator here returns the first, except the intersection, which is 0.

Operands are 0 or more, except those of a sum: only there do fields below 0, of primitives with a negative
weight, act. Programs raise the operands of other operators to 0 (`tape.program`), so that other formulas need
not know of them.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Box, Float64Array
from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.nodes.node import Node
from blobtree.nodes.operator import Operator, Pair
from blobtree.nodes.warp import Placed, Warp
from blobtree.tape.program import Placement
from blobtree.validation import Matrix

wp.set_module_options({"enable_backward": False})

LARGEST_EXPONENT = 100.0
"""Beyond it a Ricci blend differs from a union by less than float32 can tell at the surface."""


class Macro(Node):
    """A node that stands for a tree of other nodes.

    Programs hold that tree. Files, `repr`, paths and edits know the node with its parameters and operands.
    """

    @property
    def expanded(self) -> Node:
        """The tree that this node stands for; subclasses compute it once, see `Lazy`."""
        raise NotImplementedError

    @property
    def program_children(self) -> tuple[Node, ...]:
        """The expanded tree alone."""
        return (self.expanded,)


class Sum(Operator):
    """Smooth blend F = Σ fᵢ (Blinn 1982; Wyvill et al. 1986).

    Examples
    --------
    >>> from blobtree import Point, Sum
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Sum(parts) == Sum(parts[0], parts[1]) == parts[0] + parts[1]
    True
    """

    tag = "sum"
    like = "blend"
    monotone = associative = _signed = True

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = a + b, the blend of Blinn and Wyvill."""
        return wp.vec3(a + b, 1.0, 1.0)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """Bound the slope of a sum: |∇a + ∇b| ≤ |∇a| + |∇b|."""
        return rise[0] + rise[1]

    @formula
    def interval(a: wp.vec2, b: wp.vec2) -> wp.vec2:
        """F is monotone in both operands."""
        return a + b


@wp.func
def union_partials(a: wp.float32, b: wp.float32) -> wp.vec3:
    """F = max(a, b)."""
    if a >= b:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(b, 0.0, 1.0)


@wp.func
def extremum_slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
    """|∇F| of max and min is that of one of the operands."""
    return wp.max(rise[0], rise[1])


@wp.func
def union_keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of a union: on one operand where that one is always the larger."""
    if b[1] <= a[0]:
        return KEEP_LEFT
    if a[1] <= b[0]:
        return KEEP_RIGHT
    return KEEP_BOTH


class Union(Operator):
    """Sharp union F = max fᵢ (Ricci 1973).

    Examples
    --------
    >>> from blobtree import Point, Union
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Union(tuple(parts)) == parts[0] | parts[1]
    True
    """

    tag = "union"
    like = "blend"
    monotone = associative = True
    partials = formula(union_partials)
    slope = formula(extremum_slope)
    keeps = formula(union_keeps)

    @formula
    def interval(a: wp.vec2, b: wp.vec2) -> wp.vec2:
        """F is monotone in both operands."""
        return wp.max(a, b)


@wp.func
def intersection_partials(a: wp.float32, b: wp.float32) -> wp.vec3:
    """F = min(a, b)."""
    if a <= b:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(b, 0.0, 1.0)


@wp.func
def intersection_interval(a: wp.vec2, b: wp.vec2) -> wp.vec2:
    """F is monotone in both operands."""
    return wp.min(a, b)


class Intersection(Operator):
    """Sharp intersection F = min fᵢ (Ricci 1973).

    Examples
    --------
    >>> from blobtree import Intersection, Point
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Intersection(tuple(parts)) == parts[0] & parts[1]
    True
    """

    tag = "intersection"
    like = "intersection"
    monotone = associative = True
    partials = formula(intersection_partials)
    slope = formula(extremum_slope)
    interval = formula(intersection_interval)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
        """Return the dependence of an intersection: on the operand that is always the smaller."""
        if a[1] <= 0.0 or b[1] <= 0.0:
            return KEEP_NONE
        if a[1] <= b[0]:
            return KEEP_LEFT
        if b[1] <= a[0]:
            return KEEP_RIGHT
        return KEEP_BOTH


exponent_field = partial(
    par.factor,
    "exponent n",
    low=1.0,
    high=LARGEST_EXPONENT,
    natural=3.0,
    hint="1 is the sum; for more use a union",
)
"""The exponent of the sum of powers in a blend."""


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


class Ricci(Operator):
    """Blend F = (Σ fᵢⁿ)^(1/n) (Ricci 1973): exponent 1 is the sum, a large one nears the union.

    Examples
    --------
    >>> from blobtree import Point, Ricci
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> blend, total = Ricci(tuple(parts), exponent=3), parts[0] + parts[1]
    >>> bool(blend([[0.5, 0, 0]])[0] < total([[0.5, 0, 0]])[0])
    True
    """

    tag = "ricci"
    like = "blend"
    monotone = associative = True
    partials = formula(ricci_partials)

    exponent: float = exponent_field()

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, exponent: wp.float32) -> wp.float32:
        """Hölder: the partials lie on the dual norm's unit sphere, so slopes combine by the norm itself."""
        return ricci_norm(wp.max(rise[0], 0.0), wp.max(rise[1], 0.0), exponent)

    @formula
    def interval(a: wp.vec2, b: wp.vec2, exponent: wp.float32) -> wp.vec2:
        """F is monotone in both operands."""
        return wp.vec2(ricci_norm(a[0], b[0], exponent), ricci_norm(a[1], b[1], exponent))


@wp.func
def difference_partials(a: wp.float32, b: wp.float32) -> wp.vec3:
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


class Difference(Pair):
    """`solid` without `tool`: F = min(f, 1 − g) while f ≤ 1 (Wyvill, Guy & Galin 1999).

    `difference_partials` states what happens where fields add up to more than 1.

    Examples
    --------
    >>> from blobtree import Difference, Point
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((0, 0, 1), radius=0.5)
    >>> Difference(solid, tool) == solid - tool
    True
    """

    tag = "difference"
    like = "difference"
    partials = formula(difference_partials)

    solid: Node
    tool: Node

    @formula
    def slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
        """Where a ≤ 1 either gradient; above, |1 − 2b| ≤ 1 as long as F > 0, and |1 − 2a| ≤ 2 max_a − 1."""
        if most[0] <= 1.0:
            return wp.max(rise[0], rise[1])
        return rise[0] + (2.0 * most[0] - 1.0) * rise[1]

    @formula
    def interval(a: wp.vec2, b: wp.vec2) -> wp.vec2:
        """Bound a difference: the complement m − b(2m − 1) is linear in m and b: extremes are at corners."""
        low_top = wp.max(a[0], 1.0)
        high_top = wp.max(a[1], 1.0)
        c0 = low_top - b[0] * (2.0 * low_top - 1.0)
        c1 = low_top - b[1] * (2.0 * low_top - 1.0)
        c2 = high_top - b[0] * (2.0 * high_top - 1.0)
        c3 = high_top - b[1] * (2.0 * high_top - 1.0)
        smallest = wp.min(wp.min(c0, c1), wp.min(c2, c3))
        largest = wp.max(wp.max(c0, c1), wp.max(c2, c3))
        return wp.vec2(wp.max(wp.min(a[0], smallest), 0.0), wp.max(wp.min(a[1], largest), 0.0))

    @formula
    def keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
        """Return the dependence of a difference: it ignores a tool that does not cut."""
        if a[1] <= 0.0 or b[0] >= 1.0:
            return KEEP_NONE
        if b[1] <= 0.0 or (a[1] <= 1.0 and a[1] + b[1] <= 1.0):
            return KEEP_LEFT
        return KEEP_BOTH


@dataclass(frozen=True, eq=False, repr=False)
class Transform(Placed):
    """`child` under an affine map.

    The map folds into the primitives below it when the tape is made, so it costs nothing afterwards.

    Examples
    --------
    >>> from blobtree import Point, Transform
    >>> moved = Transform(Point((0, 0, 0), radius=1.0), [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]])
    >>> moved == Point((0, 0, 0), radius=1.0).translate((5, 0, 0))
    True
    """

    file_tag = "transform"

    matrix: Annotated[
        Matrix, Parameter(Quantity.MATRIX, "rows of the map from the child's points (columns) to this node's")
    ]

    def child_placement(self, placement: Placement) -> Placement:
        """Return the placement of the child: this map below those above."""
        matrix = np.vstack([self.matrix, (0.0, 0.0, 0.0, 1.0)])
        volume_scale = abs(float(np.linalg.det(matrix[:3, :3])))
        growth = placement.growth / float(np.cbrt(volume_scale)) if placement.growth else 0.0
        return Placement(placement.matrix @ matrix, growth)


@dataclass(frozen=True, eq=False, repr=False)
class Offset(Placed):
    """`child` with every visible radius below it larger by `distance`, or smaller if that is negative.

    For primitives, and for unions and intersections of them, this is the surface at that distance. Where
    fields blend it is the blend of the larger primitives. Tools of differences change the other way.

    Examples
    --------
    >>> from blobtree import Offset, Point
    >>> Offset(Point((0, 0, 0), radius=1.0), 0.5)([[1.5, 0, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "offset"

    distance: Annotated[float, Parameter(Quantity.DISTANCE, "growth of the visible radii")]

    def child_placement(self, placement: Placement) -> Placement:
        """Return the placement of the child: its radii grow by the distance too."""
        return replace(placement, growth=placement.growth + self.distance)


def cylinder_box(lower: Float64Array, upper: Float64Array) -> Box:
    """Return the box around the cylinder around a box."""
    radius = float(np.hypot(*np.maximum(np.abs(lower[:2]), np.abs(upper[:2]))))
    return np.array([-radius, -radius, lower[2]]), np.array([radius, radius, upper[2]])


class Twist(Warp):
    """`child` turned about the z axis by an angle that grows with the height (Barr 1984).

    Examples
    --------
    >>> from blobtree import Point, Twist
    >>> Twist(Point((1, 0, 1), radius=0.5), 90)([[0, 1, 1]]).round(3).tolist()
    [1.0]
    """

    tag = "twist"

    degrees: float = par.angle("degrees per model unit of height, counter-clockwise from above")

    @classmethod
    def numbers(cls, degrees: float) -> tuple[float, ...]:
        """Return the angle per unit of height in radians."""
        return (math.radians(degrees),)

    @formula
    def forward(q: wp.vec3, rate: wp.float32) -> wp.vec3:
        """Rotate about z by −rate·z."""
        c = wp.cos(rate * q[2])
        s = wp.sin(rate * q[2])
        return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])

    @formula
    def pullback(q: wp.vec3, g: wp.vec3, rate: wp.float32) -> wp.vec3:
        """Rotate back, and add the change of the rotation along z."""
        c = wp.cos(rate * q[2])
        s = wp.sin(rate * q[2])
        x = c * q[0] + s * q[1]
        y = c * q[1] - s * q[0]
        return wp.vec3(c * g[0] - s * g[1], s * g[0] + c * g[1], g[2] + rate * (y * g[0] - x * g[1]))

    @formula
    def lipschitz(q: wp.vec3, reach: wp.float32, rate: wp.float32) -> wp.float32:
        """Return ‖J‖ = (k + √(k² + 4)) / 2: a rotation and a shear by k = |rate| · distance from the axis."""
        k = wp.abs(rate) * (wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach)
        return 0.5 * (k + wp.sqrt(k * k + 4.0))

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, rate: float) -> Box:
        """Return the box around the cylinder around a box."""
        return cylinder_box(lower, upper)
