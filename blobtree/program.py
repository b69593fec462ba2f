"""Tree → program: the order in which one accumulator and a few registers evaluate a tree.

A run folds primitives of one kind into the accumulator; a subtree that cannot be folded in directly gets an
accumulator of its own (push) and is combined afterwards (pop). The subtree that needs most registers goes
first, so a tree of n leaves needs at most log₂ n registers and a spine of any length needs none
(Sethi & Ullman 1970).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import affine
from .errors import InvalidNode
from .operators import RICCI, SUM, Operator
from .skeletons import Skeleton
from .traversal import fold

if TYPE_CHECKING:
    from .tree import Combination, Node, Primitive

MOST_PRIMITIVES = 1 << 24
"""Beyond it a float32 cannot count the primitives of a run."""

SIMPLE = -1
"""Weight of a node that folds into the accumulator without one of its own."""


@dataclass(frozen=True)
class PlacedPrimitive:
    """A leaf under the product of the transforms above it."""

    primitive: "Primitive"
    matrix: NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """Fold `primitives`, one after the other, into the accumulator."""

    skeleton: Skeleton
    stretched: bool
    """Their maps stretch directions differently, so each carries its inverse map."""
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


Instruction = Run | Push | Pop


@dataclass(frozen=True)
class _Emit:
    """Still to do: fold `node` into the accumulator, registers from `register` on being free."""

    node: "Node"
    matrix: NDArray[np.float64]
    operator: Operator
    parameter: float
    register: int


def compile_program(root: "Node") -> list[Instruction]:
    """The instructions that leave the value of `root` in the accumulator, which starts empty (0)."""
    if fold(root, _count_primitives) > MOST_PRIMITIVES:
        raise InvalidNode(
            f"tree: its subtrees, counted as often as they are used, exceed {MOST_PRIMITIVES:,} primitives"
        )
    weights: dict[int, int] = {}

    def weigh(node: "Node", child_weights: list[int]) -> int:
        weights[id(node)] = weight = _weight(node, child_weights)
        return weight

    fold(root, weigh)
    program: list[Instruction] = []
    pending: list[_Emit | Instruction] = [_Emit(root, np.eye(4), SUM, 0.0, register=0)]
    while pending:
        step = pending.pop()
        if isinstance(step, _Emit):
            pending.extend(reversed(list(_expand(step, weights))))
        elif isinstance(step, Run) and program and isinstance(program[-1], Run) and program[-1].accepts(step):
            program[-1].primitives.extend(step.primitives)
        else:
            program.append(step)
    return program


def _count_primitives(_node: "Node", child_counts: list[int]) -> int:
    """Leaves below a node, those of shared subtrees as often as they are used."""
    return sum(child_counts) if child_counts else 1


def registers_needed(program: list[Instruction]) -> int:
    """How many registers `program` uses."""
    return max((step.register + 1 for step in program if isinstance(step, Push)), default=0)


def _weight(node: "Node", child_weights: list[int]) -> int:
    """Registers that `node` needs, SIMPLE where it needs no accumulator of its own."""
    if not child_weights:
        return SIMPLE
    if len(child_weights) == 1:
        return child_weights[0]
    heaviest, *others = sorted(child_weights, reverse=True)
    return max([0, heaviest, *(weight + 1 for weight in others)])


def _expand(step: _Emit, weights: dict[int, int]) -> Iterator[_Emit | Instruction]:
    """`step` in smaller steps."""
    from .tree import Combination, Primitive

    node, matrix = _strip(step.node, step.matrix)
    if isinstance(node, Primitive):
        stretched = affine.uniform_scale(matrix) is None
        placed = PlacedPrimitive(node, matrix)
        yield Run(node.skeleton, stretched, step.operator, step.parameter, [placed])
    elif isinstance(node, Combination):
        expand = _expand_commutative if node.operator.commutes else _expand_ordered
        yield from expand(node, matrix, step.register, weights)


def _expand_commutative(
    node: "Combination", matrix: NDArray[np.float64], register: int, weights: dict[int, int]
) -> Iterator[_Emit | Instruction]:
    """Heaviest operand first; the others follow it into the accumulator."""
    operator, parameter = _operation(node)
    operands = sorted(_flatten(node, matrix), key=lambda operand: -weights[id(operand[0])])
    (first, first_matrix), *others = operands
    first_operator = operator if operator.starts_from_zero else SUM
    yield _Emit(
        first, first_matrix, first_operator, parameter if operator.starts_from_zero else 0.0, register
    )
    for operand, operand_matrix in others:
        if weights[id(operand)] == SIMPLE:
            yield _Emit(operand, operand_matrix, operator, parameter, register)
        else:
            yield Push(register)
            yield _Emit(operand, operand_matrix, SUM, 0.0, register + 1)
            yield Pop(register, operator, parameter)


def _expand_ordered(
    node: "Combination", matrix: NDArray[np.float64], register: int, weights: dict[int, int]
) -> Iterator[_Emit | Instruction]:
    """Left operand first, unless the right one needs more registers."""
    operator, parameter = _operation(node)
    left, right = node.children
    if weights[id(right)] == SIMPLE:
        yield _Emit(left, matrix, SUM, 0.0, register)
        yield _Emit(right, matrix, operator, parameter, register)
        return
    swapped = weights[id(right)] > weights[id(left)]
    first, second = (right, left) if swapped else (left, right)
    yield _Emit(first, matrix, SUM, 0.0, register)
    yield Push(register)
    yield _Emit(second, matrix, SUM, 0.0, register + 1)
    yield Pop(register, operator, parameter, swapped)


def _operation(node: "Combination") -> tuple[Operator, float]:
    """Operator and parameter of `node`; a Ricci blend of exponent 1 is the sum (GLSL has no pow(0, 0))."""
    if node.operator is RICCI and node.parameter == 1.0:
        return SUM, 0.0
    return node.operator, node.parameter


def _strip(node: "Node", matrix: NDArray[np.float64]) -> tuple["Node", NDArray[np.float64]]:
    """`node` without the transforms and one-operand combinations on top of it, and the map they leave."""
    from .tree import Transform

    while len(node.children) == 1:
        if isinstance(node, Transform):
            matrix = matrix @ affine.square(node.matrix)
        (node,) = node.children
    return node, matrix


def _flatten(
    root: "Combination", root_matrix: NDArray[np.float64]
) -> Iterator[tuple["Node", NDArray[np.float64]]]:
    """Operands of `root`, those of nested combinations by the same associative operator among them."""
    from .tree import Combination

    operation = _operation(root)
    pending: list[tuple[Node, NDArray[np.float64]]] = [
        (child, root_matrix) for child in reversed(root.children)
    ]
    while pending:
        node, matrix = _strip(*pending.pop())
        if isinstance(node, Combination) and _operation(node) == operation:
            pending.extend((child, matrix) for child in reversed(node.children))
        else:
            yield node, matrix
