"""Warp kernels of `DecalIndex.candidates`."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.index.lookup import IndexedDecals, cell_range

wp.set_module_options({"enable_backward": False})


@wp.kernel
def count_candidates(
    points: wp.array(dtype=wp.vec3),
    index: IndexedDecals,
    counts: wp.array(dtype=wp.int32),
):
    """Write the number of candidates at each point, over all levels."""
    i = wp.tid()
    total = wp.int32(0)
    for level in range(index.level_count):
        span = cell_range(points[i], level, index)
        total += span[1] - span[0]
    counts[i] = total


@wp.kernel
def list_candidates(
    points: wp.array(dtype=wp.vec3),
    index: IndexedDecals,
    offsets: wp.array(dtype=wp.int32),
    candidates: wp.array(dtype=wp.int32),
):
    """Write the candidates of each point from its offset on, level after level."""
    i = wp.tid()
    slot = offsets[i]
    for level in range(index.level_count):
        span = cell_range(points[i], level, index)
        for j in range(span[0], span[1]):
            candidates[slot] = index.ids[j]
            slot += 1
