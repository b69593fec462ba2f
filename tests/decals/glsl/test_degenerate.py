"""Fields in GLSL on centres, axes, faces and coordinate planes, where formulas divide by 0 or take powers."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from blobtree import Box, Node, Point
from blobtree.conformance.samples import DRAWS, Rng, sampled_box
from blobtree.declare.parameters import Quantity, fields_of, parameters_of
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.primitives import Leaf
from blobtree.nodes.tree import Macro
from blobtree.tape.model import gradients_at
from decals.rendering import Context
from decals.rendering.tracing_shader import Kinds
from tests.blobtree.csg_trees import PRIMITIVES, csg_primitive
from tests.blobtree.trees import triple
from tests.conformance import AWAY, EXACT, sample
from tests.decals.glsl.arguments import Array
from tests.decals.glsl.tapes import BOUND_AND_VALUE, COLOR, GRADIENT
from tests.decals.glsl.test_tapes import read_tape
from tests.oracles import blobtree as oracle

GRID = 0.2
"""Distance of the planes in which points and faces of the nodes lie."""

PLANES = 9
"""Most coordinates along each axis whose planes, lines and points are tried."""

TINY = (0.0, 1e-42, 1e-30, -1e-20, 1e-7)
"""Distances from planes: 0, numbers that are too small for drivers, and float32's rounding."""

CHANGE = 1e-4
"""Reach of the slope bounds."""

ROUNDING = 1e-6
"""How far float32 moves a point near parameters of this size."""


def snapped(values: Any) -> Any:
    return GRID * np.round(np.asarray(values) / GRID)


def regular_direction(rng: Rng, _: Any) -> tuple[float, float, float]:
    return triple(rng.choice([-1.0, 1.0]) * np.roll([1.0, 0.0, 0.0], rng.integers(3)))


REGULAR = DRAWS | {
    Quantity.POINT: lambda rng, _: triple(snapped(rng.uniform(-0.8, 0.8, 3))),
    Quantity.POINTS: lambda rng, _: tuple(map(triple, snapped(rng.uniform(-0.8, 0.8, (4, 3))))),
    Quantity.DIRECTION: regular_direction,
    Quantity.EXTENTS: lambda rng, _: triple(GRID * rng.integers(2, 6, 3)),
    Quantity.LENGTH: lambda rng, _: float(GRID * rng.integers(1, 5)),
    Quantity.SEMI_AXES: lambda rng, _: triple(GRID * rng.integers(1, 5, 3)),
}


def regular_operand(rng: Rng) -> Node:
    """A box or a ball on the grid."""
    place = triple(snapped(rng.uniform(-0.4, 0.4, 3)))
    if rng.random() < 0.5:
        return Point(place, radius=0.4, color=triple(rng.uniform(0.0, 1.0, 3)))
    return Box(
        place, triple(GRID * rng.integers(1, 4, 3)), radius=0.2, color=triple(rng.uniform(0.0, 1.0, 3))
    )


def leaves_of(node: Node) -> Iterator[Node]:
    """Yield the leaves below a node, those of a macro's tree too."""
    below = node.program_children if isinstance(node, Macro) else node.children
    if isinstance(node, Leaf):
        yield node
    for child in below:
        if isinstance(child, Node):
            yield from leaves_of(child)


def degenerate_points(rng: Rng, node: Node) -> Array:
    """Points at which coordinates agree with those of a node's parameters, of its faces and of its box."""
    box = np.array(sampled_box(node))
    known: list[Any] = [np.zeros((1, 3)), box, box.mean(axis=0)[None]]
    for leaf in leaves_of(node):
        declared = parameters_of(type(leaf))
        values = {f.name: getattr(leaf, f.name) for f in fields_of(type(leaf)) if f.name in declared}
        places = [np.zeros((1, 3))]
        for name, value in values.items():
            if declared[name].quantity in (Quantity.POINT, Quantity.POINTS):
                places.append(np.reshape(value, (-1, 3)))
        points = np.concatenate(places)
        known.append(points)
        for name, value in values.items():
            lengths = {
                Quantity.EXTENTS: 0.5,
                Quantity.SEMI_AXES: 1.0,
                Quantity.LENGTH: 1.0,
                Quantity.RADIUS: 1.0,
            }
            if value is not None and (share := lengths.get(declared[name].quantity)):
                known += [points + share * np.asarray(value), points - share * np.asarray(value)]
    numbers = np.concatenate(known).astype(np.float32)
    axes = [np.unique(column) for column in numbers.T]
    axes = [rng.permutation(axis)[:PLANES] for axis in axes]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    apart = rng.choice(TINY, lattice.shape) * rng.choice([-1.0, 1.0], lattice.shape)
    return np.concatenate([lattice, numbers, lattice + apart.astype(np.float32)])


@dataclass(frozen=True)
class Readings:
    """What shaders read at points: bounds (n, 3) in all directions, values beside gradients or colours."""

    bound: Array
    gradient: Array
    color: Array

    @classmethod
    def of(cls, context: Context, node: Node, points: Array) -> "Readings":
        kinds, reach = Kinds.of(node.tape), np.full((len(points), 1), CHANGE)
        bound = read_tape(context, node, BOUND_AND_VALUE, np.hstack([points, reach]), kinds=kinds)[:, :3]
        gradient = read_tape(context, node, GRADIENT, points, kinds=kinds)
        return cls(bound, gradient, read_tape(context, node, COLOR, points, kinds=kinds))

    def assert_values(self, expected: Any) -> None:
        """Raise if a number is not finite, or a value farther off than rounding of the point takes it."""
        assert all(np.isfinite(values).all() for values in (self.bound, self.gradient, self.color, expected))
        allowed = EXACT * np.maximum(1.0, np.abs(expected)) + ROUNDING * self.bound[:, 1:].max(axis=1)
        for values in (self.bound[:, 0], self.gradient[:, 0], self.color[:, 0]):
            excess = np.abs(values - expected) - allowed
            assert excess.max() <= 0.0, f"{values[excess.argmax()]} is not {expected[excess.argmax()]}"


@pytest.mark.ordinary_cases("superquadric", "torus", "ricci", "intersection")
@pytest.mark.parametrize("tag", NODE_KINDS)
def test_degenerate_points_have_the_field_of_float64(context: Context, tag: str) -> None:
    rng = np.random.default_rng(sum(map(ord, tag)))
    node = sample(NODE_KINDS[tag], rng, regular_operand, REGULAR)
    points = degenerate_points(rng, node)
    seen = Readings.of(context, node, points)
    with np.errstate(all="ignore"):
        field = oracle.signed(node, points)
        smooth = field.margin > AWAY
        expected = oracle.gradient(node, points[smooth])
    seen.assert_values(field.value)
    if node.tape.instruction_set.reads_gradients:  # they jump where an operand is flat, beside each box
        smooth, expected = (
            np.ones(len(points), np.bool_),
            gradients_at(node.tape, points)[:, 1:].astype(np.float64),
        )
    error = np.linalg.norm(seen.gradient[smooth, 1:] - expected, axis=1)
    error /= np.maximum(1.0, np.linalg.norm(expected, axis=1))
    assert error.max(initial=0.0) <= 1e-3


@pytest.mark.ordinary_cases("1e-05-superquadric", "0.001-cylinder")
@pytest.mark.parametrize("kind", PRIMITIVES)
@pytest.mark.parametrize("radius", [1e-3, 1e-5])
def test_sharp_primitives_have_the_field_of_float64_there(context: Context, kind: str, radius: float) -> None:
    rng = np.random.default_rng(sum(map(ord, kind)))
    node = csg_primitive(rng, kind, radius, regular=True)
    points = degenerate_points(rng, node)
    seen = Readings.of(context, node, points)
    with np.errstate(all="ignore"):
        seen.assert_values(oracle.signed(node, points).value)
    steepness = np.linalg.norm(seen.gradient[:, 1:], axis=1)
    assert (steepness <= 1.001 * seen.bound[:, 1:].max(axis=1) + 1e-3).all()
