"""Conformance of node classes: what every class must satisfy, sampled from its declarations alone.

A class is taken up as soon as it is in `NODE_KINDS`. It needs a case in `tests.oracles.blobtree`, and an
entry of `SPECIAL` if no sample of its quantities makes a valid node.
"""

import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, cast, get_type_hints

import numpy as np
from numpy.typing import NDArray

import blobtree
from blobtree import InvalidNode, Node, from_json, to_json
from blobtree.declare.parameters import OPTIONAL, Parameter, Quantity, fields_of, parameters_of
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.primitives import Falling, Leaf
from blobtree.tape.model import gradients_at
from tests.blobtree.tape.evaluations import bounds_along
from tests.blobtree.trees import BUILT_IN_FALLOFFS, points_around, random_leaf, random_profile, triple
from tests.oracles import blobtree as oracle

Floats = NDArray[np.float64]
Rng = np.random.Generator
Operand = Callable[[Rng], Node]
Draw = Callable[[Rng, Parameter], Any]

EXACT = 1e-4
"""Largest relative error of values and gradients, absolute below 1."""

AWAY = 2e-3
"""Field values between a point and the nearest kink, where gradients are compared."""

ATTEMPTS = 60
NAMES = {name: getattr(blobtree, name) for name in blobtree.__all__}


def _numbers(rng: Rng, parameter: Parameter) -> float:
    low = parameter.low if np.isfinite(parameter.low) else -0.5
    high = min(parameter.high, 3.0) if np.isfinite(parameter.high) else max(0.5, low + 1.0)
    return float(rng.uniform(max(low, 0.3) if high > 0.3 > low >= 0.0 else low, high))


def _angle(rng: Rng, parameter: Parameter) -> float:
    return float(rng.uniform(max(parameter.low, -40.0), min(parameter.high, 40.0)))


DRAWS: dict[Quantity, Draw] = {
    Quantity.POINT: lambda rng, _: triple(rng.uniform(-0.8, 0.8, 3)),
    Quantity.POINTS: lambda rng, _: tuple(map(triple, rng.uniform(-0.8, 0.8, (4, 3)))),
    Quantity.DIRECTION: lambda rng, _: triple(rng.normal(size=3)),
    Quantity.EXTENTS: lambda rng, _: triple(rng.uniform(0.3, 1.2, 3)),
    Quantity.LENGTH: lambda rng, _: float(rng.uniform(0.2, 0.9)),
    Quantity.RADIUS: lambda rng, _: float(rng.uniform(0.15, 0.45)),
    Quantity.RADII: lambda rng, _: tuple(rng.uniform(0.2, 0.3, 4).tolist()),
    Quantity.SEMI_AXES: lambda rng, _: triple(rng.uniform(0.3, 0.9, 3)),
    Quantity.DISTANCE: lambda rng, _: float(rng.uniform(-0.08, 0.2)),
    Quantity.ANGLE: _angle,
    Quantity.FACTOR: _numbers,
    Quantity.WIDTH: lambda rng, _: float(rng.uniform(0.1, 0.4)),
    Quantity.NUMBERS: lambda rng, p: int(rng.integers(int(max(p.low, 0)), int(min(p.high, 100)))),
    Quantity.CHOICE: lambda rng, p: str(rng.choice(p.choices)),
    Quantity.COLOR: lambda rng, _: triple(rng.uniform(0.0, 1.0, 3)),
}


def _polygon(rng: Rng, _: Operand) -> Node:
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 6))
    flat = rng.uniform(0.3, 0.9, 6)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    points = [(x, y, 0.3 * x - 0.2 * y) for x, y in flat.tolist()]
    return blobtree.Polygon(tuple(points), radius=0.2)


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
    "polygon": _polygon,
    "contact": _contact,
    "blend_graph": _graph,
    "volume": _volume,
    "curve_warp": _curve_warp,
    "gradient_blend": _gradient_blend,
}
"""Makers of classes whose parameters depend on each other."""


def sample(
    kind: type[Node], rng: Rng, operand: Operand = random_leaf, draws: dict[Quantity, Draw] | None = None
) -> Node:
    """Return a valid node of a class, with drawn operands; raise `LookupError` if none is found."""
    for _ in range(ATTEMPTS):
        try:
            node = (
                SPECIAL[kind.file_tag](rng, operand)
                if kind.file_tag in SPECIAL
                else _drawn(kind, rng, operand, draws or DRAWS)
            )
            node.tape, node.support  # noqa: B018  (they may refuse a combination of parameters)
        except InvalidNode:
            continue
        return node
    raise LookupError(f"no valid sample of {kind.__name__}: give it an entry in tests.conformance.SPECIAL")


def _drawn(kind: type[Node], rng: Rng, operand: Operand, draws: dict[Quantity, Draw]) -> Node:
    declared, hints = parameters_of(kind), get_type_hints(kind)
    values: dict[str, Any] = {}
    for field in fields_of(kind):
        parameter = declared.get(field.name)
        if parameter is None:
            several = hints[field.name] is not Node
            values[field.name] = tuple(operand(rng) for _ in range(2)) if several else operand(rng)
        elif OPTIONAL not in field.metadata and parameter.quantity in draws:
            values[field.name] = draws[parameter.quantity](rng, parameter)
    return kind(**values)


BULKY = ("volume",)
"""Classes whose text leaves out their data."""


# -- checks ---------------------------------------------------------------------------------------------


def problems_of(kind: type[Node], seed: int, samples: int) -> list[str]:
    """Return what a class violates; nothing if it conforms."""
    rng = np.random.default_rng(seed)
    found: list[str] = []
    for _ in range(samples):
        node = sample(kind, rng)
        found += [f"{problem}: {node!r}" for problem in _problems(node, rng)]
    found += _degenerate(sample(kind, rng))
    return found


def field_problems(kind: type[Node], seed: int, samples: int) -> list[str]:
    """Return how values and gradients of a class differ from float64; nothing if they agree."""
    rng = np.random.default_rng(seed)
    nodes = [sample(kind, rng) for _ in range(samples)]
    return [f"{p}: {node!r}" for node in nodes for p in _fields(node, points_around(rng, node, 150), "plain")]


def _problems(node: Node, rng: Rng) -> Iterator[str]:
    points = points_around(rng, node, 150)
    try:
        yield from _fields(node, points, "plain")
    except TypeError as error:
        yield f"no oracle ({error}): add a case to tests.oracles.blobtree"
        return
    yield from _ranges(node, rng)
    yield from _slopes(node, rng)
    yield from _box(node, rng)
    yield from _texts(node)
    if isinstance(node, Leaf):
        variants: dict[str, Any] = {"negative": replace(random_profile(rng, node, (1.0,)), weight=-0.7)}  # type: ignore[type-var]
        if Quantity.RADIUS in {item.quantity for item in parameters_of(type(node)).values()}:
            variants["offset"] = random_profile(rng, node, (1.0,)).offset(float(rng.uniform(-0.1, 0.2)))
        if isinstance(node, Falling):
            for name in BUILT_IN_FALLOFFS:
                variants[name] = replace(random_profile(rng, node, (1.0, 0.7)), falloff=name)  # type: ignore[type-var]
        for name, falling in variants.items():
            yield from _fields(falling, points_around(rng, falling, 60), name)
            yield from _box(falling, rng)
            yield from _texts(falling)
        yield from _ranges(variants["negative"], rng)
        yield from _slopes(variants["negative"], rng)


def _fields(node: Node, points: Any, what: str) -> Iterator[str]:
    """Compare value and gradient with float64."""
    field = oracle.signed(node, points)
    seen = gradients_at(node.tape, points)
    error = np.abs(seen[:, 0] - field.value) / np.maximum(1.0, np.abs(field.value))
    if error.max() > EXACT:
        yield f"{what}: value differs from float64 by {error.max():.3g}"
    smooth = field.margin > AWAY
    expected = oracle.gradient(node, points[smooth])
    length = np.maximum(1.0, np.linalg.norm(expected, axis=1))
    if isinstance(node, Pieces):  # joints yield by a part of the radius, which steep profiles enlarge
        length[:] = length.max(initial=1.0)
    error = np.linalg.norm(seen[smooth, 1:] - expected, axis=1) / length
    if error.max(initial=0.0) > EXACT:
        yield f"{what}: gradient differs from float64 by {error.max():.3g}"


def _ranges(node: Node, rng: Rng) -> Iterator[str]:
    """Sample values in cubes, which the interval must contain."""
    for center in points_around(rng, node, 12):
        half = float(10.0 ** rng.uniform(-2.0, -0.3))
        low, high = node.interval(center - half, center + half)
        values = node(rng.uniform(center - half, center + half, (200, 3)).astype(np.float32))
        if values.min() < low - 1e-6 or values.max() > high + 1e-6:
            yield f"interval [{low:.6g}, {high:.6g}] lacks [{values.min():.6g}, {values.max():.6g}]"


def _slopes(node: Node, rng: Rng) -> Iterator[str]:
    """Sample rays, on which no field may rise or fall faster than its bounds."""
    starts = points_around(rng, node, 40)
    reach = (10.0 ** rng.uniform(-3.0, 0.5, 40)).astype(np.float32)
    headings = rng.normal(size=(40, 3))
    headings = (headings / np.linalg.norm(headings, axis=1, keepdims=True)).astype(np.float32)
    value, rise, fall = bounds_along(node.tape, starts, headings, reach).astype(np.float64).T
    distance = reach * np.linspace(0.05, 1.0, 20)[:, None]
    places = starts.astype(np.float64) + headings.astype(np.float64) * distance[..., None]
    ahead = oracle.value(node, places.reshape(-1, 3)).reshape(20, 40)
    change = ahead - oracle.value(node, starts)
    excess = np.maximum(change - rise * distance, -change - fall * distance).max()
    if excess > 2e-5:
        yield f"a ray exceeds its slope bound by {excess:.3g}"
    if not np.allclose(value, oracle.value(node, starts), atol=EXACT):
        yield "the bound's value is another"


def _box(node: Node, rng: Rng) -> Iterator[str]:
    """Sample values outside the support, which must be 0."""
    lower, upper = node.support
    points = rng.uniform(lower - 1.0, upper + 1.0, (400, 3)).astype(np.float32)
    outside = points[((points < lower) | (points > upper)).any(axis=1)]
    if (node(outside) != 0.0).any():
        yield f"the field is {np.abs(node(outside)).max():.3g} outside its box"


def _texts(node: Node) -> Iterator[str]:
    """Read back files, pickles and texts."""
    copies: dict[str, Callable[[], Node]] = {
        "JSON": lambda: from_json(to_json(node)),
        "pickle": lambda: cast(Node, pickle.loads(pickle.dumps(node))),
        "repr": lambda: cast(Node, eval(repr(node), NAMES)),
    }
    if node.file_tag in BULKY:
        del copies["repr"]
    for name, copy in copies.items():
        try:
            same = copy() == node
        except Exception as error:  # whatever a class does wrong
            yield f"{name}: {type(error).__name__}: {error}"
            continue
        if not same:
            yield f"{name} gives another node"


def _degenerate(node: Node) -> list[str]:
    """Pass NaN, and 0 for sizes: a class must refuse them."""
    found: list[str] = []
    for name, parameter in parameters_of(type(node)).items():
        value = getattr(node, name)
        bad = _bad_values(parameter, value)
        for wrong in bad:
            try:
                replace(node, **{name: wrong}).tape  # type: ignore[type-var]  # noqa: B018
            except InvalidNode:
                continue
            except Exception as error:  # whatever a class does wrong
                found.append(f"{name} = {wrong!r}: {type(error).__name__} in place of InvalidNode")
                continue
            found.append(f"{name} = {wrong!r} is accepted")
    return found


def _bad_values(parameter: Parameter, value: Any) -> list[Any]:
    sizes = (Quantity.LENGTH, Quantity.RADIUS, Quantity.WIDTH)
    bad: list[Any] = [0.0, -1.0] if parameter.quantity in sizes else []
    if isinstance(value, float) or parameter.quantity in sizes:
        return [*bad, float("nan"), float("inf")]
    if isinstance(value, tuple) and value and isinstance(value[0], float):
        return [(float("nan"), *value[1:])]
    return bad
