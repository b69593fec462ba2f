"""Program → tape: one flat array that Warp and GLSL read alike, and that an edit overwrites in place.

Layout, in texels (vec4 of float32). First the data region, `Tape.start` texels without instructions, then one
instruction after the other:

    header     (code, operator, count, parameter)
      code ≥ 0     a run of `count` primitives of the instruction set's skeletons[code], behind the header:
                   parameters, then a texel of colour
      code ≥ STRETCHED  the same for skeletons[code − STRETCHED], each behind PREFIX texels: the rows of its
                   world → local map, then (largest stretch of that map, its profile), where the profile is
                   (0, 0, 0) or (code of a falloff, k > 0, weight), see `evaluators.profile_distance`
      code ≥ FIELD  a run of `count` direct fields of fields[code − FIELD], each behind PREFIX texels as those
                   of a stretched primitive: parameters, then a texel of colour
      PUSH         register[count] = accumulator; accumulator = 0
      POP          accumulator = operator(register[count], accumulator)
      POP_SWAPPED  accumulator = operator(accumulator, register[count])
      WARP         before PREFIX texels: the rows of a world → local map, then (its largest stretch, and the
                   warp's first three parameters); `operator` is the warp's code, `count` the register for the
                   point, `parameter` the number of texels with further parameters, which follow
      UNWARP       the same; ends what WARP began

`parameter` is the number that the operator takes. An operator with several parameters has them in the data
region, four to a texel, and `parameter` is the index of the first of these texels.

All texels of a primitive are adjacent, so a slice of the instructions is a tape, as long as the data region
stays where it is. Every pruned tape (of cells, meshes and rays) lies in an array that begins with the same
data region, so an index into it holds in all of them.

The region holds what an instruction reads besides its own texels: parameters of operators, vertices, samples
of grids. `DataRegion.add` stores a block of numbers and returns the index of its first texel; the instruction
holds this index in one of its own texels. Equal blocks are stored once. For leaves this is automatic: if
`ProgramLeaf.data` returns numbers, their index becomes the first number of the leaf's parameters.
Without such instructions the region is empty.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from typing import Any, cast

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array
from blobtree.declare.field import FieldKind
from blobtree.declare.registry import row_of
from blobtree.declare.skeleton import Skeleton
from blobtree.device import known_device
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import WYVILL
from blobtree.tape.bounds import warp_parameters
from blobtree.tape.codes import (
    FIELD,
    POP,
    POP_SWAPPED,
    PREFIX,
    PUSH,
    REGISTERS,
    STRETCHED,
    UNWARP,
    WARP,
    WARP_REGISTERS,
)
from blobtree.tape.data_region import DataRegion
from blobtree.tape.instruction_set import InstructionSet, Row, core, instruction_set_for
from blobtree.tape.program import (
    EnterWarp,
    Instruction,
    LeaveWarp,
    PlacedPrimitive,
    Placement,
    Pop,
    ProgramLeaf,
    ProgramPrimitive,
    Push,
    Run,
    distinct_placements,
    grown_fields,
    influence_radii,
    profile_factors,
    registers_needed,
    warp_registers_needed,
)

Precision = type[np.float32] | type[np.float64]


@dataclass(frozen=True)
class DeviceTape:
    """A tape in the memory of one Warp device: its texels, and the span of texels to read."""

    data: "wp.array[wp.vec4]"
    span: wp.vec2i


@dataclass(frozen=True, eq=False)
class Tape:
    """Flat form of a tree, which every evaluator reads.

    Attributes
    ----------
    data
        float32[m, 4]: the texels.
    registers, warp_registers
        Numbers of registers that an evaluation needs.
    skeletons, operators, warps
        Codes of the kinds in use, here or in its pruned tapes, to which shaders are specialised.
    stretched
        True if a primitive around a skeleton carries its own map.
    falloffs
        Codes of the falloffs of primitives with a profile.
    instruction_set
        The kinds that the codes stand for.
    headers
        int64[k]: indices in `data` where the instructions begin.
    fields
        Codes of the direct fields in use.
    start
        Number of texels of the data region, behind which the instructions begin.

    Examples
    --------
    >>> from blobtree import Point
    >>> (Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=1.0)).tape.data.shape
    (5, 4)
    """

    data: NDArray[Any]
    registers: int
    skeletons: tuple[int, ...]
    operators: tuple[int, ...]
    stretched: bool
    warps: tuple[int, ...] = ()
    warp_registers: int = 0
    instruction_set: InstructionSet = field(default_factory=core)
    headers: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    fields: tuple[int, ...] = ()
    start: int = 0
    falloffs: tuple[int, ...] = ()

    def on(self, device: str | None = None) -> DeviceTape:
        """Return this tape on a Warp device, by default the current one."""
        return _upload(self, known_device(device))


@lru_cache(maxsize=64)
def _upload(tape: Tape, device: str) -> DeviceTape:
    return DeviceTape(wp.array(tape.data, dtype=wp.vec4, device=device), wp.vec2i(tape.start, len(tape.data)))


def compile_tape(program: list[Instruction], precision: Precision = np.float32) -> Tape:
    """Return the tape of a tree's program.

    Devices read tapes in float32; differences of tapes need float64.

    Raises
    ------
    InvalidNode
        The program needs too many registers, its warps nest too deeply, or an offset leaves nothing of a
        primitive.
    """
    registers, warp_registers = registers_needed(program), warp_registers_needed(program)
    if registers > REGISTERS:
        raise InvalidNode(
            f"tree: needs {registers} registers, at most {REGISTERS} exist; group its operands otherwise"
        )
    if warp_registers > WARP_REGISTERS:
        raise InvalidNode(f"tree: warps nest {warp_registers} deep, at most {WARP_REGISTERS} may")
    runs = [step for step in program if isinstance(step, Run)]
    rows: set[Row] = {run.kind for run in runs}
    rows |= {WYVILL for kind in rows if isinstance(kind, FieldKind)}  # formulas of direct fields name one
    rows |= {step.warp for step in program if isinstance(step, EnterWarp)}
    operators = {step.operator for step in program if isinstance(step, Run | Pop)}
    rows |= operators
    if not all(operator.starts_from_zero for operator in operators):
        rows.add(row_of("sum"))  # a pruned tape may begin with any operand: `prune_kernels.first_operator`
    carrying = [placed.primitive for run in runs if run.stretched for placed in run.primitives]
    rows |= {primitive.profile[0] for primitive in carrying if primitive.profiled}
    instruction_set = instruction_set_for(rows)
    region = DataRegion(precision)
    of_warps = warp_parameters(program)
    texels = [np.concatenate(list(_texels(step, instruction_set, region, of_warps))) for step in program]
    start = len(region.texels)
    ends = start + np.cumsum([len(part) for part in texels])
    return Tape(
        data=np.concatenate([region.texels, *texels]).astype(precision),
        registers=registers,
        stretched=any(run.stretched for run in runs if isinstance(run.kind, Skeleton)),
        warp_registers=warp_registers,
        instruction_set=instruction_set,
        headers=np.concatenate([[start], ends[:-1]]).astype(np.int64),
        start=start,
        **instruction_set.codes_of(rows),
    )


def shifted_texels(tape: Tape, program: list[Instruction], shift: int) -> Float32Array:
    """Return the instructions of a tape for a place whose data region begins `shift` texels before its own.

    They are read with the region of the tape behind `shift` other texels.
    """
    texels = tape.data[tape.start :].copy()
    if shift == 0 or tape.start == 0:
        return texels
    ends = [*tape.headers[1:].tolist(), len(tape.data)]
    for step, header, end in zip(program, tape.headers.tolist(), ends, strict=True):
        if not isinstance(step, Run | Pop):
            continue
        first = header - tape.start
        if len(step.parameters) > 1:
            texels[first, 3] += shift
        if isinstance(step, Run) and step.primitives[0].primitive.data is not None:
            count, prefixed = len(step.primitives), step.stretched or isinstance(step.kind, FieldKind)
            stride = (end - header - 1) // count
            texels[first + 1 + PREFIX * prefixed + stride * np.arange(count), 0] += shift
    return texels


def _texels(
    step: Instruction,
    instruction_set: InstructionSet,
    region: DataRegion,
    of_warps: dict[int, tuple[float, ...]],
) -> Iterator[NDArray[np.float64]]:
    """Yield the texels (·, 4) of one instruction; `of_warps` is `warp_parameters` of the program."""
    match step:
        case Push(register):
            yield np.array([[PUSH, 0.0, register, 0.0]])
        case Pop(register, operator, parameters, swapped):
            code = POP_SWAPPED if swapped else POP
            parameter = _parameter(parameters, region)
            yield np.array([[code, instruction_set.operators.index(operator), register, parameter]])
        case EnterWarp():
            yield _warp_texels(WARP, step, of_warps[id(step)], instruction_set)
        case LeaveWarp(entry):
            yield _warp_texels(UNWARP, entry, of_warps[id(entry)], instruction_set)
        case Run(kind, stretched, operator, parameters, primitives):
            parameter = _parameter(parameters, region)
            if isinstance(kind, FieldKind):
                code = instruction_set.fields.index(kind) + FIELD
                texels = _field_texels(primitives, instruction_set, region)
            else:
                code = instruction_set.skeletons.index(kind) + (STRETCHED if stretched else 0)
                texels = _primitive_texels(primitives, instruction_set, region, stretched=stretched)
            yield np.array([[code, instruction_set.operators.index(operator), len(primitives), parameter]])
            yield texels


def _parameter(parameters: tuple[float, ...], region: DataRegion) -> float:
    """Return the number of a header that stands for an operator's parameters."""
    if len(parameters) > 1:
        return region.add(parameters)
    return parameters[0] if parameters else 0.0


def _warp_texels(
    code: int, entry: EnterWarp, parameters: tuple[float, ...], instruction_set: InstructionSet
) -> NDArray[np.float64]:
    """Return header, map and parameters of a warp."""
    prefix = _map_texels(entry.placement.matrix)
    first, more = parameters[:3], parameters[3:]
    prefix[-1, 1 : 1 + len(first)] = first
    texels = np.zeros((-(-len(more) // 4), 4))
    texels.ravel()[: len(more)] = more
    header = [code, instruction_set.warps.index(entry.warp), entry.register, len(texels)]
    return np.vstack([header, prefix, texels])


def _map_texels(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return PREFIX texels: the rows of the inverse of `matrix`, then (its largest stretch, 0, 0, 0)."""
    inverse = np.linalg.inv(matrix)
    stretch = np.linalg.svd(inverse[:3, :3], compute_uv=False)[0]
    return np.vstack([inverse[:3], [stretch, 0.0, 0.0, 0.0]])


def _primitive_texels(
    primitives: list[PlacedPrimitive],
    instruction_set: InstructionSet,
    region: DataRegion,
    *,
    stretched: bool,
) -> NDArray[np.float64]:
    """Return parameters and colours of a run's primitives, all at once, for there may be a million.

    Similarity maps fold into the parameters. Under other maps each primitive carries its map, and points are
    taken to the primitive's own space.
    """
    nodes = cast("list[ProgramPrimitive]", [placed.primitive for placed in primitives])
    placements, placed_by = distinct_placements(primitives)
    grown = influence_radii(primitives)
    matrices = None
    if not stretched:
        matrices = np.array([placement.matrix for placement in placements])[placed_by]
        scales = np.array([placement.uniform_scale for placement in placements])[placed_by]
        grown = grown * scales[:, None]
    parameters = _with_data(nodes[0].packed(nodes, grown, matrices), nodes, region)
    parts = [parameters, _color_texels(nodes)]
    if stretched:
        prefixes = _prefixes(placements)[placed_by]
        factors = profile_factors(primitives, grown)
        for number in np.flatnonzero(factors):
            falloff, _, weight = nodes[number].profile
            prefixes[number, -1, 1:] = (instruction_set.falloffs.index(falloff), factors[number], weight)
        parts.insert(0, prefixes)
    return np.concatenate(parts, axis=1).reshape(-1, 4)


def _field_texels(
    placed_fields: list[PlacedPrimitive], instruction_set: InstructionSet, region: DataRegion
) -> NDArray[np.float64]:
    """Return maps and profiles, parameters and colours of a run's direct fields, all at once."""
    placements, placed_by = distinct_placements(placed_fields)
    leaves = grown_fields(placed_fields)
    prefixes = _prefixes(placements)[placed_by]
    prefixes[:, -1, 1:] = (0.0, 1.0, 1.0)
    for number, leaf in enumerate(leaves):
        if leaf.profiled:
            falloff, _, weight = leaf.profile
            prefixes[number, -1, 1:] = (instruction_set.falloffs.index(falloff), leaf.profile_factor, weight)
    parameters = _with_data(leaves[0].packed_fields(leaves), leaves, region)
    parts = [prefixes, parameters, _color_texels(leaves)]
    return np.concatenate(parts, axis=1).reshape(-1, 4)


def _with_data(
    parameters: NDArray[np.float64], leaves: Sequence[ProgramLeaf], region: DataRegion
) -> NDArray[np.float64]:
    """Return parameters (n, ·, 4), the first number of which is the index of the leaf's data, if any."""
    if leaves[0].data is not None:
        parameters[:, 0, 0] = [region.add(cast("ArrayLike", leaf.data)) for leaf in leaves]
    return parameters


def _prefixes(placements: list[Placement]) -> NDArray[np.float64]:
    """Return the PREFIX texels (n, PREFIX, 4) of placements."""
    return np.array([_map_texels(placement.matrix) for placement in placements])


def _color_texels(leaves: Sequence[ProgramLeaf]) -> NDArray[np.float64]:
    """Return the colours of leaves as texels (n, 1, 4)."""
    colors = np.ones((len(leaves), 1, 4))
    components = chain.from_iterable(leaf.color for leaf in leaves)
    colors[:, 0, :3] = np.fromiter(components, np.float64, 3 * len(leaves)).reshape(-1, 3)
    return colors
