"""The table of blocks that rays walk through: what it says of every block is so."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_cdt

from blobtree import ISO, Node, Point
from blobtree.sparse.refine import SURELY_INSIDE
from blobtree.tapes.evaluate import values_at
from blobtree.tapes.tape import Tape
from blobtree.tracing.cells import BLOCKS_ALONG, MOST_LAYERS, TracingCells, tracing_cells
from blobtree.tracing.rays import EMPTY
from tests.blobtree.trees import random_trees
from tests.oracles import blobtree as oracle

CORNERS = Point((0, 0, 0), radius=0.02) | Point((1, 1, 1), radius=0.02)
THIN = Point((0, 0, 0), radius=0.1) | Point((5, 0, 0), radius=0.1)
TREES = {"corners": CORNERS, "thin": THIN} | dict(enumerate(random_trees(seed=51, count=8)))


def table(cells: TracingCells) -> np.ndarray:
    return cells.blocks.reshape(cells.counts)


def pruned(cells: TracingCells, texel: int, whole: Tape) -> Tape:
    """The tape behind a texel with its length."""
    length = int(cells.tape[texel, 0])
    return Tape(
        cells.tape[texel + 1 : texel + 1 + length], whole.registers, whole.skeletons, whole.operators,
        whole.stretched, whole.warps, whole.warp_registers, whole.vocabulary,
    )  # fmt: skip


@pytest.mark.parametrize("name", TREES)
def test_blocks_hold_what_the_table_says(name: str | int) -> None:
    tree: Node = TREES[name]
    cells = tracing_cells(tree, device="cpu")
    blocks = table(cells)
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, cells.counts, (40_000, 3))
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


@pytest.mark.parametrize("name", TREES)
def test_rays_leap_as_far_as_all_is_empty(name: str | int) -> None:
    """Against SciPy's chessboard distance to the nearest block that is not empty."""
    blocks = table(tracing_cells(TREES[name], device="cpu"))
    empty = blocks <= EMPTY
    layers = EMPTY - blocks[empty]
    if empty.all():
        return
    expected = distance_transform_cdt(empty, metric="chessboard")[empty] - 1
    np.testing.assert_array_equal(layers, np.minimum(expected, MOST_LAYERS))
    assert layers.max() > 0


def test_blocks_lie_in_the_tree_box_alone() -> None:
    cells = tracing_cells(THIN, device="cpu")
    lower, upper = (corner.astype(np.float64) for corner in THIN.bounds)
    assert max(cells.counts) == cells.counts[0] == BLOCKS_ALONG
    extent = cells.block_size * np.array(cells.counts)
    assert (cells.lower + extent >= upper - 1e-6).all()
    assert (extent - (upper - lower) <= cells.block_size * 1.001).all()


def test_a_tree_without_surface_is_empty_all_over() -> None:
    nothing = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    cells = tracing_cells(nothing, device="cpu")
    assert (cells.blocks == EMPTY - MOST_LAYERS).all()
