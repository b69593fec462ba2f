"""Sparse cells of many models: their blocks in one list, which the kernels of one model refine together.

The root blocks of the models are neighbours in a lattice, so each block has a key of its own, and the blocks
of a model have keys in one range. The texels of all tapes lie in one array, behind all data regions.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Int64Array
from blobtree.cells.grid import BRANCHING_BITS, KEY_DIGITS, Grid
from blobtree.cells.sparse_cells import MAX_TEXELS, Level, SparseCells, first_blocks, refined
from blobtree.errors import InvalidResolution
from blobtree.progress import Progress
from blobtree.tape.model import ImplicitModel
from blobtree.tape.tape import Tape, shifted_texels


def most_models(depth: int) -> int:
    """Return how many models, in grids of a depth, have keys for all their blocks in one list."""
    return 1 << (3 * BRANCHING_BITS * (KEY_DIGITS - depth))


def build_joint_cells(
    models: Sequence[ImplicitModel],
    grids: Sequence[Grid],
    device: str,
    report: Progress = lambda _stage, _fraction: None,
) -> SparseCells:
    """Return the cells of models with one instruction set, in grids of one depth.

    Raises
    ------
    InvalidResolution
        The models are too many for one list, or do not fit into memory; take fewer.
    """
    tape, spans = joint_tape(models)
    depth = grids[0].depth
    count = len(models)
    if count > most_models(depth):
        raise InvalidResolution(
            f"expected at most {most_models(depth):,} models of depth {depth}, got {count:,}"
        )
    level = Level(
        wp.array(first_blocks(count, 0), dtype=wp.vec3i, device=device),
        wp.array(np.arange(count), dtype=wp.int64, device=device),
        wp.array(spans, dtype=wp.vec2i, device=device),
        wp.array(tape.data, dtype=wp.vec4, device=device),
        wp.zeros(0, dtype=wp.int32, device=device),
        wp.full(count, -1, dtype=wp.int32, device=device),
    )
    return refined(SparseCells(grids[0], (level,), device, tape, tuple(grids)), report)


def joint_tape(models: Sequence[ImplicitModel]) -> tuple[Tape, Int64Array]:
    """Return the texels of all tapes as one tape, behind all data regions, and the span of each (k, 2)."""
    tapes = [model.tape for model in models]
    regions = np.cumsum([0, *(tape.start for tape in tapes)])
    start = int(regions[-1])
    parts: list[Any] = [tape.data[: tape.start] for tape in tapes]
    for model, region in zip(models, regions.tolist(), strict=False):
        parts.append(shifted_texels(model.tape, model._program, region))
    data = np.concatenate(parts)
    if len(data) > MAX_TEXELS:
        raise InvalidResolution(f"expected tapes of at most {MAX_TEXELS:,} texels, got {len(data):,}")
    ends = start + np.cumsum([0, *(len(tape.data) - tape.start for tape in tapes)])
    return replace(tapes[0], data=data, start=start), np.stack([ends[:-1], ends[1:]], axis=1)


def model_starts(cells: SparseCells) -> Int64Array:
    """Return the first of the finest blocks of each model, and the end (k + 1)."""
    ends = np.arange(len(cells.models) + 1, dtype=np.int64) << (3 * BRANCHING_BITS * cells.grid.depth)
    return np.searchsorted(cells.leaves.keys.numpy(), ends).astype(np.int64)
