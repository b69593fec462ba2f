"""Tree → program: the order in which one accumulator and a few registers evaluate a tree.

A run folds primitives of one kind into the accumulator; a subtree that cannot be folded in directly gets an
accumulator of its own (push) and is combined afterwards (pop). The subtree that needs most registers goes
first, so a tree of n leaves needs at most log₂ n registers and a spine of any length needs none
(Sethi & Ullman 1970). Affine maps and offsets fold into the primitives below them.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from blobtree.errors import InvalidNode
from blobtree.formulas.operators import RICCI, SUM, Operator, Reach
from blobtree.formulas.skeletons import Skeleton
from blobtree.formulas.warps import SpaceWarp
from blobtree.lazy import Lazy
from blobtree.nodes import affine
from blobtree.nodes.traversal import branches

if TYPE_CHECKING:
    from blobtree.nodes.primitives import Primitive
    from blobtree.nodes.tree import Combination, Node, Twist

MOST_PRIMITIVES = 1 << 24
"""Beyond it a float32 cannot count the primitives of a run."""

SIMPLE = -1
"""Weight of a node that folds into the accumulator without one of its own."""


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a node stands: what the nodes above it do to it."""

    matrix: NDArray[np.float64]
    """From the node's space to the world's, or to that of the warp around it."""
    growth: float = 0.0
    """What offsets add to its radii, in its own units."""

    @Lazy
    def uniform_scale(self) -> float | None:
        """The factor by which all lengths are scaled, None where directions differ."""
        return affine.uniform_scale(self.matrix)

    def is_carried_by(self, skeleton: Skeleton) -> bool:
        """Whether primitives of this kind carry the map, for it does not fold into their parameters."""
        if skeleton.takes_maps:
            return self.uniform_scale is None
        return not np.array_equal(self.matrix, WORLD.matrix)


WORLD = Placement(np.eye(4))


class PlacedPrimitive(NamedTuple):
    """A leaf and where it stands."""

    primitive: "Primitive"
    placement: Placement


_PlacedNode = tuple["Node", Placement]
"""Another node and where it stands."""


def distinct_placements(primitives: list[PlacedPrimitive]) -> tuple[list[Placement], NDArray[np.intp]]:
    """The placements of `primitives`, each object once, and which one each primitive has."""
    identities = np.fromiter((id(placed.placement) for placed in primitives), np.int64, len(primitives))
    if (identities == identities[0]).all():
        return [primitives[0].placement], np.zeros(len(primitives), np.intp)
    _, first, placed_by = np.unique(identities, return_index=True, return_inverse=True)
    placements = [primitives[i].placement for i in first]
    return placements, placed_by


def vanished(placed: PlacedPrimitive) -> InvalidNode:
    """What to raise where an offset leaves nothing of a primitive."""
    return InvalidNode(f"offset: {placed.placement.growth:g} leaves nothing of {placed.primitive!r}")


@dataclass(frozen=True)
class Run:
    """Fold `primitives`, one after the other, into the accumulator."""

    skeleton: Skeleton
    stretched: bool
    """Their maps do not fold into their parameters, so each carries its inverse map."""
    operator: Operator
    parameter: float
    primitives: list[PlacedPrimitive] = field(default_factory=list)

    def accepts(self, other: "Run") -> bool:
        """Whether `other` only continues this run."""
        mine = (self.skeleton, self.stretched, self.operator, self.parameter)
        return mine == (other.skeleton, other.stretched, other.operator, other.parameter)


@dataclass(frozen=True)
class Push:
    """Put the accumulator into `register` and start again from the empty field."""

    register: int


@dataclass(frozen=True)
class Pop:
    """Combine `register` (left operand) with the accumulator, or the other way round where `swapped`."""

    register: int
    operator: Operator
    parameter: float
    swapped: bool = False


@dataclass(frozen=True)
class EnterWarp:
    """Look at what follows, up to LeaveWarp, through a map and a warp; the place is kept in `register`."""

    warp: SpaceWarp
    parameters: tuple[float, ...]
    placement: Placement
    register: int


@dataclass(frozen=True)
class LeaveWarp:
    """Go back to the place that `entry` kept, and take the accumulator along."""

    entry: EnterWarp


Instruction = Run | Push | Pop | EnterWarp | LeaveWarp


@dataclass(frozen=True)
class _Emit:
    """Still to do: fold `node` into the accumulator, registers from `register` on being free."""

    node: "Node"
    placement: Placement
    register: int = 0
    warp_register: int = 0

    def into(self, node: "Node", placement: Placement, *, deeper: int = 0) -> "_Emit":
        """The same for a node below, `deeper` more registers being in use."""
        return replace(self, node=node, placement=placement, register=self.register + deeper)


def compile_program(root: "Node") -> list[Instruction]:
    """The instructions that leave the value of `root` in the accumulator, which starts empty (0)."""
    weights = _weights(root)
    program: list[Instruction] = []
    pending: list[_Emit | Instruction] = [_Emit(root, WORLD)]
    while pending:
        step = pending.pop()
        if isinstance(step, _Emit):
            pending.extend(reversed(list(_expand(step, weights))))
        elif isinstance(step, Run) and program and isinstance(program[-1], Run) and program[-1].accepts(step):
            program[-1].primitives.extend(step.primitives)
        else:
            program.append(step)
    return program


def registers_needed(program: list[Instruction]) -> int:
    """How many registers `program` uses."""
    return max((step.register + 1 for step in program if isinstance(step, Push)), default=0)


def warp_registers_needed(program: list[Instruction]) -> int:
    """How deep warps nest in `program`."""
    return max((step.register + 1 for step in program if isinstance(step, EnterWarp)), default=0)


def _weights(root: "Node") -> dict[int, int]:
    """Weight of every node that has children; refuses trees that use their subtrees too often."""
    weights: dict[int, int] = {}
    counts: dict[int, int] = {}
    for node in branches(root):
        children = [id(child) for child in node.children]
        counts[id(node)] = sum([counts.get(child, 1) for child in children])
        weights[id(node)] = _weight(node, [weights.get(child, SIMPLE) for child in children])
    if counts.get(id(root), 1) > MOST_PRIMITIVES:
        raise InvalidNode(
            f"tree: its subtrees, counted as often as they are used, exceed {MOST_PRIMITIVES:,} primitives"
        )
    return weights


def _weight(node: "Node", child_weights: list[int]) -> int:
    """Registers that a node with children needs, SIMPLE where it needs no accumulator of its own."""
    from blobtree.nodes.tree import Twist

    if isinstance(node, Twist):
        return max(0, child_weights[0])
    if len(child_weights) == 1:
        return child_weights[0]
    heaviest, *others = sorted(child_weights, reverse=True)
    return max([0, heaviest, *(weight + 1 for weight in others)])


def _expand(step: _Emit, weights: dict[int, int]) -> Iterator[_Emit | Instruction]:
    """`step`, whose node finds an empty accumulator, in smaller steps."""
    from blobtree.nodes.primitives import Primitive
    from blobtree.nodes.tree import Combination, Twist

    node, placement = _strip(step.node, step.placement)
    if isinstance(node, Primitive):
        yield from _runs([PlacedPrimitive(node, placement)], SUM, 0.0)
    elif isinstance(node, Twist):
        yield from _expand_warp(replace(step, node=node, placement=placement), node)
    elif isinstance(node, Combination):
        expand = _expand_commutative if node.operator.commutes else _expand_ordered
        yield from expand(replace(step, node=node, placement=placement), node, weights)


def _expand_warp(step: _Emit, node: "Twist") -> Iterator[_Emit | Instruction]:
    """The child in a space of its own."""
    outer = Placement(step.placement.matrix)
    entry = EnterWarp(node.warp, node.parameters, outer, step.warp_register)
    inner = _Emit(
        node.child, Placement(np.eye(4), step.placement.growth), step.register, step.warp_register + 1
    )
    yield from (entry, inner, LeaveWarp(entry))


def _expand_commutative(
    step: _Emit, node: "Combination", weights: dict[int, int]
) -> Iterator[_Emit | Instruction]:
    """Heaviest operand first; the primitives fold in at the end, kind by kind."""
    operator, parameter = _operation(node)
    subtrees: list[_PlacedNode] = []
    primitives: list[PlacedPrimitive] = []
    for placed in _flatten(node, step.placement):
        if isinstance(placed, PlacedPrimitive):
            primitives.append(placed)
        else:
            subtrees.append(placed)
    subtrees.sort(key=lambda subtree: -weights[id(subtree[0])])
    for number, (operand, placement) in enumerate(subtrees):
        if number == 0:
            yield step.into(operand, placement)
        else:
            yield Push(step.register)
            yield step.into(operand, placement, deeper=1)
            yield Pop(step.register, operator, parameter)
    if not subtrees and not operator.starts_from_zero:
        first, *primitives = primitives
        yield from _runs([first], SUM, 0.0)
    yield from _runs(primitives, operator, parameter)


def _expand_ordered(
    step: _Emit, node: "Combination", weights: dict[int, int]
) -> Iterator[_Emit | Instruction]:
    """Left operand first, unless the right one needs more registers."""
    from blobtree.nodes.primitives import Primitive

    operator, parameter = _operation(node)
    left, right = node.children
    left_place = step.placement
    cuts = operator.reach is Reach.LEFT
    right_place = replace(left_place, growth=-left_place.growth) if cuts else left_place
    if weights.get(id(right), SIMPLE) == SIMPLE:
        leaf, placement = _strip(right, right_place)
        assert isinstance(leaf, Primitive)
        yield step.into(left, left_place)
        yield from _runs([PlacedPrimitive(leaf, placement)], operator, parameter)
        return
    swapped = weights[id(right)] > weights.get(id(left), SIMPLE)
    operands = [(left, left_place), (right, right_place)]
    first, second = reversed(operands) if swapped else operands
    yield step.into(*first)
    yield Push(step.register)
    yield step.into(*second, deeper=1)
    yield Pop(step.register, operator, parameter, swapped)


def _runs(primitives: Iterable[PlacedPrimitive], operator: Operator, parameter: float) -> Iterator[Run]:
    """One run per kind of primitive, in the order in which the kinds first occur."""
    runs: dict[tuple[Skeleton, bool], Run] = {}
    run: Run | None = None
    placement: Placement | None = None
    for placed in primitives:
        skeleton = placed.primitive.skeleton
        if run is None or placed.placement is not placement or skeleton is not run.skeleton:
            placement = placed.placement
            key = skeleton, placement.is_carried_by(skeleton)
            run = runs.setdefault(key, Run(*key, operator, parameter))
        run.primitives.append(placed)
    yield from runs.values()


def _operation(node: "Combination") -> tuple[Operator, float]:
    """Operator and parameter of `node`; a Ricci blend of exponent 1 is the sum (GLSL has no pow(0, 0))."""
    if node.operator is RICCI and node.parameter == 1.0:
        return SUM, 0.0
    return node.operator, node.parameter


def _strip(node: "Node", placement: Placement) -> tuple["Node", Placement]:
    """`node` without the maps, offsets and one-operand combinations above it, and where it stands."""
    from blobtree.nodes.tree import Offset, Transform, Twist

    while len(node.children) == 1 and not isinstance(node, Twist):
        if isinstance(node, Transform):
            matrix = affine.square(node.matrix)
            growth = placement.growth / affine.mean_scale(matrix) if placement.growth else 0.0
            placement = Placement(placement.matrix @ matrix, growth)
        elif isinstance(node, Offset):
            placement = replace(placement, growth=placement.growth + node.distance)
        (node,) = node.children
    return node, placement


def _flatten(root: "Combination", place: Placement) -> Iterator[PlacedPrimitive | _PlacedNode]:
    """Operands of `root`, those of nested combinations by the same associative operator among them."""
    from blobtree.nodes.tree import Combination

    operation = _operation(root)
    pending = _placed(root.children, place)
    while pending:
        placed = pending.pop()
        if isinstance(placed, PlacedPrimitive):
            yield placed
            continue
        node, placement = _strip(*placed)
        if isinstance(node, Combination) and _operation(node) == operation:
            pending.extend(_placed(node.children, placement))
        elif node.children:
            yield node, placement
        else:
            yield PlacedPrimitive(cast("Primitive", node), placement)


def _placed(nodes: tuple["Node", ...], placement: Placement) -> list[PlacedPrimitive | _PlacedNode]:
    """`nodes` and where they stand, the last one first."""
    return [
        (node, placement) if node.children else PlacedPrimitive(cast("Primitive", node), placement)
        for node in reversed(nodes)
    ]
