"""Sharing of pruned tapes: blocks whose tapes are the same bit for bit have one tape in common.

Copies of a repeat lie many blocks apart, so most blocks around a copy hold its primitives alone. Their tapes
are equal, and finer blocks take little more memory.
"""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int32Array
from blobtree.cells.sparse_cells import Level
from blobtree.device import array_on, launch
from blobtree.tracing.sharing_kernels import copy_tapes, hash_tapes, match_tapes


def shared_tapes(level: Level) -> tuple[Float32Array, Int32Array]:
    """Return the different tapes of a level, and where in them each of its blocks (n,) has its own.

    The tapes float32[m, 4] lie one after the other in the order of their first blocks, each behind a texel
    with its length. The place of a block is the one of that texel.
    """
    device, count = str(level.tape.device), len(level)
    hashes: Any = wp.empty(count, dtype=wp.uint64, device=device)
    launch(hash_tapes, count, [level.spans, level.tape.view(wp.vec4i)], [hashes], device)
    owners = _owners(level, hashes.numpy())
    kept = np.flatnonzero(owners == np.arange(count, dtype=np.int32)).astype(np.int32)
    lengths = np.diff(level.spans.numpy()[kept], axis=1)[:, 0] + 1
    ends = np.cumsum(lengths, dtype=np.int32)
    places = np.zeros(count, np.int32)
    places[kept] = ends - lengths
    tapes: Any = wp.empty(int(lengths.sum()), dtype=wp.vec4, device=device)
    inputs = [array_on(device, numbers, wp.int32) for numbers in (kept, places[kept])]
    launch(copy_tapes, len(kept), [inputs[0], level.spans, inputs[1], level.tape], [tapes], device)
    return tapes.numpy(), places[owners]


def _owners(level: Level, hashes: NDArray[np.uint64]) -> Int32Array:
    """Return for each block (n,) the first one of equal hash, or itself if their tapes differ."""
    device = str(level.tape.device)
    _, firsts, groups = np.unique(hashes, return_index=True, return_inverse=True)
    owners: Any = array_on(device, firsts[groups].astype(np.int32), wp.int32)
    launch(match_tapes, len(level), [level.spans, level.tape.view(wp.vec4i)], [owners], device)
    result: Int32Array = owners.numpy()
    return result
