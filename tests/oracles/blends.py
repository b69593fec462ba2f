"""The blends of the library in float64 NumPy, by the formulas of the papers and not by the product's.

Each is a function of the operands' values and the node's parameters. `kink` returns how far, in field values,
the next kink of it is.
"""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def superelliptic(a: Floats, b: Floats, width: float, exponent: float) -> Floats:
    """Rockwood's sum of powers, scaled so that an operand alone is itself."""
    x, y = (np.maximum(1.0 - (0.5 - f) / width, 0.0) for f in (a, b))
    larger = np.maximum(np.maximum(x, y), 1e-300)
    norm = larger * ((x / larger) ** exponent + (y / larger) ** exponent) ** (1.0 / exponent)
    return np.where((x > 0.0) | (y > 0.0), 0.5 + width * (norm - 1.0), np.maximum(a, b))


def signed(f: Floats) -> Floats:
    """A function that is 0 on the surface, for R-functions."""
    return np.where(f < 0.5, 1.0 - 0.5 / np.maximum(f, 1e-100), 2.0 * f - 1.0)


def unsigned(z: Floats) -> Floats:
    return np.where(z < 0.0, 0.5 / (1.0 - np.minimum(z, 0.0)), 0.5 + 0.5 * z)


def r_join(x: Floats, y: Floats) -> Floats:
    """x + y + √(x² + y²), for far negative numbers by the conjugate."""
    low, high, length = np.minimum(x, y), np.maximum(x, y), np.hypot(x, y)
    one_negative = high + high * (high / np.maximum(length - low, 1e-300))
    negative = np.where(high < 0.0, low, -1.0)
    both_negative = 2.0 * high / np.where(high < 0.0, (low + high - length) / negative, 1.0)
    plain = x + y + length
    return np.where(high < 0.0, both_negative, np.where(low < 0.0, one_negative, plain))


def r_union(a: Floats, b: Floats) -> Floats:
    joined = unsigned(r_join(signed(a), signed(b)))
    return np.where((a <= 0.0) | (b <= 0.0), np.maximum(a, b), joined)


def r_intersection(a: Floats, b: Floats) -> Floats:
    met = unsigned(-r_join(-signed(a), -signed(b)))
    return np.where((a <= 0.0) | (b <= 0.0), 0.0, met)


def r_difference(a: Floats, b: Floats) -> Floats:
    met = unsigned(-r_join(-signed(a), signed(b)))
    return np.where(b <= 0.0, a, np.where(a <= 0.0, 0.0, met))


def rounded_minimum(a: Floats, b: Floats, k: Floats) -> Floats:
    """Quilez's polynomial minimum, as the minimum less a parabola."""
    depth = np.maximum(1.0 - np.abs(a - b) / np.maximum(k, 1e-300), 0.0)
    smaller: Floats = np.minimum(a, b) - 0.25 * k * depth**2
    return smaller


def smooth_intersection(a: Floats, b: Floats, width: float) -> Floats:
    return rounded_minimum(a, b, _harmonic(width, 0.5 * (a + b)))


def smooth_difference(a: Floats, b: Floats, width: float) -> Floats:
    top = np.maximum(a, 1.0)
    rest = np.maximum(top - b * (2.0 * top - 1.0), 0.0)
    return rounded_minimum(a, rest, _harmonic(width, 0.5 * (a + rest), 0.5 * b))


def clean_union(a: Floats, b: Floats) -> Floats:
    k = 2.0 * _harmonic(np.abs(0.5 - a), np.abs(0.5 - b), a, b)
    depth = np.maximum(1.0 - np.abs(a - b) / np.maximum(k, 1e-300), 0.0)
    larger: Floats = np.maximum(a, b) + 0.25 * k * depth**2
    return larger


def _harmonic(*terms: Any) -> Floats:
    """The reciprocal of the sum of reciprocals, 0 if a term is."""
    smallest = np.min(np.broadcast_arrays(*terms), axis=0)
    total: Floats = sum(1.0 / np.maximum(term, 1e-100) for term in terms)
    return np.where(smallest > 0.0, 1.0 / total, 0.0)


def controllable(a: Floats, b: Floats, left_angle: float, right_angle: float) -> Floats:
    """By bisection: the level C whose line of two rays and an elliptical arc passes through (a, b)."""
    t, s = np.tan(np.radians(left_angle)), np.tan(np.radians(right_angle))
    low, high = np.maximum(a, b), a + b + 1e-300
    for _ in range(60):
        c = 0.5 * (low + high)
        x, y = np.maximum(a - s * c, 0.0) / (1.0 - s), np.maximum(b - t * c, 0.0) / (1.0 - t)
        outside = x**2 + y**2 > c**2
        low, high = np.where(outside, c, low), np.where(outside, high, c)
    return 0.5 * (low + high)


def arc_union(a: Floats, b: Floats, left: float, right: float) -> Floats:
    return controllable(a, b, *np.degrees(np.arctan([left, right])))


def arc_intersection(a: Floats, b: Floats, left: float, right: float) -> Floats:
    """By bisection: the level C whose line of two rays and an elliptical arc passes through (a, b)."""
    low, high = np.zeros_like(a), np.minimum(a, b)
    for _ in range(60):
        c = 0.5 * (low + high)
        x, y = np.maximum(right * c - a, 0.0) / (right - 1.0), np.maximum(left * c - b, 0.0) / (left - 1.0)
        inside = x**2 + y**2 <= c**2
        low, high = np.where(inside, c, low), np.where(inside, high, c)
    return 0.5 * (low + high)


def arc_difference(a: Floats, b: Floats, left: float, right: float) -> Floats:
    """Up to ½ the intersection with the complement; above, the complement of a union of complements."""
    top = np.maximum(a, 1.0)
    rest = np.maximum(top - b * (2.0 * top - 1.0), 0.0)
    met = arc_intersection(a, rest, left, right)
    cut = top - arc_union(top - a, top - rest, 2.0 - left, 2.0 - right)
    return np.where(b <= 0.0, a, np.where(met <= 0.5, met, cut))


def masked(a: Floats, b: Floats) -> Floats:
    t = np.minimum(2.0 * b, 1.0)
    shown: Floats = a * t**2 * (3.0 - 2.0 * t)
    return shown


def unmasked(a: Floats, b: Floats) -> Floats:
    shown: Floats = a * (1.0 - smoothstep(2.0 * b))
    return shown


def opening(towards_a: Floats, towards_b: Floats, start_angle: float, full_angle: float) -> Floats:
    """tan(π/4 − θ) from gradients (n, 3): the angle by its cosine, faded where one is far shorter."""
    lengths = np.linalg.norm(towards_a, axis=1), np.linalg.norm(towards_b, axis=1)
    shorter, longer = np.minimum(*lengths), np.maximum(*lengths)
    product = np.maximum(lengths[0] * lengths[1], 1e-200)
    degrees = np.degrees(np.arccos(np.clip((towards_a * towards_b).sum(axis=1) / product, -1.0, 1.0)))
    theta = 0.25 * np.pi * (1.0 - smoothstep((degrees - start_angle) / (full_angle - start_angle)))
    faded: Floats = smoothstep(32.0 * shorter / np.maximum(longer, 1e-100)) * np.tan(0.25 * np.pi - theta)
    return faded


def smoothstep(t: Floats) -> Floats:
    x = np.clip(t, 0.0, 1.0)
    return x**2 * (3.0 - 2.0 * x)


def opened(a: Floats, b: Floats, opening: Floats) -> Floats:
    """The larger operand and a parabola, which ends at the rays b/a = (1 − o)/(1 + o), inside earlier."""
    k = opening * (a + b)
    for f in (a, b):
        k = k * np.where(f > 0.5, np.maximum(1.0 - (2.0 * f - 1.0) ** 2, 0.0) ** 2 * (f < 1.0), 1.0)
    depth = np.maximum(1.0 - np.abs(a - b) / np.maximum(k, 1e-300), 0.0)
    larger: Floats = np.maximum(a, b) + 0.25 * k * depth**2
    return larger


def deepest(a: Floats, b: Floats) -> Floats:
    smaller: Floats = np.minimum(a, b)
    return smaller


VALUES: dict[str, Callable[..., Floats]] = {
    "superelliptic_blend": superelliptic,
    "r_union": r_union,
    "r_intersection": r_intersection,
    "r_difference": r_difference,
    "smooth_intersection": smooth_intersection,
    "smooth_difference": smooth_difference,
    "clean_union": clean_union,
    "controllable_blend": controllable,
    "arc_union": arc_union,
    "arc_intersection": arc_intersection,
    "arc_difference": arc_difference,
    "masked": masked,
    "unmasked": unmasked,
    "deepest": deepest,
    "gradient_blend": opened,
}
"""Blends by the names of their operators."""


def partials(
    value: Callable[..., Floats], a: Floats, b: Floats, step: float = 1e-6, **parameters: Any
) -> tuple[Floats, Floats, Floats]:
    """Partial derivatives by a and b, and the largest change of them within a step: large near kinks."""
    at_a = [value(moved(a, s * step), b, **parameters) for s in (-1.0, 0.0, 1.0)]
    at_b = [value(a, moved(b, s * step), **parameters) for s in (-1.0, 0.0, 1.0)]
    below, above = ((f[1] - f[0]) / step for f in (at_a, at_b)), ((f[2] - f[1]) / step for f in (at_a, at_b))
    (a0, b0), (a1, b1) = below, above
    return 0.5 * (a0 + a1), 0.5 * (b0 + b1), np.maximum(np.abs(a1 - a0), np.abs(b1 - b0))


def moved(f: Floats, step: float) -> Floats:
    """f and a step, but not past 0."""
    return np.where(f < 0.0, np.minimum(f + step, 0.0), np.maximum(f + step, 0.0))


def kink(name: str, a: Floats, b: Floats, reach: float = 2e-3, **parameters: Any) -> Floats:
    """Infinite where the partial derivatives change little within `reach` of (a, b), and 0 elsewhere."""
    margin = np.full(len(a), np.inf)
    value = VALUES[name]
    middle = partials(value, a, b, **parameters)[:2]
    for da in (-reach, 0.0, reach):
        for db in (-reach, 0.0, reach):
            near = np.maximum(a + da, 0.5 * a), np.maximum(b + db, 0.5 * b)
            by_a, by_b, _ = partials(value, near[0], near[1], **parameters)
            change = np.maximum(np.abs(by_a - middle[0]) * (a > 0.0), np.abs(by_b - middle[1]) * (b > 0.0))
            margin[change > 0.2] = 0.0
    return margin


def cliques(names: tuple[str, ...], pairs: tuple[tuple[str, str], ...]) -> list[tuple[int, ...]]:
    """The maximal groups of operands of which every two blend, by trying every group."""
    edges = {frozenset((names.index(one), names.index(other))) for one, other in pairs}
    numbers = range(len(names))
    groups = [group for size in range(1, len(names) + 1) for group in combinations(numbers, size)]
    found = [group for group in groups if all(frozenset(two) in edges for two in combinations(group, 2))]
    return [group for group in found if not any(set(group) < set(other) for other in found)]
