"""BlobTree nodes: immutable values that combine with Python's operators (Wyvill, Guy & Galin 1999).

    body = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0, 0), radius=0.4)
    model = (body | Point((2, 1, 0), radius=0.5)) - Point((0, 0, 1), radius=0.5)

`radius` is what an isolated primitive shows; the radius of influence that the field needs is radius / RIM.
"""

import math
import reprlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.errors import InvalidNode
from blobtree.formulas.operators import DIFFERENCE, INTERSECTION, RICCI, SUM, UNION, Operator
from blobtree.formulas.warps import TWIST, SpaceWarp
from blobtree.lazy import Lazy
from blobtree.nodes.bounds import influence_bounds
from blobtree.nodes.identity import equal, from_records, hash_of, text_of, to_records
from blobtree.nodes.outline import outline
from blobtree.sparse.interval import range_over
from blobtree.tapes.evaluate import colors_at, gradients_at, values_at
from blobtree.tapes.program import Instruction, compile_program
from blobtree.tapes.tape import Tape, compile_tape
from blobtree.tracing.trace import Hits, raycast
from blobtree.validation import Matrix, affine_matrix, finite_number, finite_vector, settle
from blobtree.views.viewing import Viewing

LARGEST_EXPONENT = 100.0
"""Beyond it a Ricci blend differs from a union by less than float32 can tell at the surface."""


class Node(Viewing):
    """Part of a BlobTree: a field that is 0 far away and larger than ISO inside.

    Every node is a value: it never changes, and equal nodes compare equal. All that Python asks of a value is
    answered here, for a tree of any depth; so a kind of node is a dataclass with `eq=False, repr=False`.
    """

    @property
    def children(self) -> tuple["Node", ...]:
        """The nodes that this one combines, none for a primitive."""
        return ()

    # -- being a value ------------------------------------------------------------------------------

    def __eq__(self, other: object) -> bool:
        return equal(self, other) if isinstance(other, Node) else NotImplemented

    def __hash__(self) -> int:
        return hash_of(self)

    def __repr__(self) -> str:
        return text_of(self)

    def __str__(self) -> str:
        return outline(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return from_records, (to_records(self),)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, _memo: dict[int, Any]) -> Self:
        return self

    # -- combining ----------------------------------------------------------------------------------

    def __add__(self, other: "Node") -> "Node":
        return _folded(Sum, self, other)

    def __or__(self, other: "Node") -> "Node":
        return _folded(Union, self, other)

    def __and__(self, other: "Node") -> "Node":
        return _folded(Intersection, self, other)

    def __sub__(self, other: "Node") -> "Node":
        return Difference(self, other) if isinstance(other, Node) else NotImplemented

    # -- placing ------------------------------------------------------------------------------------

    def transform(self, matrix: ArrayLike) -> "Transform":
        """This node under an affine map, 3×4 or 4×4, that takes its points (columns) to the world."""
        return Transform(self, affine_matrix(matrix))

    def translate(self, offset: ArrayLike) -> "Transform":
        """This node moved by `offset` (3,)."""
        return self.transform(np.column_stack([np.eye(3), finite_vector("offset", offset)]))

    def rotate(self, axis: ArrayLike, degrees: float) -> "Transform":
        """This node turned about `axis` (3,) through the origin, counter-clockwise as seen from its tip."""
        direction = np.array(finite_vector("axis", axis))
        length = np.linalg.norm(direction)
        if length == 0.0:
            raise InvalidNode("axis: expected a direction, got the zero vector")
        x, y, z = direction / length
        angle = math.radians(finite_number("degrees", degrees))
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        linear = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
        return self.transform(np.column_stack([linear, np.zeros(3)]))

    def scale(self, factor: float | ArrayLike) -> "Transform":
        """This node scaled about the origin by one factor, or by one per axis."""
        factors = finite_vector("factor", factor if isinstance(factor, Iterable) else (factor,) * 3)
        if 0.0 in factors:
            raise InvalidNode(f"factor: expected a scale other than 0, got {factor!r}")
        return self.transform(np.column_stack([np.diag(factors), np.zeros(3)]))

    def twist(self, degrees: float) -> "Twist":
        """This node turned about the z axis by `degrees` per unit of height."""
        return Twist(self, degrees)

    def offset(self, distance: float) -> "Offset":
        """This node with every radius larger by `distance`."""
        return Offset(self, distance)

    # -- asking -------------------------------------------------------------------------------------

    @Lazy
    def _program(self) -> list[Instruction]:
        return compile_program(self)

    @Lazy
    def tape(self) -> Tape:
        """The flat form of this tree that every backend reads."""
        return compile_tape(self._program)

    @Lazy
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Corners (3,), (3,) of a box outside of which the field is exactly 0."""
        return influence_bounds(self._program)

    def __call__(self, points: ArrayLike) -> NDArray[np.float32]:
        """Field values (n,) at `points` (n, 3)."""
        return values_at(self.tape, points)

    def interval(self, lower: ArrayLike, upper: ArrayLike) -> tuple[float, float]:
        """Numbers that the field is never below and never above in the box between two corners (3,)."""
        return range_over(self.tape, lower, upper)

    def gradient(self, points: ArrayLike) -> NDArray[np.float32]:
        """Exact field gradients (n, 3) at `points` (n, 3)."""
        return gradients_at(self.tape, points)[:, 1:]

    def colors(self, points: ArrayLike) -> NDArray[np.float32]:
        """Blended colours (n, 3) at `points` (n, 3), black where no primitive reaches."""
        return colors_at(self.tape, points)

    def raycast(self, origins: ArrayLike, directions: ArrayLike, *, device: str | None = None) -> Hits:
        """What the rays from `origins` (n, 3) along `directions` (n, 3) meet first of the surface.

        Directions need not be unit; a ray that starts inside hits at once. `device` is the Warp device that
        does the work, by default the current one.

        Raises
        ------
        InvalidPoints
            Origins and directions differ in number, or a direction has no length.
        """
        return raycast(self, origins, directions, device=device)


class Combination(Node):
    """An operator folded over its operands from left to right."""

    operator: ClassVar[Operator]

    @property
    def parameter(self) -> float:
        """What the operator needs besides its operands."""
        return 0.0


@dataclass(frozen=True, eq=False, repr=False)
class AssociativeCombination(Combination):
    """A combination of any number of `operands`, nested alike or not."""

    operands: tuple[Node, ...]

    def __post_init__(self) -> None:
        settle(self, operands=_nodes(self.operands))

    @property
    def children(self) -> tuple[Node, ...]:
        """What this node combines."""
        return self.operands


@dataclass(frozen=True, eq=False, repr=False)
class Sum(AssociativeCombination):
    """Smooth blend F = Σ fᵢ."""

    operator = SUM


@dataclass(frozen=True, eq=False, repr=False)
class Union(AssociativeCombination):
    """Sharp union F = max fᵢ."""

    operator = UNION


@dataclass(frozen=True, eq=False, repr=False)
class Intersection(AssociativeCombination):
    """Sharp intersection F = min fᵢ."""

    operator = INTERSECTION


@dataclass(frozen=True, eq=False, repr=False)
class Ricci(AssociativeCombination):
    """Blend F = (Σ fᵢⁿ)^(1/n) (Ricci 1973): `exponent` 1 is the sum, a large one nears the union."""

    operator = RICCI

    exponent: float = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        exponent = finite_number("exponent", self.exponent)
        if not 1.0 <= exponent <= LARGEST_EXPONENT:
            raise InvalidNode(
                f"exponent: expected 1 to {LARGEST_EXPONENT:g}, got {exponent!r}; for more use a union"
            )
        settle(self, exponent=exponent)

    @property
    def parameter(self) -> float:
        """The exponent n."""
        return self.exponent


@dataclass(frozen=True, eq=False, repr=False)
class Difference(Combination):
    """`solid` without `tool`: F = min(f, 1 − g) while f ≤ 1, see `operators.difference_partials`."""

    operator = DIFFERENCE

    solid: Node
    tool: Node

    def __post_init__(self) -> None:
        _nodes((self.solid, self.tool))

    @property
    def children(self) -> tuple[Node, ...]:
        """What this node combines."""
        return (self.solid, self.tool)


@dataclass(frozen=True, eq=False, repr=False)
class Transform(Node):
    """`child` under an affine map whose 3×4 `matrix` takes the child's points (columns) to this node's space.

    The map folds into the primitives below it when the tape is made, so it costs nothing afterwards.
    """

    child: Node
    matrix: Matrix

    def __post_init__(self) -> None:
        _nodes((self.child,))
        settle(self, matrix=affine_matrix(self.matrix))

    @property
    def children(self) -> tuple[Node, ...]:
        """What this node combines."""
        return (self.child,)


@dataclass(frozen=True, eq=False, repr=False)
class Offset(Node):
    """`child` with every radius below it larger by `distance`, or smaller where that is negative.

    For primitives, unions and intersections of them this is the surface at that distance; where fields blend
    it is what the blend makes of the larger primitives. Tools of differences change the other way.
    """

    child: Node
    distance: float

    def __post_init__(self) -> None:
        _nodes((self.child,))
        settle(self, distance=finite_number("distance", self.distance))

    @property
    def children(self) -> tuple[Node, ...]:
        """What this node combines."""
        return (self.child,)


@dataclass(frozen=True, eq=False, repr=False)
class Twist(Node):
    """`child` turned about the z axis, by `degrees` per unit of height, counter-clockwise seen from above."""

    warp: ClassVar[SpaceWarp] = TWIST

    child: Node
    degrees: float

    def __post_init__(self) -> None:
        _nodes((self.child,))
        settle(self, degrees=finite_number("degrees", self.degrees))

    @property
    def children(self) -> tuple[Node, ...]:
        """What this node combines."""
        return (self.child,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The turn per unit in radians."""
        return (math.radians(self.degrees),)


def checked_tree(tree: object) -> Node:
    """`tree`, if it is one; InvalidNode otherwise."""
    if not isinstance(tree, Node):
        raise InvalidNode(f"tree: expected a BlobTree node such as Point(...), got {reprlib.repr(tree)}")
    return tree


def _nodes(operands: Iterable[Node]) -> tuple[Node, ...]:
    """`operands` as a tuple of nodes, at least one."""
    try:
        nodes = tuple(operands)
    except TypeError:
        raise InvalidNode(f"operands: expected several BlobTree nodes, got {operands!r}") from None
    if not nodes:
        raise InvalidNode("operands: expected at least one node, got none")
    for node in nodes:
        if not isinstance(node, Node):
            raise InvalidNode(f"operands: expected BlobTree nodes, got {node!r}")
    return nodes


def _folded(kind: type[Sum] | type[Union] | type[Intersection], first: Node, second: Node) -> Node:
    """Both under an operator of `kind`: a + b + c is one sum of three."""
    if not isinstance(second, Node):
        return NotImplemented
    operands = [item.operands if isinstance(item, kind) else (item,) for item in (first, second)]
    return kind((*operands[0], *operands[1]))
