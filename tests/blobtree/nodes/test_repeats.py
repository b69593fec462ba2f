"""Repeats: copies in rows, grids and rings, and what they refuse."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree import (
    Box,
    EndlessRepeat,
    Node,
    Point,
    PolarRepeat,
    Repeat,
    Segment,
    Sum,
    Union,
    from_json,
    polygonize,
    to_json,
)
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


def endless(child: Node, *steps: Any, joining: str = "union") -> Node:
    for step in steps:
        child = EndlessRepeat(child, step, joining)
    return child


SPACE = (1, 0, 0), (0, 1, 0), (0, 0, 1)


@given(
    st.sampled_from([BALL, BRICK, Segment((0, 0, 0), (0.9, 0.5, 0.2), radius=0.2)]),
    st.tuples(st.floats(0.4, 2.0), st.floats(-0.5, 0.5)),
    st.sampled_from(["sum", "union"]),
    st.sampled_from(["alike", "mirrored"]),
    st.tuples(coordinates, coordinates, coordinates),
)
def test_an_endless_row_is_its_copies_joined(
    child: Any, step: Any, joining: str, copies: str, place: Any
) -> None:
    row = EndlessRepeat(child, (*step, 0.0), joining, copies)
    points = np.array([place])
    assert row(points) == pytest.approx(oracle.value(row, points), abs=1e-5)
    pairs = 2.0 * np.array([*step, 0.0])
    assert row(points + 100.0 * pairs) == pytest.approx(row(points), abs=2e-3)


@pytest.mark.parametrize("joinings", [("sum", "union"), ("union", "sum")])
def test_endless_repeats_of_endless_repeats_are_lattices(joinings: tuple[str, str]) -> None:
    inner, outer = joinings
    steps: Any = (1, 0.2, 0), (0.3, 0.8, 0.1)
    grid = EndlessRepeat(EndlessRepeat(BRICK, steps[0], inner), steps[1], outer)
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (300, 3))
    copies = [-8.0 * np.array(step) for step in steps]
    rows = Repeat(BRICK.translate(tuple(copies[0])), steps[0], 17, inner)
    assert grid(points) == pytest.approx(
        Repeat(rows.translate(tuple(copies[1])), steps[1], 17, outer)(points), abs=2e-5
    )


def test_an_intersection_with_a_finite_solid_ends() -> None:
    balls = endless(Point((0.5, 0.5, 0.5), radius=0.3), *SPACE)
    cut = balls & Box((0, 0, 0), (4, 4, 4), radius=0)
    mesh = cut.to_pyvista(resolution=96)
    assert mesh.is_manifold
    assert mesh.volume == pytest.approx(64 * 4 / 3 * np.pi * 0.3**3, rel=0.05)
    assert cut(mesh.points) == pytest.approx(0.5, abs=1e-4)
    assert (np.abs(cut.bounds) < 2.0).all()
    assert (np.abs(balls.rotate((0, 0, 1), 90).field_box) > 1e18).all()
    posts = endless(Segment((0, 0, -1), (0, 0, 1), radius=0.2), *SPACE[:2])
    assert np.abs(posts.rotate((1, 0, 0), 90).field_box)[:, 1].max() < 2.0


def test_rays_meet_endless_copies_up_to_a_distance() -> None:
    rng = np.random.default_rng(3)
    balls = endless(Point((0, 0, 0), radius=0.3), *SPACE)
    origins, ways = rng.uniform(0.35, 0.65, (2000, 3)), rng.normal(size=(2000, 3))
    hits = balls.raycast(origins, ways, far=3.0)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    centers = np.stack(np.meshgrid(*[np.arange(-3, 5)] * 3), axis=-1).reshape(-1, 3)
    away = origins[:, None] - centers
    along = np.einsum("nci,ni->nc", away, ways)
    depth = along**2 - np.einsum("nci,nci->nc", away, away) + 0.09
    first = np.where((depth > 0) & (along < 0), -along - np.sqrt(np.maximum(depth, 0)), np.inf).min(axis=1)
    first[first > 3.0] = np.inf
    grazing = np.abs(depth).min(axis=1) < 1e-2
    assert grazing.mean() < 0.5
    assert hits.distances[~grazing] == pytest.approx(first[~grazing], abs=2e-3)


def test_endless_copies_grow_as_their_child_does() -> None:
    row, points = EndlessRepeat(BALL, (1.2, 0, 0)), np.random.default_rng(5).uniform(-2, 2, (200, 3))
    grown = EndlessRepeat(BALL.offset(0.05), (1.2, 0, 0))
    assert row.offset(0.05)(points) == pytest.approx(grown(points), abs=1e-5)
    with pytest.raises(InvalidNode, match="offset its child in its place"):
        row.offset(3.0)(points)


def test_a_file_holds_one_child() -> None:
    row = Repeat(BRICK, (1, 0, 0), 500, "union")
    assert from_json(to_json(row)) == row
    assert len(to_json(row)) < 1000
    assert row.offset(0.05)([[499.1, 0.0, 0.24]])[0] > 0.5
    grid = endless(BALL, *SPACE)
    assert from_json(to_json(grid)) == grid


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Repeat(BALL, (0, 0, 0), 2), "step: expected a direction"),
        (
            lambda: Repeat(BALL, (0, 1e16, 0), 1000),
            "step: expected a shorter one, the last copy is 9",
        ),
        (lambda: Repeat(BALL, (1, 0, 0), 0), "count: expected a number from 1 to 10000"),
        (lambda: Repeat(BALL, (1, 0, 0), 10**9), "count: expected a number from 1 to 10000.*repeat a repeat"),
        (lambda: Repeat(BALL, (1, 0, 0), 2.5), "count: expected a whole number"),  # type: ignore[arg-type]
        (lambda: Repeat(BALL, (1, 0, 0), 2, "blend"), "joining: expected 'sum' or 'union'"),
        (lambda: endless(BALL, (0, 0, 0)), "step: expected a direction"),
        (lambda: endless(BALL, (1, 0, 0), (2, 0, 0)), "step: expected a direction apart from those"),
        (lambda: endless(BALL, *SPACE, (1, 1, 1)), "step: expected a direction apart from those"),
        (
            lambda: EndlessRepeat(endless(BALL, (1, 0, 0)), (1, 1, 0), copies="mirrored"),
            "step: expected steps at right angles",
        ),
        (lambda: endless(BALL, (1e-4, 0, 0)).tape, "step: expected a longer one"),
        (
            lambda: endless(Union(endless(BALL, (1, 0, 0)), BALL), (0, 1, 0)).tape,
            "tree: expected one that ends",
        ),
        (lambda: polygonize(endless(BALL, (1, 0, 0))), "tree: expected one that ends.*Box"),
        (lambda: endless(BALL, (1, 0, 0)).raycast((0, 0, 9), (0, 0, -1)), "trace rays with `far=`"),
        (lambda: PolarRepeat(BALL, (0, 0, 1), 20_000), "count: expected a number from 1 to 10000"),
        (lambda: PolarRepeat(BALL, (0, 0, float("nan")), 2), "axis: expected"),
    ],
)
def test_wrong_repeats_are_refused(make: Callable[[], Node], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()
