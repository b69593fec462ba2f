"""Sparse cells against brute force: pruning changes no value, and no quad of the surface is lost."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from blobtree import ISO, RIM, Mesh, Node, Point, Polygonizer, Ricci, Sum, Union, polygonize
from blobtree.cells.grid import BRANCHING, aligned_grid
from blobtree.cells.sparse_cells import SparseCells, build_cells, split_tape
from blobtree.tape.model import values_at
from tests.blobtree.custom_kinds import CUSTOM
from tests.blobtree.meshing.edits import edited
from tests.blobtree.meshing.test_polygonize import assert_closed, assert_valid
from tests.blobtree.tape.evaluations import bounds_at
from tests.blobtree.trees import BLENDED, SHAPES, SOLIDS, random_leaf, random_trees
from tests.oracles.dense_polygonize import polygonize as dense_polygonize

CELLS_ALONG = 28


def cells_of(tree: Node, cell: float) -> SparseCells:
    return build_cells(tree.tape, aligned_grid(*tree.support, cell))


def quads(mesh: Mesh, labels: np.ndarray) -> np.ndarray:
    """Every pair of triangles as the set of its corners, whichever diagonal splits it; sorted."""
    pairs = np.sort(labels[mesh.faces].reshape(-1, 6), axis=1)
    pairs[:, 1:][pairs[:, 1:] == pairs[:, :-1]] = -1
    return np.unique(np.sort(pairs, axis=1), axis=0)


def assert_same_surface(tree: Node) -> None:
    lower, upper = tree.support
    cell = float((upper - lower).max()) / CELLS_ALONG
    sparse, dense = polygonize(tree, cell_size=cell), dense_polygonize(tree, cell_size=cell)
    assert len(sparse.vertices) == len(dense.vertices)
    if len(dense.vertices) == 0:
        return
    assert len(sparse.faces) == len(dense.faces)
    distance, label = cKDTree(dense.vertices).query(sparse.vertices)
    coincide = len(np.unique(label)) < len(
        label
    )  # two sheets that meet in one point: told apart by quads alone
    assert distance.max() <= 1e-2 * cell
    if not coincide:
        assert np.array_equal(quads(sparse, label), quads(dense, np.arange(len(label))))


MORE = {"built_in": None, "solids": SOLIDS, "shapes": SHAPES, "blends": BLENDED, "custom": CUSTOM}
SEEDS = [("built_in", 0), ("built_in", 1), *((kinds, 0) for kinds in MORE if MORE[kinds])]


@pytest.mark.slow_cases("blends-0", "built_in-1", "custom-0", "shapes-0")
@pytest.mark.parametrize(("kinds", "seed"), SEEDS)
def test_sparse_and_dense_give_the_same_quads(kinds: str, seed: int) -> None:
    surfaces = 0
    for tree in random_trees(seed, 4, more=MORE[kinds]):
        assert_same_surface(tree)
        mesh = polygonize(tree, resolution=20)
        assert_valid(mesh)
        assert_closed(mesh)
        surfaces += len(mesh.faces) > 0
    assert surfaces >= 2


@pytest.mark.slow
@pytest.mark.parametrize(("kinds", "count"), [(kinds, 10 if more else 60) for kinds, more in MORE.items()])
def test_sparse_and_dense_give_the_same_quads_over_many_trees(kinds: str, count: int) -> None:
    for tree in random_trees(99, count, depth=5, more=MORE[kinds]):
        assert_same_surface(tree)
        assert_closed(polygonize(tree, resolution=20))


def test_every_edge_has_two_triangles_in_opposite_directions() -> None:
    for tree in random_trees(7, 20):
        assert_closed(polygonize(tree, resolution=CELLS_ALONG))


def test_pruned_tapes_match_the_whole_tape_in_their_blocks() -> None:
    rng = np.random.default_rng(3)
    for tree in random_trees(3, 12):
        lower, upper = tree.support
        cell = float((upper - lower).max()) / 24
        cells = cells_of(tree, cell)
        blocks, spans = cells.leaves.blocks.numpy(), cells.leaves.spans.numpy()
        texels = cells.leaves.tape.numpy()
        for i in rng.choice(len(blocks), min(12, len(blocks)), replace=False):
            corner = cells.grid.origin + blocks[i] * BRANCHING * cell
            points = corner + rng.uniform(0.0, BRANCHING * cell, (40, 3))
            begin, end = spans[i]
            pruned = type(tree.tape)(texels[begin:end], *list(vars(tree.tape).values())[1:])
            assert np.abs(values_at(pruned, points) - tree(points)).max() <= 1e-6


def test_dropped_blocks_contain_no_surface() -> None:
    for tree in random_trees(11, 20):
        lower, upper = tree.support
        cell = float((upper - lower).max()) / 20
        cells = cells_of(tree, cell)
        side, origin = cells.grid.blocks_per_side, cells.grid.origin
        kept = np.zeros((side, side, side), bool)
        kept[tuple(cells.leaves.blocks.numpy().T)] = True
        size = BRANCHING * cell
        points = origin + np.random.default_rng(5).uniform(0.0, side * size, (60_000, 3))
        block = np.minimum(((points - origin) / size).astype(int), side - 1)
        value, slope = bounds_at(tree.tape, points, 1e-3 * cell).T
        near_surface = np.abs(value - ISO) <= slope * 1e-3 * cell
        assert kept[tuple(block[near_surface].T)].all()


def random_blobs(count: int) -> tuple[Node, float]:
    """The benchmark's scene: `count` points of influence s in the unit cube."""
    rng = np.random.default_rng(1234 + count)
    s = 0.6 * count ** (-1.0 / 3.0)
    centers = rng.uniform(0.75 * s, 1.0 - 0.75 * s, (count, 3))
    return Sum(tuple(Point(tuple(center), radius=s * RIM) for center in centers.tolist())), s


def test_few_cells_and_primitives_are_read() -> None:
    tree, _ = random_blobs(1000)
    cells = build_cells(tree.tape, aligned_grid(np.zeros(3), np.ones(3), 1.0 / 128.0))
    spans = cells.leaves.spans.numpy()
    primitives = (spans[:, 1] - spans[:, 0] - 1) / 2  # one run of points, two texels each
    crossing = len(polygonize(tree, cell_size=1.0 / 128.0).vertices)
    assert len(cells.leaves) * BRANCHING**3 <= 8.0 * crossing  # measured at twice this resolution: 4.8
    assert primitives.mean() <= 4.0


def cull_always(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many threads to the root's children, as on a graphics card, for tapes of any length."""
    monkeypatch.setattr("blobtree.cells.sparse_cells.pieces_to_cull", lambda tape, _device: split_tape(tape))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_culling_the_root_changes_no_triangle(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = [*random_trees(seed, 12), random_blobs(1000)[0], *flat_trees(seed)]
    plain = [polygonize(tree, resolution=24) for tree in shapes]
    cull_always(monkeypatch)
    assert sum(split_tape(tree.tape) is not None for tree in shapes) >= 6
    for tree, expected in zip(shapes, plain, strict=True):
        culled = polygonize(tree, resolution=24)
        for name in ("vertices", "faces", "normals", "colors"):
            assert np.array_equal(getattr(culled, name), getattr(expected, name))


def test_edits_of_culled_trees_match_a_new_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    cull_always(monkeypatch)
    rng = np.random.default_rng(8)
    for tree in flat_trees(9):
        polygonizer = Polygonizer(tree, resolution=32)
        for _edit in range(4):
            tree = edited(rng, tree)
            ours, fresh = polygonizer.update(tree), polygonize(tree, cell_size=polygonizer.cell_size)
            assert np.array_equal(ours.vertices, fresh.vertices)
            assert np.array_equal(ours.faces, fresh.faces)


def flat_trees(seed: int) -> list[Node]:
    """Long runs of every kind under every operator, mapped, and with a tool."""
    rng = np.random.default_rng(seed)
    leaves = [random_leaf(rng) for _ in range(150)]
    stretched = [leaf.scale((0.3, 0.4, 0.35)) for leaf in leaves]
    small = [leaf.scale(0.3).translate(rng.uniform(-2.0, 2.0, 3)) for leaf in leaves]
    return [
        Sum(tuple(small)),
        Union(tuple(small)) - small[0],
        Ricci((*small, *stretched[:70]), exponent=2.0),
        Sum(tuple(small)) & small[3].scale(3.0),
        Union((Sum(tuple(small[:140])), small[141].twist(20.0))),
    ]
