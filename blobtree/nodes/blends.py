"""Blends of the literature: combinations by the operators of `formulas.blends`, and macros of them."""

import math
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.formulas.blends import (
    CLEAN_UNION,
    CONTROLLABLE,
    MASKED,
    R_DIFFERENCE,
    R_INTERSECTION,
    R_UNION,
    SMOOTH_DIFFERENCE,
    SMOOTH_INTERSECTION,
    SUPERELLIPTIC,
)
from blobtree.formulas.gradient_blends import GRADIENT_BLEND
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.tree import (
    EXPONENT,
    AssociativeCombination,
    Intersection,
    Macro,
    ManyOperands,
    Sum,
    Union,
)

WIDEST = 0.5
"""Largest width of a blend, in field values: from the surface to where a field ends."""

LARGEST_ANGLE = 44.0
"""Largest angle of a controllable blend, in degrees; at 45 it would be a union."""

NARROWEST_TURN = 1.0
"""Smallest difference of both angles of a gradient blend, in degrees."""

MOST_GROUPS = 1024
"""Most groups of a blend graph: each repeats its operands in the program."""

_WIDTH = Parameter(
    Quantity.FACTOR,
    "field values over which it blends",
    low=1e-4,
    high=WIDEST,
    hint="fields are ½ on surfaces",
)
_ANGLE = Parameter(
    Quantity.ANGLE,
    "angle in degrees between an axis of the plane of field values and the blend",
    low=0.0,
    high=LARGEST_ANGLE,
    hint="for more use a union",
)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class SuperellipticBlend(AssociativeCombination):
    """Blend within a width of the surfaces: F = l + (Σ (fᵢ − l)ⁿ)^(1/n), l = ½ − width (Rockwood 1989).

    An operand whose field is below l changes nothing there. With width ½ it is the `Ricci` blend.

    Examples
    --------
    >>> from blobtree import Point, SuperellipticBlend
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1.5, 0, 0), radius=1.0)
    >>> blend = SuperellipticBlend(a, b, width=0.2, exponent=2.0)
    >>> blend([[0, 0, 1], [0.75, 0, 0.65]]).astype(float).round(3).tolist()
    [0.5, 0.591]
    """

    file_tag = "superelliptic_blend"
    operator = SUPERELLIPTIC

    width: Annotated[float, _WIDTH] = field(kw_only=True)
    exponent: Annotated[float, EXPONENT] = field(kw_only=True)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class RUnion(AssociativeCombination):
    """Union of two operands by an R-function: smooth everywhere but at its crease (Pasko et al. 1995).

    Examples
    --------
    >>> from blobtree import Point, RUnion
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> RUnion(a, b)([[-1, 0, 0], [2, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "r_union"
    operator = R_UNION


@dataclass(frozen=True, eq=False, repr=False, init=False)
class RIntersection(AssociativeCombination):
    """Intersection of two operands by an R-function: smooth but at its crease (Pasko et al. 1995).

    Examples
    --------
    >>> from blobtree import Point, RIntersection
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> RIntersection(a, b)([[0, 0, 0], [1, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "r_intersection"
    operator = R_INTERSECTION


@dataclass(frozen=True, eq=False, repr=False, init=False)
class RDifference(AssociativeCombination):
    """First operand without the second by an R-function: smooth but at its crease (Pasko et al. 1995).

    Examples
    --------
    >>> from blobtree import Point, RDifference
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> RDifference(solid, tool)([[-1, 0, 0], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "r_difference"
    operator = R_DIFFERENCE


@dataclass(frozen=True, eq=False, repr=False, init=False)
class SmoothIntersection(AssociativeCombination):
    """Intersection of two operands with a rounded edge.

    Examples
    --------
    >>> from blobtree import Point, SmoothIntersection
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> bool(SmoothIntersection(a, b, width=0.2)([[0.5, 0, 0.5]])[0] < (a & b)([[0.5, 0, 0.5]])[0])
    True
    """

    file_tag = "smooth_intersection"
    operator = SMOOTH_INTERSECTION

    width: Annotated[float, _WIDTH] = field(kw_only=True)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class SmoothDifference(AssociativeCombination):
    """First operand without the second, with a rounded edge.

    Examples
    --------
    >>> from blobtree import Point, SmoothDifference
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> cut = SmoothDifference(solid, tool, width=0.2)
    >>> bool(cut([[0.4, 0, 0.8]])[0] < (solid - tool)([[0.4, 0, 0.8]])[0])
    True
    """

    file_tag = "smooth_difference"
    operator = SMOOTH_DIFFERENCE

    width: Annotated[float, _WIDTH] = field(kw_only=True)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class CleanUnion(AssociativeCombination):
    """Union of two operands whose field is smooth everywhere but at its crease (after Gourmel et al. 2013).

    What is blended with a clean union shows no trace of a crease away from the surface's own.
    `formulas.blends.clean_union_partials` states the formula.

    Examples
    --------
    >>> from blobtree import CleanUnion, Point
    >>> a, b = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> CleanUnion(a, b)([[-1, 0, 0], [2, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "clean_union"
    operator = CLEAN_UNION


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ControllableBlend(AssociativeCombination):
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

    file_tag = "controllable_blend"
    operator = CONTROLLABLE

    left_angle: Annotated[float, _ANGLE] = field(kw_only=True)
    right_angle: Annotated[float, _ANGLE] = field(kw_only=True)

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The tangents of the angles."""
        return math.tan(math.radians(self.left_angle)), math.tan(math.radians(self.right_angle))


@dataclass(frozen=True, eq=False, repr=False, init=False)
class GradientBlend(AssociativeCombination):
    """Blend of two operands where their surfaces meet at an angle (after Gourmel et al. 2013).

    The angle between the gradients of the operands opens the blend: up to `start_angle` it is the union, from
    `full_angle` on a full blend, and in between it opens smoothly. So no bulge shows where both surfaces run
    alike, and small details stay. Outside the support of an operand it is the other one.
    `formulas.gradient_blends` states the formula, which differs from the paper's tables.

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

    file_tag = "gradient_blend"
    operator = GRADIENT_BLEND

    start_angle: Annotated[
        float,
        Parameter(Quantity.ANGLE, "angle between gradients up to which it is the union", low=0.0, high=179.0),
    ] = field(kw_only=True)
    full_angle: Annotated[
        float,
        Parameter(
            Quantity.ANGLE, "angle between gradients from which it is a full blend", low=1.0, high=180.0
        ),
    ] = field(kw_only=True)

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


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Masked(AssociativeCombination):
    """First operand times a mask: all of it within the second operand, and none where that is 0.

    Examples
    --------
    >>> from blobtree import Masked, Point
    >>> a, mask = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    >>> Masked(a, mask)([[0.5, 0, 0], [-1.5, 0, 0]]).astype(float).round(3).tolist()
    [0.853, 0.0]
    """

    file_tag = "masked"
    operator = MASKED


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
