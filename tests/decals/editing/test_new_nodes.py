"""New nodes: every class gives one with a surface, or is left out for a stated reason."""

from typing import Any

import numpy as np
import pytest

from blobtree import InvalidNode, Node, Point
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


def test_custom_kinds_are_offered() -> None:
    assert Ring.__name__ in new_nodes.families()["primitives"]
    assert Soft.__name__ in new_nodes.families()["combinations"]
    ring: Node = new_nodes.new_node("Ring")
    assert isinstance(ring, Ring)


@pytest.mark.parametrize(
    ("name", "count"), [("Pointy", 0), (None, 0), ("Twist", 0), ("Twist", 2), ("Difference", 3), ("Sum", 0)]
)
def test_wrong_kinds_and_operands_are_refused(name: str, count: int) -> None:
    with pytest.raises((InvalidEdit, InvalidNode)):
        new_nodes.new_node(name, OPERANDS[:count])
