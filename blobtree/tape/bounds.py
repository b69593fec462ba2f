"""Boxes outside of which a tree's field is exactly 0."""

from itertools import product
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Box, Float32Array
from blobtree.declare.claims import OperatorRow, Support
from blobtree.declare.field import FieldKind
from blobtree.declare.skeleton import Skeleton
from blobtree.tape.program import (
    EnterWarp,
    Instruction,
    LeaveWarp,
    PlacedPrimitive,
    Pop,
    ProgramPrimitive,
    Push,
    Run,
    distinct_placements,
    grown_fields,
    support_radii,
)
from blobtree.validation import LARGEST_NUMBER

ENDLESS = 1e30
"""Coordinate of a side of a box that lies nowhere: the field goes on there without end."""

TURN_ROUNDING = 1e-12
"""Entry of a map, over its largest one, below which it moves no side of an endless box."""

EMPTY: Box = (np.full(3, np.inf), np.full(3, -np.inf))


def support_box(program: list[Instruction]) -> tuple[Float32Array, Float32Array]:
    """Return lower and upper corner (3,) of the support of a tree, rounded outward.

    The program runs over boxes in place of numbers. A tree that is empty everywhere has the box of its first
    primitive, without the warps around it, so that views always have a box to frame.
    """
    box, fallback, _ = _boxes(program)
    if np.any(box[0] > box[1]) and fallback is not None:
        box = fallback
    lower, upper = (corner.astype(np.float32) for corner in box)
    return np.nextafter(lower, np.float32(-np.inf)), np.nextafter(upper, np.float32(np.inf))


def warp_parameters(program: list[Instruction]) -> dict[int, tuple[float, ...]]:
    """Return the parameters of warps by ``id(entry)`` of their instructions `EnterWarp`.

    A warp with `SpaceWarp.room` has more of them than its node states.

    Raises
    ------
    InvalidNode
        A warp has no room for what it contains.
    """
    entries = [step for step in program if isinstance(step, EnterWarp)]
    boxes = _boxes(program)[2] if any(entry.warp.room for entry in entries) else {}
    return {
        id(entry): entry.parameters + entry.warp.room(*boxes[id(entry)], entry.parameters)
        if entry.warp.room
        else entry.parameters
        for entry in entries
    }


def _boxes(program: list[Instruction]) -> tuple[Box, Box | None, dict[int, Box]]:
    """Return the box of a tree, that of its first primitive, and the boxes within warps by ``id(entry)``."""
    box = EMPTY
    registers: dict[int, Box] = {}
    fallback: Box | None = None
    inner: dict[int, Box] = {}
    for step in program:
        match step:
            case Push(register):
                registers[register], box = box, EMPTY
            case Pop(register, operator, _, swapped):
                left, right = (box, registers[register]) if swapped else (registers[register], box)
                box = _combine(operator, left, right)
            case Run(kind=kind, primitives=primitives, operator=operator):
                direct = isinstance(kind, FieldKind)
                boxes = field_boxes(primitives) if direct else primitive_boxes(primitives)
                fallback = fallback or (boxes[0][0], boxes[1][0])
                box = _combine_all(operator, box, boxes)
            case LeaveWarp(entry):
                inner[id(entry)] = box
                box = _warped(box, entry)
    return box, fallback, inner


def primitive_boxes(primitives: list[PlacedPrimitive]) -> Box:
    """Return boxes (n, 3), (n, 3) of balls swept over the primitives' skeletons, under their maps.

    Raises
    ------
    InvalidNode
        An offset leaves nothing of a primitive, or a width is too small.
    """
    leaves = cast("list[ProgramPrimitive]", [placed.primitive for placed in primitives])
    points = leaves[0].hulls(leaves)
    placements, placed_by = distinct_placements(primitives)
    matrices = np.array([placement.matrix for placement in placements])[placed_by]
    reaches = support_radii(primitives).max(axis=1)
    placed_points = np.einsum("nij,nkj->nki", matrices[:, :3, :3], points) + matrices[:, None, :3, 3]
    margins = reaches[:, None] * np.linalg.norm(matrices[:, :3, :3], axis=2)
    return placed_points.min(axis=1) - margins, placed_points.max(axis=1) + margins


def field_boxes(placed_fields: list[PlacedPrimitive]) -> Box:
    """Return boxes (n, 3), (n, 3) around the supports of direct fields, under their maps.

    Raises
    ------
    InvalidNode
        A field has an offset and cannot grow, or nothing is left of it.
    """
    leaves = grown_fields(placed_fields)
    lower, upper = leaves[0].boxes(leaves)
    matrices = np.array([placed.placement.matrix for placed in placed_fields])
    linear, offset = matrices[:, :3, :3], matrices[:, :3, 3]
    middle = np.einsum("nij,nj->ni", linear, 0.5 * (lower + upper)) + offset
    half = np.einsum("nij,nj->ni", np.abs(linear), 0.5 * (upper - lower))
    return middle - half, middle + half


def leaf_boxes(program: list[Instruction]) -> Box:
    """Return boxes (n, 3), (n, 3) around the supports of the leaves of a tree, without warps."""
    boxes = [
        primitive_boxes(run.primitives) if isinstance(run.kind, Skeleton) else field_boxes(run.primitives)
        for run in program
        if isinstance(run, Run)
    ]
    return np.concatenate([lower for lower, _ in boxes]), np.concatenate([upper for _, upper in boxes])


def _combine_all(operator: OperatorRow, box: Box, boxes: Box) -> Box:
    """Return a box combined with many, one after the other."""
    if operator.support is Support.LEFT:
        return box
    if operator.support is Support.COMMON:
        return _combine(operator, box, (boxes[0].max(axis=0), boxes[1].min(axis=0)))
    return _combine(operator, box, (boxes[0].min(axis=0), boxes[1].max(axis=0)))


def _warped(box: Box, entry: EnterWarp) -> Box:
    """Return the outer box around a box below a warp; an empty box stays empty."""
    if np.any(box[0] > box[1]):
        return box
    lower, upper = entry.warp.box(*box, entry.parameters)
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    matrix = entry.placement.matrix
    if is_endless((lower, upper)):
        matrix = np.where(np.abs(matrix) < TURN_ROUNDING * np.abs(matrix).max(), 0.0, matrix)
    placed = corners @ matrix[:3, :3].T + matrix[:3, 3]
    return placed.min(axis=0).clip(-ENDLESS, ENDLESS), placed.max(axis=0).clip(-ENDLESS, ENDLESS)


def is_endless(box: tuple[NDArray[Any], NDArray[Any]]) -> bool:
    """Return True if a side of a box lies beyond all numbers that models may have."""
    return bool(max(-box[0].min(), box[1].max()) > LARGEST_NUMBER)


def _combine(operator: OperatorRow, left: Box, right: Box) -> Box:
    """Return the box in which the combination of two fields can differ from 0."""
    if operator.support is Support.LEFT:
        return left
    if operator.support is Support.COMMON:
        return np.maximum(left[0], right[0]), np.minimum(left[1], right[1])
    return np.minimum(left[0], right[0]), np.maximum(left[1], right[1])
