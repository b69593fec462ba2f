"""The first step down a long tape, many threads to a block: what does not reach a block is left out.

`prune` walks a block's tape with one thread; below the root these are few blocks and the longest tapes, and a
graphics card would wait for a handful of threads. Here a thread looks at a piece of the tape for one block.
What it may leave out it may leave out without knowing the rest: a primitive that is 0 in the block, under an
operator that gives its first operand back where the second is 0. `prune` does what is left on the next level.
"""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.formulas.operators import DIFFERENCE, RICCI, SUM, UNION
from blobtree.formulas.skeletons import HALF_DIAGONAL
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.sparse.blocks import block_center, block_key, child_place
from blobtree.sparse.prune import primitive_range, range_in_ball
from blobtree.sparse.refine import SURELY_OUTSIDE
from blobtree.tapes.readings import to_local
from blobtree.tapes.tape import PREFIX, STRETCHED, UNWARP, WARP, Tape

wp.set_module_options(KERNEL_OPTIONS)

PIECE = 64
"""Primitives that one thread looks at."""

LONG_TAPE = 4096
"""Texels from which on a graphics card culls."""

MOSTLY = 0.9
"""Share of a tape that must be worth looking at, for the rest is copied to every block."""

_NEUTRAL = (SUM, RICCI, UNION, DIFFERENCE)
"""Operators that give their first operand back where the second is 0."""


def pieces_of(tape: Tape, device: str) -> NDArray[np.int32] | None:
    """The tape in pieces (n, 4): header, first texel, length, stride; None where `prune` alone is faster.

    A piece of a run has the length in primitives and their stride in texels; anything else is copied as it is
    and has the length in texels and the stride 0.
    """
    if wp.get_device(device).is_cpu or len(tape.data) < LONG_TAPE:
        return None
    return split(tape)


def split(tape: Tape) -> NDArray[np.int32] | None:
    """`pieces_of` a tape of any length."""
    headers = tape.headers
    code, operator, count = tape.data[headers, :3].astype(np.int64).T
    lengths = np.diff(headers, append=len(tape.data))
    warped = np.cumsum(code == WARP) - np.cumsum(code == UNWARP) > 0
    neutral = [tape.vocabulary.operators.index(row) for row in _NEUTRAL]
    run = (code >= 0) & ~warped & np.isin(operator, neutral)
    if lengths[run].sum() < MOSTLY * len(tape.data):
        return None
    parts = np.where(run, -(-count // PIECE), 1)
    which = np.repeat(np.arange(len(headers)), parts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)
    stride = np.where(run, (lengths - 1) // np.maximum(count, 1), 0)[which]
    begin = headers[which] + np.where(run[which], 1 + number * PIECE * stride, 0)
    length = np.where(run[which], np.minimum(PIECE, count[which] - number * PIECE), lengths[which])
    return np.stack([headers[which], begin, length, stride], axis=1).astype(np.int32)


@wp.func
def reaches(
    code: wp.int32, center: wp.vec3, half: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.bool:
    """Whether a primitive may be other than 0 somewhere in the cube center ± half."""
    r = wp.vec2()
    if code >= STRETCHED:
        ball = half * HALF_DIAGONAL * tape[at + 3][0]
        r = range_in_ball(code - STRETCHED, to_local(center, tape, at), ball, tape, at + PREFIX)
    else:
        r = primitive_range(code, center, half, tape, at)
    return r[1] > 0.0


@wp.kernel
def count_reaching(
    first: wp.int32,
    pieces: wp.array(dtype=wp.vec4i),
    tape: wp.array(dtype=wp.vec4),
    base: wp.vec3i,
    corner: wp.vec3,
    size: wp.float32,
    pad: wp.float32,
    kept: wp.array(dtype=wp.int32),
    texels: wp.array(dtype=wp.int32),
) -> None:
    """What each piece needs in each of the root's children, and which of these hold a primitive."""
    i = first + wp.tid()
    child = i // pieces.shape[0]
    piece = pieces[i % pieces.shape[0]]
    code = int(tape[piece[0]][0])
    center = block_center(base + child_place(child), corner, size)
    needed = int(0)
    if i % pieces.shape[0] == 0:
        needed = 1  # for the length, in front of the block's tape
    if piece[3] == 0:
        needed += piece[2]
        if code >= 0:
            kept[child] = 1
    else:
        found = int(0)
        for k in range(piece[2]):
            if reaches(code, center, 0.5 * size + pad, tape, piece[1] + k * piece[3]):
                found += 1
        if found > 0:
            needed += 1 + found * piece[3]
            kept[child] = 1
    texels[i] = needed


@wp.kernel
def write_reaching(
    first: wp.int32,
    pieces: wp.array(dtype=wp.vec4i),
    tape: wp.array(dtype=wp.vec4),
    base: wp.vec3i,
    corner: wp.vec3,
    size: wp.float32,
    pad: wp.float32,
    starts: wp.array(dtype=wp.int32),
    out: wp.array(dtype=wp.vec4),
) -> None:
    """The pieces without what does not reach each of the root's children."""
    i = first + wp.tid()
    child = i // pieces.shape[0]
    piece = pieces[i % pieces.shape[0]]
    header = tape[piece[0]]
    center = block_center(base + child_place(child), corner, size)
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
    found = int(0)
    for k in range(piece[2]):
        source = piece[1] + k * piece[3]
        if reaches(int(header[0]), center, 0.5 * size + pad, tape, source):
            for texel in range(piece[3]):
                out[at + texel] = tape[source + texel]
            at += piece[3]
            found += 1
    if found > 0:
        out[begin] = wp.vec4(header[0], header[1], float(found), header[3])


@wp.kernel
def name_children(
    first: wp.int32,
    count: wp.int32,
    places: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    children: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    spans: wp.array(dtype=wp.vec2i),
) -> None:
    """The root's children that hold a primitive; `count` pieces each."""
    child = first + wp.tid()
    place = places[child]
    if places[child + 1] == place:
        children[child] = SURELY_OUTSIDE
        return
    children[child] = place
    blocks[place] = child_place(child)
    keys[place] = block_key(child_place(child))
    spans[place] = wp.vec2i(starts[child * count] + 1, starts[(child + 1) * count])
