"""Nodes: immutable values that combine with operators."""

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import ArrayLike

import blobtree
from blobtree import Difference, Intersection, Node, Point, Ricci, Segment, Sum, Transform, Union
from blobtree.errors import InvalidNode, InvalidPoints
from tests.blobtree.trees import random_trees, trees

A = Point((0, 0, 0), radius=1.0)
B = Point((1, 0, 0), radius=0.5, color=(1, 0, 0))
C = Segment((0, 0, 0), (0, 2, 0), radius=0.25)


@pytest.mark.parametrize(
    ("combined", "kind"), [(A + B + C, Sum), (A | B | C, Union), (A & B & C, Intersection)]
)
def test_operators_flatten(combined: Node, kind: type[Node]) -> None:
    assert type(combined) is kind
    assert combined.children == (A, B, C)


def test_sum_blends_a_list_of_nodes() -> None:
    assert sum([A, B, C]) == A + B + C
    assert sum([A]) == A
    for wrong in (1, "x", None):
        with pytest.raises(TypeError):
            wrong + A  # type: ignore[operator]


def test_bounds_are_the_box_of_the_surface() -> None:
    """Analytic boxes, to a 64th of the longest side of the support."""
    half = 0.25 * 5.0
    solids: list[tuple[Node, Any]] = [
        (A, [[-1, -1, -1], [1, 1, 1]]),
        (C, [[-0.25, -0.25, -0.25], [0.25, 2.25, 0.25]]),
        (A.scale((3, 1, 0.2)).translate((5, 0, 0)), [[2, -1, -0.2], [8, 1, 0.2]]),
        (A | B.scale(0.5).translate((2, 0, 0)), [[-1, -1, -1], [2.75, 1, 1]]),
        (A - A.translate((half, 0, 0)), [[-1, -1, -1], [half / 2, 1, 1]]),
    ]
    for tree, box in solids:
        lower, upper = tree.bounds
        assert lower.dtype == upper.dtype == np.float32
        cell = float((tree.support[1] - tree.support[0]).max()) / 64
        np.testing.assert_allclose([lower, upper], box, atol=cell)
        assert (tree.support[0] < lower).all()
        assert (tree.support[1] > upper).all()
        assert tree.bounds is tree.bounds
    with pytest.raises(InvalidNode, match="expected a tree with a surface"):
        _ = (A & A.translate((9, 0, 0))).bounds


def test_operators_flatten_from_the_right_too_but_not_one_kind_into_another() -> None:
    assert (A + (B + C)).children == (A, B, C)
    assert ((A | B) + C).children == (Union((A, B)), C)
    assert (Ricci((A, B), exponent=2.0) + C).children == (Ricci((A, B), exponent=2.0), C)
    assert Difference(Difference(A, B), C) == A - B - C


def test_operands_may_come_from_any_iterable() -> None:
    assert Sum(iter([A, B])) == Sum([A, B]) == Sum((A, B))


@given(trees())
@settings(max_examples=60)
def test_nodes_are_values(tree: Node) -> None:
    names: dict[str, Any] = {name: getattr(blobtree, name) for name in blobtree.__all__}
    again = eval(repr(tree), names)
    assert again == tree
    assert hash(again) == hash(tree)
    assert again is not tree
    assert len({tree, again}) == 1


def test_different_nodes_differ() -> None:
    assert Point((0, 0, 0), radius=1.0) == A
    assert Point((0, 0, 0), radius=1.1) != A
    assert A + B != A | B
    assert Sum((A, B)) != Sum((B, A))
    assert Ricci((A, B), exponent=2.0) != Ricci((A, B), exponent=3.0)


@pytest.mark.parametrize("node", [A, C, A + B, A - B, Ricci((A, B), exponent=2.0), A.translate((1, 2, 3))])
def test_nodes_do_not_change(node: Node) -> None:
    for name in (*node.__dataclass_fields__, "anything"):  # type: ignore[attr-defined]
        with pytest.raises((FrozenInstanceError, TypeError)):
            setattr(node, name, 1.0)


def test_numbers_are_kept_as_plain_floats() -> None:
    node = Point(np.array([1, 2, 3], np.float32), radius=np.float32(2), color=[0, 1, 0])  # type: ignore[arg-type]
    assert node == Point((1.0, 2.0, 3.0), radius=2.0, color=(0.0, 1.0, 0.0))
    assert "np." not in repr(node)


def surface_point(node: Node, points: list[tuple[float, float, float]]) -> None:
    np.testing.assert_allclose(node(points), 0.5, atol=1e-5)


def test_transforms_move_the_surface() -> None:
    surface_point(A.translate((5, 0, 0)), [(6, 0, 0), (5, 1, 0)])
    surface_point(A.scale(3.0), [(3, 0, 0), (0, 0, -3)])
    surface_point(A.scale((1, 2, -3)), [(1, 0, 0), (0, 2, 0), (0, 0, 3)])
    surface_point(B.rotate((0, 0, 1), 90.0), [(0, 1.5, 0), (0, 0.5, 0)])
    surface_point(B.rotate((0, 0, -7), 90.0), [(0, -1.5, 0)])
    surface_point(B.translate((1, 0, 0)).rotate((0, 0, 1), 180.0), [(-2.5, 0, 0)])
    surface_point(A.transform(np.diag([2.0, 1.0, 1.0, 1.0])), [(2, 0, 0), (0, 1, 0)])


def test_a_turn_leaves_its_axis_alone_and_a_full_one_everything() -> None:
    turned = A.translate((1, 1, 1)).rotate((1, 1, 1), 77.0)
    surface_point(turned, [(1 + 3**-0.5,) * 3])
    full, part = A.rotate((1, 2, 3), 360.0), A.rotate((1, 2, 3), 50)
    assert isinstance(full, Transform)
    assert isinstance(part, Transform)
    np.testing.assert_allclose(np.array(full.matrix), np.eye(4)[:3], atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(np.array(part.matrix)[:, :3]), 1.0)


def test_tape_and_bounds_are_made_once() -> None:
    (tree,) = random_trees(seed=3, count=1)
    assert tree.tape is tree.tape
    assert tree.support is tree.support
    assert tree.tape.on() is tree.tape.on()


# -- bounds over boxes, and the outline ----------------------------------------------------------------


BALL = Point((0, 0, 0), radius=1.0)


def test_intervals_of_one_point_are_close_and_exact_far_away() -> None:
    assert BALL.interval((5, 5, 5), (6, 6, 6)) == (0.0, 0.0)
    assert BALL.interval((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))[1] == pytest.approx(1.0, abs=1e-4)
    here = BALL((0.5, 0.0, 0.0) * np.ones((1, 3)))[0]
    assert BALL.interval((0.5, 0, 0), (0.5, 0, 0)) == pytest.approx((here, here), abs=1e-4)


@pytest.mark.parametrize("box", [((1, 0, 0), (0, 1, 1)), ((0, 0), (1, 1)), ((0, 0, np.nan), (1, 1, 1))])
def test_invalid_boxes_are_refused(box: tuple[ArrayLike, ArrayLike]) -> None:
    with pytest.raises(InvalidPoints):
        BALL.interval(*box)


def test_an_outline_has_a_line_per_node() -> None:
    tree = Ricci((BALL, Segment((0, 0, 0), (1, 0, 0), radius=0.5)), exponent=2.0) - BALL.translate((1, 2, 3))
    lines = str(tree).splitlines()
    assert [line.split("(")[0] for line in lines] == [
        "Difference", "  Ricci", "    Point", "    Segment", "  Transform", "    Point",
    ]  # fmt: skip
    assert lines[1] == "  Ricci(exponent=2.0)"
    assert lines[2] == f"    {BALL!r}"
