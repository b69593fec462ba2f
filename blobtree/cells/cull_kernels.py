"""Culling: kernels that copy a long tape to the root's children without primitives that do not reach them.

`prune` reads a block's tape with one thread. Below the root there are few blocks, and their tapes are long:
a graphics card would run a handful of threads. Here a thread reads one piece of the tape for one block. A
piece alone shows which primitives may be left out: those that are 0 in the block, under an operator that
returns its first operand if the second is 0. The next level is pruned as usual.
"""

import warp as wp

from blobtree.cells.block_kernels import ChildGrid, LevelBlocks, block_center, child_offset
from blobtree.cells.prune_kernels import absent, direct_range, primitive_range, stretched_range
from blobtree.cells.refine_kernels import SURELY_OUTSIDE, write_block
from blobtree.formulas.skeletons import HALF_DIAGONAL
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import FIELD, STRETCHED
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def reaches(code: wp.int32, center: wp.vec3, half: wp.float32, tape: Texels, at: wp.int32) -> wp.bool:
    """Return True if a primitive may differ from 0 somewhere in the cube center ± half."""
    r = wp.vec2()
    if code >= FIELD:
        cube = wp.vec3(half, half, half)
        r = direct_range(code - FIELD, center, cube, half * HALF_DIAGONAL, tape, at)
    elif code >= STRETCHED:
        cube = wp.vec3(half, half, half)
        r = stretched_range(code - STRETCHED, center, cube, half * HALF_DIAGONAL, tape, at)
    else:
        r = primitive_range(code, center, half, tape, at)
    return not absent(r)


@wp.kernel
def count_reaching(
    first: wp.int32,
    pieces: wp.array(dtype=wp.vec4i),
    tape: Texels,
    grid: ChildGrid,
    flags: wp.array(dtype=wp.int32),
    texels: wp.array(dtype=wp.int32),
) -> None:
    """Count the texels of each piece in each of the root's children, and flag children with a primitive."""
    i = first + wp.tid()
    child = i // pieces.shape[0]
    piece = pieces[i % pieces.shape[0]]
    code = int(tape[piece[0]][0])
    center = block_center(grid.base + child_offset(child), grid.corner, grid.size)
    needed = int(0)
    if i % pieces.shape[0] == 0:
        needed = 1  # for the length, in front of the block's tape
    if piece[3] == 0:
        needed += piece[2]
        if code >= 0:
            flags[child] = 1
    else:
        count = int(0)
        for k in range(piece[2]):
            if reaches(code, center, 0.5 * grid.size + grid.pad, tape, piece[1] + k * piece[3]):
                count += 1
        if count > 0:
            needed += 1 + count * piece[3]
            flags[child] = 1
    texels[i] = needed


@wp.kernel
def write_reaching(
    first: wp.int32,
    pieces: wp.array(dtype=wp.vec4i),
    tape: Texels,
    grid: ChildGrid,
    starts: wp.array(dtype=wp.int32),
    out: wp.array(dtype=wp.vec4),
) -> None:
    """Write the tapes of the root's children, piece by piece."""
    i = first + wp.tid()
    child = i // pieces.shape[0]
    piece = pieces[i % pieces.shape[0]]
    header = tape[piece[0]]
    center = block_center(grid.base + child_offset(child), grid.corner, grid.size)
    at = starts[i]
    if i % pieces.shape[0] == 0:
        length = starts[i + pieces.shape[0]] - at - 1
        out[at] = wp.vec4(float(length), 0.0, 0.0, 0.0)
        at += 1
    if piece[3] == 0:
        for k in range(piece[2]):
            out[at + k] = tape[piece[1] + k]
        return
    begin = at
    at += 1
    count = int(0)
    for k in range(piece[2]):
        source = piece[1] + k * piece[3]
        if reaches(int(header[0]), center, 0.5 * grid.size + grid.pad, tape, source):
            for texel in range(piece[3]):
                out[at + texel] = tape[source + texel]
            at += piece[3]
            count += 1
    if count > 0:
        out[begin] = wp.vec4(header[0], header[1], float(count), header[3])


@wp.kernel
def write_reached_children(
    first: wp.int32,
    pieces: wp.int32,
    slots: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    children: wp.array(dtype=wp.int32),
    level: LevelBlocks,
) -> None:
    """Write the root's children that hold a primitive; `pieces` is the number of pieces of each."""
    child = first + wp.tid()
    slot = slots[child]
    if slots[child + 1] == slot:
        children[child] = SURELY_OUTSIDE
        return
    children[child] = slot
    start = starts[child * pieces]
    write_block(level, slot, child_offset(child), start, starts[(child + 1) * pieces] - start - 1)
