"""The polygonizer that ours is measured against is a whole one: closed, oriented, of the right size."""

import numpy as np
import pytest

from blobtree import Mesh
from blobtree.cells.grid import aligned_grid
from blobtree.cells.sparse_cells import build_cells
from tests.bench.marching_cubes import TRIANGLE_COUNT, marching_cubes
from tests.blobtree.meshing.test_polygonize import BALL, assert_closed, ring, volume


def meshed(tree: object, cell: float) -> Mesh:
    lower, upper = (corner.astype(np.float64) for corner in tree.support)  # type: ignore[attr-defined]
    cells = build_cells(tree.tape, aligned_grid(lower - cell, upper + cell, cell))  # type: ignore[attr-defined]
    positions, faces = marching_cubes(cells)
    return Mesh(positions.numpy(), faces.numpy(), positions.numpy(), positions.numpy())


def test_the_table_has_the_known_number_of_triangles() -> None:
    assert TRIANGLE_COUNT.max() <= 5
    assert (TRIANGLE_COUNT[0], TRIANGLE_COUNT[255], TRIANGLE_COUNT[1]) == (0, 0, 1)


def test_a_ball_and_a_ring_are_closed_and_of_the_right_size() -> None:
    ball = meshed(BALL, 0.05)
    assert_closed(ball)
    assert volume(ball) == pytest.approx(4.0 / 3.0 * np.pi, rel=0.01)
    assert len(ball.vertices) - len(ball.faces) // 2 == 2
    torus = meshed(ring(), 0.05)
    assert_closed(torus)
    assert len(torus.vertices) - len(torus.faces) // 2 == 0
    assert volume(torus) > 0.0
