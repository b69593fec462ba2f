"""Derivatives of fields by parameters: against differences in float64, for every kind of node."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import (
    Box,
    Ellipsoid,
    Node,
    Point,
    Polygon,
    Ricci,
    Segment,
    Sum,
    Sweep,
    numeric_parameters,
    numeric_values,
    with_numeric_values,
)
from blobtree.errors import InvalidNode, InvalidPoints
from blobtree.nodes.kinds import NODE_KINDS
from tests.blobtree.custom_kinds import CUSTOM_TREES
from tests.blobtree.trees import (
    CONTACTS,
    DEFORMED,
    FIELDS,
    SHAPES,
    SOLIDS,
    RandomTrees,
    points_around,
    random_trees,
)
from tests.conformance import sample
from tests.oracles import blobtree as oracle
from tests.parameter_derivatives import AWAY, STEP, difference, wrong_derivatives

Numbers = NDArray[np.float64]

TREES: dict[str, Sequence[Node]] = {
    "solids": RandomTrees(seed=15, count=4, more=SOLIDS),
    "custom": CUSTOM_TREES[1:2],
    "shapes": RandomTrees(seed=5, count=3, depth=2, more=SHAPES),
    "fields": RandomTrees(seed=5, count=6, depth=2, more=FIELDS),
    "deformed": RandomTrees(seed=5, count=4, depth=2, more=DEFORMED),
    "contacts": RandomTrees(seed=5, count=4, depth=2, more=CONTACTS),
}


@pytest.mark.slow_cases("shapes", "custom", "solids")
@pytest.mark.parametrize("kind", TREES)
def test_derivatives_match_differences(kind: str) -> None:
    rng = np.random.default_rng(4)
    compared = 0
    for tree in TREES[kind]:
        count, wrong = wrong_derivatives(tree, rng)
        assert wrong == []
        compared += count
    assert compared > 40 * len(TREES[kind])


@pytest.mark.slow
@pytest.mark.parametrize("tag", NODE_KINDS)
def test_derivatives_of_a_class_match_differences(tag: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(3):
        assert wrong_derivatives(sample(NODE_KINDS[tag], rng), rng)[1] == []


@pytest.mark.parametrize(
    "seed", [5, pytest.param(6, marks=pytest.mark.slow), pytest.param(7, marks=pytest.mark.slow)]
)
def test_derivatives_by_the_points_of_a_sweep_match_differences(seed: int) -> None:
    """The frames of these courses are half turns from the vectors across their lines, or are near them."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (3, 3)) + np.arange(3)[:, None] * (2.0, 0.5, 0.0)
    outline = "M-.1-.15H.1V.15H-.1Z"
    courses = (
        Sweep(outline, ((0, 0, 0), (1, 0.2, 0)), radius=0.05),
        Sweep(outline, points.tolist()),
        Sweep(outline, (points * (1.0, 1.0, 0.0)).tolist(), corners="smooth"),
        Sweep(outline, points[:2].tolist(), end_scale=0.7, end_turn=40.0),
    )
    for tree in courses:
        count, wrong = wrong_derivatives(tree, rng, columns=12)
        assert wrong == []
        assert count > 60


def test_numbers_that_may_not_change_are_no_parameters() -> None:
    outline = "M-.1-.15H.1V.15H-.1Z"
    bent: Any = ((0, 0, 0), (1, 0, 0), (1, 1, 0))
    for tree, scales in (
        (Sweep(outline, bent), False),
        (Sweep(outline, bent, corners="smooth", ends="closed"), False),
        (Sweep(outline, bent, corners="smooth"), True),
        (Sweep(outline, bent[:2]), True),
    ):
        names = {parameter.name for parameter in numeric_parameters(tree)}
        assert ("end_scale" in names) == scales
        assert np.isfinite(tree.parameter_gradient([[0.5, 0.02, 0.1]]).values).all()


def test_the_corners_of_a_polygon_move_in_its_plane() -> None:
    flat = np.array([(0.8, 0.0), (0.2, 0.3), (0.1, 0.9), (-0.7, 0.2), (-0.1, -0.1), (0.1, -0.8)])
    axes = np.linalg.qr(np.array([[1.0, 0.2], [0.1, 1.0], [0.4, -0.3]]))[0].T
    polygon = Polygon((flat @ axes).tolist(), radius=0.3)
    points = points_around(np.random.default_rng(6), polygon, 60)
    exact = points.astype(np.float64)
    away = oracle.signed(polygon, exact).margin > AWAY
    seen = polygon.parameter_gradient(points).values[:, : flat.size * 3 // 2].reshape(-1, len(flat), 3)
    for corner in range(len(flat)):
        for axis in axes:
            shift = STEP * np.eye(len(flat))[corner][:, None] * axis
            ends = [
                oracle.value(Polygon((flat @ axes + d).tolist(), radius=0.3), exact) for d in (shift, -shift)
            ]
            expected = (ends[0] - ends[1]) / (2.0 * STEP)
            np.testing.assert_allclose((seen[:, corner] @ axis)[away], expected[away], atol=1e-4)


def test_a_polygon_may_change_its_triangles() -> None:
    corners: Any = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]  # both diagonals cut it equally
    square = Polygon(corners, radius=0.3)
    points = np.array([[0.5, 1.1, 0.2], [1.1, 0.4, 0.1], [1.15, 1.1, 0.1], [0.2, 0.3, 0.2]])
    seen = square.parameter_gradient(points)
    assert np.abs(seen.values).max() < 3.0
    radial = seen.values[:, [str(parameter) for parameter in seen.parameters].index("root: radius")]
    ends = [oracle.value(Polygon(corners, radius=0.3 + d), points) for d in (STEP, -STEP)]
    np.testing.assert_allclose(radial, (ends[0] - ends[1]) / (2.0 * STEP), rtol=1e-4)


def test_parameters_have_names_values_and_copies() -> None:
    tree = Ricci(
        (Point((1, 2, 3), radius=1.0), Segment((0, 0, 0), (1, 0, 0), radius=0.5).twist(20)), exponent=2
    )
    parameters = numeric_parameters(tree)
    assert [str(parameter) for parameter in parameters] == [
        "root: exponent",
        *(f"0: center[{i}]" for i in range(3)),
        "0: radius",
        "1: degrees",
        *(f"1.0: start[{i}]" for i in range(3)),
        *(f"1.0: end[{i}]" for i in range(3)),
        "1.0: radius",
    ]
    values = numeric_values(tree, parameters)
    assert values.tolist() == [2.0, 1.0, 2.0, 3.0, 1.0, 20.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5]
    assert with_numeric_values(tree, parameters, values) == tree
    moved = with_numeric_values(tree, parameters, values + 1.0)
    np.testing.assert_allclose(numeric_values(moved, parameters), values + 1.0)
    assert with_numeric_values(tree, [], []) is tree
    with pytest.raises(InvalidNode, match="radius"):
        with_numeric_values(tree, parameters, -values)


def test_chosen_parameters_give_the_same_columns() -> None:
    tree = random_trees(seed=3, count=1, more=SOLIDS)[0]
    points = points_around(np.random.default_rng(0), tree, 30)
    everything = tree.parameter_gradient(points)
    chosen = everything.parameters[1::3]
    np.testing.assert_allclose(
        tree.parameter_gradient(points, chosen).values, everything.values[:, 1::3], atol=2e-5, rtol=2e-5
    )


def test_a_shared_node_has_a_parameter_per_path() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    tree = Sum((ball, ball))
    seen = tree.parameter_gradient([[0.7, 0, 0]])
    np.testing.assert_allclose(seen.values[0, :4], seen.values[0, 4:])
    alone = ball.parameter_gradient([[0.7, 0, 0]])
    np.testing.assert_allclose(seen.values[0, :4], alone.values[0], rtol=1e-6)


def test_derivatives_at_the_ends_of_ranges() -> None:
    first, second = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    points = np.array([[0.4, 0.3, 0.1], [0.1, 0.9, 0.2]])
    seen = Ricci((first, second), exponent=1.0).parameter_gradient(points).values[:, 0]
    a, b = oracle.value(first, points), oracle.value(second, points)
    np.testing.assert_allclose(seen, a * np.log(a) + b * np.log(b) - (a + b) * np.log(a + b), rtol=1e-3)
    flat = Box((0, 0, 0), (1, 0, 1), radius=0.5).parameter_gradient([[0, 0.4, 0]])
    column = [str(parameter) for parameter in flat.parameters].index("root: size[1]")
    radial = -Box((0, 0, 0), (1, 0, 1), radius=0.5).gradient([[0, 0.4, 0]])[0, 1] / 2.0
    np.testing.assert_allclose(flat.values[0, column], radial, rtol=1e-3)


def test_nested_blends_of_equal_exponents_have_separate_derivatives() -> None:
    a, b, c = (Point((x, 0, 0), radius=1.0) for x in (0.0, 0.5, 1.0))
    tree = Ricci((Ricci((a, b), exponent=2.0), c), exponent=2.0)
    points = np.array([[0.4, 0.3, 0.1]])
    seen = tree.parameter_gradient(points)
    for column in (0, 1):
        np.testing.assert_allclose(
            seen.values[:, column], difference(tree, seen.parameters[column], points), rtol=1e-3
        )


def test_similar_and_other_maps() -> None:
    rng = np.random.default_rng(1)
    ball = Point((0.2, 0, 0), radius=1.0)
    for tree in (
        ball.rotate((1, 2, 3), 30),
        ball.scale((1, 2, 1)),
        Ellipsoid((0, 0, 0), (1, 1, 1)).offset(0.1),
    ):
        assert wrong_derivatives(tree + Segment((0, 0, 0), (1, 1, 0), radius=0.3), rng, columns=40)[1] == []


def test_parameters_of_what_does_nothing_have_derivatives_of_0() -> None:
    tree = Point((0, 0, 0), radius=0.5) | Point((0.3, 0, 0), radius=0.5, weight=-0.5)
    seen = tree.parameter_gradient([[0.2, 0.1, 0.0]])
    absent = [parameter.path == (1,) for parameter in seen.parameters]
    assert not seen.values[:, absent].any()
    assert seen.values[:, np.logical_not(absent)].any()


def test_outside_every_support_derivatives_are_0_and_bad_points_are_refused() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    np.testing.assert_array_equal(ball.parameter_gradient([[9, 9, 9]]).values, np.zeros((1, 4)))
    assert ball.parameter_gradient(np.zeros((0, 3))).values.shape == (0, 4)
    with pytest.raises(InvalidPoints):
        ball.parameter_gradient([[np.nan, 0, 0]])
