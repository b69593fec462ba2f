"""Operands of a tree that removes: the parts of its tape whose surfaces bound walls and lenses.

Differences, intersections and their smooth kin leave parts that are thinner than any primitive: a wall
between two surfaces, a lens where two bodies overlap. Both sides of such a part belong to different operands.
So a tree is cut into operands that remove nothing themselves, or into all of its leaves.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from blobtree._typing import Float32Array
from blobtree.declare.claims import OperatorRow, Support
from blobtree.declare.field import FieldKind
from blobtree.tape.codes import OPERATORS
from blobtree.tape.program import EnterWarp, Instruction, LeaveWarp, Pop, ProgramLeaf, Push, Run
from blobtree.tape.tape import Tape

MOST_WALLED_PARTS = 64
"""Most parts of expressions in a tree whose walls are looked for, operand by operand."""


@dataclass(frozen=True)
class Operand:
    """A part of a tape that removes nothing itself."""

    tape: Tape
    leaf: ProgramLeaf
    """The first of its leaves."""
    numbers: tuple[int, ...]
    """Its leaves, counted through the program."""
    tool: bool
    """True if it is removed from others."""
    meets: bool
    """True for an operand of an intersection, of which the part that all operands share is left."""

    @property
    def faces_itself(self) -> bool:
        """True for a tool of several primitives, between which it may leave walls."""
        return self.tool and len(self.numbers) > 1


@dataclass(frozen=True)
class _Part:
    """Texels of instructions that leave one value in the accumulator, and the numbers of their leaves."""

    texels: tuple[Float32Array, ...] = ()
    numbers: tuple[int, ...] = ()
    tool: bool = False
    meets: bool = False

    def then(self, texels: Float32Array, numbers: tuple[int, ...]) -> "_Part":
        """Return these instructions and one more."""
        return _Part((*self.texels, texels), self.numbers + numbers)

    def within(self, enter: Float32Array, leave: Float32Array) -> "_Part":
        """Return these instructions inside a warp."""
        return replace(self, texels=(enter, *self.texels, leave))


@dataclass(frozen=True)
class _Value:
    """The accumulator: its instructions, and its operands if it removes."""

    whole: _Part = _Part()
    operands: tuple[_Part, ...] = ()

    @property
    def parts(self) -> tuple[_Part, ...]:
        """The operands, or all of it."""
        return self.operands or ((self.whole,) if self.whole.texels else ())

    @property
    def met(self) -> tuple[_Part, ...]:
        """The parts, as those of an operand of an intersection."""
        return tuple(replace(part, meets=True) for part in self.parts)

    @property
    def tools(self) -> tuple[_Part, ...]:
        """The parts, as those of an operand that is removed: what they remove themselves stays."""
        return tuple(replace(part, tool=not part.tool) for part in self.parts)


def removes(operator: OperatorRow) -> bool:
    """Return True if the operator removes from its first operand."""
    return operator.support is not Support.EITHER


def has_walls(program: list[Instruction]) -> bool:
    """Return True if an operator of the program may leave walls or lenses that are looked for.

    They are not in a tree with more than `MOST_WALLED_PARTS` parts of expressions: each would be an operand.
    """
    kinds = [(step.kind, len(step.primitives)) for step in program if isinstance(step, Run)]
    parts = sum(count for kind, count in kinds if isinstance(kind, FieldKind) and kind.has_distances)
    removing = any(removes(step.operator) for step in program if isinstance(step, Run | Pop))
    return removing and parts <= MOST_WALLED_PARTS


def operands_of(program: list[Instruction], tape: Tape) -> list[Operand]:
    """Return the operands of a tree that `has_walls`; none for other trees."""
    if not has_walls(program):
        return []
    value = _Value()
    leaves: list[ProgramLeaf] = []
    registers: dict[int, tuple[_Value, Float32Array]] = {}
    enters: dict[int, Float32Array] = {}
    for step, texels in zip(program, _pieces(tape), strict=True):
        match step:
            case Run(operator=operator, primitives=primitives):
                numbers = tuple(range(len(leaves), len(leaves) + len(primitives)))
                leaves += [placed.primitive for placed in primitives]
                more: tuple[_Part, ...] = ()
                if removes(operator):
                    more = tuple(_runs(step, texels, tape, numbers))
                elif value.operands:
                    more = (_Part((texels,), numbers),)
                met = removes(operator) and operator.support is not Support.LEFT
                operands = (value.met if met else value.parts) + more if more else ()
                value = _Value(value.whole.then(texels, numbers), operands)
            case Push(register):
                registers[register], value = (value, texels), _Value()
            case Pop(register, operator, _, swapped):
                first, push = registers[register]
                left, right = (value, first) if swapped else (first, value)
                both = (*first.whole.texels, push, *value.whole.texels, texels)
                whole = _Part(both, left.whole.numbers + right.whole.numbers)
                operands = ()
                if removes(operator):
                    tools = operator.support is Support.LEFT
                    operands = left.parts + right.tools if tools else left.met + right.met
                elif left.operands or right.operands:
                    operands = left.parts + right.parts
                value = _Value(whole, operands)
            case EnterWarp(register=register):
                enters[register], value = texels, _Value()
            case LeaveWarp(entry):
                enter = enters[entry.register]
                within = tuple(part.within(enter, texels) for part in value.operands)
                value = _Value(value.whole.within(enter, texels), within)
    return [_operand(part, tape, leaves) for part in value.operands if part.numbers]


def leaves_of(program: list[Instruction], tape: Tape) -> Iterator[Tape]:
    """Yield the tape of each leaf alone, within the warps around it, for the kernels of the whole tape."""
    pieces, entries = _pieces(tape), list[int]()
    leaves_warp: dict[int, Float32Array] = {}
    for number, step in enumerate(program):
        if isinstance(step, EnterWarp):
            entries.append(number)
        elif isinstance(step, LeaveWarp):
            leaves_warp[entries.pop()] = pieces[number]
    for number, (step, texels) in enumerate(zip(program, pieces, strict=True)):
        if isinstance(step, EnterWarp):
            entries.append(number)
        elif isinstance(step, LeaveWarp):
            entries.pop()
        elif isinstance(step, Run):
            for own in np.split(texels[1:], len(step.primitives)):
                part = _Part((_alone(texels, own, tape),))
                for entry in reversed(entries):
                    part = part.within(pieces[entry], leaves_warp[entry])
                yield _tape_of(part, tape)


def _pieces(tape: Tape) -> list[Float32Array]:
    """Return the texels of each instruction of a tape."""
    starts = tape.headers.tolist()
    return [tape.data[a:b] for a, b in zip(starts, [*starts[1:], len(tape.data)], strict=True)]


def _alone(texels: Float32Array, own: Float32Array, tape: Tape) -> Float32Array:
    """Return the texels of a run with one of its primitives."""
    header = [texels[0, 0], OPERATORS.index("sum"), 1.0, 0.0]
    return np.vstack([header, own])


def _runs(step: Run, texels: Float32Array, tape: Tape, numbers: tuple[int, ...]) -> Iterator[_Part]:
    """Yield the primitives of a run that removes, as operands of their own.

    What tools cut away lies outside all of them, so a union of tools has all of the surface that is left.
    """
    if step.operator.support is Support.LEFT:
        header = [texels[0, 0], OPERATORS.index("union"), texels[0, 2], 0.0]
        yield _Part((np.vstack([header, texels[1:]]),), numbers, tool=True)
        return
    for number, own in zip(numbers, np.split(texels[1:], len(numbers)), strict=True):
        yield _Part((_alone(texels, own, tape),), (number,), meets=True)


def _operand(part: _Part, tape: Tape, leaves: list[ProgramLeaf]) -> Operand:
    """Return an operand with its tape."""
    return Operand(_tape_of(part, tape), leaves[part.numbers[0]], part.numbers, part.tool, part.meets)


def _tape_of(part: _Part, tape: Tape) -> Tape:
    """Return the tape of a part, behind the data region of the whole one."""
    data = np.concatenate([tape.data[: tape.start], *part.texels]).astype(tape.data.dtype)
    starts = tape.start + np.cumsum([0, *(len(texels) for texels in part.texels[:-1])])
    return replace(tape, data=data, headers=starts)
