"""Tests of the comparison with the paper's octree."""

import numpy as np

from tests.bench.paper_octree import LEAF_DECALS, Octree, padded


def test_a_leaf_lists_all_balls_that_reach_its_points() -> None:
    rng = np.random.default_rng(3)
    centres, reach = rng.uniform(0, 1, (300, 3)), rng.uniform(0.02, 0.08, 300)
    octree = Octree.build(centres, reach)
    points = rng.uniform(0, 1, (500, 3))
    listed, steps = octree.find(points)
    near = np.linalg.norm(points[:, None] - centres, axis=2) < reach
    assert octree.dropped == 0
    assert steps.max() == octree.depth + 1
    for row, needed in zip(listed, near, strict=True):
        assert set(np.flatnonzero(needed)) <= set(row[row >= 0])


def test_leaves_drop_balls_beyond_the_eighth() -> None:
    octree = Octree.build(np.zeros((11, 3)), np.ones(11), depth=2)
    listed, _ = octree.find(np.zeros((1, 3)))
    assert (listed >= 0).sum() == LEAF_DECALS
    assert octree.dropped > 0


def test_lists_become_rows() -> None:
    assert padded(np.array([0, 2, 2, 3]), np.array([4, 5, 6])).tolist() == [[4, 5], [-1, -1], [6, -1]]
