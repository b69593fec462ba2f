"""Node trees in plain float64 NumPy, by recursion over their structure: no program, no tape, no interpreter.

Colours are folded from left to right with the weights |∂F/∂a|·a and |∂F/∂b|·b. In a sum and a Ricci blend
these are aⁿ and bⁿ over a common divisor, and union and intersection choose one operand: so the order of a
fold does not matter, save on exact ties of a union or an intersection. A difference has an order of its own.
"""

from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import Difference, Intersection, Node, Point, Ricci, Segment, Sum, Transform, Union

Floats = NDArray[np.float64]

RIM = np.sqrt(1.0 - 0.5 ** (1.0 / 3.0))


@dataclass(frozen=True)
class Field:
    """Value (n,), colour (n, 3), and how far (n,), in field values, the next kink of an operator is away."""

    value: Floats
    color: Floats
    margin: Floats


def evaluate(node: Node, points: ArrayLike) -> Field:
    """The field of `node` at `points` (n, 3)."""
    q = np.asarray(points, np.float64)
    match node:
        case Point(center=center, radius=radius, color=color):
            return _leaf(q - np.array(center), radius, color)
        case Segment(start=start, end=end, radius=radius, color=color):
            return _leaf(q - _closest_on_segment(q, np.array(start), np.array(end)), radius, color)
        case Transform(child=child, matrix=matrix):
            linear, offset = np.array(matrix)[:, :3], np.array(matrix)[:, 3]
            return evaluate(child, np.linalg.solve(linear, (q - offset).T).T)
        case Difference(solid=solid, tool=tool):
            return _difference(evaluate(solid, q), evaluate(tool, q))
        case Sum(operands=operands):
            return reduce(lambda a, b: _ricci(a, b, 1.0), [evaluate(operand, q) for operand in operands])
        case Ricci(operands=operands, exponent=exponent):
            return reduce(lambda a, b: _ricci(a, b, exponent), [evaluate(operand, q) for operand in operands])
        case Union(operands=operands):
            return reduce(lambda a, b: _choose(a, b, a.value >= b.value), [evaluate(x, q) for x in operands])
        case Intersection(operands=operands):
            return reduce(lambda a, b: _choose(a, b, a.value <= b.value), [evaluate(x, q) for x in operands])
    raise TypeError(type(node))


def value(node: Node, points: ArrayLike) -> Floats:
    """The field's values (n,)."""
    return evaluate(node, points).value


def gradient(node: Node, points: ArrayLike, step: float = 1e-6) -> Floats:
    """Central differences (n, 3)."""
    q = np.asarray(points, np.float64)
    shifts = step * np.eye(3)
    sides = [(value(node, q + shift) - value(node, q - shift)) / (2.0 * step) for shift in shifts]
    return np.stack(sides, axis=1)


def _leaf(offset: Floats, radius: float, color: Any) -> Field:
    squared = (offset**2).sum(axis=1) * (RIM / radius) ** 2
    count = len(offset)
    return Field(
        np.maximum(1.0 - squared, 0.0) ** 3, np.tile(np.array(color), (count, 1)), np.full(count, np.inf)
    )


def _closest_on_segment(q: Floats, start: Floats, end: Floats) -> Floats:
    axis = end - start
    squared = float(axis @ axis)
    share = np.clip((q - start) @ axis / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(q))
    closest: Floats = start + share[:, None] * axis
    return closest


def _ricci(a: Field, b: Field, exponent: float) -> Field:
    larger = np.maximum(a.value, b.value)
    safe = np.where(larger > 0.0, larger, 1.0)
    powers = (a.value / safe) ** exponent, (b.value / safe) ** exponent
    total = powers[0] + powers[1]
    weights = [power / np.where(total > 0.0, total, 1.0) for power in powers]
    weights[0] = np.where(total > 0.0, weights[0], 1.0)
    return Field(larger * total ** (1.0 / exponent), _mixed(a, b, *weights), np.minimum(a.margin, b.margin))


def _choose(a: Field, b: Field, takes_a: NDArray[np.bool_]) -> Field:
    winner = np.where(takes_a, a.value, b.value)
    tie = np.abs(a.value - b.value)
    tie[(a.value == 0.0) & (b.value == 0.0)] = np.inf
    margin = np.minimum(np.minimum(a.margin, b.margin), tie)
    return Field(winner, np.where(takes_a[:, None], a.color, b.color), margin)


def _difference(a: Field, b: Field) -> Field:
    top = np.maximum(a.value, 1.0)
    complement = top - b.value * (2.0 * top - 1.0)
    keeps = (a.value < complement) | (b.value == 0.0)
    above = a.value > 1.0
    slope_a = np.where(keeps, 1.0, np.where(above, 1.0 - 2.0 * b.value, 0.0))
    slope_b = np.where(keeps, 0.0, np.where(above, 1.0 - 2.0 * a.value, -1.0))
    weight_a, weight_b = np.abs(slope_a) * a.value, np.abs(slope_b) * b.value
    result = np.where(keeps, a.value, np.maximum(complement, 0.0))
    kinks = np.minimum(np.abs(a.value - complement), np.minimum(np.abs(complement), np.abs(a.value - 1.0)))
    kinks[b.value == 0.0] = np.inf
    total = weight_a + weight_b
    total[total == 0.0] = 1.0
    color = _mixed(a, b, weight_a / total, weight_b / total)
    return Field(result, color, np.minimum(np.minimum(a.margin, b.margin), kinks))


def _mixed(a: Field, b: Field, weight_a: Floats, weight_b: Floats) -> Floats:
    mixed: Floats = a.color * weight_a[:, None] + b.color * weight_b[:, None]
    return mixed
