"""Paths through trees: nodes found, moved and replaced."""

import numpy as np
import pytest

from blobtree import Cone, Point, Segment, Transform
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import (
    moved,
    node_in_world,
    primitive_at,
    primitive_paths,
    with_node,
)

A, B = Point((0, 0, 0), radius=1.0), Segment((1, 0, 0), (2, 0, 0), radius=0.5)
C = Cone((0, 0, 2), (0, 0, 3), radius=0.4, end_radius=0.2)
NESTED = (A + B.translate((0.5, 0, 0)).scale(2)) - (C.rotate((0, 0, 1), 90) | A)


def test_paths_lead_to_every_primitive_and_replace_it() -> None:
    paths = primitive_paths(NESTED)
    assert [primitive_at(NESTED, path) for path in paths] == [A, B, C, A]
    for path in paths:
        assert with_node(NESTED, path, primitive_at(NESTED, path)) == NESTED
        other = with_node(NESTED, path, Point((9, 9, 9), radius=1))
        assert primitive_at(other, path) == Point((9, 9, 9), radius=1)
        assert sum(primitive_at(other, at) != primitive_at(NESTED, at) for at in paths) == 1
    for path in ((7,), (0, 0, 0), (1,)):
        with pytest.raises(InvalidNode):
            primitive_at(NESTED, path)


def test_a_primitive_alone_lies_where_it_lies_in_the_tree() -> None:
    tree = A.translate((3, 0, 0)) + B
    points = np.random.default_rng(0).normal(0, 3, (200, 3)).astype(np.float32)
    np.testing.assert_array_equal(node_in_world(tree, (0, 0))(points), A.translate((3, 0, 0))(points))


def test_moving_keeps_what_a_primitive_is() -> None:
    assert moved(B, (0, 1, 0)) == Segment((1, 1, 0), (2, 1, 0), radius=0.5)
    cone = moved(C, (1, 0, 0))
    assert isinstance(cone, Cone)
    assert cone.end_radius == 0.2
    black = Point((0, 0, 0), radius=1, color=(0, 0, 0))
    assert moved(black, (1, 2, 3)) == Point((1, 2, 3), radius=1, color=(0, 0, 0))
    turned = B.rotate((0, 0, 1), 30)
    assert isinstance(turned, Transform)
    assert moved(moved(turned, (1, 0, 0)), (0, 2, 0)) == turned.child.transform(
        np.array(turned.matrix) + np.outer([1, 2, 0], [0, 0, 0, 1])
    )
