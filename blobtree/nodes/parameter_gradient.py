"""Derivatives of a tree's field by its parameters.

The field is a function of the tape, and the tape of the parameters. `transpile.derivative` gives the exact
derivative of the interpreter by the tape; the derivative of the tape by a parameter is a difference of tapes
in float64, relative error about 1e-10. A parameter changes the field only in the support of its node, so
only the points there are evaluated.

Primitives differ from each other in their own texels alone. Hence the tangents of one parameter of all
primitives of a class are one difference of two tapes. Every other parameter takes two tapes of its own.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Float64Array
from blobtree.declare.parameters import Quantity
from blobtree.derivatives.sensitivity import sensitivities_at
from blobtree.errors import InvalidNode
from blobtree.nodes.numeric_parameters import (
    AnyNode,
    NumericParameter,
    Path,
    checked_parameters,
    node_along,
    numeric_parameters,
    numeric_values,
    with_number,
    with_numeric_values,
    without_sharing,
)
from blobtree.tape.model import ImplicitModel
from blobtree.tape.program import Instruction, ProgramLeaf, ProgramNode, Run, compile_program
from blobtree.tape.tape import Tape, compile_tape

STEP = 6e-6
"""Step of differences, relative to the parameter: the cube root of float64's precision."""

SIDES = ((-1.0, 1.0), (1.0, 3.0), (-3.0, -1.0))
"""Pairs of steps to try: across the value, then on one side of it, where its range or another kind begins."""

LARGEST_TANGENTS = 1 << 26
"""Bytes of tangents on the device at a time."""


@dataclass(frozen=True, eq=False)
class ParameterGradient:
    """Derivatives of a field at n points by p parameters.

    Attributes
    ----------
    values
        float32[n, p]: ∂f/∂(parameter), per unit of the parameter.
    parameters
        The p parameters, see `NumericParameter`.

    Examples
    --------
    >>> from blobtree import ParameterGradient, Point
    >>> gradient = Point((0, 0, 0), radius=1.0).parameter_gradient([[1, 0, 0], [5, 0, 0]])
    >>> isinstance(gradient, ParameterGradient), gradient.values.shape, len(gradient.parameters)
    (True, (2, 4), 4)
    >>> gradient.values[:, 3].astype(float).round(3).tolist()
    [0.78, 0.0]
    """

    values: Float32Array
    parameters: tuple[NumericParameter, ...]


@dataclass(frozen=True, eq=False)
class _Tangent:
    """The derivative of a tape by one parameter."""

    column: int
    tape: Tape
    """The tape at the parameter's value, or right beside it."""
    first: int
    texels: Float64Array
    """Derivatives of the texels from `first` on; those of the others are 0."""


def parameter_gradient_of(
    model: ImplicitModel, points: Float32Array, parameters: Iterable[NumericParameter] | None = None
) -> ParameterGradient:
    """Return the derivatives of a tree's field by its parameters, see `Node.parameter_gradient`."""
    chosen = checked_parameters(numeric_parameters(model) if parameters is None else parameters)
    return ParameterGradient(_derivatives(model, points, chosen, gradients=False)[:, :, 0], chosen)


def gradient_sensitivities(
    model: ImplicitModel, points: Float32Array, parameters: Sequence[NumericParameter]
) -> Float32Array:
    """Return the derivatives (n, p, 4) of the field and of its gradient at n points by p parameters."""
    return _derivatives(model, points, tuple(parameters), gradients=True)


def _derivatives(
    model: ImplicitModel, points: Float32Array, chosen: tuple[NumericParameter, ...], *, gradients: bool
) -> Float32Array:
    """Return the derivatives (n, p, 4) of value and gradient, or (n, p, 1) of the value alone."""
    tree = without_sharing(model)
    values = np.zeros((len(points), len(chosen), 4 if gradients else 1), np.float32)
    touched = _touched_points(tree, chosen, points)
    for tangents in _batches(_tangents(tree, chosen)):
        tape = tangents[0].tape
        dense = np.zeros((len(tangents), len(tape.data), 4), np.float32)
        for place, tangent in enumerate(tangents):
            dense[place, tangent.first : tangent.first + len(tangent.texels)] = tangent.texels
        rows = np.concatenate([touched[chosen[tangent.column].path] for tangent in tangents])
        counts = [len(touched[chosen[tangent.column].path]) for tangent in tangents]
        places = np.repeat(np.arange(len(tangents)), counts)
        columns = np.array([tangent.column for tangent in tangents])
        changes = sensitivities_at(tape, dense, points, rows, places, gradients=gradients)
        values[rows, columns[places]] = changes.reshape(len(rows), values.shape[2])
    return values


def _batches(tangents: Iterable[_Tangent]) -> Iterator[list[_Tangent]]:
    """Yield tangents of the same tape together, as many as fit on the device."""
    batch: list[_Tangent] = []
    for tangent in tangents:
        size = tangent.tape.data.size * 4 * (len(batch) + 1)
        if batch and (tangent.tape is not batch[0].tape or size > LARGEST_TANGENTS):
            yield batch
            batch = []
        batch.append(tangent)
    if batch:
        yield batch


def _touched_points(
    tree: ImplicitModel, parameters: Sequence[NumericParameter], points: Float32Array
) -> dict[Path, NDArray[np.intp]]:
    """Return the indices of the points in the support of each node that has one of the parameters."""
    touched: dict[Path, NDArray[np.intp]] = {}
    for path in {parameter.path for parameter in parameters}:
        lower, upper = _in_world(tree, path).field_box
        margin = 1e-5 * np.maximum(np.abs(lower), np.abs(upper))
        inside = ((points >= lower - margin) & (points <= upper + margin)).all(axis=1)
        touched[path] = np.flatnonzero(inside)
    return touched


def _in_world(tree: AnyNode, path: Path) -> AnyNode:
    """Return a node under the maps and warps above it, without what it combines with.

    Where a macro with several operands is above it, the macro takes its place.
    """
    nodes: list[AnyNode] = [tree]
    for step in path:
        nodes.append(nodes[-1].children[step])  # type: ignore[arg-type]  # children are of the same class
    result = nodes[-1]
    for parent in reversed(nodes[:-1]):
        if parent.program_children != parent.children:
            result = parent
        elif parent.operator is None:
            result = cast(AnyNode, _changed(parent, "child", result))
    return result


# -- tangents of tapes ----------------------------------------------------------------------------------


def _tangents(tree: ImplicitModel, parameters: tuple[NumericParameter, ...]) -> Iterator[_Tangent]:
    """Yield the derivatives of the tape by the parameters, those of the tree's own tape first."""
    maps = any(_maps_change(node_along(tree, parameter.path)) for parameter in parameters)
    program = _program(tree, stretched=maps)
    base = compile_tape(program, np.float64)
    groups: dict[tuple[type[ProgramNode], str, tuple[int, ...]], list[int]] = {}
    single: list[int] = []
    for column, parameter in enumerate(parameters):
        node = node_along(tree, parameter.path)
        if isinstance(node, ProgramLeaf) and not _below_macro(tree, parameter.path):
            groups.setdefault((type(node), parameter.name, parameter.index), []).append(column)
        else:
            single.append(column)
    for columns in groups.values():
        tangents = _of_leaves(tree, parameters, columns, program, base)
        single += columns if tangents is None else []
        yield from tangents or ()
    own = [_of_one(tree, parameters[column], column, base, stretched=maps) for column in single]
    yield from sorted(own, key=lambda tangent: tangent.tape is not base)


def _program(tree: ProgramNode, *, stretched: bool) -> list[Instruction]:
    """Return the program of a tree; in a `stretched` one every primitive carries its map.

    Then maps that cease to be similarities change numbers on the tape alone.
    """
    program = compile_program(tree)
    if not stretched:
        return program
    return [replace(step, stretched=True) if isinstance(step, Run) else step for step in program]


def _maps_change(node: ProgramNode) -> bool:
    """Return True if a parameter of the node may change the map of a primitive."""
    return not isinstance(node, ProgramLeaf) and node.operator is None


def _below_macro(tree: ProgramNode, path: Path) -> bool:
    """Return True if a node is, or lies below, a node that stands for others."""
    nodes = [node_along(tree, path[:length]) for length in range(len(path) + 1)]
    return any(node.program_children != node.children for node in nodes)


def _steps(tree: ProgramNode, parameter: NumericParameter) -> tuple[float, float]:
    """Return the value of a parameter and the step of its differences."""
    (value,) = numeric_values(tree, [parameter])
    numbers = np.abs(np.asarray(getattr(node_along(tree, parameter.path), parameter.name), np.float64))
    if parameter.declaration.quantity is Quantity.MATRIX and parameter.index[1] < 3:
        numbers = numbers[:, :3]
    scale = float(numbers.max(initial=0.0))
    return float(value), STEP * (scale if scale > 0.0 else 1.0)


def _of_leaves(
    tree: ImplicitModel,
    parameters: tuple[NumericParameter, ...],
    columns: list[int],
    program: list[Instruction],
    base: Tape,
) -> list[_Tangent] | None:
    """Return the tangents of one parameter of several primitives, None if they need tapes of their own."""
    name, index = parameters[columns[0]].name, parameters[columns[0]].index
    nodes = [cast(ProgramLeaf, node_along(tree, parameters[column].path)) for column in columns]
    steps = [_steps(tree, parameters[column]) for column in columns]
    owners = {id(node): place for place, node in enumerate(nodes)}
    starts: list[int] = []
    runs: list[Run] = []
    for instruction, header in zip(program, base.headers.tolist(), strict=True):
        if isinstance(instruction, Run) and any(id(p.primitive) in owners for p in instruction.primitives):
            runs.append(instruction)
            starts.append(header)
    if not runs:  # their weights are negative, and they do nothing where they stand
        return []
    tapes: list[Tape] = []
    for side in (-1.0, 1.0):
        try:
            copies = {
                id(node): _changed(node, name, with_number(getattr(node, name), index, value + side * step))
                for node, (value, step) in zip(nodes, steps, strict=True)
            }
        except InvalidNode:
            return None
        if any(cast(ProgramLeaf, copies[id(node)]).profiled is not node.profiled for node in nodes):
            return None
        tapes.append(compile_tape([_with_leaves(run, copies) for run in runs], np.float64))
    difference = tapes[1].data - tapes[0].data
    if not _alike(*tapes) or difference[: tapes[0].headers[0]].any():
        return None
    found: dict[int, _Tangent] = {}
    ends = [*tapes[0].headers[1:], len(tapes[0].data)]
    for run, start, header, end in zip(runs, starts, tapes[0].headers.tolist(), ends, strict=True):
        size = (end - header - 1) // len(run.primitives)
        for number, placed in enumerate(run.primitives):
            place = owners.get(id(placed.primitive))
            if place in found:
                return None
            if place is not None:
                first = 1 + number * size
                texels = difference[header + first : header + first + size] / (2.0 * steps[place][1])
                found[place] = _Tangent(columns[place], base, start + first, texels)
    return list(found.values())


def _changed(node: ProgramNode, name: str, value: object) -> ProgramNode:
    """Return a node with another value of a parameter."""
    return replace(node, **{name: value})  # type: ignore[type-var]  # every node is a dataclass


def _with_leaves(run: Run, copies: dict[int, ProgramNode]) -> Run:
    """Return a run with copies in place of some primitives."""
    primitives = [
        placed._replace(primitive=cast(ProgramLeaf, copies.get(id(placed.primitive), placed.primitive)))
        for placed in run.primitives
    ]
    return replace(run, primitives=primitives)


def _of_one(
    tree: ImplicitModel, parameter: NumericParameter, column: int, base: Tape, *, stretched: bool
) -> _Tangent:
    """Return the tangent of any parameter: the difference of two tapes of the whole tree.

    Where a macro changes its tree at the parameter's value, such as a polygon its triangles, tapes on the two
    sides differ by more than a small step. Then the difference is taken on the side where it is smallest.
    """
    value, step = _steps(tree, parameter)
    best: tuple[float, _Tangent] | None = None
    for low, high in SIDES:
        try:
            ends = [with_numeric_values(tree, [parameter], [value + side * step]) for side in (low, high)]
            first, second = (compile_tape(_program(end, stretched=stretched), np.float64) for end in ends)
        except InvalidNode:
            continue
        if not _alike(first, second):
            continue
        texels = (second.data - first.data) / ((high - low) * step)
        beside = base if _near(base, first, step) else replace(first, data=0.5 * (first.data + second.data))
        steepest = float(np.abs(texels).max())
        if best is None or steepest < best[0]:
            best = steepest, _Tangent(column, beside, 0, texels)
        if _near(first, second, step):
            break
    if best is None:
        raise InvalidNode(f"{parameter}: expected a parameter that can change a little, got {value:g}")
    return best[1]


def _near(first: Tape, second: Tape, step: float) -> bool:
    """Return True if tapes are alike, and no number of one is far from that of the other."""
    if not _alike(first, second):
        return False
    change = np.abs(second.data - first.data)
    return not (change > np.maximum(1e-3 * np.abs(first.data), 100.0 * step)).any()


def _alike(first: Tape, second: Tape) -> bool:
    """Return True if two tapes hold the same instructions, and differ in parameters alone."""
    if first.data.shape != second.data.shape or first.instruction_set is not second.instruction_set:
        return False
    if not np.array_equal(first.headers, second.headers):
        return False
    return np.array_equal(first.data[first.headers, :3], second.data[second.headers, :3])
