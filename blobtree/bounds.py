"""Boxes outside of which a tree's field is exactly 0."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import affine
from .operators import DIFFERENCE, INTERSECTION, Operator
from .program import PlacedPrimitive, Pop, Push, compile_program

if TYPE_CHECKING:
    from .tree import Node

Box = tuple[NDArray[np.float64], NDArray[np.float64]]

EMPTY: Box = (np.full(3, np.inf), np.full(3, -np.inf))


def influence_bounds(root: "Node") -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lower and upper corner (3,) of the box of influence of `root`, rounded outward.

    The tree's program, run over boxes in place of numbers. A tree that is empty everywhere has the box of
    its first primitive, so that there is always a place to look at.
    """
    program = compile_program(root)
    box = EMPTY
    registers: dict[int, Box] = {}
    for step in program:
        match step:
            case Push(register):
                registers[register], box = box, EMPTY
            case Pop(register, operator, _, swapped):
                left, right = (box, registers[register]) if swapped else (registers[register], box)
                box = _combine(operator, left, right)
            case _:
                for placed in step.primitives:
                    box = _combine(step.operator, box, primitive_box(placed))
    if np.any(box[0] > box[1]):
        box = primitive_box(next(step.primitives[0] for step in program if not isinstance(step, Push | Pop)))
    lower, upper = (corner.astype(np.float32) for corner in box)
    return np.nextafter(lower, np.float32(-np.inf)), np.nextafter(upper, np.float32(np.inf))


def primitive_box(placed: PlacedPrimitive) -> Box:
    """Box of a ball swept over the primitive's skeleton, under its map."""
    points = affine.apply(placed.matrix, placed.primitive.control_points)
    margin = placed.primitive.influence * np.linalg.norm(placed.matrix[:3, :3], axis=1)
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _combine(operator: Operator, left: Box, right: Box) -> Box:
    """Where the combination of two fields can differ from 0."""
    if operator is DIFFERENCE:
        return left
    if operator is INTERSECTION:
        return np.maximum(left[0], right[0]), np.minimum(left[1], right[1])
    return np.minimum(left[0], right[0]), np.maximum(left[1], right[1])
