"""Hessians against differences in float64, and curvatures against those of known surfaces."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Box, Node, Point, Torus
from blobtree.errors import InvalidPoints
from tests.blobtree.custom_kinds import CUSTOM_TREES
from tests.blobtree.trees import CONTACTS, DEFORMED, FIELDS, SHAPES, SOLIDS, RandomTrees, points_around
from tests.oracles import blobtree as oracle

Numbers = NDArray[np.float64]
POINTS = 25
AWAY = 1e-2
TORUS = Torus((0.3, 0.1, -0.2), (0, 0, 1), 1.0, radius=0.3)
AXES = np.array([1.0, 2.0, 0.7])
ELLIPSOID = Point((0, 0, 0), radius=1.0).scale(AXES)


def second_differences(node: Node, points: Numbers, step: float) -> Numbers:
    """Return Hessians (n, 3, 3) by differences of the gradient in float64."""
    rows = [
        (oracle.gradient(node, points + d, 1e-5) - oracle.gradient(node, points - d, 1e-5)) / (2.0 * step)
        for d in step * np.eye(3)
    ]
    return np.stack(rows, axis=1)


TREES: dict[str, Sequence[Node]] = {
    "solids": RandomTrees(seed=8, count=5, more=SOLIDS),
    "custom": CUSTOM_TREES[:2],
    "shapes": RandomTrees(seed=6, count=5, depth=2, more=SHAPES),
    "fields": RandomTrees(seed=6, count=6, depth=2, more=FIELDS),
    "deformed": RandomTrees(seed=6, count=4, depth=2, more=DEFORMED),
    "contacts": RandomTrees(seed=6, count=4, depth=2, more=CONTACTS),
}


@pytest.mark.slow_cases("custom", "fields", "shapes", "solids")
@pytest.mark.parametrize("kind", TREES)
def test_hessians_match_differences(kind: str) -> None:
    trees = TREES[kind]
    rng = np.random.default_rng(2)
    compared = 0
    for tree in trees:
        points = points_around(rng, tree, POINTS)
        exact = points.astype(np.float64)
        near, far = (second_differences(tree, exact, step) for step in (1e-4, 3e-4))
        size = np.maximum(1.0, np.abs(near).max(axis=(1, 2)))
        smooth = np.abs(near - far).max(axis=(1, 2)) < 1e-4 * size  # no kink of the gradient within reach
        smooth &= oracle.evaluate(tree, exact).margin > AWAY
        error = np.abs(tree.hessian(points) - near).max(axis=(1, 2))
        assert (error <= 1e-3 * size)[smooth].all(), tree
        compared += int(smooth.sum())
    assert compared > 0.4 * POINTS * len(trees)


def test_a_point_alone_has_one_hessian() -> None:
    model = Point((0, 0, 0), radius=1.0)
    assert model.hessian((0.5, 0, 0)).shape == (3, 3)
    np.testing.assert_array_equal(model.hessian([[9, 9, 9]]), np.zeros((1, 3, 3)))
    assert model.hessian(np.zeros((0, 3))).shape == (0, 3, 3)
    with pytest.raises(InvalidPoints):
        model.hessian([[np.nan, 0, 0]])


def torus_samples(count: int) -> tuple[Numbers, Numbers, Numbers]:
    """Return points on TORUS, their normals, and the principal curvatures there."""
    around, along = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, (2, count))
    ring = np.stack([np.cos(along), np.sin(along), 0.0 * along], axis=1)
    normals = np.cos(around)[:, None] * ring + np.sin(around)[:, None] * [0.0, 0.0, 1.0]
    curvatures = np.stack([np.full(count, 1.0 / 0.3), np.cos(around) / (1.0 + 0.3 * np.cos(around))], axis=1)
    return np.array(TORUS.center) + ring + 0.3 * normals, normals, curvatures


def ellipsoid_samples(count: int) -> tuple[Numbers, Numbers, Numbers]:
    """Return points on ELLIPSOID, with the support function h: K = h⁴ / (abc)², and H."""
    unit = np.random.default_rng(2).normal(size=(count, 3))
    points = unit / np.linalg.norm(unit, axis=1, keepdims=True) * AXES
    h = 1.0 / np.linalg.norm(points / AXES**2, axis=1)
    gauss = h**4 / np.prod(AXES) ** 2
    mean = h**3 * (np.sum(AXES**2) - np.sum(points**2, axis=1)) / (2.0 * np.prod(AXES) ** 2)
    root = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
    return points, (points / AXES**2) * h[:, None], np.stack([mean + root, mean - root], axis=1)


@pytest.mark.parametrize(("node", "samples"), [(TORUS, torus_samples), (ELLIPSOID, ellipsoid_samples)])
def test_curvatures_of_known_surfaces(node: Node, samples: object) -> None:
    assert callable(samples)
    points, normals, expected = samples(500)
    seen = node.curvatures(points)
    size = np.abs(expected).max(axis=1)
    assert (np.abs(seen.principal - expected) <= 1e-3 * size[:, None]).all()
    assert (np.abs(seen.mean - expected.mean(axis=1)) <= 1e-3 * size).all()
    assert (np.abs(seen.gauss - expected.prod(axis=1)) <= 1e-3 * size**2).all()
    assert np.abs(np.einsum("nki,ni->nk", seen.directions, normals)).max() < 1e-3
    products = np.einsum("nki,nli->nkl", seen.directions, seen.directions)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(2), products.shape), atol=1e-6)


def test_principal_directions_of_a_torus_run_around_its_tube_and_along_its_ring() -> None:
    points, normals, _ = torus_samples(200)
    directions = TORUS.curvatures(points).directions
    offset = points - np.array(TORUS.center)
    along = np.cross([0.0, 0.0, 1.0], offset)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    assert np.abs(np.einsum("ni,ni->n", directions[:, 1], along)).min() > 0.999
    assert np.abs(np.einsum("ni,ni->n", directions[:, 0], np.cross(along, normals))).min() > 0.999


def test_a_ball_curves_equally_in_all_directions_and_its_hollow_the_other_way() -> None:
    ball = Point((0, 0, 0), radius=2.0)
    np.testing.assert_allclose(ball.curvatures([[0, 0, 2], [0, 2, 0]]).principal, 0.5, rtol=1e-5)
    hollow = Box((0, 0, 0), (6, 6, 6), radius=0.1) - ball
    np.testing.assert_allclose(hollow.curvatures([[0, 0, 1.999]]).principal, -0.5, rtol=2e-3)


def test_flat_fields_have_no_curvature() -> None:
    seen = Point((0, 0, 0), radius=1.0).curvatures([[0, 0, 0], [9, 9, 9], [0, 0, 1]])
    assert np.isnan(seen.principal[:2]).all()
    assert np.isnan(seen.mean[:2]).all()
    assert np.isnan(seen.gauss[:2]).all()
    assert np.isnan(seen.directions[:2]).all()
    assert np.isfinite(seen.directions[2]).all()
