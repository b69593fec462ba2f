"""Tracing cells: the table of blocks that rays and points read, and the pruned tapes of these blocks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Float64Array, IndexArray, Int32Array
from blobtree.cells.grid import BRANCHING, Grid, grid_from
from blobtree.cells.refine_kernels import SURELY_OUTSIDE
from blobtree.cells.sparse_cells import MAX_BLOCKS, Level, SparseCells, build_cells
from blobtree.cells.surface_box import Corners, surface_box
from blobtree.device import known_device
from blobtree.lazy import Lazy
from blobtree.sized_cache import sized_cache
from blobtree.tape.instruction_set import InstructionSet
from blobtree.tape.model import ImplicitModel
from blobtree.tape.tape import Tape
from blobtree.tracing.ray_kernels import EMPTY, RayCells
from blobtree.tracing.sharing import shared_tapes

RELATIVE_TOLERANCE = 1e-5
"""Distance to the surface at which a ray hits, over the diagonal of the model's box."""

BLOCKS_ALONG = 64
"""Finest blocks along the longest side of a model's box."""

MOST_BLOCKS_ALONG = 16384
"""The same for a long box that holds much; a ray crosses less than `ray_kernels.MAX_BLOCKS`."""

BLOCKS_PER_TEXEL = 16.0
"""Finest blocks per texel of a tape, if the box is flat or long: fewer hold too many primitives each."""

BLOCKS_PER_LEAF = 5.0
"""Finest blocks along a usual primitive with its influence; finer ones are about as full."""

MAX_LAYERS = 16
"""Most layers of empty blocks that a ray skips at once."""

MIN_POINT_TEXELS = 20
"""Length of a tape from which blocks save time at points; a shorter one is read as fast as found."""

WORD = 64
"""Bits of a word; no box has more blocks along its shortest side."""

MAX_CELLS_BYTES = 1 << 22
"""Bytes of the last cells, which are kept though no drawing uses them; those of a model take 1 MB or more."""

Corner: TypeAlias = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TracingCells:
    """The sparse cells of a model as arrays that rays read.

    Attributes
    ----------
    tape
        float32[m, 4]: the data region, then the whole tape and the blocks' pruned ones, each behind a texel
        with its length.
    start
        Number of texels of the data region.
    blocks
        int32[nx ny nz], the last axis fastest: for each block the texel in front of its tape, SURELY_INSIDE,
        or the number of empty layers around it (see `ray_kernels.EMPTY`).
    lower, block_size, counts
        The grid: lowest corner (3,), side of the blocks, number of blocks along each axis.
    tolerance
        Distance to the surface at which a ray hits.
    instruction_set
        The meaning of the codes on the tape.
    """

    tape: Float32Array
    start: int
    blocks: Int32Array
    lower: Float32Array
    block_size: float
    counts: tuple[int, int, int]
    tolerance: float
    instruction_set: InstructionSet
    _on_devices: "dict[str, DeviceCells]" = field(default_factory=dict, repr=False)

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays."""
        return self.tape.nbytes + self.blocks.nbytes

    @Lazy
    def crossed_box(self) -> tuple[Float32Array, Float32Array] | None:
        """Lower and upper corner (3,) of all blocks with a tape; None if there are none."""
        crossed = self.blocks.reshape(self.counts) >= 0
        if not crossed.any():
            return None
        ends = [np.flatnonzero(crossed.any(axis=others))[[0, -1]] for others in ((1, 2), (0, 2), (0, 1))]
        low, high = np.transpose(ends)
        low, high = self.lower + self.block_size * low, self.lower + self.block_size * (high + 1)
        return low.astype(np.float32), high.astype(np.float32)

    def on(self, device: str) -> "DeviceCells":
        """Return the cells in the memory of a Warp device, as long as they are kept here."""
        if device not in self._on_devices:
            self._on_devices[device] = self._uploaded(device)
        return self._on_devices[device]

    def _uploaded(self, device: str) -> "DeviceCells":
        arrays: Any = RayCells()
        arrays.lower, arrays.counts = wp.vec3(*self.lower.tolist()), wp.vec3i(*self.counts)
        arrays.block_size, arrays.tolerance = self.block_size, self.tolerance
        copy = device != "cpu"  # the processor's kernels read the arrays themselves
        arrays.tape = wp.array(self.tape, dtype=wp.vec4, device=device, copy=copy)
        arrays.start = self.start
        arrays.blocks = wp.array(self.blocks, dtype=wp.int32, device=device, copy=copy)
        return DeviceCells(arrays.tape, arrays, self.instruction_set)


@dataclass(frozen=True, eq=False)
class DeviceCells:
    """`TracingCells` in the memory of a Warp device."""

    tape: "wp.array[wp.vec4]"
    arrays: Any
    """`ray_kernels.RayCells`, the argument of kernels."""
    instruction_set: InstructionSet


def tracing_cells(
    tree: ImplicitModel,
    *,
    device: str | None = None,
    blocks: int | None = None,
    within: Corners | None = None,
) -> TracingCells:
    """Return the cells for rays through `tree`.

    `device` is the Warp device that builds them, by default the current one. `blocks` is the number of finest
    blocks along the longest side, by default `blocks_along`. `within` is the box of the cells, by default
    `surface_box`.
    """
    box = within or surface_box(tree, device)
    if blocks is None:
        blocks = blocks_of(tree, *box)
    lower, upper = (tuple(corner.tolist()) for corner in box)
    return _tracing_cells(tree.tape, lower, upper, known_device(device), blocks)


def device_cells(
    tree: ImplicitModel, *, device: str | None = None, within: Corners | None = None
) -> DeviceCells:
    """Return the cells for rays through `tree` in a device's memory."""
    return tracing_cells(tree, device=device, within=within).on(known_device(device))


def blocks_of(tree: ImplicitModel, lower: Float32Array, upper: Float32Array) -> int:
    """Return the number of finest blocks along the longest side of a box of a model, see `blocks_along`."""
    texels = len(tree.tape.data) - tree.tape.start
    if blocks_along(texels, 0.0, lower, upper) == BLOCKS_ALONG:
        return BLOCKS_ALONG  # whatever the sizes of its primitives are
    return blocks_along(texels, tree._leaf_size, lower, upper)


def blocks_along(texels: int, size: float, lower: Float32Array, upper: Float32Array) -> int:
    """Return the number of finest blocks along the longest side of a model's box.

    `texels` is the length of its tape, `size` that of a usual primitive. A long tape of small primitives in a
    flat or long box has more than `BLOCKS_ALONG`, with `MAX_BLOCKS` in all at most, and no more than `WORD`
    along the shortest side.
    """
    longest = float((upper - lower).max())
    extent = (upper - lower).astype(np.float64) / longest

    def counts(blocks: int) -> Float64Array:
        sides: Float64Array = np.maximum(np.ceil(blocks * extent), 1.0)
        return sides

    blocks = BLOCKS_ALONG
    while blocks < MOST_BLOCKS_ALONG and counts(blocks).prod() < BLOCKS_PER_TEXEL * texels:
        if blocks * size >= BLOCKS_PER_LEAF * longest:
            break
        finer = counts(2 * blocks)
        if finer.prod() > MAX_BLOCKS or finer.min() > WORD:
            break
        blocks *= 2
    return blocks


def cells_grid(lower: Float32Array, upper: Float32Array, blocks: int = BLOCKS_ALONG) -> Grid:
    """Return the cells for rays through a model in a box."""
    return grid_from(lower, upper, float((upper - lower).max()) / (blocks * BRANCHING) * (1.0 + 1e-6))


def block_counts(lower: Float32Array, upper: Float32Array, block_size: float) -> IndexArray:
    """Return the number of finest blocks along each axis of a box (3,), one at least."""
    counts: IndexArray = np.maximum(np.ceil((upper - lower) / block_size).astype(int), 1)
    return counts


def trace_tolerance(bounds: tuple[Float32Array, Float32Array]) -> float:
    """Return the distance to the surface at which a ray hits a model of these bounds."""
    return RELATIVE_TOLERANCE * float(np.linalg.norm(bounds[1] - bounds[0]))


@sized_cache(MAX_CELLS_BYTES)
def _tracing_cells(tape: Tape, lower: Corner, upper: Corner, device: str, blocks: int) -> TracingCells:
    bounds = np.array(lower, np.float32), np.array(upper, np.float32)
    grid = cells_grid(*bounds, blocks)
    cells = build_cells(tape, grid, device=device)
    if blocks > BLOCKS_ALONG:
        tapes, places = shared_tapes(cells.leaves)
    else:
        tapes = cells.leaves.tape.numpy()[tape.start :]
        places = cells.leaves.spans.numpy()[:, 0] - 1 - tape.start
    places += tape.start + len(_whole(tape))
    table = block_table(cells, places, block_counts(*bounds, grid.cell_size * BRANCHING))
    return _assembled(tape, bounds, grid, table, [tapes])


def point_cells(tree: ImplicitModel, device: str) -> TracingCells:
    """Return new cells for points near the surface; a device builds them.

    Every block has a tape: its own if the surface may cross it, or else that of the smallest block around it
    which the surface may cross. A tape shorter than MIN_POINT_TEXELS has no blocks.
    """
    tape, bounds = tree.tape, surface_box(tree, device)
    grid = cells_grid(*bounds)
    if len(tape.data) - tape.start < MIN_POINT_TEXELS:
        return _assembled(tape, bounds, grid, np.zeros((0, 0, 0), np.int32), ())
    cells = build_cells(tape, grid, device=device)
    counts = block_counts(*bounds, grid.cell_size * BRANCHING)
    table = _tape_table(cells, len(_whole(tape)), counts)
    tapes = [level.tape.numpy()[tape.start :] for level in cells.levels[1:]]
    return _assembled(tape, bounds, grid, table, tapes)


def _whole(tape: Tape) -> Float32Array:
    """Return the instructions of a tape behind a texel with their length."""
    instructions = tape.data[tape.start :]
    return np.concatenate([np.array([[len(instructions), 0.0, 0.0, 0.0]], np.float32), instructions])


def _assembled(
    tape: Tape, bounds: Corners, grid: Grid, table: Int32Array, tapes: Sequence[Float32Array]
) -> TracingCells:
    """Return cells with the whole tape and those of blocks, one after the other."""
    return TracingCells(
        tape=np.concatenate([tape.data[: tape.start], _whole(tape), *tapes]),
        start=tape.start,
        blocks=table.ravel(),
        lower=grid.origin.astype(np.float32),
        block_size=grid.cell_size * BRANCHING,
        counts=table.shape,
        tolerance=trace_tolerance(bounds),
        instruction_set=tape.instruction_set,
    )


def block_table(cells: SparseCells, places: Int32Array, counts: IndexArray, model: int = 0) -> Int32Array:
    """Return `TracingCells.blocks` for the finest blocks (nx, ny, nz) of a model.

    `places` has the texel in front of the tape of each block of `cells`.
    """
    *_, (_leaves, known) = _tables(cells, counts, model)
    crossed, empty = known >= 0, known == SURELY_OUTSIDE
    order = np.argsort(empty.shape)[::-1]
    layers = _layers(empty.transpose(order)).transpose(np.argsort(order))
    blocks = np.where(empty, EMPTY - layers, known)
    blocks[crossed] = places[known[crossed]]
    return blocks


def _tape_table(cells: SparseCells, shift: int, counts: IndexArray) -> Int32Array:
    """Return for the finest blocks (nx, ny, nz) the texel in front of the tape of the smallest block around.

    The tapes of all levels but the root's lie one after the other; those of the first move by `shift`.
    """
    start = cells.tape.start
    texels = np.full((1, 1, 1), start, np.int32)
    for level, known in _tables(cells, counts):
        x, y, z = known.shape
        for axis in range(3):
            texels = texels.repeat(BRANCHING, axis)
        texels = texels[:x, :y, :z]
        crossed = known >= 0
        texels[crossed] = level.spans.numpy()[known[crossed], 0] - 1 + shift
        shift += len(level.tape) - start
    return texels


def _tables(cells: SparseCells, counts: IndexArray, model: int = 0) -> Iterator[tuple[Level, Int32Array]]:
    """Yield each level below the root of a model with its blocks' entries, see `_refined`."""
    known = np.full((1, 1, 1), model, np.int32)
    for number, level in enumerate(cells.levels[1:], 2):
        x, y, z = -(-counts // BRANCHING ** (len(cells.levels) - number))
        known = _refined(known, level.children.numpy())[:x, :y, :z]
        yield level, known


def _refined(known: Int32Array, children: Int32Array) -> Int32Array:
    """Return the entries of all children (4a, 4b, 4c) of the blocks with entries `known` (a, b, c).

    An entry is the index of a block in its level, or the reason why it has none.
    """
    x, y, z = known.shape
    families = children.reshape(-1, BRANCHING, BRANCHING, BRANCHING)
    below = known.repeat(BRANCHING, 0).repeat(BRANCHING, 1).repeat(BRANCHING, 2)
    of_parents = below.reshape(x, BRANCHING, y, BRANCHING, z, BRANCHING).transpose(0, 2, 4, 1, 3, 5)
    of_parents[known >= 0] = families[known[known >= 0]]
    return below


def _layers(empty: BoolArray) -> Int32Array:
    """Return the number of layers of empty blocks around each empty one (nx, ny, nz), MAX_LAYERS at most.

    The blocks of a column along the last axis are the bits of one word. Blocks beyond the grid are empty. The
    numbers are counted as binary digits, each in words of its own.
    """
    columns = np.ones((*empty.shape[:2], WORD), np.bool_)
    columns[..., : empty.shape[2]] = empty
    words = np.packbits(columns, axis=2, bitorder="little").view("<u8")[..., 0]
    lowest, highest = np.uint64(1), np.uint64(1 << 63)
    digits = np.zeros((MAX_LAYERS.bit_length(), *words.shape), np.uint64)
    for number in range(1, MAX_LAYERS + 1):
        words = words & ((words << lowest) | lowest) & ((words >> lowest) | highest)
        for after, before in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
            eroded = words.copy()
            eroded[after] &= words[before]
            eroded[before] &= words[after]
            words = eroded
        if not words.any():
            break
        for place, digit in enumerate(digits):
            digit[:] = digit | words if number >> place & 1 else digit & ~words
    layers = np.zeros(columns.shape, np.uint8)
    for digit in digits[::-1]:
        layers += layers + np.unpackbits(digit[..., None].view(np.uint8), axis=2, bitorder="little")
    return layers[..., : empty.shape[2]].astype(np.int32)
