"""Expressions in float64, clause by clause: a reader of the text and formulas of their own."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import Expression

Floats = NDArray[np.float64]

VALUES: dict[str, Callable[..., Any]] = {
    "neg": lambda a: -a,
    "abs": np.abs,
    "square": lambda a: a * a,
    "sqrt": lambda a: np.sqrt(np.maximum(a, 0.0)),
    "recip": lambda a: 1.0 / a,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": lambda a: np.arcsin(np.clip(a, -1.0, 1.0)),
    "acos": lambda a: np.arccos(np.clip(a, -1.0, 1.0)),
    "atan": np.arctan,
    "exp": np.exp,
    "ln": lambda a: np.log(np.maximum(a, 1e-18)),
    "floor": np.floor,
    "ceil": np.ceil,
    "round": lambda a: np.sign(a) * np.floor(np.abs(a) + 0.5),
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "min": np.minimum,
    "max": np.maximum,
    "hypot": np.hypot,
    "atan2": np.arctan2,
    "mod": lambda a, b: a - np.abs(b) * np.floor(a / np.abs(b)),
    "compare": lambda a, b: np.sign(a - b),
    "pow": lambda a, b: np.where(b == np.round(b), np.power(a, b), np.power(np.maximum(a, 0.0), b)),
    "nth-root": lambda a, n: np.where(n % 2.0 == 1.0, np.sign(a), a >= 0.0) * np.abs(a) ** (1.0 / n),
}
"""What operations return, of numbers below 0 too where the node says so."""

KINKS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "min": lambda a, b: np.abs(a - b),
    "max": lambda a, b: np.abs(a - b),
    "sqrt": np.abs,
    "hypot": np.hypot,
}
"""How far an operand is from a kink."""


def values(lines: Iterable[str], points: Floats) -> tuple[Floats, Floats]:
    """The values (n,) of a text at points (n, 3), and how far, in values, the next kink is."""
    known: dict[str, Any] = {}
    margin = np.full(len(points), np.inf)
    last: Any = np.nan
    with np.errstate(all="ignore"):
        for line in lines:
            name, operation, *operands = line.split()
            if operation.startswith("var-"):
                last = points[:, "xyz".index(operation[4])]
            elif operation == "const":
                last = float(operands[0])
            else:
                read = [known[operand] for operand in operands]
                last = VALUES[operation](*read)
                if operation in KINKS:
                    margin = np.minimum(margin, KINKS[operation](*read))
            known[name] = last
    return np.broadcast_to(last, len(points)) + np.zeros(len(points)), margin


def distances(node: Expression, points: Floats) -> tuple[Floats, Floats]:
    """The larger one of the value and of the distance from the box, and how far the next kink is."""
    value, margin = values(node.clauses, points)
    beyond = np.abs(points - np.array(node.center)) - 0.5 * np.array(node.size)
    box = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    ordered = np.sort(beyond, axis=1)
    edges = np.minimum(ordered[:, 2] - ordered[:, 1], np.abs(beyond).min(axis=1))
    inside_box = np.where(value > box, np.inf, edges)
    return np.maximum(value, box), np.minimum(np.minimum(margin, np.abs(value - box)), inside_box)
