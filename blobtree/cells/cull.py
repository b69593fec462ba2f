"""Pieces of a long tape, for the kernels that cull it with many threads per block."""

import numpy as np
import warp as wp

from blobtree._typing import Int32Array
from blobtree.formulas.operators import DIFFERENCE, RICCI, SUM, UNION
from blobtree.tape.tape import UNWARP, WARP, Tape

PRIMITIVES_PER_PIECE = 64

MIN_CULLED_TEXELS = 4096
"""Length of a tape from which graphics cards cull it."""

MIN_CULLED_SHARE = 0.9
"""Smallest share of a tape in runs that culling can shorten; all other texels are copied to every block."""

_NEUTRAL_OPERATORS = (SUM, RICCI, UNION, DIFFERENCE)
"""Operators that return their first operand if the second is 0."""


def pieces_to_cull(tape: Tape, device: str) -> Int32Array | None:
    """Return the pieces of a tape (n, 4), see `split_tape`; None if `prune` alone is faster."""
    if wp.get_device(device).is_cpu or len(tape.data) < MIN_CULLED_TEXELS:
        return None
    return split_tape(tape)


def split_tape(tape: Tape) -> Int32Array | None:
    """Return a tape in pieces (n, 4): header, first texel, length, stride; None if culling is not worth it.

    A piece of a run has its length in primitives, and their stride in texels. All other pieces are copied as
    they are: their length is in texels, their stride 0.
    """
    headers = tape.headers
    code, operator, count = tape.data[headers, :3].astype(np.int64).T
    lengths = np.diff(headers, append=len(tape.data))
    warped = np.cumsum(code == WARP) - np.cumsum(code == UNWARP) > 0
    neutral = [tape.instruction_set.operators.index(row) for row in _NEUTRAL_OPERATORS]
    run = (code >= 0) & ~warped & np.isin(operator, neutral)
    if lengths[run].sum() < MIN_CULLED_SHARE * len(tape.data):
        return None
    parts = np.where(run, -(-count // PRIMITIVES_PER_PIECE), 1)
    instruction = np.repeat(np.arange(len(headers)), parts)
    number = np.arange(len(instruction)) - np.repeat(np.cumsum(parts) - parts, parts)
    done = number * PRIMITIVES_PER_PIECE
    stride = np.where(run, (lengths - 1) // np.maximum(count, 1), 0)[instruction]
    begin = headers[instruction] + np.where(run[instruction], 1 + done * stride, 0)
    length = np.where(
        run[instruction], np.minimum(PRIMITIVES_PER_PIECE, count[instruction] - done), lengths[instruction]
    )
    return np.stack([headers[instruction], begin, length, stride], axis=1).astype(np.int32)
