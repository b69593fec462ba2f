"""New nodes: every class gives one with a surface, or is left out for a stated reason."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from blobtree import Cone, Node, Point, Polyline, Segment
from blobtree.declare.parameters import parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.kinds import NODE_KINDS
from decals.editing import new_nodes
from decals.errors import InvalidEdit
from tests.blobtree.custom_kinds import Ring, Soft

OPERANDS = Point((0, 0, 0), radius=0.5), Point((0.5, 0, 0), radius=0.4), Point((0, 0.5, 0), radius=0.4)
KINDS = [*new_nodes.built_in_kinds(), "Ring", "Soft"]


def test_every_built_in_class_is_offered_once() -> None:
    families = [*new_nodes.families().values()]
    names = [name for family in families for name in family]
    assert len(names) == len(set(names))
    left_out = {NODE_KINDS[tag].__name__ for tag in new_nodes.NOT_OFFERED}
    assert {kind.__name__ for kind in NODE_KINDS.values()} - left_out <= set(names)


@pytest.mark.slow_cases("GradientBlend")
@pytest.mark.parametrize("name", KINDS)
def test_a_new_node_has_a_surface(name: str) -> None:
    count = new_nodes.operand_range(new_nodes.kinds()[name])[0]
    low, high = new_nodes.new_node(name, OPERANDS[:count]).bounds
    assert (high > low).all()


@pytest.mark.parametrize("name", ["Point", "Torus", "Polygon", "Cylinder", "Ellipsoid"])
def test_a_new_primitive_stands_where_it_is_wanted(name: str) -> None:
    center = np.array([4.0, -2.0, 7.0])
    low, high = new_nodes.new_node(name, center=center, size=3.0).bounds
    np.testing.assert_allclose((low + high) / 2, center, atol=1.0)
    assert 1.0 < (high - low).max() < 8.0


def test_a_new_cone_tapers_and_a_new_segment_does_not() -> None:
    shares = []
    for name in ("Cone", "Segment"):
        node: Any = new_nodes.new_node(name)
        start, end = np.array(node.start), np.array(node.end)
        along = (end - start) / np.linalg.norm(end - start)
        across = np.cross(along, (0, 0, 1))
        widths = [
            [(node([place + t * across]) >= 0.5).sum() for t in np.linspace(0, 0.5, 101)]
            for place in (start, end)
        ]
        shares.append(np.sum(widths[1]) / np.sum(widths[0]))
    assert shares[0] < 0.7 < 0.9 < shares[1]


def test_a_node_of_another_kind_takes_the_place_of_one() -> None:
    limb = Segment((1, 2, 3), (2, 2, 4), radius=0.3, color="red", falloff="gaussian")
    cone: Any = new_nodes.exchanged_node(limb, "Cone")
    shared = [name for name in parameters_of(Segment) if name in parameters_of(Cone)]
    assert {"start", "end", "radius", "color", "falloff"} <= {*shared}
    assert [getattr(cone, name) for name in shared] == [getattr(limb, name) for name in shared]
    ball = Point((1, 2, 3), radius=0.5, color="red", weight=0.7)
    ring: Any = new_nodes.exchanged_node(ball, "Torus")
    assert (ring.center, ring.color, ring.weight) == (ball.center, ball.color, 0.7)
    assert ring.radius < ball.radius  # else it would have no hole
    assert new_nodes.exchanged_node(OPERANDS[0] + OPERANDS[1], "Difference") == OPERANDS[0] - OPERANDS[1]
    assert new_nodes.exchanged_node(ball.twist(30), "Taper").children == (ball,)
    points = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 0), (2, 2, 1))
    stroke: Any = new_nodes.exchanged_node(Polyline(points, radius=0.2), "Stroke")
    assert (stroke.points, stroke.radii) == (points, (0.2,) * 5)


@pytest.mark.parametrize("center", [(0, 0, 0), (1.2, 0.4, 0), (0, 5, 3)])
@pytest.mark.parametrize("name", new_nodes.families()["modifiers"])
def test_a_node_anywhere_goes_under_each_modifier(name: str, center: tuple[float, float, float]) -> None:
    ball = Point(center, radius=0.6)
    assert new_nodes.node_above(name, ball).children == (ball,)
    assert new_nodes.exchanged_node(ball.twist(10), name).children == (ball,)
    with pytest.raises(InvalidEdit, match="Sum: expected 2 or more operands"):
        new_nodes.node_above("Sum", ball)


def test_other_kinds_have_as_many_operands() -> None:
    ball, twist, three = OPERANDS[0], OPERANDS[0].twist(30), OPERANDS[0] + OPERANDS[1] + OPERANDS[2]
    families = new_nodes.families()
    assert new_nodes.alternatives(ball) == families["primitives"]
    assert new_nodes.alternatives(twist) == families["modifiers"]
    assert {"Sum", "Union"} <= {*new_nodes.alternatives(three)} <= {*families["combinations"]}
    assert not {"Difference", "RUnion"} & {*new_nodes.alternatives(three)}
    assert {"Difference", "RUnion"} <= {*new_nodes.alternatives(ball + ball)}
    with pytest.raises(InvalidEdit, match="Twist: expected 1 or more operands"):
        new_nodes.exchanged_node(ball, "Twist")


@pytest.mark.slow
@pytest.mark.parametrize("name", new_nodes.built_in_kinds())
def test_every_kind_takes_the_place_of_every_other_one(name: str) -> None:
    count = new_nodes.operand_range(new_nodes.kinds()[name])[0]
    node = new_nodes.new_node(name, OPERANDS[:count])
    for other in new_nodes.alternatives(node):
        assert type(new_nodes.exchanged_node(node, other)).__name__ == other


def test_custom_kinds_are_offered() -> None:
    assert Ring.__name__ in new_nodes.families()["primitives"]
    assert Soft.__name__ in new_nodes.families()["combinations"]
    ring: Node = new_nodes.new_node("Ring")
    assert isinstance(ring, Ring)


@pytest.fixture
def points_by_name() -> Iterator[None]:
    """Two custom kinds have the name of a class of the library."""
    Ring.__name__ = Soft.__name__ = "Point"
    yield
    Ring.__name__, Soft.__name__ = "Ring", "Soft"


def test_custom_kinds_named_like_others_take_the_place_of_none(points_by_name: None) -> None:
    kinds = new_nodes.kinds()
    names = {kind: [name for name, known in kinds.items() if known is kind] for kind in (Point, Ring, Soft)}
    assert names[Point] == ["Point"]
    assert sorted(names[Ring] + names[Soft]) in (
        ["Point (custom)", f"Point ({Ring.kind})"],
        ["Point (custom)", f"Point ({Soft.kind})"],
    )
    families = new_nodes.families()
    assert new_nodes.name_of(Ring) in families["primitives"]
    assert new_nodes.name_of(Soft) in families["combinations"]
    assert type(new_nodes.new_node(new_nodes.name_of(Ring))) is Ring
    assert type(new_nodes.exchanged_node(OPERANDS[0], new_nodes.name_of(Ring))) is Ring
    assert type(new_nodes.new_node("Point")) is Point


@pytest.mark.parametrize(
    ("name", "count"), [("Pointy", 0), (None, 0), ("Twist", 0), ("Twist", 2), ("Difference", 3), ("Sum", 0)]
)
def test_wrong_kinds_and_operands_are_refused(name: str, count: int) -> None:
    with pytest.raises((InvalidEdit, InvalidNode)):
        new_nodes.new_node(name, OPERANDS[:count])
