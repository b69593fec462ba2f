"""Rounded unions, intersections and differences, whose width is a length in model units.

In the plane of both fields f and g, an arc of an ellipse joins the lines f = ½ and g = ½. It leaves each line
where the other field is as large as it is at the distance `width` from the surface of its operand. So an arc
depends on two numbers, one for each operand: twice that field.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
import warp as wp

from blobtree import par
from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, Support, widened_range
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.formulas.falloff import RIM
from blobtree.lazy import Lazy
from blobtree.nodes.blends import (
    controllable_keeps,
    controllable_partials,
    controllable_slope,
    remainder,
    remainder_range,
)
from blobtree.nodes.node import Node
from blobtree.nodes.operator import Operator
from blobtree.nodes.tree import Macro, intersection_partials
from blobtree.tape.program import (
    WORLD,
    PlacedPrimitive,
    Placement,
    ProgramLeaf,
    ProgramNode,
    ProgramPrimitive,
    grown_fields,
    influence_radii,
    profile_factors,
)

wp.set_module_options({"enable_backward": False})

LEAST_RISE = 2e-4
"""Least difference between 1 and twice a field at the end of an arc: float32 resolves no narrower arc."""

_low = partial(par.factor, "twice a field outside, at the end of an arc", low=0.0, high=1.0 - LEAST_RISE)
_high = partial(par.factor, "twice a field inside, at the end of an arc", low=1.0 + LEAST_RISE, high=2.0)

Width = Annotated[
    float,
    Parameter(
        Quantity.LENGTH,
        "distance from each surface at which rounding of the other one begins, in model units",
        natural=0.3,
    ),
]


class _ArcUnion(Operator):
    """A controllable blend, by the tangents of its angles."""

    tag = "arc_union"
    like = "blend"
    monotone = True

    left: float = _low()
    right: float = _low()

    @formula
    def partials(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.vec3:
        """Return F of the blend."""
        return controllable_partials(a, b, left, right)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, left: wp.float32, right: wp.float32) -> wp.float32:
        """Bound its slope."""
        return controllable_slope(rise, most, left, right)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, left: wp.float32, right: wp.float32) -> wp.int32:
        """Return the operand that it keeps."""
        return controllable_keeps(a, b, left, right)


@wp.func
def arc_value_root(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.vec2:
    """Return C of `arc_partials` between both rays, and the root that its derivatives take."""
    p = 1.0 / (right - 1.0)
    q = 1.0 / (left - 1.0)
    u = wp.vec2(p * right, q * left)
    v = wp.vec2(p * a, q * b)
    cross = p * q * (right * b - left * a)
    root = wp.sqrt(wp.max(wp.dot(v, v) - cross * cross, 1e-30))
    return wp.vec2((wp.dot(u, v) + root) / (wp.dot(u, u) - 1.0), root)


@wp.func
def arc_partials(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.vec3:
    """F = C, where an arc inside the corner a = b = C joins the lines of level C of both operands.

    F is a where b ≥ t₁ a, and b where a ≥ t₂ b. Between these rays the level line is the arc of an ellipse,
    ((C t₂ − a) / (t₂ − 1))² + ((C t₁ − b) / (t₁ − 1))² = C², which is tangent to both lines.
    """
    if b >= left * a or a >= right * b:
        return intersection_partials(a, b)
    arc = arc_value_root(a, b, left, right)
    by_a = (right * arc[0] - a) / ((right - 1.0) * (right - 1.0) * arc[1])
    by_b = (left * arc[0] - b) / ((left - 1.0) * (left - 1.0) * arc[1])
    return wp.vec3(arc[0], wp.clamp(by_a, 0.0, 1.0), wp.clamp(by_b, 0.0, 1.0))


class _ArcIntersection(Operator):
    """An intersection whose edge is an arc."""

    tag = "arc_intersection"
    like = "intersection"
    monotone = True
    partials = formula(arc_partials)

    left: float = _high()
    right: float = _high()

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, left: wp.float32, right: wp.float32) -> wp.float32:
        """∂F/∂a and ∂F/∂b are not negative, and their sum lies between ¾ and 1."""
        larger = wp.max(rise[0], rise[1])
        if larger < 0.0:
            return 0.75 * larger
        return larger

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, left: wp.float32, right: wp.float32) -> wp.int32:
        """Return the operand beyond whose ray the other one stays."""
        if a[1] <= 0.0 or b[1] <= 0.0:
            return KEEP_NONE
        if b[0] >= left * a[1]:
            return KEEP_LEFT
        if a[0] >= right * b[1]:
            return KEEP_RIGHT
        return KEEP_BOTH


@wp.func
def arc_cut(a: wp.float32, c: wp.float32, left: wp.float32, right: wp.float32) -> wp.vec3:
    """Return F and its derivatives by a solid a and the complement c of its tool.

    Up to ½ F is the intersection of a and c. Above, 1 − F is the union of 1 − a and 1 − c with the same arc
    at ½, so that F is a where the tool is absent.
    """
    met = arc_partials(a, c, left, right)
    if met[0] <= 0.5:
        return met
    top = wp.max(a, 1.0)
    joined = controllable_partials(top - a, top - c, 2.0 - left, 2.0 - right)
    if joined[2] <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(top - joined[0], joined[1], joined[2])


class _ArcDifference(Operator):
    """A difference whose edge is an arc; the numbers are those of an intersection with the complement."""

    tag = "arc_difference"
    like = "difference"

    left: float = _high()
    right: float = _high()

    @formula
    def partials(a: wp.float32, b: wp.float32, left: wp.float32, right: wp.float32) -> wp.vec3:
        """F = `arc_cut` of a and the complement c = m − b(2m − 1), m = max(a, 1), of the tool."""
        if b <= 0.0:
            return wp.vec3(a, 1.0, 0.0)
        c = remainder(a, b)
        if c <= 0.0 or a <= 0.0:
            return wp.vec3(0.0, 0.0, 0.0)
        cut = arc_cut(a, c, left, right)
        if a <= 1.0:
            return wp.vec3(cut[0], cut[1], -cut[2])
        return wp.vec3(cut[0], cut[1] + (1.0 - 2.0 * b) * cut[2], (1.0 - 2.0 * a) * cut[2])

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, left: wp.float32, right: wp.float32) -> wp.float32:
        """As in the union where a ≤ 1, and as in the difference above, where no arc is."""
        if most[0] <= 1.0:
            return controllable_slope(rise, most, 2.0 - left, 2.0 - right)
        return rise[0] + (2.0 * most[0] - 1.0) * rise[1]

    @formula
    def interval(a: wp.vec2, b: wp.vec2, left: wp.float32, right: wp.float32) -> wp.vec2:
        """F rises with a and c."""
        c = remainder_range(a, b)
        return widened_range(arc_cut(a[0], c[0], left, right)[0], arc_cut(a[1], c[1], left, right)[0])

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, left: wp.float32, right: wp.float32) -> wp.int32:
        """Ignore a tool that does not cut, and whose arc does not reach the solid."""
        if a[1] <= 0.0 or b[0] >= 1.0:
            return KEEP_NONE
        if b[1] <= 0.0 or (a[1] <= 1.0 and arc_cut(a[1], 1.0 - b[1], left, right)[0] >= a[1]):
            return KEEP_LEFT
        return KEEP_BOTH


class _Rounded(Macro):
    """A macro of two operands, which keeps what `field_at` returned for it."""

    @Lazy
    def fields(self) -> dict[float, float]:
        """Return the fields of this node alone, by the distances from its surface."""
        return {}


@dataclass(frozen=True, eq=False, repr=False)
class RoundUnion(_Rounded):
    """Union of two nodes with a fillet, whose width is a length.

    The fillet leaves each surface at the distance `width` from the other one, whatever the falloffs and radii
    of the operands are, or where the other field ends. Where an operand holds several primitives, it counts
    as the one whose field falls off least there, so that no fillet is wider.

    Examples
    --------
    >>> from blobtree import HalfSpace, RoundUnion
    >>> floor = HalfSpace((0, 0, 0), (0, 0, 1), 4.0, radius=0)
    >>> wall = HalfSpace((0, 0, 0), (1, 0, 0), 4.0, radius=0)
    >>> (RoundUnion(floor, wall, 0.5)([[0.51, 0, 0], [0.3, 0, 0]]) > 0.5).tolist()
    [False, True]
    """

    file_tag = "round_union"

    first: Node
    second: Node
    width: Width

    @Lazy
    def expanded(self) -> Node:
        """Return the union by arcs."""
        operands = self.first, self.second
        left, right = (min(2.0 * field_at(node, self.width), 1.0 - LEAST_RISE) for node in reversed(operands))
        return _ArcUnion(*operands, left=left, right=right)


@dataclass(frozen=True, eq=False, repr=False)
class RoundIntersection(_Rounded):
    """Intersection of two nodes with a rounded edge, whose width is a length.

    The edge begins on each surface at the depth `width` below the other one; otherwise as in `RoundUnion`.

    Examples
    --------
    >>> from blobtree import HalfSpace, RoundIntersection
    >>> floor = HalfSpace((0, 0, 0), (0, 0, 1), 4.0, radius=0)
    >>> wall = HalfSpace((0, 0, 0), (1, 0, 0), 4.0, radius=0)
    >>> RoundIntersection(floor, wall, 0.5)([[-0.51, 0, 0], [-0.3, 0, 0]]).astype(float).round(2).tolist()
    [0.5, 0.49]
    """

    file_tag = "round_intersection"

    first: Node
    second: Node
    width: Width

    @Lazy
    def expanded(self) -> Node:
        """Return the intersection by arcs."""
        operands = self.first, self.second
        left, right = (_inside(field_at(node, -self.width)) for node in reversed(operands))
        return _ArcIntersection(*operands, left=left, right=right)


@dataclass(frozen=True, eq=False, repr=False)
class RoundDifference(_Rounded):
    """`solid` without `tool`, with a rounded edge, whose width is a length.

    The edge begins on the solid at the distance `width` from the tool, and in the cut at that depth below the
    surface of the solid; otherwise as in `RoundUnion`.

    Examples
    --------
    >>> from blobtree import HalfSpace, RoundDifference
    >>> floor = HalfSpace((0, 0, 0), (0, 0, 1), 4.0, radius=0)
    >>> trench = HalfSpace((0, 0, 0), (1, 0, 0), 4.0, radius=0)
    >>> RoundDifference(floor, trench, 0.5)([[0.51, 0, 0], [0.3, 0, 0]]).astype(float).round(2).tolist()
    [0.5, 0.49]
    """

    file_tag = "round_difference"

    solid: Node
    tool: Node
    width: Width

    @Lazy
    def expanded(self) -> Node:
        """Return the difference by arcs."""
        left = _inside(1.0 - field_at(self.tool, self.width))
        right = _inside(field_at(self.solid, -self.width))
        return _ArcDifference(self.solid, self.tool, left=left, right=right)


def _inside(field: float) -> float:
    """Return twice a field at the end of an arc inside, as operators take it."""
    return min(max(2.0 * field, 1.0 + LEAST_RISE), 2.0)


def field_at(root: ProgramNode, distance: float) -> float:
    """Return the field of an operand alone at a distance from its surface, below 0 inside.

    The operand's primitives decide it: of their fields at that distance, the one nearest to ½ counts. Warps,
    and maps that scale directions differently, count as if they kept lengths in the mean.
    """
    fields = {0.0 if distance > 0.0 else 1.0}
    pending: list[tuple[ProgramNode, Placement, bool]] = [(root, WORLD, False)]
    while pending:
        node, placement, cuts = pending.pop()
        if isinstance(node, _Rounded) and placement is WORLD and distance in node.fields and not cuts:
            fields.add(node.fields[distance])
            continue
        if isinstance(node, ProgramLeaf) and not node.program_children:
            if node.profile[2] > 0.5:  # it has a surface
                field = _leaf_field(node, placement, -distance if cuts else distance)
                fields.add(1.0 - field if cuts else field)
            continue
        below = node.child_placement(placement)
        is_cut = isinstance(node, RoundDifference) or (
            node.operator is not None and node.operator.support is Support.LEFT
        )
        for number, child in enumerate(
            node.children if isinstance(node, _Rounded) else node.program_children
        ):
            is_tool = is_cut and number > 0
            inner = Placement(below.matrix, -below.growth) if is_tool else below
            pending.append((child, inner, cuts != is_tool))
    field = min(fields, key=lambda field: abs(field - 0.5))
    if isinstance(root, _Rounded):
        root.fields[distance] = field
    return field


def _leaf_field(leaf: ProgramLeaf, placement: Placement, distance: float) -> float:
    """Return the field of a primitive at a distance from its surface."""
    placed = [PlacedPrimitive(leaf, placement)]
    if isinstance(leaf, ProgramPrimitive):
        influences = influence_radii(placed)
        radius, factor = RIM * float(influences.max()), float(profile_factors(placed, influences)[0] or 1.0)
    else:
        (grown,) = grown_fields(placed)
        measured = grown.field_kind.distance
        radius = grown.mean_radius if measured else float(grown.inradii([grown])[0])
        factor = grown.profile_factor
    falloff, _, weight = leaf.profile
    scale = float(np.cbrt(abs(np.linalg.det(placement.matrix[:3, :3]))))
    start = falloff.distance_of(0.5 / weight)
    return weight * falloff.at(start + falloff.rim * factor * distance / (scale * radius))
