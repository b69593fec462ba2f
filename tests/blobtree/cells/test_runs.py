"""Copies of runs against copies of one block after the other."""

from unittest.mock import patch

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from blobtree.cells import runs as runs_module
from blobtree.cells.runs import Runs, copy_indices, copy_runs, item_runs, runs_of

OLD_BLOCKS = 24

Blocks = tuple[NDArray[np.int32], NDArray[np.int32]]


@st.composite
def unchanged_blocks(draw: st.DrawFn) -> Blocks:
    """Ascending blocks, and for all blocks their index before the edit: pieces of old ones in any order."""
    pieces = draw(st.permutations([range(7), range(7, 8), range(8, 19), range(19, OLD_BLOCKS)]))
    gaps = draw(st.lists(st.integers(0, 3), min_size=4, max_size=4))
    sources: list[int] = []
    for piece, gap in zip(pieces, gaps, strict=True):
        sources += [-1] * gap + [source for source in piece if draw(st.integers(0, 9))]
    everywhere = np.array(sources, np.int32)
    return np.flatnonzero(everywhere >= 0).astype(np.int32), everywhere


def starts_of(counts: NDArray[np.int64]) -> NDArray[np.int32]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)


def moved(old_counts: NDArray[np.int64], blocks: Blocks) -> tuple[Runs, NDArray[np.int32], NDArray[np.int32]]:
    """Return the runs of the blocks' items, and the first items of the blocks before and after."""
    listed, sources = blocks
    counts = np.where(sources >= 0, old_counts[sources], 2)
    old_starts, starts = starts_of(old_counts), starts_of(counts)
    return item_runs(runs_of(listed, sources), starts, old_starts), old_starts, starts


counts = arrays(np.int64, OLD_BLOCKS, elements=st.integers(0, 5))


@given(unchanged_blocks())
def test_runs_are_the_listed_blocks_with_their_sources(blocks: Blocks) -> None:
    listed, sources = blocks
    found = runs_of(listed, sources)
    expanded = [(first + k, before + k) for first, before, count in found.tolist() for k in range(count)]
    assert expanded == list(zip(listed.tolist(), sources[listed].tolist(), strict=True))
    ends = found[:-1, :2] + found[:-1, 2:]
    assert not (found[1:, :2] == ends).all(axis=1).any()  # no run could be longer


@given(unchanged_blocks(), counts)
def test_items_of_runs_are_copied_block_by_block(blocks: Blocks, old_counts: NDArray[np.int64]) -> None:
    listed, sources = blocks
    runs, old_starts, starts = moved(old_counts, blocks)
    source = np.random.default_rng(0).normal(size=(old_starts[-1], 3))
    target = np.zeros((starts[-1], 3))
    copy_runs(runs, source, target)
    expected = np.zeros_like(target)
    for block in listed:
        before = slice(*old_starts[sources[block] : sources[block] + 2])
        expected[starts[block] : starts[block + 1]] = source[before]
    assert np.array_equal(target, expected)


@given(unchanged_blocks(), counts, st.integers(1, 60))
def test_indices_follow_their_items(blocks: Blocks, old_counts: NDArray[np.int64], at_once: int) -> None:
    listed, sources = blocks
    items, old_starts, starts = moved(old_counts, blocks)
    new_index = np.full(old_starts[-1], -1, np.int32)
    for block in listed:
        old = np.arange(*old_starts[sources[block] : sources[block] + 2])
        new_index[old] = starts[block] + old - old_starts[sources[block]]
    rng = np.random.default_rng(1)
    rows_per_block = rng.integers(0, 4, OLD_BLOCKS)
    rows, old_row_starts, row_starts = moved(rows_per_block, blocks)
    kept = np.flatnonzero(new_index >= 0)
    if not len(kept):
        return
    source = rng.choice(kept, (int(old_row_starts[-1]), 3)).astype(np.int32)
    target = np.full((int(row_starts[-1]), 3), -1, np.int32)
    with patch.object(runs_module, "INDICES_AT_ONCE", 3 * at_once):
        copy_indices(rows, source, target, items, np.arange(len(rows)))
    expected = np.full_like(target, -1)
    for block in listed:
        kept_rows = slice(*old_row_starts[sources[block] : sources[block] + 2])
        expected[row_starts[block] : row_starts[block + 1]] = new_index[source[kept_rows]]
    assert np.array_equal(target, expected)
