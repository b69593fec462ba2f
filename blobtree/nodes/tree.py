"""Core kinds of nodes above others: the operators and maps that Python's operators make, and their bases.

`radius` is the visible radius of an isolated primitive; its influence radius is radius / RIM.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np

from blobtree import par
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.formulas.operators import DIFFERENCE, INTERSECTION, RICCI, SUM, UNION
from blobtree.formulas.warps import TWIST
from blobtree.nodes.node import Node
from blobtree.nodes.operator import Combination, Operator
from blobtree.nodes.warp import Placed, Warp
from blobtree.tape.program import Placement
from blobtree.validation import Matrix

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


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Sum(Operator):
    """Smooth blend F = Σ fᵢ (Blinn 1982; Wyvill et al. 1986).

    Examples
    --------
    >>> from blobtree import Point, Sum
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Sum(parts) == Sum(parts[0], parts[1]) == parts[0] + parts[1]
    True
    """

    file_tag = "sum"
    operator = SUM


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Union(Operator):
    """Sharp union F = max fᵢ (Ricci 1973).

    Examples
    --------
    >>> from blobtree import Point, Union
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Union(tuple(parts)) == parts[0] | parts[1]
    True
    """

    file_tag = "union"
    operator = UNION


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Intersection(Operator):
    """Sharp intersection F = min fᵢ (Ricci 1973).

    Examples
    --------
    >>> from blobtree import Intersection, Point
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Intersection(tuple(parts)) == parts[0] & parts[1]
    True
    """

    file_tag = "intersection"
    operator = INTERSECTION


exponent_field = partial(
    par.factor,
    "exponent n",
    low=1.0,
    high=LARGEST_EXPONENT,
    natural=3.0,
    hint="1 is the sum; for more use a union",
)
"""The exponent of the sum of powers in a blend."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
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

    file_tag = "ricci"
    operator = RICCI

    exponent: float = exponent_field()


@dataclass(frozen=True, eq=False, repr=False)
class Difference(Combination):
    """`solid` without `tool`: F = min(f, 1 − g) while f ≤ 1 (Wyvill, Guy & Galin 1999).

    `operators.difference_partials` states what happens where fields add up to more than 1.

    Examples
    --------
    >>> from blobtree import Difference, Point
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((0, 0, 1), radius=0.5)
    >>> Difference(solid, tool) == solid - tool
    True
    """

    file_tag = "difference"
    operator = DIFFERENCE

    solid: Node
    tool: Node


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


@dataclass(frozen=True, eq=False, repr=False)
class Twist(Warp):
    """`child` turned about the z axis by an angle that grows with the height (Barr 1984).

    Examples
    --------
    >>> from blobtree import Point, Twist
    >>> Twist(Point((1, 0, 1), radius=0.5), 90)([[0, 1, 1]]).round(3).tolist()
    [1.0]
    """

    file_tag = "twist"
    warp = TWIST

    degrees: float = par.angle("degrees per model unit of height, counter-clockwise from above")

    @classmethod
    def numbers(cls, degrees: float) -> tuple[float, ...]:
        """Return the angle per unit of height in radians."""
        return (math.radians(degrees),)
