"""Program → tape: one flat array that Warp and GLSL read alike, and that an edit overwrites in place.

Layout, in texels (vec4 of float32):

    header     (code, operator, count, parameter)
      code ≥ 0     a run of `count` primitives of SKELETONS[code], behind the header: parameters, then a
                   texel of colour
      code ≥ STRETCHED  the same for SKELETONS[code − STRETCHED], each behind PREFIX texels: the rows of its
                   world → local map, then (largest stretch of that map, 0, 0, 0)
      PUSH         register[count] = accumulator; accumulator = 0
      POP          accumulator = operator(register[count], accumulator)
      POP_SWAPPED  accumulator = operator(accumulator, register[count])

Everything of a primitive lies in one place, so a part of a tape is a tape.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from . import affine
from .errors import InvalidNode
from .operators import OPERATORS
from .program import Instruction, PlacedPrimitive, Pop, Push, Run, compile_program, registers_needed
from .skeletons import SKELETONS

if TYPE_CHECKING:
    from .tree import Node

PUSH = -1
POP = -2
POP_SWAPPED = -3
STRETCHED = 1024
PREFIX = 4
REGISTERS = 24
"""Registers that the interpreters hold: enough for any tree of 2²⁴ leaves."""


@dataclass(frozen=True)
class DeviceTape:
    """A tape in the memory of one Warp device: its texels, and from where to where they are read."""

    data: "wp.array[wp.vec4]"
    span: wp.vec2i


@dataclass(frozen=True, eq=False)
class Tape:
    """Flat form of a tree: float32 `data` (m, 4), and what a shader is specialised to."""

    data: NDArray[np.float32]
    registers: int
    skeletons: tuple[int, ...]
    """Codes of the skeleton kinds in use."""
    operators: tuple[int, ...]
    """Codes of the operators in use."""
    stretched: bool
    """Some primitive carries its own map."""

    def on(self, device: str | None = None) -> DeviceTape:
        """This tape on a Warp device, by default the current one."""
        return _upload(self, str(wp.get_device(device)))


@lru_cache(maxsize=64)
def _upload(tape: Tape, device: str) -> DeviceTape:
    return DeviceTape(wp.array(tape.data, dtype=wp.vec4, device=device), wp.vec2i(0, len(tape.data)))


def compile_tape(root: "Node") -> Tape:
    """The tape of the tree below `root`."""
    program = compile_program(root)
    registers = registers_needed(program)
    if registers > REGISTERS:
        raise InvalidNode(
            f"tree: needs {registers} registers, at most {REGISTERS} exist; group its operands otherwise"
        )
    runs = [step for step in program if isinstance(step, Run)]
    operators = {OPERATORS.index(step.operator) for step in program if not isinstance(step, Push)}
    return Tape(
        data=np.concatenate([texels for step in program for texels in _texels(step)]).astype(np.float32),
        registers=registers,
        skeletons=tuple(sorted({SKELETONS.index(run.skeleton) for run in runs})),
        operators=tuple(sorted(operators)),
        stretched=any(run.stretched for run in runs),
    )


def _texels(step: Instruction) -> Iterator[NDArray[np.float64]]:
    """The texels (·, 4) of one instruction."""
    match step:
        case Push(register):
            yield np.array([[PUSH, 0.0, register, 0.0]])
        case Pop(register, operator, parameter, swapped):
            yield np.array(
                [[POP_SWAPPED if swapped else POP, OPERATORS.index(operator), register, parameter]]
            )
        case Run(skeleton, stretched, operator, parameter, primitives):
            code = SKELETONS.index(skeleton) + (STRETCHED if stretched else 0)
            yield np.array([[code, OPERATORS.index(operator), len(primitives), parameter]])
            pack = _pack_stretched if stretched else _pack_similar
            for placed in primitives:
                yield from pack(placed)
                yield np.array([[*placed.primitive.color, 1.0]])


def _pack_similar(placed: PlacedPrimitive) -> Iterator[NDArray[np.float64]]:
    """A primitive whose map keeps shapes: the map folds into its parameters."""
    primitive, matrix = placed.primitive, placed.matrix
    scale = affine.uniform_scale(matrix)
    assert scale is not None
    yield primitive.texels(affine.apply(matrix, primitive.control_points), primitive.influence * scale)


def _pack_stretched(placed: PlacedPrimitive) -> Iterator[NDArray[np.float64]]:
    """A primitive whose map stretches it: points are taken to its own space instead."""
    inverse = np.linalg.inv(placed.matrix)
    stretch = np.linalg.svd(inverse[:3, :3], compute_uv=False)[0]
    yield inverse[:3].astype(np.float64)
    yield np.array([[stretch, 0.0, 0.0, 0.0]])
    yield placed.primitive.texels(placed.primitive.control_points, placed.primitive.influence)
