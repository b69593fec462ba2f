"""The other methods of `python -m tests.bench.node_peers` mesh the same surface."""

import numpy as np

from blobtree import Point
from tests.bench.node_peers import METHODS, models, qualities, run, samples, vertex_errors


def test_vtk_and_ours_mesh_the_same_ball() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    for method, error in (("blobtree", 1e-4), ("NumPy + VTK", 0.1)):
        result = run(METHODS[method], ball, 16)
        assert abs(np.linalg.norm(result.vertices, axis=1).mean() - 1.0) < 0.01
        assert vertex_errors(ball, result.vertices, 2.0 / 16).max() < error
        assert 0.0 <= qualities(result).min() <= qualities(result).max() <= 1.0 + 1e-9


def test_samples_are_the_values_at_grid_points() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    values = samples(ball, np.array([-1.0, 0.0, 0.0]), np.array([3, 2, 2]), 1.0)
    assert values.shape == (3, 2, 2)
    np.testing.assert_allclose(values[:, 0, 0], [0.5, 1.0, 0.5])


def test_every_model_has_a_surface() -> None:
    assert all((node.bounds[1] > node.bounds[0]).all() for node in models().values())
