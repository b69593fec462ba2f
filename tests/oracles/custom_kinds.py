"""The custom kinds of `tests/blobtree/custom_kinds.py` in float64 NumPy, by geometry and not by code.

A skeleton gives closest points (n, 3) and how far (n,) the next place with two of them is; an operator its
value, its partial derivatives, and how far, in field values, its next kink is.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def ring(q: Floats, center: Any, axis: Any, size: float) -> tuple[Floats, Floats]:
    normal = np.array(axis) / np.linalg.norm(axis)
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    x, y = (q - center) @ first, (q - center) @ second
    angle = np.arctan2(y, x)
    around = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    return np.array(center) + size * around, np.hypot(x, y)


def brick(q: Floats, middle: Any, sides: Any) -> tuple[Floats, Floats]:
    halves = 0.5 * np.abs(sides)
    return np.clip(q, np.array(middle) - halves, np.array(middle) + halves), np.full(len(q), np.inf)


def path(q: Floats, a: Any, b: Any, c: Any) -> tuple[Floats, Floats]:
    """By dense search along both parts, refined around the best place."""
    found = []
    for start, end in ((a, b), (b, c)):
        start, way = np.array(start), np.array(end) - np.array(start)
        low, high = np.zeros(len(q)), np.ones(len(q))
        for _ in range(100):
            third = (high - low) / 3.0
            ahead = _away(q, start, way, low + third) >= _away(q, start, way, high - third)
            low, high = np.where(ahead, low + third, low), np.where(ahead, high, high - third)
        found.append(start + (0.5 * (low + high))[:, None] * way)
    distances = [np.linalg.norm(q - point, axis=1) for point in found]
    nearer = distances[0] <= distances[1]
    apart = np.linalg.norm(found[0] - found[1], axis=1)
    clearance = np.where(apart < 1e-6, np.inf, np.abs(distances[0] - distances[1]))
    return np.where(nearer[:, None], *found), clearance


def _away(q: Floats, start: Floats, way: Floats, t: Floats) -> Floats:
    distance: Floats = np.linalg.norm(q - start - t[:, None] * way, axis=1)
    return distance


def soft(a: Floats, b: Floats, hardness: float) -> tuple[Floats, Floats, Floats, Floats]:
    root = np.sqrt((a - b) ** 2 + hardness * a * b)
    safe = np.where(root > 0.0, root, 1.0)
    by_a = np.where(root > 0.0, 0.5 + 0.5 * (a - b + 0.5 * hardness * b) / safe, 1.0)
    by_b = np.where(root > 0.0, 0.5 + 0.5 * (b - a + 0.5 * hardness * a) / safe, 0.0)
    kink = root if hardness < 0.1 else np.full(len(a), np.inf)
    return 0.5 * (a + b + root), by_a, by_b, kink


def carve(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    rest = np.maximum(1.0 - b, 0.0)
    return a * rest**2, rest**2, -2.0 * a * rest, np.full(len(a), np.inf)


def shared(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    total = np.where(a + b > 0.0, a + b, 1.0)
    nothing = (a == 0.0) | (b == 0.0)
    by_a, by_b = (np.where(nothing, 0.0, 2.0 * (x / total) ** 2) for x in (b, a))
    return 2.0 * a * b / total, by_a, by_b, np.full(len(a), np.inf)


def mean(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    half = np.full(len(a), 0.5)
    return 0.5 * (a + b), half, half, np.full(len(a), np.inf)


def swell(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    value = np.hypot(a, b)
    safe = np.where(value > 0.0, value, 1.0)
    return value, a / safe, b / safe, np.full(len(a), np.inf)


def stew(
    a: Floats, b: Floats, left: float, right: float, both: float, less_left: float, less_right: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """The partial derivatives by central differences."""

    def value(a: Floats, b: Floats) -> Floats:
        return left * a + right * b + both * a * b / (1.0 + less_left * a + less_right * b)

    step = 1e-5
    by_a = (value(a + step, b) - value(a - step, b)) / (2.0 * step)
    by_b = (value(a, b + step) - value(a, b - step)) / (2.0 * step)
    return value(a, b), by_a, by_b, np.full(len(a), np.inf)


CLOSEST: dict[str, Callable[..., tuple[Floats, Floats]]] = {"ring": ring, "brick": brick, "path": path}
OPERATORS: dict[str, Callable[..., tuple[Floats, Floats, Floats, Floats]]] = {
    "soft": soft,
    "carve": carve,
    "shared": shared,
    "mean": mean,
    "swell": swell,
    "stew": stew,
}
