"""Core kinds of nodes above others: the operators and maps that Python's operators make, and their bases.

`radius` is the visible radius of an isolated primitive; its influence radius is radius / RIM.
"""

import math
from collections.abc import Iterable
from dataclasses import MISSING, dataclass, field, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from blobtree.declare.claims import OperatorRow
from blobtree.declare.parameters import Parameter, Quantity, fields_of, parameters_of
from blobtree.errors import InvalidNode
from blobtree.formulas.operators import DIFFERENCE, INTERSECTION, RICCI, SUM, UNION
from blobtree.formulas.warps import TWIST, SpaceWarp
from blobtree.nodes.node import Node
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


class Combination(Node):
    """An operator folded over its operands from left to right.

    The operator takes the parameters that the class declares, in their order.
    """

    combines = True
    operator: ClassVar[OperatorRow]

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The numbers that the operator takes besides its operands."""
        values = ((p, getattr(self, name)) for name, p in parameters_of(type(self)).items())
        return tuple(number for p, value in values for number in p.components(value))


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ManyOperands(Node):
    """A node with any number of `operands`, which come one by one or as one iterable.

    Its parameters follow them, best by name.
    """

    operands: tuple[Node, ...]

    def __init__(self, *arguments: "Node | Iterable[Node] | float", **named: Any) -> None:
        for name, value in _bound(type(self), arguments, named).items():
            object.__setattr__(self, name, value)
        self.__post_init__()


@dataclass(frozen=True, eq=False, repr=False, init=False)
class AssociativeCombination(ManyOperands, Combination):
    """A combination of `operands`: any number of them, or two if their order matters to the operator."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.operator.commutes and len(self.operands) != 2:
            raise InvalidNode(
                f"operands: expected two, got {len(self.operands)}; {type(self).__name__} does not "
                "claim that operands may come in any order, so nest it"
            )


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Sum(AssociativeCombination):
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
class Union(AssociativeCombination):
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
class Intersection(AssociativeCombination):
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


EXPONENT = Parameter(
    Quantity.FACTOR,
    "exponent n",
    low=1.0,
    high=LARGEST_EXPONENT,
    hint="1 is the sum; for more use a union",
)
"""Exponent of the sum of powers in a blend."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Ricci(AssociativeCombination):
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

    exponent: Annotated[float, EXPONENT] = field(kw_only=True)


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
class Placed(Node):
    """A node with one `child`, which it moves, grows or deforms."""

    child: Node


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
class Twist(Placed):
    """`child` turned about the z axis by an angle that grows with the height (Barr 1984).

    Examples
    --------
    >>> from blobtree import Point, Twist
    >>> Twist(Point((1, 0, 1), radius=0.5), 90)([[0, 1, 1]]).round(3).tolist()
    [1.0]
    """

    file_tag = "twist"
    warp: ClassVar[SpaceWarp] = TWIST

    degrees: Annotated[
        float, Parameter(Quantity.ANGLE, "degrees per model unit of height, counter-clockwise from above")
    ]

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The angle per unit of height in radians."""
        return (math.radians(self.degrees),)


def _bound(kind: type[Node], arguments: tuple[Any, ...], named: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a combination's fields; nodes in front of all other arguments are its operands."""
    names = [item.name for item in fields_of(kind)]
    values = {item.name: item.default for item in fields_of(kind) if item.default is not MISSING}
    count = next((i for i, item in enumerate(arguments) if not isinstance(item, Node)), len(arguments))
    positional = (arguments[:count], *arguments[count:]) if count else arguments
    given = dict(zip(names, positional, strict=False)) | named
    missing = [name for name in names if name not in values | given]
    unknown = [name for name in named if name not in names]
    if missing or unknown or len(positional) > len(names) or len(given) < len(positional) + len(named):
        expected = ", ".join(f"{name}=…" for name in names[1:]) or "nothing else"
        problem = f"got {len(positional)} arguments by position and {', '.join(named) or 'none'} by name"
        if missing:
            problem = f"{', '.join(missing)} missing"
        elif unknown:
            problem = f"{', '.join(unknown)} unknown"
        raise TypeError(f"{kind.__name__}: expected operands and {expected}; {problem}")
    return values | given
