"""Repeats: copies in rows, grids and rings, and what they refuse."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree import Box, Node, Point, PolarRepeat, Repeat, Sum, from_json, to_json
from blobtree.errors import InvalidNode
from tests.oracles import blobtree as oracle

BALL = Point((0.2, 0.1, 0.0), radius=0.4)
BRICK = Box((0.1, 0.0, 0.0), (0.6, 0.3, 0.4), radius=0)
coordinates = st.floats(-3.0, 3.0)


@given(
    st.sampled_from([BALL, BRICK]),
    st.integers(1, 5),
    st.sampled_from(["sum", "union"]),
    st.sampled_from(["alike", "mirrored"]),
    st.tuples(coordinates, coordinates, coordinates),
)
def test_a_row_is_its_copies_joined(child: Any, count: int, joining: str, copies: str, place: Any) -> None:
    row = Repeat(child, (0.7, 0.2, 0.0), count, joining, copies)
    points = np.array([place])
    assert row(points) == pytest.approx(oracle.value(row, points), abs=1e-5)


def test_mirrored_copies_face_each_other() -> None:
    row = Repeat(BALL, (2, 0, 0), 3, copies="mirrored")
    assert row([[0.2, 0.1, 0.0], [1.8, 0.1, 0.0], [4.2, 0.1, 0.0]]).tolist() == [1.0, 1.0, 1.0]


def test_a_grid_blends_across_its_cells() -> None:
    grid = Repeat(Repeat(Point((0, 0, 0), radius=0.5), (1, 0, 0), 3), (0, 1, 0), 2)
    balls = [Point((x, y, 0), radius=0.5) for y in range(2) for x in range(3)]
    points = np.random.default_rng(1).uniform(-1, 3, (200, 3))
    assert grid(points) == pytest.approx(Sum(balls)(points), abs=1e-6)
    assert np.array(grid.bounds) == pytest.approx(np.array(Sum(balls).bounds), abs=1e-5)


def test_a_ring_closes() -> None:
    ring = PolarRepeat(Point((1, 0, 0), radius=0.3), (0, 0, 2), 5)
    angles = 2 * np.pi * np.arange(5) / 5
    assert ring(np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])) == pytest.approx(1.0, abs=0.05)


def test_a_file_holds_one_child() -> None:
    row = Repeat(BRICK, (1, 0, 0), 500, "union")
    assert from_json(to_json(row)) == row
    assert len(to_json(row)) < 1000
    assert row.offset(0.05)([[499.1, 0.0, 0.24]])[0] > 0.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Repeat(BALL, (0, 0, 0), 2), "step: expected a direction"),
        (
            lambda: Repeat(BALL, (0, 1e16, 0), 1000),
            "step: expected a shorter one, the last copy is 9",
        ),
        (lambda: Repeat(BALL, (1, 0, 0), 0), "count: expected a number from 1 to 10000"),
        (lambda: Repeat(BALL, (1, 0, 0), 2.5), "count: expected a whole number"),  # type: ignore[arg-type]
        (lambda: Repeat(BALL, (1, 0, 0), 2, "blend"), "joining: expected 'sum' or 'union'"),
        (lambda: PolarRepeat(BALL, (0, 0, 1), 20_000), "count: expected a number from 1 to 10000"),
        (lambda: PolarRepeat(BALL, (0, 0, float("nan")), 2), "axis: expected"),
    ],
)
def test_wrong_repeats_are_refused(make: Callable[[], Node], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()
