"""After edits a Polygonizer's mesh matches `polygonize` bit for bit, and few blocks are rebuilt."""

from dataclasses import fields, replace

import numpy as np
import pytest
import warp as wp
from hypothesis import assume, given, settings

from blobtree import Mesh, Node, Point, Polygonizer, Segment, Sum, Union, polygonize
from blobtree.cells import runs
from blobtree.errors import InvalidResolution
from tests.blobtree.meshing.edits import edited
from tests.blobtree.trees import random_trees, trees


def assert_same_bits(ours: Mesh, fresh: Mesh) -> None:
    for field in fields(Mesh):
        a, b = getattr(ours, field.name), getattr(fresh, field.name)
        if field.name == "sheet_counts":
            assert a is b is None
            continue
        assert a.dtype == b.dtype
        assert a.shape == b.shape, field.name
        assert np.array_equal(a.view(np.int32), b.view(np.int32)), field.name


def rebuilt_blocks(polygonizer: Polygonizer) -> int:
    """Return the number of blocks that the last update rebuilt."""
    return int((polygonizer.dual_mesh.cells.leaves.sources.numpy() < 0).sum())


def small_blobs(count: int = 300) -> list[Point]:
    rng = np.random.default_rng(count)
    places = rng.uniform(0.0, 1.0, (count, 3)).tolist()
    return [Point((x, y, z), radius=0.04, color=(x, y, z)) for x, y, z in places]


@pytest.mark.slow_cases("1")
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4))])
def test_random_edits_match_a_new_mesh(seed: int) -> None:
    random_edits(seed)


@pytest.mark.parametrize("min_run", [0, 1 << 30])
def test_runs_and_kernels_copy_the_same(min_run: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the processor, kernels copy what runs are too short for, and on cards everything."""
    monkeypatch.setattr(runs, "MIN_RUN", min_run)
    random_edits(5)


def random_edits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    reused = 0
    for tree in random_trees(500 + seed, 6):
        polygonizer = Polygonizer(tree, resolution=40)
        edited_tree: Node = tree
        for _edit in range(6):
            edited_tree = edited(rng, edited_tree)
            mesh = polygonizer.update(edited_tree)
            assert_same_bits(mesh, polygonize(edited_tree, cell_size=polygonizer.cell_size))
            reused += len(polygonizer.dual_mesh.cells.leaves) - rebuilt_blocks(polygonizer)
    assert reused > 1000


@pytest.mark.slow
def test_many_random_edits() -> None:
    rng = np.random.default_rng(77)
    for tree in random_trees(600, 30, depth=5):
        polygonizer = Polygonizer(tree, resolution=32)
        edited_tree: Node = tree
        for _edit in range(8):
            edited_tree = edited(rng, edited_tree)
            mesh = polygonizer.update(edited_tree)
            assert_same_bits(mesh, polygonize(edited_tree, cell_size=polygonizer.cell_size))


@given(trees(max_leaves=6), trees(max_leaves=6))
@settings(max_examples=25)
def test_any_tree_may_follow_any_other(first: Node, second: Node) -> None:
    polygonizer = Polygonizer(first, resolution=24)
    lower, upper = second.support
    cells = np.max(np.subtract(upper, lower)) / polygonizer.cell_size
    assume(not 64 < cells < 1 << 20)  # others take half a minute
    try:
        fresh = polygonize(second, cell_size=polygonizer.cell_size)
    except InvalidResolution:
        with pytest.raises(InvalidResolution):
            polygonizer.update(second)
        assert polygonizer.tree is first
        return
    assert_same_bits(polygonizer.update(second), fresh)
    assert_same_bits(polygonizer.update(first), polygonize(first, cell_size=polygonizer.cell_size))


def test_moving_a_primitive_rebuilds_its_neighbourhood_alone() -> None:
    blobs = small_blobs()
    polygonizer = Polygonizer(Sum(tuple(blobs)), cell_size=1.0 / 96.0)
    before = len(polygonizer.dual_mesh.cells.leaves)
    blobs[17] = replace(blobs[17], center=(0.5, 0.5, 0.5))
    mesh = polygonizer.update(Sum(tuple(blobs)))
    assert_same_bits(mesh, polygonize(Sum(tuple(blobs)), cell_size=1.0 / 96.0))
    size = 4.0 / 96.0
    reach = 2.0 * 0.04 / 0.4542 + 2.0 * size
    assert 0 < rebuilt_blocks(polygonizer) <= 2.0 * (reach / size) ** 3
    assert rebuilt_blocks(polygonizer) < 0.2 * before


def test_a_blob_that_leaves_the_box_keeps_the_grid() -> None:
    blobs = small_blobs()
    polygonizer = Polygonizer(Sum(tuple(blobs)), cell_size=1.0 / 64.0)
    grid = polygonizer.dual_mesh.cells.grid
    for x in (-0.1, -0.4, 1.6, 9.0, -40.0):
        moved = Sum((replace(blobs[0], center=(x, 0.5, 0.5)), *blobs[1:]))
        assert_same_bits(polygonizer.update(moved), polygonize(moved, cell_size=1.0 / 64.0))
        assert rebuilt_blocks(polygonizer) < 0.3 * len(polygonizer.dual_mesh.cells.leaves)
    assert polygonizer.dual_mesh.cells.grid != grid


def test_nodes_above_an_edit_do_not_widen_it() -> None:
    def below_an_offset(blobs: list[Point]) -> Node:
        inner = Union((Sum(tuple(blobs[:150])), Sum(tuple(blobs[150:]))))
        carved = inner.twist(20.0).scale((1.0, 1.2, 0.9)) - Segment((0, 0, 0), (1, 1, 1), radius=0.1)
        return carved.offset(0.005)

    blobs = small_blobs()
    polygonizer = Polygonizer(below_an_offset(blobs), cell_size=1.0 / 80.0)
    blobs[3] = replace(blobs[3], radius=0.05)
    tree = below_an_offset(blobs)
    assert_same_bits(polygonizer.update(tree), polygonize(tree, cell_size=1.0 / 80.0))
    assert 0 < rebuilt_blocks(polygonizer) < 0.2 * len(polygonizer.dual_mesh.cells.leaves)


def test_an_unchanged_tree_rebuilds_nothing_and_old_meshes_stay() -> None:
    blobs = small_blobs(50)
    polygonizer = Polygonizer(Sum(tuple(blobs)), resolution=48)
    first = polygonizer.mesh
    copy = Mesh(first.vertices.copy(), first.faces.copy(), first.normals.copy(), first.colors.copy())
    assert_same_bits(polygonizer.update(Sum(tuple(small_blobs(50)))), copy)
    assert rebuilt_blocks(polygonizer) == 0
    polygonizer.update(Sum(tuple(blobs[1:])))
    assert_same_bits(first, copy)


def test_a_model_may_vanish_and_come_back() -> None:
    ball, hole = Point((0, 0, 0), radius=1.0), Point((0, 0, 0), radius=3.0)
    polygonizer = Polygonizer(ball, cell_size=0.2)
    assert len(polygonizer.update(ball - hole).faces) == 0
    assert_same_bits(polygonizer.update(ball), polygonize(ball, cell_size=0.2))


def test_recolouring_moves_nothing() -> None:
    blobs = small_blobs(50)
    polygonizer = Polygonizer(Sum(tuple(blobs)), resolution=48)
    before = polygonizer.mesh
    after = polygonizer.update(Sum((replace(blobs[0], color=(1, 0, 0)), *blobs[1:])))
    assert np.array_equal(before.vertices, after.vertices)
    assert np.array_equal(before.faces, after.faces)
    assert not np.array_equal(before.colors, after.colors)


def test_a_refused_edit_keeps_the_last_mesh() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    polygonizer = Polygonizer(ball, cell_size=0.01)
    mesh = polygonizer.mesh
    with pytest.raises(InvalidResolution, match="too far from the origin"):
        polygonizer.update(ball.translate((1e6, 0, 0)))
    assert polygonizer.tree is ball
    assert polygonizer.mesh is mesh


def test_edits_compile_nothing(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    tree = random_trees(3, 1)[0]
    polygonizer = Polygonizer(tree, resolution=24)
    polygonizer.update(edited(np.random.default_rng(0), tree))
    monkeypatch.setattr(wp.config, "log_level", wp.LOG_INFO)  # a line for each module built or loaded
    for other in random_trees(4, 4):
        polygonizer.update(other)
    assert "Module" not in "".join(capfd.readouterr())
    wp.get_module("blobtree.meshing.vertex_kernels").unload()
    polygonizer.update(tree)
    assert "Module blobtree.meshing.vertex_kernels" in "".join(capfd.readouterr())
