"""Attributes of leaves at points, blended with the weights of colours; and rest coordinates.

Both read a copy of the tape. For an attribute, the texels of colours hold its values, so that the evaluation
of colours blends them. For rest coordinates, they hold indices of maps to the primitives' own spaces.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array, Float64Array
from blobtree.declare.skeleton import Skeleton
from blobtree.errors import InvalidNode
from blobtree.tape.data_region import DataRegion
from blobtree.tape.model import colors_at, evaluate
from blobtree.tape.program import Instruction, Run, distinct_placements
from blobtree.tape.rest_kernels import evaluate_rest_coordinates
from blobtree.tape.tape import Tape
from blobtree.validation import LARGEST_NUMBER, LIMIT, real

CHANNELS = 3
"""Numbers that a texel of colour holds."""

AttributeValues = Sequence[float | tuple[float, ...] | str | None]


def attribute_names(program: list[Instruction]) -> list[str]:
    """Return the names of all attributes of the leaves of a program, sorted."""
    return sorted({name for own in _attributes(program) for name in own})


def attribute_at(
    tape: Tape,
    program: list[Instruction],
    name: str,
    points: Float32Array,
    default: float | ArrayLike | str | None,
) -> NDArray[Any]:
    """Return an attribute at `points` (n, 3): blended numbers (n,) or vectors (n, k), or labels (n,).

    `default` is the value of leaves that have none, and outside all influences.

    Raises
    ------
    InvalidNode
        No leaf has the attribute, its values differ in type or length, or the default has another type.
    """
    values = _values(program, name)
    given = next(value for value in values if value is not None)
    if isinstance(given, str):
        if default is not None and not isinstance(default, str):
            raise InvalidNode(f"default: expected a label for {name!r}, got {default!r}")
        return _labels_at(tape, program, values, points, default or "")
    size = len(given) if isinstance(given, tuple) else 1
    base = np.broadcast_to(_numbers(default, size), size)
    channels = np.zeros((len(values), CHANNELS))
    for row, value in zip(channels, values, strict=True):
        row[:size] = 0.0 if value is None else np.subtract(value, base)
    blended = colors_at(_with_channels(tape, program, channels), points)[:, :size] + base.astype(np.float32)
    return blended if isinstance(given, tuple) else blended[:, 0]


def _values(program: list[Instruction], name: str) -> AttributeValues:
    """Return the value of an attribute for each leaf of a program, None for leaves without it."""
    values = [own.get(name) for own in _attributes(program)]
    sizes = {_type_name(value) for value in values if value is not None}
    if not sizes:
        known = ", ".join(attribute_names(program)) or "none"
        raise InvalidNode(f"name: expected an attribute of a primitive in the tree ({known}), got {name!r}")
    if len(sizes) > 1:
        raise InvalidNode(
            f"attribute {name!r}: expected values of one type, got {' and '.join(sorted(sizes))}; "
            "use another name for one of them"
        )
    return values


def _numbers(default: Any, size: int) -> NDArray[np.float64]:
    """Return the default of an attribute as one number or `size` numbers."""
    try:
        numbers = np.asarray(real(0.0 if default is None else default), np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty((0, 0))
    if numbers.shape not in ((), (size,)) or not (np.abs(numbers) <= LARGEST_NUMBER).all():
        raise InvalidNode(f"default: expected a number, or {size} of them, got {default!r}; {LIMIT}")
    return numbers


def _labels_at(
    tape: Tape, program: list[Instruction], values: AttributeValues, points: ArrayLike, default: str
) -> NDArray[np.str_]:
    """Return the label (n,) with the largest weight at `points` (n, 3); `default` outside all influences."""
    own = [default if value is None else str(value) for value in values]
    labels = sorted(set(own))
    places = np.array([labels.index(label) for label in own])
    shares: list[Float32Array] = []
    for first in range(0, len(labels), CHANNELS):
        channels = (places[:, None] == first + np.arange(CHANNELS)).astype(np.float64)
        shares.append(colors_at(_with_channels(tape, program, channels), points))
    weights = np.concatenate(shares, axis=1)[:, : len(labels)]
    chosen = np.array(labels)[weights.argmax(axis=1)]
    return np.where(weights.max(axis=1) > 0.0, chosen, default)


def rest_tape(tape: Tape, program: list[Instruction], to_rest: Float64Array | None = None) -> Tape:
    """Return a tape with maps of leaves in its data region, for `rest_kernels.own_position`.

    The maps lead to the leaves' own spaces, or where `to_rest` (leaves, 4, 4) leads from there.
    """
    region, indices = DataRegion(), np.full(len(_attributes(program)), -1.0)
    first = 0
    for run in (step for step in program if isinstance(step, Run)):
        count = len(run.primitives)
        folded = isinstance(run.kind, Skeleton) and not run.stretched  # others carry their maps
        placements, placed_by = distinct_placements(run.primitives)
        if folded and to_rest is None:
            maps = [region.add(np.linalg.inv(placement.matrix)[:3]) for placement in placements]
            indices[first : first + count] = tape.start + np.array(maps)[placed_by]
        elif to_rest is not None:
            own = np.linalg.inv([placement.matrix for placement in placements])[placed_by]
            part = to_rest[first : first + count]
            ways = part @ own if folded else part
            indices[first : first + count] = [tape.start + region.add(way[:3]) for way in ways]
        first += count
    channels = np.pad(indices[:, None], ((0, 0), (0, CHANNELS - 1)))
    indexed, moved = _with_channels(tape, program, channels), len(region.texels)
    data = np.insert(indexed.data, tape.start, region.texels, axis=0)
    return replace(indexed, data=data, start=tape.start + moved, headers=tape.headers + moved)


def rest_coordinates_at(tape: Tape, points: ArrayLike) -> Float32Array:
    """Return blended rest coordinates (n, 3) at `points` (n, 3), NaN where the field is 0."""
    return evaluate(evaluate_rest_coordinates, tape, points)[:, 1:]


def _with_channels(tape: Tape, program: list[Instruction], channels: Float64Array) -> Tape:
    """Return a tape whose texels of colour hold other numbers (leaves, 3), the last texel of each leaf."""
    data = tape.data.copy()
    ends = [*tape.headers[1:].tolist(), len(data)]
    first = 0
    for step, header, end in zip(program, tape.headers.tolist(), ends, strict=True):
        if isinstance(step, Run):
            count = len(step.primitives)
            stride = (end - header - 1) // count
            data[header + stride * np.arange(1, count + 1), :CHANNELS] = channels[first : first + count]
            first += count
    return replace(tape, data=data)


def _attributes(program: list[Instruction]) -> list[Mapping[str, float | tuple[float, ...] | str]]:
    """Return the attributes of each leaf of a program; a leaf need not have any."""
    runs = [step for step in program if isinstance(step, Run)]
    return [getattr(placed.primitive, "attributes", {}) for run in runs for placed in run.primitives]


def _type_name(value: float | tuple[float, ...] | str) -> str:
    if isinstance(value, str):
        return "labels"
    return f"vectors of {len(value)}" if isinstance(value, tuple) else "numbers"
