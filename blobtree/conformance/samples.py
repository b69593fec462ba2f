"""Samples of a kind: valid nodes whose parameters are drawn from the declarations alone."""

from collections.abc import Callable, Mapping
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float64Array
from blobtree.declare.checks import trial_value
from blobtree.declare.falloff import Falloff
from blobtree.declare.parameters import OPTIONAL, Parameter, Quantity, fields_of, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.node import Node
from blobtree.nodes.primitives import Point
from blobtree.validation import LARGEST_NUMBER

Rng = np.random.Generator
Draw = Callable[[Rng, Parameter], Any]
Operand = Callable[[Rng], Node]

ATTEMPTS = 60
MOST_SAMPLED = 4.0
"""Distance from the origin up to which endless nodes are sampled."""

WEIGHTS = (1.0, 1.0, 0.7, 2.5)
"""Factors of the fields of operands: above 1 they reach values that sums of fields have."""


def _triple(numbers: Float64Array) -> tuple[float, float, float]:
    x, y, z = numbers.tolist()
    return x, y, z


def _factor(rng: Rng, parameter: Parameter) -> float:
    low = parameter.low if np.isfinite(parameter.low) else -0.5
    high = min(parameter.high, 3.0) if np.isfinite(parameter.high) else max(0.5, low + 1.0)
    if low > high:
        return _within(rng, parameter, -0.5, 0.5)
    return float(rng.uniform(max(low, 0.3) if high > 0.3 > low >= 0.0 else low, high))


def _within(rng: Rng, parameter: Parameter, low: float, high: float) -> float:
    """Return a number between `low` and `high` if the parameter allows one, else one close to them."""
    least, most = max(low, parameter.low), min(high, parameter.high)
    if least > most and parameter.low > high:
        most = min(parameter.high, least + high - low)
    elif least > most:
        least = max(parameter.low, most - (high - low))
    return float(rng.uniform(least, most))


def _numbers(rng: Rng, parameter: Parameter) -> Any:
    if parameter.whole:
        low, high = max(parameter.low, -100), min(parameter.high, 100)
        return int(rng.integers(int(low), max(int(high), int(low) + 1)))
    return trial_value(parameter, rng, 3 if parameter.size == 1 else parameter.size + 1)


DRAWS: dict[Quantity, Draw] = {
    Quantity.POINT: lambda rng, _: _triple(rng.uniform(-0.8, 0.8, 3)),
    Quantity.POINTS: lambda rng, _: tuple(map(_triple, rng.uniform(-0.8, 0.8, (4, 3)))),
    Quantity.DIRECTION: lambda rng, _: _triple(rng.normal(size=3)),
    Quantity.EXTENTS: lambda rng, _: _triple(rng.uniform(0.3, 1.2, 3)),
    Quantity.LENGTH: lambda rng, p: _within(rng, p, 0.2, 0.9),
    Quantity.RADIUS: lambda rng, _: float(rng.uniform(0.15, 0.45)),
    Quantity.RADII: lambda rng, _: tuple(rng.uniform(0.2, 0.3, 4).tolist()),
    Quantity.SEMI_AXES: lambda rng, _: _triple(rng.uniform(0.3, 0.9, 3)),
    Quantity.DISTANCE: lambda rng, p: _within(rng, p, -0.08, 0.2),
    Quantity.ANGLE: lambda rng, p: _within(rng, p, -40.0, 40.0),
    Quantity.FACTOR: _factor,
    Quantity.WIDTH: lambda rng, _: float(rng.uniform(0.1, 0.4)),
    Quantity.NUMBERS: _numbers,
    Quantity.CHOICE: lambda rng, p: str(rng.choice(p.choices)),
    Quantity.COLOR: lambda rng, _: _triple(rng.uniform(0.0, 1.0, 3)),
}
"""How values are drawn, by their quantity; other quantities need a sample of the caller's."""


def balls(rng: Rng) -> Operand:
    """Return a function that draws balls as operands.

    Half of these functions draw balls around one middle, whose gradients are parallel everywhere.
    """
    middle = None if rng.random() < 0.5 else _triple(rng.uniform(-0.3, 0.3, 3))

    def ball(rng: Rng) -> Node:
        center = middle or _triple(rng.uniform(-0.4, 0.4, 3))
        return Point(center, radius=float(rng.uniform(0.25, 0.6)), weight=float(rng.choice(WEIGHTS)))

    return ball


def drawn_node(
    kind: type[Node], rng: Rng, operand: Operand | None = None, draws: Mapping[Quantity, Draw] = DRAWS
) -> Node:
    """Return a valid node of a class, with drawn operands; balls by default.

    Raises
    ------
    InvalidNode
        The class refuses all values that were drawn, or has a parameter that depends on others.
    """
    refusal: Exception | None = None
    for _ in range(ATTEMPTS):
        try:
            node = kind(**_drawn_values(kind, rng, operand or balls(rng), draws))
            node.tape, node.field_box  # noqa: B018  (they may refuse a combination of parameters)
        except (InvalidNode, TypeError) as error:
            refusal = error
            continue
        return node
    raise InvalidNode(
        f"{kind.__name__}: no drawn parameters make a valid node ({refusal}); pass sample=, a function of a "
        "random generator that returns one"
    )


def _drawn_values(
    kind: type[Node], rng: Rng, operand: Operand, draws: Mapping[Quantity, Draw]
) -> dict[str, Any]:
    declared, hints = parameters_of(kind), get_type_hints(kind)
    values: dict[str, Any] = {}
    for item in fields_of(kind):
        parameter = declared.get(item.name)
        if parameter is None:
            several = hints[item.name] is not Node
            values[item.name] = tuple(operand(rng) for _ in range(2)) if several else operand(rng)
        elif OPTIONAL not in item.metadata and parameter.quantity in draws:
            values[item.name] = draws[parameter.quantity](rng, parameter)
    return values


def falling_ball(falloff: Falloff) -> Callable[[Rng], Node]:
    """Return a function that draws balls with a falloff."""

    def draw(rng: Rng) -> Node:
        center, radius = _triple(rng.uniform(-0.5, 0.5, 3)), float(rng.uniform(0.3, 0.8))
        width = None if rng.random() < 0.5 else float(radius * rng.uniform(0.5, 1.5))
        return Point(center, radius=radius, falloff=falloff, width=width)

    return draw


def sampled_box(node: Node) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of a node's box; where it has no end, they are `MOST_SAMPLED` from the origin."""
    lower, upper = (corner.astype(np.float64) for corner in node.field_box)
    ends = np.abs([lower, upper]) > LARGEST_NUMBER
    return np.where(ends[0], -MOST_SAMPLED, lower), np.where(ends[1], MOST_SAMPLED, upper)


def points_around(
    rng: Rng, node: Node, count: int, values: Callable[[NDArray[np.float32]], NDArray[Any]] | None = None
) -> NDArray[np.float32]:
    """Return points (count, 3) in the node's box widened by a tenth, most of them where there is a field.

    `values` returns the field at points; by default `node` does.
    """
    lower, upper = sampled_box(node)
    margin = 0.1 * (upper - lower)
    pool = rng.uniform(lower - margin, upper + margin, (8 * count, 3)).astype(np.float32)
    empty = (values or node)(pool) == 0.0
    empty[: count // 4] = False
    return pool[np.argsort(empty, kind="stable")[:count]]
