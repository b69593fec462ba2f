"""Kernels that refine a level: children that the surface may cross, their tapes, and unchanged children.

Each kernel has one thread per child of the blocks `parents`. A child's number is
parent · CHILDREN + its number in the parent. A child that is kept gets a slot, its index in the new level.
"""

import warp as wp

from blobtree.cells.block_kernels import (
    ChildGrid,
    Lattices,
    LevelBlocks,
    block_center,
    block_key,
    child_block,
    find_block,
    lattice_of,
)
from blobtree.cells.grid import CHILDREN
from blobtree.cells.prune_kernels import prune
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)

SURELY_OUTSIDE = -1
SURELY_INSIDE = -2


@wp.func
def write_block(
    level: LevelBlocks, slot: wp.int32, block: wp.vec3i, start: wp.int32, length: wp.int32
) -> None:
    """Write the coordinates, the key and the span of a block whose tape lies behind texel `start`."""
    level.blocks[slot] = block
    level.keys[slot] = block_key(block)
    level.spans[slot] = wp.vec2i(start + 1, start + 1 + length)


@wp.kernel
def refine_children(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    above: LevelBlocks,
    single: ChildGrid,
    models: Lattices,
    write: wp.bool,
    children: wp.array(dtype=wp.int32),
    slots: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    level: LevelBlocks,
) -> None:
    """Find the children that the surface may cross; in a second pass, write them to `level`.

    The first pass sets `slots` to 1 for these children, and `starts` to the texels that writing their tapes
    needs. For the second, both are summed up. `prune` compiles once for both.
    """
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    child = parent * CHILDREN + i % CHILDREN
    slot = slots[child]
    start = starts[child]
    if write and slots[child + 1] == slot:
        return
    block = child_block(above.blocks[parent], i % CHILDREN)
    grid = lattice_of(parent, above.keys, single, models)
    center = block_center(grid.base + block, grid.corner, grid.size)
    half = 0.5 * grid.size + grid.pad
    result = prune(center, half, above.tape, above.spans[parent], level.tape, start + 1, write)
    if write:
        level.tape[start] = wp.vec4(result[3], 0.0, 0.0, 0.0)
        write_block(level, slot, block, start, int(result[3]))
        children[child] = slot
    elif result[0] > ISO:
        children[child] = SURELY_INSIDE
    elif result[1] < ISO:
        children[child] = SURELY_OUTSIDE
    else:
        slots[child] = 1
        starts[child] = int(result[2]) + 1


@wp.kernel
def inherit_child_texels(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_children: wp.array(dtype=wp.int32),
    old: LevelBlocks,
    children: wp.array(dtype=wp.int32),
    flags: wp.array(dtype=wp.int32),
    texels: wp.array(dtype=wp.int32),
) -> None:
    """Do the same as the first pass of `refine_children` for unchanged blocks, from the old level."""
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    child = parent * CHILDREN + i % CHILDREN
    source = old_children[sources[parent] * CHILDREN + i % CHILDREN]
    if source < 0:
        children[child] = source
    else:
        flags[child] = 1
        texels[child] = old.spans[source][1] - old.spans[source][0] + 1


@wp.kernel
def copy_children(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    above: LevelBlocks,
    old_children: wp.array(dtype=wp.int32),
    old: LevelBlocks,
    slots: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    children: wp.array(dtype=wp.int32),
    level: LevelBlocks,
    level_sources: wp.array(dtype=wp.int32),
) -> None:
    """Copy the children of unchanged blocks from the old level to `level`."""
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    child = parent * CHILDREN + i % CHILDREN
    source = old_children[sources[parent] * CHILDREN + i % CHILDREN]
    if source < 0:
        return
    slot = slots[child]
    start = starts[child]
    length = old.spans[source][1] - old.spans[source][0]
    for k in range(-1, length):
        level.tape[start + 1 + k] = old.tape[old.spans[source][0] + k]
    write_block(level, slot, child_block(above.blocks[parent], i % CHILDREN), start, length)
    level_sources[slot] = source
    children[child] = slot


@wp.kernel
def match_children(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    slots: wp.array(dtype=wp.int32),
    level: LevelBlocks,
    bits: wp.array(dtype=wp.vec4i),
    shift: wp.vec3i,
    old: LevelBlocks,
    old_bits: wp.array(dtype=wp.vec4i),
    sources: wp.array(dtype=wp.int32),
) -> None:
    """Find for each kept child the old block with the same coordinates and the same tape, bit for bit.

    `bits` and `old_bits` are the tapes of the two levels read as integers.
    """
    i = first + wp.tid()
    child = parents[i // CHILDREN] * CHILDREN + i % CHILDREN
    slot = slots[child]
    if slots[child + 1] == slot:
        return
    source = find_block(level.blocks[slot] + shift, old.keys)
    if source < 0:
        return
    length = level.spans[slot][1] - level.spans[slot][0]
    if old.spans[source][1] - old.spans[source][0] != length:
        return
    for k in range(length):
        same = bits[level.spans[slot][0] + k] == old_bits[old.spans[source][0] + k]
        if not same:
            return
    sources[slot] = source
