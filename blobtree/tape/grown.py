"""Trees whose leaves have grown, and tapes of single leaves."""

from collections.abc import Iterator
from dataclasses import replace

from blobtree._typing import Float64Array, IndexArray
from blobtree.declare.registry import row_of
from blobtree.lazy import Lazy
from blobtree.tape.model import ImplicitModel
from blobtree.tape.program import (
    EnterWarp,
    Instruction,
    LeaveWarp,
    PlacedPrimitive,
    ProgramField,
    ProgramNode,
    Run,
)
from blobtree.tape.tape import Tape, compile_tape

NO_SLAB = -1
"""Number of a slab for a leaf that grows on all sides."""


class GrownModel(ImplicitModel):
    """A tree in which leaves are larger, each by a length of its own: on all sides, or across a slab.

    The growths are in the leaves' own units, in the order of the program, as are the numbers of slabs.
    `tree` is the tree with its own sizes.
    """

    def __init__(self, tree: ImplicitModel, growths: Float64Array, slabs: IndexArray) -> None:
        self.tree, self._growths, self._slabs = tree, growths, slabs

    @property
    def children(self) -> tuple[ProgramNode, ...]:
        """The operands of the tree."""
        return self.tree.children

    @property
    def program_children(self) -> tuple[ProgramNode, ...]:
        """The nodes below the tree in programs."""
        return self.tree.program_children

    @Lazy
    def _program(self) -> list[Instruction]:
        growths = zip(self._growths.tolist(), self._slabs.tolist(), strict=True)
        return [
            replace(step, primitives=[grown(placed, *next(growths)) for placed in step.primitives])
            if isinstance(step, Run)
            else step
            for step in self.tree._program
        ]


def grown(placed: PlacedPrimitive, growth: float, slab: int = NO_SLAB) -> PlacedPrimitive:
    """Return a leaf that is larger by a length in its own units, on all sides or across a slab."""
    if growth == 0.0:
        return placed
    if slab != NO_SLAB:
        assert isinstance(placed.primitive, ProgramField)
        return PlacedPrimitive(placed.primitive.thickened(slab, growth), placed.placement)
    placement = replace(placed.placement, growth=placed.placement.growth + growth)
    return PlacedPrimitive(placed.primitive, placement)


def runs_of_leaves(program: list[Instruction]) -> Iterator[tuple[Run, PlacedPrimitive]]:
    """Yield the leaves of a program in its order, each with its run."""
    return ((step, placed) for step in program if isinstance(step, Run) for placed in step.primitives)


def leaf_tape(program: list[Instruction], number: int, growth: float = 0.0) -> Tape:
    """Return the tape of one leaf alone, with the default profile, within the warps around it."""
    warps: list[EnterWarp] = []
    first = 0
    for step in program:
        match step:
            case EnterWarp():
                warps.append(step)
            case LeaveWarp():
                warps.pop()
            case Run(primitives=primitives):
                if first <= number < first + len(primitives):
                    leaf = grown(primitives[number - first], growth)
                    leaf = leaf._replace(primitive=leaf.primitive.plain)
                    run = Run(step.kind, step.stretched, row_of("sum"), (), [leaf])
                    return compile_tape([*warps, run, *map(LeaveWarp, reversed(warps))])
                first += len(primitives)
    raise IndexError(f"expected the number of a leaf below {first}, got {number}")
