"""Values, gradients, colours and slope bounds of random trees against float64, and unusual points."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from blobtree import Point, Segment, Transform
from blobtree.errors import InvalidPoints
from blobtree.tape.model import colors_at, gradients_at, values_at
from blobtree.tape.program import postorder
from tests.blobtree.tape.evaluations import bounds_along, bounds_at
from tests.blobtree.tree_sets import BUILT_IN_TREES, EVERY_BATCH, FIRST_BATCHES, POINTS, Batch
from tests.blobtree.trees import KINDS, points_around
from tests.oracles import blobtree as oracle
from tests.vectors import random_units

AWAY = 1e-3
"""Field values between a point and the nearest kink of min, max or difference."""

BALLS, IN_BALL = 40, 8
"""Balls around a tree, and points in each, of the tests of bounds."""


def test_random_trees_contain_every_kind_of_node_and_stretched_primitives() -> None:
    kinds = {type(node) for tree in BUILT_IN_TREES for node in postorder(tree)}
    assert kinds == set(KINDS)
    assert sum(tree.tape.stretched for tree in BUILT_IN_TREES) > 50
    assert max(tree.tape.registers for tree in BUILT_IN_TREES) >= 3
    determinants = [np.linalg.det(np.array(node.matrix)[:, :3]) for tree in BUILT_IN_TREES
                    for node in postorder(tree) if isinstance(node, Transform)]  # fmt: skip
    assert min(determinants) < 0.0 < max(determinants)


@EVERY_BATCH
def test_values_match_float64(batch: Batch) -> None:
    inside = 0
    for tree, points in batch.cases:
        expected = oracle.value(tree, points)
        error = np.abs(tree(points) - expected) / np.maximum(1.0, expected)
        assert error.max() <= batch.value_error, tree
        inside += int((expected > 0.5).sum())
    assert inside > 2 * len(batch.trees)


@pytest.mark.slow_cases("fields-0")
@EVERY_BATCH
def test_gradients_match_float64_differences(batch: Batch) -> None:
    compared = 0
    for (tree, points), field in zip(batch.cases, batch.fields, strict=True):
        smooth = field.margin > AWAY
        seen, expected = tree.gradient(points)[smooth], oracle.gradient(tree, points[smooth])
        error = np.linalg.norm(seen - expected, axis=1)
        assert (error <= batch.gradient_error * np.maximum(1.0, np.linalg.norm(expected, axis=1))).all(), tree
        compared += int(smooth.sum())
    assert compared > 0.6 * len(batch.trees) * POINTS


@EVERY_BATCH
def test_colours_follow_the_field(batch: Batch) -> None:
    compared = 0
    for (tree, points), field in zip(batch.cases, batch.fields, strict=True):
        sure = (field.margin > AWAY) & (field.value > 0.01)
        np.testing.assert_allclose(tree.colors(points)[sure], field.color[sure], atol=batch.color_error)
        compared += int(sure.sum())
    assert compared > 0.3 * len(batch.trees) * POINTS


def test_colours_of_plain_blends() -> None:
    red, blue = Point((-1, 0, 0), radius=1.0, color=(1, 0, 0)), Point((1, 0, 0), radius=1.0, color=(0, 0, 1))
    middle, left = [[0, 0, 0]], [[-0.5, 0, 0]]
    np.testing.assert_allclose((red + blue).colors(middle), [[0.5, 0, 0.5]], atol=1e-6)
    np.testing.assert_allclose((red | blue).colors(left), [[1, 0, 0]])
    np.testing.assert_allclose((red & blue).colors(left), [[0, 0, 1]])
    np.testing.assert_allclose((red - blue).colors([[-1.5, 0, 0]]), [[1, 0, 0]])
    np.testing.assert_allclose((red - blue).colors([[0.1, 0, 0]]), [[0, 0, 1]])  # the wall of the cut
    np.testing.assert_array_equal((red + blue).colors([[9, 9, 9]]), [[0, 0, 0]])


@FIRST_BATCHES
def test_outside_the_bounds_the_field_is_exactly_zero(batch: Batch) -> None:
    rng = np.random.default_rng(5)
    for tree in batch.trees:
        lower, upper = tree.support
        assert lower.dtype == upper.dtype == np.float32
        points = rng.uniform(lower - 1.0, upper + 1.0, (800, 3)).astype(np.float32)
        faces = rng.integers(0, 3, 200), rng.integers(0, 2, 200)
        outside = np.where(faces[1], np.nextafter(upper[faces[0]], np.float32(np.inf)),
                           np.nextafter(lower[faces[0]], np.float32(-np.inf)))  # fmt: skip
        points[np.arange(200), faces[0]] = outside
        beyond = ((points < lower) | (points > upper)).any(axis=1)
        assert (tree(points[beyond]) == 0.0).all()
        assert (tree.gradient(points[beyond]) == 0.0).all()


def test_the_bounds_are_tight_around_a_stretched_capsule() -> None:
    tree = Segment((0, 0, 0), (1, 0, 0), radius=0.5).scale((1.0, 2.0, 3.0)).translate((1.0, 0.0, 0.0))
    reach = 0.5 / oracle.RIM
    np.testing.assert_allclose(tree.support[0], [1.0 - reach, -2.0 * reach, -3.0 * reach], rtol=1e-6)
    np.testing.assert_allclose(tree.support[1], [2.0 + reach, 2.0 * reach, 3.0 * reach], rtol=1e-6)


def test_an_empty_tree_has_a_box() -> None:
    nothing = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    lower, upper = nothing.support
    assert (lower < upper).all()
    assert nothing([[0, 0, 0], [9, 9, 9]]).tolist() == [0.0, 0.0]


def test_an_isolated_primitive_shows_its_radius() -> None:
    for radius in (1e-6, 1.0, 1e6):
        ball = Point((0, 0, 0), radius=radius)
        np.testing.assert_allclose(ball([[radius, 0, 0], [0, 0, -radius]]), 0.5, atol=1e-6)
        np.testing.assert_allclose(
            ball.gradient([[radius, 0, 0]])[0] * radius, [-oracle_slope(), 0, 0], rtol=1e-5
        )


def oracle_slope() -> float:
    """|r · ∂f/∂r| of a ball at its surface, by 6 d² (1 − d²)²."""
    return float(6.0 * oracle.RIM**2 * (1.0 - oracle.RIM**2) ** 2)


# -- bounds on the slope --------------------------------------------------------------------------------


@EVERY_BATCH
def test_no_gradient_inside_a_ball_is_longer_than_its_bound(batch: Batch) -> None:
    """Tapered primitives are left out: only the change from the centre of the ball is bounded there."""
    rng = np.random.default_rng(batch.start)
    for tree, points in batch.cases:
        skeletons = (tree.tape.instruction_set.skeletons[code] for code in tree.tape.skeletons)
        if any(skeleton.own_influence_near for skeleton in skeletons):
            continue
        reach = (10.0 ** rng.uniform(-3.0, 0.5, POINTS)).astype(np.float32)
        direction = random_units(rng, POINTS)
        other = (points + 0.999 * (reach * rng.uniform(0.0, 1.0, POINTS))[:, None] * direction).astype(
            np.float32
        )
        length = np.linalg.norm(tree.gradient(other), axis=1)
        assert (length <= bounds_at(tree.tape, points, reach)[:, 1] * (1.0 + 1e-5) + 1e-6).all(), tree


@EVERY_BATCH
def test_no_field_rises_or_falls_faster_along_a_ray_than_its_bounds(batch: Batch) -> None:
    """−L₋ · u ≤ f(q + u·d) − f(q) ≤ L₊ · u all the way, 320 pairs for each tree, in float64."""
    rng = np.random.default_rng(batch.start)
    tight = tight_ball = 0.0
    for tree, _ in batch.cases:
        starts = points_around(rng, tree, BALLS)
        reach = (10.0 ** rng.uniform(-3.0, 0.5, BALLS)).astype(np.float32)
        headings = random_units(rng, BALLS).astype(np.float32)
        value, rise, fall = bounds_along(tree.tape, starts, headings, reach).astype(np.float64).T
        np.testing.assert_array_equal(value.astype(np.float32), values_at(tree.tape, starts))
        distance = reach * np.linspace(0.1, 1.0, IN_BALL)[:, None]
        places = starts.astype(np.float64) + headings.astype(np.float64) * distance[..., None]
        change = oracle.value(tree, places.reshape(-1, 3)).reshape(distance.shape) - oracle.value(
            tree, starts
        )
        assert (change - rise * distance).max() <= 1e-5, tree
        assert (-change - fall * distance).max() <= 1e-5, tree
        balls = bounds_at(tree.tape, starts, reach)[:, 1]
        assert (np.maximum(rise, fall) <= balls * (1.0 + 1e-4) + 1e-6).all(), tree
        tight = max(tight, float((change / np.maximum(rise * distance, 1e-4)).max()))
        tight_ball = max(tight_ball, float((np.abs(change) / np.maximum(balls * distance, 1e-4)).max()))
    assert tight_ball > 0.7
    assert tight > 0.9, "the bounds are so loose that this shows nothing"


def test_along_a_ray_bounds_tend_to_the_slope() -> None:
    """That is why rays arrive in few steps, however slantingly they come."""
    tree = Point((0, 0, 0), radius=1.0) + Segment((0.5, 0, 0), (1, 1, 0), radius=0.5)
    rng = np.random.default_rng(2)
    points = points_around(rng, tree, 500)
    headings = random_units(rng, 500)
    along = (tree.gradient(points) * headings).sum(axis=1)
    _, rise, _ = bounds_along(tree.tape, points, headings, 1e-4).T
    np.testing.assert_allclose(rise, along, atol=2e-3)
    assert (rise < -0.1).any()


def test_the_bound_is_zero_far_from_all_primitives() -> None:
    tree = Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=0.5)
    assert bounds_at(tree.tape, [[50.0, 0.0, 0.0]], 10.0).tolist() == [[0.0, 0.0]]
    assert bounds_at(tree.tape, [[50.0, 0.0, 0.0]], 60.0)[0, 1] > 0.0


# -- unusual points -------------------------------------------------------------------------------------

BALL = Point((0, 0, 0), radius=1.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 2e18, -3e38, 1e39])
def test_points_that_are_not_finite_are_refused(bad: float) -> None:
    with pytest.raises(
        InvalidPoints, match=r"points: expected finite coordinates within ±1e\+18, got .* in row 1"
    ):
        BALL([[0.0, 0.0, 0.0], [0.0, bad, 0.0]])


@pytest.mark.parametrize(
    "wrong",
    [1.0, [1.0, 2.0], [[1.0, 2.0]], np.zeros((2, 4)), np.zeros((2, 3, 1)), np.zeros((0, 2)), "abc", None,
     [[1, 2, 3], [1, 2]], [["a", "b", "c"]], {"x": 1}, np.zeros((3, 0))],
)  # fmt: skip
def test_arrays_of_a_wrong_shape_are_refused(wrong: object) -> None:
    with pytest.raises(InvalidPoints, match=r"points: expected an array of shape \(n, 3\), got "):
        BALL(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("point", [[0.5, 0.2, 0.0], (1, 0, 0), np.array([0.0, 0.0, 0.9])])
def test_one_point_gives_one_row(point: ArrayLike) -> None:
    rows = np.array([point])
    for evaluate in (BALL, BALL.gradient, BALL.colors):
        one = evaluate(point)
        assert one.shape == evaluate(rows).shape[1:]
        np.testing.assert_array_equal(one, evaluate(rows)[0])
    hits = BALL.raycast([3, 0, 0], [-1, 0, 0])
    np.testing.assert_allclose(hits.distances, [2.0], atol=1e-3)


@pytest.mark.parametrize("none", [np.zeros((0, 3)), np.zeros((0, 3), np.float32), []])
def test_no_points_give_no_results(none: list[float]) -> None:
    assert BALL(none).shape == (0,)
    assert BALL.gradient(none).shape == (0, 3)
    assert BALL.colors(none).shape == (0, 3)
    assert bounds_at(BALL.tape, none, []).shape == (0, 2)


@pytest.mark.parametrize("size", [1e4, 1e9, 1e18])
def test_huge_points_are_outside(size: float) -> None:
    for tree in (
        BALL,
        BUILT_IN_TREES[0],
        BUILT_IN_TREES[1],
        Segment((0, 0, 0), (1, 0, 0), radius=0.1).scale((1, 2, 1)) + BALL,
    ):
        points = np.array([[0.99, 0.0, 0.0], [0.0, -0.99, 0.0], [0.99, 0.9, 0.9], [-0.5, 0.9, -0.9]]) * size
        assert (tree(points) == 0.0).all()
        assert (tree.gradient(points) == 0.0).all()
        assert np.isfinite(bounds_at(tree.tape, points, 1.0)).all()
        assert np.isfinite(tree.colors(points)).all()


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.float16, np.int64, np.uint8])
def test_points_of_any_type_and_memory_layout_are_accepted(kind: type) -> None:
    points: NDArray[Any] = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 2]], kind)
    expected = BALL(points.tolist())
    np.testing.assert_array_equal(BALL(points), expected)
    np.testing.assert_array_equal(BALL(np.asfortranarray(points)), expected)
    np.testing.assert_array_equal(BALL(np.repeat(points, 2, axis=0)[::2]), expected)
    assert BALL(points).dtype == np.float32


def test_points_are_not_modified() -> None:
    points = np.zeros((3, 3), np.float32)
    points.flags.writeable = False
    assert BALL(points).tolist() == [1.0, 1.0, 1.0]
    assert gradients_at(BALL.tape, points)[:, 0].tolist() == [1.0, 1.0, 1.0]
    assert colors_at(BALL.tape, points).shape == (3, 3)
