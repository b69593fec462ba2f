"""Kernels that write the tables of blocks of many models, which rays read, see `TracingCells.blocks`.

A model has side³ entries, the last axis fastest. `tree_cells` does the same for one model with NumPy.
"""

import warp as wp

from blobtree.cells.block_kernels import child_number
from blobtree.cells.grid import BRANCHING, BRANCHING_BITS, CHILDREN
from blobtree.cells.refine_kernels import SURELY_OUTSIDE
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tracing.ray_kernels import EMPTY

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def place_of(i: wp.int32, side: wp.int32) -> wp.vec4i:
    """Return the place of an entry in its table, and the number of the model."""
    return wp.vec4i((i // (side * side)) % side, (i // side) % side, i % side, i // (side * side * side))


@wp.kernel
def refine_entries(
    first: wp.int32,
    side: wp.int32,
    known: wp.array(dtype=wp.int32),
    children: wp.array(dtype=wp.int32),
    entries: wp.array(dtype=wp.int32),
) -> None:
    """Write the index of each block in its level, or why it has none, by entries `known` of the level above.

    `side` is the number of blocks along the new table.
    """
    i = first + wp.tid()
    at = place_of(i, side)
    above = side // BRANCHING
    x = at[0] >> BRANCHING_BITS
    y = at[1] >> BRANCHING_BITS
    entry = known[((at[3] * above + x) * above + y) * above + (at[2] >> BRANCHING_BITS)]
    if entry >= 0:
        last = BRANCHING - 1
        offset = wp.vec3i(at[0] & last, at[1] & last, at[2] & last)
        entry = children[entry * CHILDREN + child_number(offset)]
    entries[i] = entry


@wp.kernel
def mark_empty(
    first: wp.int32,
    side: wp.int32,
    farthest: wp.int32,
    counts: wp.array(dtype=wp.vec3i),
    entries: wp.array(dtype=wp.int32),
    distances: wp.array(dtype=wp.uint8),
) -> None:
    """Write `farthest` for blocks that are empty or lie beyond the grid, else 0."""
    i = first + wp.tid()
    at = place_of(i, side)
    count = counts[at[3]]
    distance = int(0)
    if entries[i] == SURELY_OUTSIDE or at[0] >= count[0] or at[1] >= count[1] or at[2] >= count[2]:
        distance = farthest
    distances[i] = wp.uint8(distance)


@wp.kernel
def spread_distances(
    first: wp.int32,
    side: wp.int32,
    stride: wp.int32,
    before: wp.array(dtype=wp.uint8),
    distances: wp.array(dtype=wp.uint8),
) -> None:
    """Write the distance to the nearest block that is not empty, along one axis more than before.

    A distance is the largest of the distances along the axes, in blocks.
    """
    i = first + wp.tid()
    place = (i // stride) % side
    nearest = int(before[i])
    step = int(1)
    while step < nearest:
        if place >= step:
            nearest = wp.min(nearest, wp.max(step, int(before[i - step * stride])))
        if place + step < side:
            nearest = wp.min(nearest, wp.max(step, int(before[i + step * stride])))
        step += 1
    distances[i] = wp.uint8(nearest)


@wp.kernel
def write_table(
    first: wp.int32,
    side: wp.int32,
    counts: wp.array(dtype=wp.vec3i),
    starts: wp.array(dtype=wp.int32),
    entries: wp.array(dtype=wp.int32),
    distances: wp.array(dtype=wp.uint8),
    spans: wp.array(dtype=wp.vec2i),
    shift: wp.int32,
    blocks: wp.array(dtype=wp.int32),
) -> None:
    """Write the entries of the blocks of all grids; a model has its entries from its start on.

    The tape of a block lies `shift` texels behind its place in `spans`.
    """
    i = first + wp.tid()
    at = place_of(i, side)
    count = counts[at[3]]
    if at[0] >= count[0] or at[1] >= count[1] or at[2] >= count[2]:
        return
    entry = entries[i]
    if entry == SURELY_OUTSIDE:
        entry = EMPTY + 1 - int(distances[i])
    elif entry >= 0:
        entry = spans[entry][0] - 1 + shift
    blocks[starts[at[3]] + (at[0] * count[1] + at[1]) * count[2] + at[2]] = entry
