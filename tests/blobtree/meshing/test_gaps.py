"""Gaps narrower than cells: parts that do not meet have meshes of their own, or the gap is named."""

import logging
from itertools import pairwise

import numpy as np
import pytest

from blobtree import Box, Node, Point, Polygonizer, Segment, Sum, Union, polygonize
from blobtree.meshing.block_tree import BlockTree
from blobtree.meshing.gaps import Gaps, open_blocks
from blobtree.meshing.mesh import DeviceMesh, bridging_faces
from tests.gap_pairs import random_pair
from tests.thin_trees import is_closed, pieces

BALL = Point((0, 0, 0), radius=1.0)
CUBE = Box((0, 0, 0), (1, 1, 1), radius=0.05)
DIAGONAL = (220, 226)
"""Pairs of which only diagonals of small cells cross the gap: a ball is 1e-4 to 2e-4 of the box away."""


def count(tree: Node) -> int:
    """Return how many pieces the closed mesh of a tree has."""
    mesh = polygonize(tree)
    assert is_closed(mesh.faces)
    assert np.abs(tree(mesh.vertices) - 0.5).max() < 1e-3
    return int(pieces(mesh).max()) + 1


@pytest.mark.parametrize("seed", [0, 2, 4, 10, 25, 42, 43, 56])
def test_a_pair_has_two_pieces(seed: int) -> None:
    assert count(random_pair(seed).tree) == 2


@pytest.mark.slow
@pytest.mark.parametrize("first", range(200, 240, 5))
def test_pairs_have_two_pieces_or_are_named(first: int, caplog: pytest.LogCaptureFixture) -> None:
    for seed in range(first, first + 5):
        caplog.clear()
        assert count(random_pair(seed).tree) == 2 or "gaps are too narrow" in caplog.text


@pytest.mark.parametrize("seed", DIAGONAL)
def test_gaps_that_only_diagonals_of_cells_cross_are_found(seed: int) -> None:
    assert count(random_pair(seed).tree) == 2


def test_the_ends_of_a_bow_stay_apart() -> None:
    corners = [(0.003, 0, 0), (1, 0, 0), (1, 1, 0), (-1, 1, 0), (-1, 0, 0), (-0.003, 0, 0)]
    rods = [
        Segment(start, end, radius=0.1).translate((0.1 if start[0] > 0 else -0.1, 0, 0))
        for start, end in pairwise(corners)
    ]
    tree = Union(tuple(rods))
    mesh = polygonize(tree)
    assert len(mesh.vertices) - len(mesh.faces) // 2 == 2  # as a ball, not as a ring


def test_a_chain_of_balls_has_as_many_pieces() -> None:
    assert count(Union(tuple(BALL.translate((2.002 * number, 0, 0)) for number in range(5)))) == 5


@pytest.mark.parametrize(
    "tree",
    [
        BALL | BALL.translate((1.99, 0.01, 0.03)),
        BALL | BALL.translate((1.5, 0.01, 0.03)),
        BALL + BALL.translate((1.99, 0, 0)),
        CUBE | CUBE.translate((1.1, 0.1, 0.2)),
        CUBE | BALL.translate((1.2, 0, 0)),
    ],
)
def test_parts_that_meet_keep_cells_of_one_size(tree: Node, caplog: pytest.LogCaptureFixture) -> None:
    uniform, default = polygonize(tree, resolution=64), polygonize(tree)
    assert np.array_equal(uniform.vertices, default.vertices)
    assert not caplog.records


def meshed(tree: Node, resolution: int = 32) -> DeviceMesh:
    """Return the mesh in cells of one size."""
    return Polygonizer(tree, resolution=resolution).device_mesh


@pytest.mark.parametrize("seed", range(4))
def test_only_triangles_across_gaps_and_creases_may_bridge(seed: int) -> None:
    places = np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 3)).tolist()
    parts = [Point((x, y, z), radius=0.8) for x, y, z in places]
    blend, union = meshed(Sum(tuple(parts))), meshed(Union(tuple(parts)))
    assert not len(bridging_faces(blend))
    bridging, owners = bridging_faces(union), np.stack([part(union.vertices.numpy()) for part in parts])
    corners = owners.argmax(axis=0)[union.faces.numpy()[bridging]]
    assert len(bridging)
    assert (corners != corners[:, :1]).any(axis=1).all()


@pytest.mark.parametrize("seed", [0, 4, 43, 56, *DIAGONAL])
def test_triangles_across_gaps_bridge(seed: int) -> None:
    first, second = random_pair(seed).tree.operands
    mesh = meshed(first | second, 64)
    side = first(mesh.vertices.numpy()) > second(mesh.vertices.numpy())
    across = side[mesh.faces.numpy()].any(axis=1) & ~side[mesh.faces.numpy()].all(axis=1)
    assert across.any()
    assert set(np.flatnonzero(across)) & set(bridging_faces(mesh))
    assert len(open_blocks(mesh))


@pytest.mark.parametrize("distance", [0.3, 0.9])
@pytest.mark.parametrize("other", [BALL, CUBE, Segment((-2, 0, 0), (2, 0, 0), radius=0.5)])
def test_triangles_across_creases_are_passed_over(other: Node, distance: float) -> None:
    mesh = meshed(BALL | other.translate((distance, 0.2, 0.1)))
    assert not len(open_blocks(mesh))


@pytest.mark.parametrize("seed", [0, 2, 10, 43])
def test_edges_across_gaps_are_those_that_dense_samples_find(seed: int) -> None:
    tree = random_pair(seed).tree
    first, _second = tree.operands
    blocks = BlockTree(meshed(tree, 64).cells)
    found, grid, shares = Gaps(blocks).edges(), blocks.grid(0), np.linspace(0.0, 1.0, 257)
    expected = set()
    for axis, step in enumerate(np.eye(3, dtype=int)):
        block, *low = np.nonzero(np.ones_like(blocks.values[:, :4, :4, :4]))
        places = np.stack(low, axis=1)
        ends = [blocks.values[block, *(places + end * step).T] >= 0.5 for end in (0, 1)]
        inside = np.flatnonzero(ends[0] & ends[1])
        starts = grid.origin + (4 * blocks.coordinates[block] + places)[inside] * grid.cell_size
        left, right = (first(starts + end * grid.cell_size * step) >= 0.5 for end in (0, 1))
        inside, starts = inside[left != right], starts[left != right]  # within a convex part an edge stays
        samples = tree((starts[:, None] + shares[:, None] * grid.cell_size * step).reshape(-1, 3))
        for row in inside[samples.reshape(-1, len(shares)).min(axis=1) < 0.5].tolist():
            expected.add((block[row], *places[row], axis))
    own = (found.lowest < 4).all(axis=1)  # those of the loop above
    rows = np.column_stack([found.blocks, found.lowest, found.steps.argmax(axis=1)])[own]
    assert set(map(tuple, rows.tolist())) == expected
    assert expected


def test_a_gap_too_narrow_for_memory_is_named_once(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        mesh = polygonize(CUBE | Box((1.1 + 3e-5, 0.1, 0.2), (1, 1, 1), radius=0.05))
    assert is_closed(mesh.faces)
    (record,) = caplog.records
    assert "one between the Box at path (0,) and the Box at path (1,) near (0.55," in record.getMessage()
    assert "resolution of" in record.getMessage()
