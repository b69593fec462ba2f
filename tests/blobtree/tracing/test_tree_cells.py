"""The table of blocks that rays read matches the field."""

import gc
import weakref

import numpy as np
import pytest
from scipy.ndimage import distance_transform_cdt

from blobtree import ISO, Box, Node, Point, Repeat, Sum, Tape
from blobtree._typing import Int32Array
from blobtree.cells.grid import BRANCHING
from blobtree.cells.refine_kernels import SURELY_INSIDE
from blobtree.cells.sparse_cells import MAX_BLOCKS
from blobtree.sized_cache import SizedCache
from blobtree.tape.codes import PUSH, STRETCHED, UNWARP, WARP
from blobtree.tape.model import gradients_at, values_at
from blobtree.tracing import ray_kernels, tree_cells
from blobtree.tracing.ray_kernels import EMPTY
from blobtree.tracing.tree_cells import (
    BLOCKS_ALONG,
    MAX_LAYERS,
    MIN_POINT_TEXELS,
    MOST_BLOCKS_ALONG,
    WORD,
    TracingCells,
    block_counts,
    blocks_along,
    cells_grid,
    device_cells,
    point_cells,
    tracing_cells,
)
from tests.blobtree.tape.test_tape import instructions
from tests.blobtree.trees import random_trees
from tests.oracles import blobtree as oracle

CORNERS = Point((0, 0, 0), radius=0.02) | Point((1, 1, 1), radius=0.02)
THIN = Point((0, 0, 0), radius=0.1) | Point((5, 0, 0), radius=0.1)
TREES = {"corners": CORNERS, "thin": THIN} | dict(enumerate(random_trees(seed=51, count=8)))

NAMES = pytest.mark.parametrize(
    "name",
    [*list(TREES)[:5], *(pytest.param(name, marks=pytest.mark.slow) for name in list(TREES)[5:])],
)


def table(cells: TracingCells) -> Int32Array:
    return cells.blocks.reshape(cells.counts)


def pruned(cells: TracingCells, texel: int, whole: Tape) -> Tape:
    """The tape behind a texel with its length."""
    length = int(cells.tape[texel, 0])
    return Tape(
        cells.tape[texel + 1 : texel + 1 + length], whole.registers, whole.skeletons, whole.operators,
        whole.stretched, whole.warps, whole.warp_registers, whole.instruction_set,
    )  # fmt: skip


@NAMES
def test_the_table_matches_the_field(name: str | int) -> None:
    tree: Node = TREES[name]
    cells = tracing_cells(tree, device="cpu")
    blocks = table(cells)
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, cells.counts, (8_000, 3))
    points = (cells.lower + places * cells.block_size).astype(np.float32)
    known = blocks[tuple(places.astype(int).T)]
    value = oracle.value(tree, points.astype(np.float64))
    assert (value[known <= EMPTY] <= ISO + 1e-5).all()
    assert (value[known == SURELY_INSIDE] >= ISO - 1e-5).all()
    assert ((known >= 0) | (known == SURELY_INSIDE) | (known <= EMPTY)).all()
    for texel in rng.permutation(np.unique(known[known >= 0]))[:20]:
        here = known == texel
        seen = values_at(pruned(cells, texel, tree.tape), points[here])
        np.testing.assert_allclose(seen, value[here], atol=2e-5 * max(1.0, value.max()))


LIMITED = (Point((-1, 0, 0), radius=0.8) | Point((1, 0, 0), radius=0.8)) & Box(
    (0, 0, 0), (2, 1, 1), radius=0.1
)


@pytest.mark.parametrize("tree", [LIMITED, *random_trees(seed=52, count=12)], ids=["limited", *range(12)])
def test_pruned_tapes_hold_no_other_kinds_than_the_whole_one(tree: Node) -> None:
    """Shaders know the kinds of the whole tape alone."""
    whole, cells = tree.tape, tracing_cells(tree, device="cpu")
    for texel in np.unique(cells.blocks[cells.blocks >= 0]):
        part = instructions(pruned(cells, texel, whole))
        assert {code % STRETCHED for code, *_ in part if code >= 0} <= set(whole.skeletons)
        assert {kind for code, kind, *_ in part if code not in (PUSH, WARP, UNWARP)} <= set(whole.operators)
        assert {kind for code, kind, *_ in part if code == WARP} <= set(whole.warps)
        assert max([count for code, _, count, _ in part if code == PUSH], default=-1) < whole.registers


def assert_empty_layers(blocks: Int32Array) -> None:
    """Try empty blocks against SciPy's chessboard distance to the nearest block that is not empty."""
    empty = blocks <= EMPTY
    layers = EMPTY - blocks[empty]
    if empty.all():
        return
    expected = distance_transform_cdt(empty, metric="chessboard")[empty] - 1
    np.testing.assert_array_equal(layers, np.minimum(expected, MAX_LAYERS))


@NAMES
def test_empty_layers_match_the_chessboard_distance(name: str | int) -> None:
    blocks = table(tracing_cells(TREES[name], device="cpu"))
    assert_empty_layers(blocks)
    assert blocks.min() < EMPTY


def crowd(count: int) -> Node:
    rng = np.random.default_rng(count)
    return Sum(Point(center, radius=0.2) for center in rng.uniform(-1.0, 1.0, (count, 3)))


@pytest.mark.parametrize("tree", [crowd(60), crowd(300), *random_trees(seed=53, count=10)], ids=range(12))
def test_each_block_of_points_gives_the_field_of_the_whole_tree(tree: Node) -> None:
    """Bit for bit: a point that is projected by pruned tapes comes to the same place."""
    cells = point_cells(tree, "cpu")
    if len(tree.tape.data) - tree.tape.start < MIN_POINT_TEXELS:
        assert cells.counts == (0, 0, 0)
        return
    blocks = table(cells)
    assert (blocks >= cells.start).all()
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, cells.counts, (20_000, 3))
    points = (cells.lower + places * cells.block_size).astype(np.float32)
    known = blocks[tuple(places.astype(int).T)]
    for texel in np.unique(known)[:: max(1, len(np.unique(known)) // 100)]:
        here = points[known == texel]
        part = pruned(cells, texel, tree.tape)
        np.testing.assert_array_equal(values_at(part, here), values_at(tree.tape, here))
        np.testing.assert_array_equal(gradients_at(part, here), gradients_at(tree.tape, here))


def test_blocks_of_points_without_surface_have_tapes_of_blocks_around_them() -> None:
    tree = crowd(300)
    of_points, of_rays = point_cells(tree, "cpu"), tracing_cells(tree, device="cpu")
    empty = table(of_rays) <= EMPTY
    lengths = of_points.tape[table(of_points)[empty], 0]
    assert np.median(lengths) < 0.2 * (len(tree.tape.data) - tree.tape.start)
    assert len(np.unique(lengths)) > 4


def test_blocks_cover_the_box_of_the_tree() -> None:
    cells = tracing_cells(THIN, device="cpu")
    lower, upper = (corner.astype(np.float64) for corner in THIN.support)
    assert max(cells.counts) == cells.counts[0] == BLOCKS_ALONG
    extent = cells.block_size * np.array(cells.counts)
    assert (cells.lower + extent >= upper - 1e-6).all()
    assert (extent - (upper - lower) <= cells.block_size * 1.001).all()


@pytest.mark.parametrize("step", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_long_box_that_holds_much_has_more_blocks(step: tuple[float, float, float]) -> None:
    row = Repeat(Box((0, 0, 0), (0.6, 0.6, 0.6), radius=0), step, 1000, "union")
    cells = tracing_cells(row, device="cpu")
    blocks, along = table(cells), int(np.argmax(step))
    assert cells.counts[along] > 4000
    assert_empty_layers(blocks)
    places = np.random.default_rng(0).integers(0, 1000, 2000)
    origins = places[:, None] * np.array(step) + 5.0 * np.roll(step, 1)
    hits = row.raycast(origins, np.tile(-np.roll(step, 1), (2000, 1)))
    np.testing.assert_allclose(hits.distances, 4.7, atol=1e-3)


def flat_grid(child: Node, side: int) -> Node:
    """Copies of a child in a square."""
    return Repeat(Repeat(child, (1, 0, 0), side, "union"), (0, 1, 0), side, "union")


def test_a_flat_box_has_more_blocks_the_more_it_holds() -> None:
    ball = Point((0, 0, 0), radius=0.3)
    counts = [tracing_cells(flat_grid(ball, side), device="cpu").counts for side in (5, 30, 100)]
    assert [x for x, _, _ in counts] == [y for _, y, _ in counts] == [64, 128, 512]
    assert np.prod(counts[-1]) <= MAX_BLOCKS


def test_visible_copies_have_as_long_tapes_in_a_large_grid_as_in_a_small_one() -> None:
    brick = Box((0, 0, 0), (0.6, 0.6, 0.6), radius=0)
    lengths = []
    for side in (10, 20, 40):
        cells = tracing_cells(flat_grid(brick, side), device="cpu")
        lengths.append(float(cells.tape[cells.blocks[cells.blocks >= 0], 0].mean()))
    assert max(lengths) < 1.5 * min(lengths)


@pytest.mark.parametrize(("radius", "blocks"), [(0.02, 128), (0.15, BLOCKS_ALONG)])
def test_primitives_that_overlap_widely_have_no_finer_blocks(radius: float, blocks: int) -> None:
    """They would be as full."""
    places = np.random.default_rng(0).uniform(-1.0, 1.0, (1000, 2)).tolist()
    cells = tracing_cells(Sum(Point((x, y, 0), radius=radius) for x, y in places), device="cpu")
    assert max(cells.counts) == blocks


@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.4), (1.0, 0.5, 0.5), (1.0, 0.01, 0.001)])
def test_no_box_has_more_blocks_than_a_level_or_a_word_holds(sides: tuple[float, float, float]) -> None:
    lower, upper = np.zeros(3, np.float32), np.array(sides, np.float32)
    blocks = blocks_along(1 << 20, 1e-9, lower, upper)
    counts = block_counts(lower, upper, cells_grid(lower, upper, blocks).cell_size * BRANCHING)
    assert counts.prod() <= MAX_BLOCKS
    assert counts.min() <= WORD
    assert blocks <= MOST_BLOCKS_ALONG
    assert counts.sum() < ray_kernels.MAX_BLOCKS


def test_all_blocks_of_an_empty_tree_are_empty() -> None:
    nothing = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    cells = tracing_cells(nothing, device="cpu")
    assert (cells.blocks == EMPTY - MAX_LAYERS).all()


def test_cells_on_a_device_are_kept_as_long_as_those_of_the_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tree_cells, "_tracing_cells", SizedCache(tree_cells._tracing_cells._function, 1))
    on_device = device_cells(THIN)
    assert device_cells(THIN) is on_device
    assert on_device.tape.ptr == tracing_cells(THIN).tape.ctypes.data  # shared by the processor
    kept = weakref.ref(on_device)
    del on_device
    device_cells(CORNERS)
    gc.collect()
    assert kept() is None
