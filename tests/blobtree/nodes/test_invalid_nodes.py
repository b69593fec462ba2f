"""Nodes refuse nonsense, in words."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from blobtree import (
    Difference,
    ImplicitDecalsError,
    Intersection,
    Node,
    Point,
    Ricci,
    Segment,
    Sum,
    Transform,
    Union,
)
from blobtree.errors import InvalidNode

A = Point((0, 0, 0), radius=1.0)
B = Point((1, 0, 0), radius=0.5, color=(1, 0, 0))
BAD_VECTORS = [
    None,
    1.0,
    "abc",
    (1, 2),
    (1, 2, 3, 4),
    (0, 0, np.nan),
    (0, np.inf, 0),
    (0, 0, 1e19),
    [[1, 2, 3]],
]
BAD_POSITIVES = [0, 0.0, -1.0, np.nan, np.inf, 1e19, None, "wide", [1.0]]
BAD_COLORS = [None, (0, 0), (0, 0, 1.01), (-0.01, 0, 0), (0, 0, np.nan), "reddish"]


@pytest.mark.parametrize("bad", BAD_VECTORS, ids=repr)
def test_places_are_three_finite_numbers(bad: Any) -> None:
    attempts: dict[str, Callable[[], Node]] = {
        "center": lambda: Point(bad, radius=1.0),
        "start": lambda: Segment(bad, (0, 0, 0), radius=1.0),
        "end": lambda: Segment((0, 0, 0), bad, radius=1.0),
        "offset": lambda: A.translate(bad),
        "axis": lambda: A.rotate(bad, 30.0),
    }
    for name, attempt in attempts.items():
        with pytest.raises(InvalidNode, match=rf"^{name}: expected three finite numbers \(x, y, z\), got "):
            attempt()


def test_a_number_that_is_too_large_hears_how_large_it_may_be() -> None:
    with pytest.raises(InvalidNode, match=r"got \(0, 0, 1e\+19\); none may be beyond 1e\+18$"):
        Point((0, 0, 1e19), radius=1.0)
    with pytest.raises(InvalidNode, match=r"got 1e\+19; none may be beyond 1e\+18$"):
        Point((0, 0, 0), radius=1e19)


@pytest.mark.parametrize("bad", BAD_POSITIVES, ids=repr)
def test_radii_are_above_zero(bad: Any) -> None:
    for attempt in (lambda: Point((0, 0, 0), radius=bad), lambda: Segment((0, 0, 0), (1, 0, 0), radius=bad)):
        with pytest.raises(InvalidNode, match=r"^radius: expected a .*number.*, got "):
            attempt()


@pytest.mark.parametrize("bad", BAD_COLORS, ids=repr)
def test_colours_are_red_green_and_blue(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^color: expected "):
        Point((0, 0, 0), radius=1.0, color=bad)
    with pytest.raises(InvalidNode, match=r"^color: expected "):
        Segment((0, 0, 0), (1, 0, 0), radius=1.0, color=bad)


@pytest.mark.parametrize("bad", [0.99, 0.0, -2.0, 101.0, np.nan, np.inf, None, "two"], ids=repr)
def test_exponents_run_from_1_to_100(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^exponent: expected "):
        Ricci((A, B), exponent=bad)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((3, 4)),
        np.diag([1.0, 1.0, 0.0, 1.0]),
        np.diag([1.0, 1.0, 1e-7, 1.0]),
        np.full((3, 4), np.nan),
        np.diag([np.inf, 1.0, 1.0, 1.0]),
        np.eye(3),
        np.eye(5),
        np.diag([1.0, 1.0, 1.0, 2.0]),
        np.eye(4) + np.eye(4, k=-3),
        "matrix",
        None,
        [[1, 2], [3]],
    ],
    ids=range(12),
)
def test_maps_are_affine_and_invertible(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^matrix: expected "):
        A.transform(bad)
    with pytest.raises(InvalidNode, match=r"^matrix: expected "):
        Transform(A, bad)


@pytest.mark.parametrize(
    "bad", [0.0, (1, 0, 1), np.nan, np.inf, (1, 2), "big", None, (1, 1, np.nan)], ids=repr
)
def test_scales_are_finite_and_not_zero(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^factor: expected "):
        A.scale(bad)


def test_a_turn_has_an_axis_and_an_angle() -> None:
    with pytest.raises(InvalidNode, match="axis: expected a direction, got the zero vector"):
        A.rotate((0, 0, 0), 10.0)
    for bad in (np.nan, np.inf, None, "a bit"):
        with pytest.raises(InvalidNode, match="degrees: expected a finite number"):
            A.rotate((0, 0, 1), bad)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [Sum, Union, Intersection, lambda nodes: Ricci(nodes, exponent=2.0)])
def test_combinations_hold_nodes_at_least_one(kind: Callable[[Any], Node]) -> None:
    with pytest.raises(InvalidNode, match="operands: expected at least one node, got none"):
        kind(())
    with pytest.raises(InvalidNode, match="operands: expected BlobTree nodes, got 1"):
        kind((A, 1))
    with pytest.raises(InvalidNode, match="operands: expected "):
        kind(5)
    with pytest.raises(InvalidNode, match="operands: expected "):
        kind(None)
    assert kind((A,))([(0, 0, 0)]) == A([(0, 0, 0)])


def test_a_difference_and_a_transform_hold_nodes() -> None:
    for attempt in (lambda: Difference(A, 1), lambda: Difference("a", A), lambda: Transform(3, np.eye(4))):  # type: ignore[arg-type]
        with pytest.raises(InvalidNode, match="operands: expected BlobTree nodes, got "):
            attempt()


@pytest.mark.parametrize("other", [1, 1.0, "a", None, (0, 0, 0), np.float64(1.0)], ids=repr)
def test_python_says_what_does_not_combine_with_a_node(other: Any) -> None:
    attempts: tuple[Callable[[], Any], ...] = (
        lambda: A + other, lambda: A | other, lambda: A & other, lambda: A - other,
        lambda: other + A, lambda: other | A, lambda: other & A, lambda: other - A,
    )  # fmt: skip
    for attempt in attempts:
        with pytest.raises(TypeError):
            attempt()


def test_an_invalid_node_is_an_error_of_ours_and_a_value_error() -> None:
    assert issubclass(InvalidNode, ImplicitDecalsError)
    assert issubclass(InvalidNode, ValueError)
