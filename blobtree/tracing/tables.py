"""Tables of blocks of many models in one array, see `TracingCells.blocks`.

On a processor, NumPy makes one table after the other, which is fastest there. On a graphics card, that would
take longer than the rays, so kernels make all tables at once.
"""

from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import IndexArray
from blobtree.cells.grid import BRANCHING
from blobtree.cells.sparse_cells import SparseCells
from blobtree.device import launch
from blobtree.tracing.table_kernels import mark_empty, refine_entries, spread_distances, write_table
from blobtree.tracing.tree_cells import MAX_LAYERS, block_table


def numpy_tables(cells: SparseCells, counts: IndexArray, shift: int) -> tuple[Any, IndexArray]:
    """Return the tables for blocks (k, 3) along the axes of k models, and their starts with the end.

    The tapes of blocks lie `shift` texels behind their places in `cells`.
    """
    places = cells.leaves.spans.numpy()[:, 0] - 1 + shift
    tables = [block_table(cells, places, count, model).ravel() for model, count in enumerate(counts)]
    return wp.array(np.concatenate(tables), dtype=wp.int32, device=cells.device), _starts(counts)


def device_tables(cells: SparseCells, counts: IndexArray, shift: int) -> tuple[Any, IndexArray]:
    """Return what `numpy_tables` returns; kernels make the tables."""
    device, models, side, starts = cells.device, len(counts), 1, _starts(counts)
    entries: Any = wp.array(np.arange(models), dtype=wp.int32, device=device)
    for level in cells.levels[1:]:
        side *= BRANCHING
        above, entries = entries, wp.empty(models * side**3, dtype=wp.int32, device=device)
        launch(refine_entries, len(entries), [side, above, level.children], [entries], device)
    along: Any = wp.array(counts, dtype=wp.vec3i, device=device)
    before, distances = (wp.empty(len(entries), dtype=wp.uint8, device=device) for _ in range(2))
    launch(mark_empty, len(entries), [side, MAX_LAYERS + 1, along, entries], [distances], device)
    for stride in (1, side, side * side):
        before, distances = distances, before
        launch(spread_distances, len(entries), [side, stride, before], [distances], device)
    blocks: Any = wp.empty(int(starts[-1]), dtype=wp.int32, device=device)
    inputs = [side, along, wp.array(starts, dtype=wp.int32, device=device), entries, distances]
    launch(write_table, len(entries), [*inputs, cells.leaves.spans, shift], [blocks], device)
    return blocks, starts


def _starts(counts: IndexArray) -> IndexArray:
    return np.concatenate([[0], np.cumsum(counts.prod(axis=1))])
