"""Runs: blocks that follow each other before an edit and after it; a run and its items are copied at once.

An edit changes blocks in a few places, so unchanged blocks form few runs. On the processor a run is one piece
of memory, and its copy takes a fraction of the time that a kernel takes block by block.
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Int32Array
from blobtree.cells.scan import DeviceArray

Runs: TypeAlias = NDArray[np.int64]
"""Runs (n, 3): the index of the first item after the edit, that before it, and the number of items."""

MIN_RUN = 16
"""Blocks of a run, on average, from which copies of runs are faster than kernels."""

INDICES_AT_ONCE = 1 << 16
"""Indices that fit into the caches of a processor several times."""


def runs_of(blocks: Int32Array, sources: Int32Array) -> Runs:
    """Return the runs of ascending blocks; `sources` has the index of each block before the edit."""
    before = sources[blocks]
    breaks = (np.diff(blocks, prepend=-2) != 1) | (np.diff(before, prepend=-2) != 1)
    begins = np.flatnonzero(breaks)
    return np.column_stack([blocks[begins], before[begins], np.diff(begins, append=len(blocks))])


def long_runs(listed: DeviceArray, sources: DeviceArray) -> Runs | None:
    """Return the runs of a device's blocks; None where kernels are faster: on cards, and for short runs."""
    if not listed.device.is_cpu:
        return None
    runs = runs_of(listed.numpy(), sources.numpy())
    return runs if len(runs) * MIN_RUN <= len(listed) else None


def item_runs(runs: Runs, starts: Int32Array, old_starts: Int32Array) -> Runs:
    """Return the runs of the items of blocks; `starts` has the first item of each block, and the end."""
    first, old_first, count = runs.T
    lengths = old_starts[old_first + count] - old_starts[old_first]
    return np.column_stack([starts[first], old_starts[old_first], lengths]).astype(np.int64)


def copy_runs(runs: Runs, source: NDArray[Any], target: NDArray[Any]) -> None:
    """Copy the items of runs from an array before the edit into one after it."""
    for first, old_first, count in runs.tolist():
        target[first : first + count] = source[old_first : old_first + count]


def copy_indices(
    runs: Runs, source: Int32Array, target: Int32Array, items: Runs, homes: NDArray[np.int64]
) -> None:
    """Copy runs of rows of indices, and let them follow the items that they number.

    `items` are the runs in which these have moved. Most indices of a run of rows are those of one run of
    items, which `homes` names, and one sum makes them new.
    """
    order = np.lexsort([items[:, 2], items[:, 1]])  # runs without items come first
    old_firsts = items[order, 1].astype(np.int32)
    shifts = (items[:, 0] - items[:, 1]).astype(np.int32)
    step = INDICES_AT_ONCE // target.shape[1]
    for (first, old_first, count), home in zip(runs.tolist(), homes.tolist(), strict=True):
        _, home_begin, home_length = items[home].astype(np.uint32)
        for done in range(0, count, step):
            some = slice(done, min(done + step, count))
            old = source[old_first:][some].reshape(-1)
            new = target[first:][some].reshape(-1)
            np.add(old, shifts[home], out=new)
            away = np.flatnonzero(old.view(np.uint32) - home_begin >= home_length)
            if len(away):
                new[away] = old[away] + shifts[order[np.searchsorted(old_firsts, old[away], "right") - 1]]
