"""Derivatives of fields by parameters: against differences in float64, for every kind of node."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import (
    Box,
    Ellipsoid,
    InvalidNode,
    InvalidPoints,
    Node,
    NumericParameter,
    Point,
    Polygon,
    Ricci,
    Segment,
    Sum,
    numeric_parameters,
    numeric_values,
    with_numeric_values,
)
from blobtree.nodes.numeric_parameters import node_along
from tests.blobtree.custom_kinds import CUSTOM_TREES
from tests.blobtree.trees import CONTACTS, DEFORMED, FIELDS, SHAPES, SOLIDS, points_around, random_trees
from tests.oracles import blobtree as oracle

Numbers = NDArray[np.float64]
POINTS = 20
AWAY = 1e-2
STEP = 1e-5


def differences(tree: Node, parameter: NumericParameter, points: Numbers) -> Numbers:
    """Return the derivative (n,) by a parameter as a difference in float64."""
    (value,) = numeric_values(tree, [parameter])
    ends = [oracle.value(with_numeric_values(tree, [parameter], [value + d]), points) for d in (STEP, -STEP)]
    result: Numbers = (ends[0] - ends[1]) / (2.0 * STEP)
    return result


def check(tree: Node, rng: np.random.Generator, columns: int = 10) -> int:
    """Compare some columns; return how many values were compared."""
    points = points_around(rng, tree, POINTS)
    exact = points.astype(np.float64)
    smooth = oracle.evaluate(tree, exact).margin > AWAY
    parameters = numeric_parameters(tree)
    chosen = [parameters[i] for i in rng.permutation(len(parameters))[:columns]]
    seen = tree.parameter_gradient(points, chosen)
    assert seen.values.shape == (POINTS, len(chosen))
    compared = 0
    for parameter, column in zip(chosen, seen.values.T, strict=True):
        try:
            expected = differences(tree, parameter, exact)
        except InvalidNode:  # at the end of its range
            continue
        node = node_along(tree, parameter.path)
        if isinstance(node, Segment) and node.start == node.end:  # it has no derivative by its ends
            continue
        size = max(1.0, float(np.abs(expected).max()))
        assert (np.abs(column - expected) <= 1e-4 * size)[smooth].all(), (str(parameter), tree)
        compared += int(smooth.sum())
    return compared


TREES = {
    "solids": random_trees(seed=15, count=4, more=SOLIDS),
    "custom": CUSTOM_TREES[1:2],
    "shapes": random_trees(seed=5, count=6, depth=2, more=SHAPES),
    "fields": random_trees(seed=5, count=6, depth=2, more=FIELDS),
    "deformed": random_trees(seed=5, count=4, depth=2, more=DEFORMED),
    "contacts": random_trees(seed=5, count=4, depth=2, more=CONTACTS),
}


@pytest.mark.parametrize("kind", TREES)
def test_derivatives_match_differences(kind: str) -> None:
    rng = np.random.default_rng(4)
    assert sum(check(tree, rng) for tree in TREES[kind]) > 40 * len(TREES[kind])


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
            seen.values[:, column], differences(tree, seen.parameters[column], points), rtol=1e-3
        )


def test_similar_and_other_maps() -> None:
    rng = np.random.default_rng(1)
    ball = Point((0.2, 0, 0), radius=1.0)
    for tree in (
        ball.rotate((1, 2, 3), 30),
        ball.scale((1, 2, 1)),
        Ellipsoid((0, 0, 0), (1, 1, 1)).offset(0.1),
    ):
        check(tree + Segment((0, 0, 0), (1, 1, 0), radius=0.3), rng, columns=40)


def test_outside_every_support_derivatives_are_0_and_bad_points_are_refused() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    np.testing.assert_array_equal(ball.parameter_gradient([[9, 9, 9]]).values, np.zeros((1, 4)))
    assert ball.parameter_gradient(np.zeros((0, 3))).values.shape == (0, 4)
    with pytest.raises(InvalidPoints):
        ball.parameter_gradient([[np.nan, 0, 0]])
