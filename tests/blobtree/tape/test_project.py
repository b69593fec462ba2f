"""Projection of points onto the surface along the gradient."""

import numpy as np
import pytest

from blobtree import ISO, Point, Segment
from tests.blobtree.tape.evaluations import project
from tests.blobtree.trees import points_around, random_trees


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_projection_onto_a_ball(scale: float) -> None:
    ball = Point((0, 0, 0), radius=scale)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    start = directions * rng.uniform(0.6, 1.5, (500, 1)) * scale
    positions, normals = project(ball.tape, start, longest_step=0.5 * scale)
    np.testing.assert_allclose(positions / scale, directions, atol=3e-6)
    np.testing.assert_allclose(normals, directions, atol=1e-5)


def test_projection_onto_random_trees() -> None:
    """A point near a smooth part of the surface ends on it, with the outward unit normal."""
    rng = np.random.default_rng(1)
    arrived = started = 0
    for tree in random_trees(seed=12, count=30, depth=3):
        near = points_around(rng, tree, 400)
        near = near[np.abs(tree(near) - ISO) < 0.05]
        positions, normals = project(tree.tape, near, longest_step=0.05)
        gradient = tree.gradient(positions)
        length = np.linalg.norm(gradient, axis=1, keepdims=True)
        steep = length[:, 0] > 0.0
        np.testing.assert_allclose(
            normals[steep], (-gradient / np.where(length > 0.0, length, 1.0))[steep], atol=1e-5
        )
        started += len(near)
        arrived += int((np.abs(tree(positions) - ISO) < 1e-5).sum())
    assert started > 200
    assert arrived > 0.85 * started  # the rest sit at creases of min and max, where no gradient leads on


def test_a_point_on_the_surface_stays() -> None:
    bone = Segment((0, 0, 0), (1, 0, 0), radius=0.5)
    on = np.array([[0.5, 0.5, 0.0], [-0.5, 0.0, 0.0], [1.0, 0.0, 0.5]])
    positions, normals = project(bone.tape, on, longest_step=0.1)
    np.testing.assert_allclose(positions, on, atol=1e-6)
    np.testing.assert_allclose(normals, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-6)


def test_no_step_exceeds_the_longest_step() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    start = np.array([[2.1, 0.0, 0.0], [0.01, 0.0, 0.0]])
    positions, _ = project(ball.tape, start, longest_step=0.01)
    assert np.linalg.norm(positions - start, axis=1).max() <= 8 * 0.01 + 1e-6


def test_a_point_where_the_field_is_flat_stays_and_gets_no_normal() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    start = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    positions, normals = project(ball.tape, start, longest_step=1.0)
    np.testing.assert_array_equal(positions, start)
    assert (normals == 0.0).all()


def test_projection_of_no_points() -> None:
    positions, normals = project(Point((0, 0, 0), radius=1.0).tape, np.zeros((0, 3)), longest_step=1.0)
    assert positions.shape == normals.shape == (0, 3)
