"""Blocks with the same pruned tape share it, and each block keeps its own, bit for bit."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import Node, Point, Repeat
from blobtree._typing import Int32Array
from blobtree.cells.grid import BRANCHING
from blobtree.cells.sparse_cells import Level, build_cells
from blobtree.tracing import sharing
from blobtree.tracing.sharing import shared_tapes
from blobtree.tracing.tree_cells import block_counts, block_table, cells_grid, tracing_cells
from tests.blobtree.tracing.flat_trees import FLAT_TREES

START = 3
"""Texels of the data region in front of the tapes of `random_level`."""


def random_level(seed: int) -> Level:
    """A level of 200 blocks with 20 different tapes: some begin alike, two are zeros of different signs."""
    rng = np.random.default_rng(seed)
    long = rng.normal(size=(12, 4)).astype(np.float32)
    tapes = [long[: 1 + number % 9] + np.float32(number // 9) for number in range(18)]
    tapes += [np.zeros((2, 4), np.float32), -np.zeros((2, 4), np.float32)]
    texels, spans = [np.zeros((START, 4), np.float32)], []
    for number in rng.integers(0, len(tapes), 200):
        begin = sum(map(len, texels)) + 1
        texels += [np.array([[len(tapes[number]), 0, 0, 0]], np.float32), tapes[number]]
        spans.append((begin, begin + len(tapes[number])))
    none: Any = wp.zeros(0, dtype=wp.int32, device="cpu")
    return Level(
        blocks=wp.zeros(200, dtype=wp.vec3i, device="cpu"),
        keys=wp.zeros(200, dtype=wp.int64, device="cpu"),
        spans=wp.array(spans, dtype=wp.vec2i, device="cpu"),
        tape=wp.array(np.concatenate(texels), dtype=wp.vec4, device="cpu"),
        children=none,
        sources=none,
    )


def tapes_of(level: Level) -> list[bytes]:
    """The tape of each block with the texel in front of it."""
    tape = level.tape.numpy()
    return [tape[begin - 1 : end].tobytes() for begin, end in level.spans.numpy()]


def assert_shared(level: Level, most: float) -> None:
    """Try each block's shared tape against its own; `most` texels are kept over those of different tapes."""
    expected = tapes_of(level)
    tapes, places = shared_tapes(level)
    lengths = 1 + tapes[places, 0].astype(int)
    seen = [tapes[place : place + length].tobytes() for place, length in zip(places, lengths, strict=True)]
    assert seen == expected
    assert len(tapes) <= most * sum(len(tape) // 16 for tape in set(expected))


@pytest.mark.parametrize("seed", range(3))
def test_each_different_tape_is_kept_once(seed: int) -> None:
    level = random_level(seed)
    assert len(set(tapes_of(level))) == 20
    assert_shared(level, most=1.0)


def test_equal_hashes_join_no_different_tapes(monkeypatch: pytest.MonkeyPatch) -> None:
    """All hashes are equal here: blocks with another tape than the first one keep their own."""
    find = sharing._owners

    def colliding(level: Level, hashes: Any) -> Int32Array:
        owners = find(level, np.zeros_like(hashes))
        assert (owners == 0).sum() == tapes_of(level).count(tapes_of(level)[0])
        return owners

    monkeypatch.setattr(sharing, "_owners", colliding)
    assert_shared(random_level(0), most=20.0)


@pytest.mark.ordinary_cases("grid", "row of limited endless repeats")
@pytest.mark.parametrize("name", FLAT_TREES)
def test_blocks_of_long_tapes_have_the_tapes_of_their_cells(name: str) -> None:
    tree: Node = FLAT_TREES[name]
    cells = tracing_cells(tree, device="cpu")
    grid = cells_grid(*tree.support, max(cells.counts))
    own = build_cells(tree.tape, grid, device="cpu")
    level = own.leaves
    numbers = np.arange(len(level), dtype=np.int32)
    table = block_table(own, numbers, block_counts(*tree.support, grid.cell_size * BRANCHING)).ravel()
    assert (table[cells.blocks < 0] == cells.blocks[cells.blocks < 0]).all()
    expected = tapes_of(level)
    for entry, number in zip(cells.blocks[table >= 0], table[table >= 0], strict=True):
        length = 1 + int(cells.tape[entry, 0])
        assert cells.tape[entry : entry + length].tobytes() == expected[number]
    assert cells.tape.nbytes < 0.7 * sum(map(len, expected))


def test_a_large_grid_takes_little_more_memory_for_each_copy_than_a_small_one() -> None:
    ball = Point((0, 0, 0), radius=0.3)
    grids = [Repeat(Repeat(ball, (1, 0, 0), side, "union"), (0, 1, 0), side, "union") for side in (30, 60)]
    few, many = (tracing_cells(grid, device="cpu").nbytes for grid in grids)
    assert many < 6.0 * few
