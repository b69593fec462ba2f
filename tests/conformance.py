"""Conformance of node classes: what every class must satisfy, on samples from its declarations.

A class is taken up as soon as it is in `NODE_KINDS`. It needs a case in `tests.oracles.blobtree`, and an
entry of `SPECIAL` if no sample of its quantities makes a valid node. The laws are those of
`blobtree.check_kind`.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

import blobtree
from blobtree import Node, check_kind
from blobtree.conformance.laws import LAWS, Case, Oracle
from blobtree.conformance.samples import DRAWS, Draw, Rng, drawn_node
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.primitives import Falling, Leaf
from tests.blobtree.expressions import program
from tests.blobtree.trees import BUILT_IN_FALLOFFS, random_leaf, random_profile, triple
from tests.oracles import blobtree as oracle

Floats = NDArray[np.float64]
Operand = Callable[[Rng], Node]

EXACT = 1e-4
"""Largest relative error of values and gradients, absolute below 1."""

AWAY = 2e-3
"""Field values between a point and the nearest kink, where gradients are compared."""

ATTEMPTS = 60
NAMES = {name: getattr(blobtree, name) for name in blobtree.__all__}


PENTAGON = np.column_stack([np.cos(np.arange(5) * 0.4 * np.pi), np.sin(np.arange(5) * 0.4 * np.pi)])


def _corners(rng: Rng) -> tuple[tuple[float, float, float], ...]:
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 6))
    flat = rng.uniform(0.3, 0.9, 6)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return tuple((x, y, 0.3 * x - 0.2 * y) for x, y in flat.tolist())


def _polygon(rng: Rng, _: Operand) -> Node:
    return blobtree.Polygon(_corners(rng), radius=0.2)


def _prism(rng: Rng, _: Operand) -> Node:
    return blobtree.Prism(_corners(rng), float(rng.uniform(0.3, 0.9)), radius=float(rng.choice([0.0, 0.2])))


def _outline(rng: Rng) -> blobtree.Outline:
    """An outline beside an axis, or one that touches it, with a hole; its corners may be rounded."""
    left, right = float(rng.choice([0.0, 0.2])), float(rng.uniform(0.9, 1.2))
    corners = [(left, -0.5), (right, -0.4), (0.9 * right, 0.4), (left, 0.5)]
    bulges = [0.0, float(rng.uniform(-0.3, 0.6)), 0.0, 0.0]
    hole = blobtree.Outline.spline(rng.uniform(0.95, 1.05, (5, 1)) * PENTAGON)
    return blobtree.Outline.arcs(corners, bulges) + hole.scale(0.15).translate((0.55, 0.0))


def _extrude(rng: Rng, _: Operand) -> Node:
    warps: Any = {"top_scale": float(rng.uniform(0.5, 1.5)), "top_turn": float(rng.uniform(-60.0, 60.0))}
    chosen = {name: value for name, value in warps.items() if rng.random() < 0.5}
    origin, radius = triple(rng.uniform(-0.3, 0.3, 3)), float(rng.choice([0.0, 0.2]))
    return blobtree.Extrude(
        _outline(rng), float(rng.uniform(0.3, 0.9)), origin=origin, radius=radius, **chosen
    )


def _revolve(rng: Rng, _: Operand) -> Node:
    angle, radius = float(rng.choice([360.0, rng.uniform(20.0, 350.0)])), float(rng.choice([0.0, 0.2]))
    return blobtree.Revolve(_outline(rng), angle, origin=triple(rng.uniform(-0.3, 0.3, 3)), radius=radius)


def _sweep(rng: Rng, _: Operand) -> Node:
    """A sweep along a line or a curve; a closed one along a circle."""
    outline, radius = _outline(rng).scale(0.3), float(rng.choice([0.0, 0.1]))
    turns = np.linspace(0.0, 4.0, 4) + rng.uniform(-0.2, 0.2, 4)
    points: Any = 0.9 * np.column_stack([np.cos(turns), np.sin(turns), rng.uniform(-0.3, 0.3, 4)])
    match str(rng.choice(["straight", "sharp", "smooth", "closed"])):
        case "straight":
            changes: Any = {
                "end_scale": float(rng.uniform(0.5, 1.5)),
                "end_turn": float(rng.uniform(-90, 90)),
            }
            return blobtree.Sweep(outline, points[:2], radius=radius, **changes)
        case "sharp":
            return blobtree.Sweep(outline, points, radius=radius)
        case "smooth":
            return blobtree.Sweep(outline, points, corners="smooth", end_scale=0.8, radius=radius)
    return blobtree.Sweep(outline, points, corners="smooth", ends="closed", radius=radius)


def _contact(rng: Rng, operand: Operand) -> Node:
    solids = tuple(operand(rng) for _ in range(3))
    return blobtree.SolidContact(solids, stiffness=(1.0, 2.0, 1.5), width=0.3, height=0.05)


def _graph(rng: Rng, operand: Operand) -> Node:
    operands = tuple(operand(rng) for _ in range(3))
    return blobtree.BlendGraph(operands, names=("a", "b", "c"), pairs=(("a", "b"), ("b", "c")))


def _volume(rng: Rng, _: Operand) -> Node:
    center, radius = rng.uniform(-0.3, 0.3, 3), float(rng.uniform(0.4, 0.7))

    def distance(points: Floats) -> Floats:
        return np.asarray(np.linalg.norm(points - center, axis=1) - radius)

    return blobtree.from_sdf(distance, (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), spacing=0.3, width=0.4)


def _expression(rng: Rng, _: Operand) -> Node:
    return blobtree.Expression(program(rng, 6), triple(rng.uniform(-0.3, 0.3, 3)), (2.0, 2.0, 2.0))


def _repeat(rng: Rng, operand: Operand) -> Node:
    step, count = triple(rng.uniform(-0.8, 0.8, 3)), int(rng.integers(1, 4))
    joining, copies = str(rng.choice(["sum", "union"])), str(rng.choice(["alike", "mirrored"]))
    return blobtree.Repeat(operand(rng), step, count, joining, copies)


def _endless_repeat(rng: Rng, operand: Operand) -> Node:
    step = triple(rng.uniform(0.5, 1.5) * rng.permutation([1.0, 0.3, 0.0]))
    joining, copies = str(rng.choice(["sum", "union"])), str(rng.choice(["alike", "mirrored"]))
    return blobtree.EndlessRepeat(operand(rng), step, joining, copies)


def _polar_repeat(rng: Rng, operand: Operand) -> Node:
    joining = str(rng.choice(["sum", "union"]))
    return blobtree.PolarRepeat(operand(rng), triple(rng.normal(size=3)), int(rng.integers(1, 4)), joining)


def _transform(rng: Rng, operand: Operand) -> Node:
    return operand(rng).rotate((1, 2, 3), 40).scale(triple(rng.uniform(0.6, 1.5, 3)))


def _gradient_blend(rng: Rng, operand: Operand) -> Node:
    start, full = float(rng.uniform(0.0, 40.0)), float(rng.uniform(60.0, 180.0))
    return blobtree.GradientBlend(operand(rng), operand(rng), start_angle=start, full_angle=full)


def _curve_warp(rng: Rng, operand: Operand) -> Node:
    source = rng.uniform(-0.6, 0.6, (3, 3))
    return operand(rng).curve_warp(source, source + rng.uniform(-0.1, 0.1, (3, 3)), 1.0)


SPECIAL: dict[str, Callable[[Rng, Operand], Node]] = {
    "transform": _transform,
    "repeat": _repeat,
    "polar_repeat": _polar_repeat,
    "endless_repeat": _endless_repeat,
    "polygon": _polygon,
    "prism": _prism,
    "expression": _expression,
    "extrude": _extrude,
    "revolve": _revolve,
    "sweep": _sweep,
    "contact": _contact,
    "blend_graph": _graph,
    "volume": _volume,
    "curve_warp": _curve_warp,
    "gradient_blend": _gradient_blend,
}
"""Makers of classes whose parameters depend on each other."""


def sample(
    kind: type[Node], rng: Rng, operand: Operand = random_leaf, draws: Mapping[Quantity, Draw] = DRAWS
) -> Node:
    """Return a valid node of a class, with drawn operands; raise `InvalidNode` if none is found."""
    if kind.file_tag not in SPECIAL:
        return drawn_node(kind, rng, operand, draws)
    for _ in range(ATTEMPTS):
        try:
            node = SPECIAL[kind.file_tag](rng, operand)
            node.tape, node.field_box  # noqa: B018  (they may refuse a combination of parameters)
        except InvalidNode:
            continue
        return node
    raise InvalidNode(f"no valid sample of {kind.__name__}: its entry in SPECIAL draws none")


def variants(kind: type[Node]) -> Iterator[Callable[[Rng, Any], Node]]:
    """Yield what makes other nodes of samples of a class, again and again: the first leaves them as they are.

    Leaves also get negative weights, offsets and all falloffs.
    """
    changes: list[Callable[[Rng, Any], Node]] = [lambda _, node: node]
    if issubclass(kind, Leaf):
        changes.append(lambda rng, node: replace(random_profile(rng, node, (1.0,)), weight=-0.7))  # type: ignore[type-var]
        radii = [item for item in parameters_of(kind).values() if item.quantity is Quantity.RADIUS]
        if radii and radii[0].low == 0.0:
            changes.append(lambda rng, node: random_profile(rng, sharpened(node), (1.0,)))
        if radii:
            changes.append(
                lambda rng, node: random_profile(rng, node, (1.0,)).offset(float(rng.uniform(-0.1, 0.2)))
            )
        if issubclass(kind, Falling):
            changes += [
                lambda rng, node, name=name: replace(random_profile(rng, node, (1.0, 0.7)), falloff=name)  # type: ignore[misc, type-var]
                for name in BUILT_IN_FALLOFFS
            ]
    return cycle(changes)


def sharpened(node: Any) -> Node:
    """Return a node with sharp edges; a width that suited its radius is left out."""
    sharp: Node = replace(node, radius=0.0, width=None)
    return sharp


def exact_field(node: Node, points: Floats) -> tuple[Floats, Floats]:
    """Return the field in float64, and how far, in field values, the next kink is."""
    field = oracle.signed(node, points)
    return field.value, field.margin


def problems_of(kind: type[Node], seed: int, samples: int, laws: tuple[str, ...] = tuple(LAWS)) -> list[str]:
    """Return what samples of a class violate; nothing if it conforms."""
    changes = variants(kind)

    def varied(rng: Rng) -> Node:
        return next(changes)(rng, sample(kind, rng))

    report = check_kind(
        kind, exact_field, sample=varied, samples=samples, seed=seed, compiled=True, show=None
    )
    return [f"{law.name}: {law.detail}" for law in report.laws if law.name in laws and law.state != "holds"]


def broken_laws(node: Node, rng: Rng, *names: str, known: Oracle | None = exact_field) -> list[str]:
    """Return what a node violates of some laws, by an oracle if one is known."""
    case = Case(node, known, compiled=True, rng=rng)
    return [f"{name}: {found.text}" for name in names for found in LAWS[name](case)]
