"""Sparse cells: where the surface may be, and the part of the tape that matters there.

Blocks of 4³ cells form a tree of branching 4³. From level to level a block's tape is pruned to its children;
children that are surely empty or surely inside end there. What is left at the finest level is, for a sum of
many points, a handful of primitives per block and a handful of cells per cell that the surface crosses.
The polygonizer samples these blocks, the tracer walks through them, an edit rebuilds those that it touches.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .errors import InvalidResolution
from .kernel_options import KERNEL_OPTIONS
from .kernels import ISO
from .launch import launch
from .prune import prune
from .tape import Tape
from .vocabulary import Vocabulary

wp.set_module_options(KERNEL_OPTIONS)

BRANCHING_BITS = 2
BRANCHING = 1 << BRANCHING_BITS
"""A block has BRANCHING³ children; a block of the finest level has BRANCHING³ cells."""

CHILDREN = BRANCHING**3

SURELY_OUTSIDE = -1
SURELY_INSIDE = -2

KEY_DIGITS = 10
"""Levels that a key has room for: 4¹⁰ blocks along a side."""

MOST_BLOCKS = 1 << 21
"""Blocks of a level, at most; a mesh in as many takes a few gigabytes, and 3000 cells span a ball."""

Ints = NDArray[np.int32]
Floats = NDArray[np.float32]


@wp.func
def child_block(parent: wp.vec3i, child: wp.int32) -> wp.vec3i:
    """Coordinates of a block's child, in blocks of the child's level."""
    return wp.vec3i(
        (parent[0] << BRANCHING_BITS) + (child >> (2 * BRANCHING_BITS)),
        (parent[1] << BRANCHING_BITS) + ((child >> BRANCHING_BITS) & (BRANCHING - 1)),
        (parent[2] << BRANCHING_BITS) + (child & (BRANCHING - 1)),
    )


@wp.func
def block_center(block: wp.vec3i, origin: wp.vec3, size: wp.float32) -> wp.vec3:
    """Middle of a block."""
    return origin + wp.vec3(float(block[0]) + 0.5, float(block[1]) + 0.5, float(block[2]) + 0.5) * size


@wp.kernel
def _measure(
    first: wp.int32,
    parents: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    origin: wp.vec3,
    size: wp.float32,
    pad: wp.float32,
    out: wp.array(dtype=wp.vec4),
) -> None:
    i = first + wp.tid()
    parent = i // CHILDREN
    center = block_center(child_block(parents[parent], i % CHILDREN), origin, size)
    out[i] = prune(center, 0.5 * size + pad, tape, spans[parent], tape, 0, False)


@wp.kernel
def _write(
    first: wp.int32,
    chosen: wp.array(dtype=wp.int32),
    parents: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    origin: wp.vec3,
    size: wp.float32,
    pad: wp.float32,
    starts: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    new_spans: wp.array(dtype=wp.vec2i),
    out: wp.array(dtype=wp.vec4),
) -> None:
    i = first + wp.tid()
    parent = chosen[i] // CHILDREN
    block = child_block(parents[parent], chosen[i] % CHILDREN)
    result = prune(
        block_center(block, origin, size), 0.5 * size + pad, tape, spans[parent], out, starts[i] + 1, True
    )
    out[starts[i]] = wp.vec4(result[3], 0.0, 0.0, 0.0)
    blocks[i] = block
    new_spans[i] = wp.vec2i(starts[i] + 1, starts[i] + 1 + int(result[3]))


@wp.func
def block_key(block: wp.vec3i) -> wp.int64:
    """A block's place in the order in which levels are refined: its children's numbers, coarsest first."""
    key = wp.int64(0)
    for digit in range(KEY_DIGITS):
        shift = (KEY_DIGITS - 1 - digit) * BRANCHING_BITS
        x = (block[0] >> shift) & (BRANCHING - 1)
        y = (block[1] >> shift) & (BRANCHING - 1)
        z = (block[2] >> shift) & (BRANCHING - 1)
        child = (x << (2 * BRANCHING_BITS)) + (y << BRANCHING_BITS) + z
        key = key * wp.int64(CHILDREN) + wp.int64(child)
    return key


@wp.func
def find_block(block: wp.vec3i, blocks: wp.array(dtype=wp.vec3i)) -> wp.int32:
    """Index of a block in a level, −1 where it is not there: bisection, levels being in key order."""
    if block[0] < 0 or block[1] < 0 or block[2] < 0:
        return -1
    wanted = block_key(block)
    low = int(0)
    high = blocks.shape[0]
    while low < high:
        middle = (low + high) // 2
        if block_key(blocks[middle]) < wanted:
            low = middle + 1
        else:
            high = middle
    if low < blocks.shape[0] and blocks[low] == block:
        return low
    return -1


@dataclass(frozen=True, eq=False)
class Level:
    """The blocks of one level that the surface may cross, in key order.

    `tape` holds the pruned tape of every block, each behind a texel (its length, 0, 0, 0).
    """

    blocks: "wp.array[wp.vec3i]"
    """Coordinates (n, 3), in blocks of this level."""
    spans: "wp.array[wp.vec2i]"
    """Where in `tape` each block's tape begins and ends (n, 2)."""
    tape: "wp.array[wp.vec4]"
    parent_children: Ints
    """For every child of the level above its place in this one, or SURELY_OUTSIDE, SURELY_INSIDE."""

    def __len__(self) -> int:
        return len(self.blocks)


@dataclass(frozen=True, eq=False)
class SparseCells:
    """A grid over a tree's box of influence, of which only blocks that the surface may cross exist.

    Cell (i, j, k) spans origin + cell_size · [i, i + 1] × …; block (a, b, c) of the finest level holds the
    cells 4a … 4a + 3 × ….
    """

    origin: NDArray[np.float64]
    cell_size: float
    blocks_per_side: int
    """Blocks of the finest level along each side of the root block."""
    levels: tuple[Level, ...]
    """From the root, a single block, to the finest."""
    device: str
    vocabulary: Vocabulary
    """What the codes on the blocks' tapes stand for."""

    @property
    def leaves(self) -> Level:
        """The finest level."""
        return self.levels[-1]


def build_cells(
    tape: Tape,
    bounds: tuple[Floats, Floats],
    cell_size: float,
    *,
    device: str | None = None,
) -> SparseCells:
    """The sparse cells of a tape, level by level.

    Raises
    ------
    InvalidResolution
        The surface crosses more than MOST_BLOCKS blocks of a level.
    """
    place = str(wp.get_device(device))
    lower, upper = (corner.astype(np.float64) for corner in bounds)
    depth = _depth(lower, upper, cell_size)
    origin = wp.vec3(*lower)
    pad = float(np.abs([lower, upper]).max()) * 2.0**-21
    uploaded = tape.on(place)
    level = Level(
        wp.zeros(1, dtype=wp.vec3i, device=place),
        wp.array([uploaded.span], dtype=wp.vec2i, device=place),
        uploaded.data,
        np.zeros(0, np.int32),
    )
    levels = [level]
    for remaining in reversed(range(depth)):
        size = cell_size * BRANCHING ** (remaining + 1)
        levels.append(_refine(levels[-1], origin, size, pad, place, tape.vocabulary))
    return SparseCells(lower, cell_size, BRANCHING**depth, tuple(levels), place, tape.vocabulary)


def _depth(lower: NDArray[np.float64], upper: NDArray[np.float64], cell_size: float) -> int:
    """Levels below the root until the root holds the box."""
    blocks = float((upper - lower).max()) / (cell_size * BRANCHING)
    depth = 0
    while BRANCHING**depth < blocks:
        depth += 1
    return depth


def _refine(
    level: Level, origin: wp.vec3, size: float, pad: float, device: str, vocabulary: Vocabulary
) -> Level:
    """The children, of side `size`, of a level's blocks that the surface may cross."""
    count = len(level) * CHILDREN
    measured: wp.array[Any] = wp.empty(count, dtype=wp.vec4, device=device)
    geometry = [level.blocks, level.spans, level.tape, origin, size, pad]
    launch(vocabulary.kernel(_measure), count, geometry, [measured], device)
    smallest, largest, texels, _ = measured.numpy().T
    chosen = np.flatnonzero((smallest <= ISO) & (largest >= ISO)).astype(np.int32)
    if len(chosen) > MOST_BLOCKS:
        raise InvalidResolution(
            f"the surface crosses {len(chosen):,} blocks of {BRANCHING}³ cells, at most {MOST_BLOCKS:,} "
            "are made; take larger cells"
        )
    children = np.where(smallest > ISO, SURELY_INSIDE, SURELY_OUTSIDE).astype(np.int32)
    children[chosen] = np.arange(len(chosen))
    needed = texels[chosen].astype(np.int64) + 1
    starts = np.cumsum(needed) - needed
    blocks: wp.array[Any] = wp.empty(len(chosen), dtype=wp.vec3i, device=device)
    spans: wp.array[Any] = wp.empty(len(chosen), dtype=wp.vec2i, device=device)
    tape: wp.array[Any] = wp.empty(int(needed.sum()), dtype=wp.vec4, device=device)
    launch(
        vocabulary.kernel(_write),
        len(chosen),
        [
            wp.array(chosen, dtype=wp.int32, device=device),
            *geometry,
            wp.array(starts.astype(np.int32), dtype=wp.int32, device=device),
        ],
        [blocks, spans, tape],
        device,
    )
    return Level(blocks, spans, tape, children)
