"""Where the roundings of operators with a width begin, against the lengths that were asked for.

Operands are half-spaces and balls of all falloffs, several radii and widths of their own, offset and scaled.
The surfaces of two of them are known, and so is the point of one at each distance from the other one.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import (
    Difference,
    HalfSpace,
    Intersection,
    Node,
    Point,
    RoundDifference,
    RoundIntersection,
    RoundUnion,
    Union,
)
from blobtree.conformance.plain_field import PlainField

Floats = NDArray[np.float64]
Place = Callable[[float], Floats]
"""The point of one surface at a distance from the other one, below 0 inside."""

PROFILES: list[dict[str, Any]] = [
    {"falloff": "wyvill"},
    {"falloff": "soft_object", "width": 0.9},
    {"falloff": "blanc_schlick"},
    {"falloff": "metaball", "width": 1.4},
    {"falloff": "gaussian"},
    {"falloff": "cauchy", "weight": 1.0},
]
KINDS = (
    (RoundUnion, Union, 1, 1),
    (RoundIntersection, Intersection, -1, -1),
    (RoundDifference, Difference, 1, -1),
)
"""Each operator, its sharp one, and the sides of the second and of the first operand on which arcs end."""

DEPARTED = 1e-10
"""Difference of the fields from which an arc counts: it grows with the square of the way along the arc."""


def half_spaces(rng: np.random.Generator) -> tuple[Node, Node, Place, Place]:
    """Return two half-spaces at a random angle, and the places on both."""
    angle = float(rng.uniform(0.25, 0.75)) * np.pi
    normals = np.array([[0.0, 1.0, 0.0], [np.sin(angle), np.cos(angle), 0.0]])
    profiles = rng.choice(len(PROFILES), 2)
    a, b = (
        HalfSpace((0, 0, 0), tuple(normal), 9.0, radius=float(rng.choice([0.0, 0.7])), **PROFILES[profile])
        for normal, profile in zip(normals.tolist(), profiles, strict=True)
    )

    def along(normal: Floats, other: Floats) -> Place:
        way = other - (other @ normal) * normal
        return lambda distance: distance * way / (way @ other)

    return a, b, along(*normals), along(*normals[::-1])


def balls(rng: np.random.Generator) -> tuple[Node, Node, Place, Place]:
    """Return two balls that meet at a large angle, one of them scaled, the other one offset."""
    first, second = (float(radius) for radius in rng.uniform(0.8, 2.0, 2))
    apart = float(np.hypot(first, second) * rng.uniform(0.85, 1.1))
    profiles = [PROFILES[i] for i in rng.choice(len(PROFILES), 2)]
    grown = float(rng.uniform(-0.2, 0.2))
    a: Node = Point((0, 0, 0), radius=first / 1.5, **profiles[0]).scale(1.5)
    b: Node = Point((apart, 0, 0), radius=second - grown, **profiles[1]).offset(grown)

    def on(radius: float, other: float, start: float, sign: float) -> Place:
        def place(distance: float) -> Floats:
            x = (radius**2 + apart**2 - (other + distance) ** 2) / (2.0 * apart)
            return np.array([start + sign * x, np.sqrt(radius**2 - x**2), 0.0])

        return place

    return a, b, on(first, second, 0.0, 1.0), on(second, first, apart, -1.0)


def measured(node: Node, sharp: Node, place: Place, side: int, width: float) -> float:
    """Return the largest distance on one side at which the rounded field on a surface is another one."""
    near, far = 0.5 * width, 1.5 * width
    fields = PlainField(node.tape), PlainField(sharp.tape)
    for _ in range(30):
        middle = 0.5 * (near + far)
        rounded, plain = (float(field.values(place(side * middle)[None])[0]) for field in fields)
        near, far = (middle, far) if abs(rounded - plain) > DEPARTED else (near, middle)
    return near


def errors(seed: int) -> Iterator[tuple[str, float]]:
    """Yield the name of each operator, and the errors of its width on random pairs, over the width."""
    rng = np.random.default_rng(seed)
    for make in (half_spaces, balls):
        a, b, on_a, on_b = make(rng)
        width = float(rng.uniform(0.1, 0.3))
        for kind, sharp_kind, side_of_b, side_of_a in KINDS:
            node, sharp = kind(a, b, width), sharp_kind(a, b)
            for place, side in ((on_a, side_of_b), (on_b, side_of_a)):
                yield kind.__name__, abs(measured(node, sharp, place, side, width) / width - 1.0)
