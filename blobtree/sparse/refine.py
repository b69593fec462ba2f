"""From level to level: kernels that prune a block's tape to its children, or take them over from before.

A child's pruned tape depends on its parent's pruned tape, on the child's place and on nothing else. So where
an older level has a block of the same place with the same tape, everything below it is there already.
"""

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.sparse.blocks import block_center, block_key, child_block, find_block
from blobtree.sparse.grid import CHILDREN
from blobtree.sparse.prune import prune

wp.set_module_options(KERNEL_OPTIONS)

SURELY_OUTSIDE = -1
SURELY_INSIDE = -2


@wp.kernel
def measure(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    base: wp.vec3i,
    corner: wp.vec3,
    size: wp.float32,
    pad: wp.float32,
    children: wp.array(dtype=wp.int32),
    kept: wp.array(dtype=wp.int32),
    texels: wp.array(dtype=wp.int32),
) -> None:
    """Whether the surface may cross the children of `parents`, and how much room their tapes need."""
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    center = block_center(base + child_block(blocks[parent], i % CHILDREN), corner, size)
    result = prune(center, 0.5 * size + pad, tape, spans[parent], tape, 0, False)
    child = parent * CHILDREN + i % CHILDREN
    if result[0] > ISO:
        children[child] = SURELY_INSIDE
    elif result[1] < ISO:
        children[child] = SURELY_OUTSIDE
    else:
        kept[child] = 1
        texels[child] = int(result[2]) + 1


@wp.kernel
def write(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    base: wp.vec3i,
    corner: wp.vec3,
    size: wp.float32,
    pad: wp.float32,
    places: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    children: wp.array(dtype=wp.int32),
    new_blocks: wp.array(dtype=wp.vec3i),
    new_keys: wp.array(dtype=wp.int64),
    new_spans: wp.array(dtype=wp.vec2i),
    new_tape: wp.array(dtype=wp.vec4),
) -> None:
    """The children of `parents` that are kept."""
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    child = parent * CHILDREN + i % CHILDREN
    place = places[child]
    if places[child + 1] == place:
        return
    block = child_block(blocks[parent], i % CHILDREN)
    start = starts[child]
    center = block_center(base + block, corner, size)
    result = prune(center, 0.5 * size + pad, tape, spans[parent], new_tape, start + 1, True)
    new_tape[start] = wp.vec4(result[3], 0.0, 0.0, 0.0)
    new_blocks[place] = block
    new_keys[place] = block_key(block)
    new_spans[place] = wp.vec2i(start + 1, start + 1 + int(result[3]))
    children[child] = place


@wp.kernel
def match(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    places: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4i),
    shift: wp.vec3i,
    old_keys: wp.array(dtype=wp.int64),
    old_spans: wp.array(dtype=wp.vec2i),
    old_tape: wp.array(dtype=wp.vec4i),
    sources: wp.array(dtype=wp.int32),
) -> None:
    """For the kept children of `parents`, the old block of the same place and tape, compared bit by bit."""
    i = first + wp.tid()
    child = parents[i // CHILDREN] * CHILDREN + i % CHILDREN
    place = places[child]
    if places[child + 1] == place:
        return
    old = find_block(blocks[place] + shift, old_keys)
    if old < 0:
        return
    length = spans[place][1] - spans[place][0]
    if old_spans[old][1] - old_spans[old][0] != length:
        return
    for k in range(length):
        same = tape[spans[place][0] + k] == old_tape[old_spans[old][0] + k]
        if not same:
            return
    sources[place] = old


@wp.kernel
def inherit(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_children: wp.array(dtype=wp.int32),
    old_spans: wp.array(dtype=wp.vec2i),
    children: wp.array(dtype=wp.int32),
    kept: wp.array(dtype=wp.int32),
    texels: wp.array(dtype=wp.int32),
) -> None:
    """What `measure` finds, for children of blocks that have not changed."""
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    child = parent * CHILDREN + i % CHILDREN
    old = old_children[sources[parent] * CHILDREN + i % CHILDREN]
    if old < 0:
        children[child] = old
    else:
        kept[child] = 1
        texels[child] = old_spans[old][1] - old_spans[old][0] + 1


@wp.kernel
def take_over(
    first: wp.int32,
    parents: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    old_children: wp.array(dtype=wp.int32),
    old_spans: wp.array(dtype=wp.vec2i),
    old_tape: wp.array(dtype=wp.vec4),
    places: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    children: wp.array(dtype=wp.int32),
    new_blocks: wp.array(dtype=wp.vec3i),
    new_keys: wp.array(dtype=wp.int64),
    new_spans: wp.array(dtype=wp.vec2i),
    new_tape: wp.array(dtype=wp.vec4),
    new_sources: wp.array(dtype=wp.int32),
) -> None:
    """What `write` and `match` do, for children of blocks that have not changed."""
    i = first + wp.tid()
    parent = parents[i // CHILDREN]
    child = parent * CHILDREN + i % CHILDREN
    old = old_children[sources[parent] * CHILDREN + i % CHILDREN]
    if old < 0:
        return
    place = places[child]
    start = starts[child]
    length = old_spans[old][1] - old_spans[old][0]
    for k in range(-1, length):
        new_tape[start + 1 + k] = old_tape[old_spans[old][0] + k]
    block = child_block(blocks[parent], i % CHILDREN)
    new_blocks[place] = block
    new_keys[place] = block_key(block)
    new_spans[place] = wp.vec2i(start + 1, start + 1 + length)
    new_sources[place] = old
    children[child] = place
