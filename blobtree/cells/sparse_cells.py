"""Sparse cells: the blocks that the surface may cross, each with the part of the tape that acts in it.

Blocks of 4³ cells form a tree of branching 4³. From level to level a block's tape is pruned to its children.
Children that are surely outside or surely inside end there. For a sum of many points, the finest level has a
handful of primitives per block, and a handful of cells per cell that the surface crosses. The polygonizer
samples these blocks, the tracer steps through them, and an edit rebuilds the blocks that it changes.

The field in a block depends on the block's coordinates and its pruned tape alone. A block whose pruned tape
is the same as before, bit for bit, is therefore unchanged, and so are all blocks inside. A primitive is on
the tapes of the blocks that its influence reaches and on no others. So an edit changes blocks where the
edited node has or had influence, whatever maps, warps and operators are above it in the tree.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array, Int32Array
from blobtree.cells.block_kernels import CellBlocks, ChildGrid, Lattices, LevelBlocks
from blobtree.cells.cull_kernels import count_reaching, write_reached_children, write_reaching
from blobtree.cells.grid import BRANCHING, BRANCHING_BITS, CHILDREN, KEY_DIGITS, Grid
from blobtree.cells.refine_kernels import (
    copy_children,
    inherit_child_texels,
    match_children,
    refine_children,
)
from blobtree.cells.runs import Runs, copy_runs, long_runs
from blobtree.cells.scan import DeviceArray, arange, exclusive_scan, where_negative
from blobtree.cells.scan_kernels import summarize
from blobtree.device import demand_memory, known_device, launch
from blobtree.errors import InvalidNode, InvalidResolution
from blobtree.progress import Progress
from blobtree.struct_rows import struct_rows
from blobtree.tape.codes import OPERATORS, UNWARP, WARP
from blobtree.tape.tape import Tape

MAX_BLOCKS = 1 << 21
"""Most blocks of a level: those of a ball 3000 cells wide, whose mesh takes a few gigabytes."""

TEXEL_BYTES = 16

MAX_TEXELS = 1 << 24
"""Most texels of a tape: float32 counts no further."""

PRIMITIVES_PER_PIECE = 64

MIN_CULLED_TEXELS = 4096
"""Length of a tape from which graphics cards cull it."""

MIN_CULLED_SHARE = 0.9
"""Smallest share of a tape in runs that culling can shorten; all other texels are copied to every block."""

CELL_KERNELS = (refine_children, summarize)
"""Kernels of every refinement, for `load_together`."""

_NEUTRAL_OPERATORS = [OPERATORS.index(tag) for tag in ("sum", "ricci", "union", "difference")]
"""Codes of operators that return their first operand if the second is 0."""


@dataclass(frozen=True, eq=False)
class Level:
    """The blocks of one level that the surface may cross, in key order.

    `tape` holds the data region of the whole tape, then the pruned tape of every block, each behind a texel
    (its length, 0, 0, 0).
    """

    blocks: "wp.array[wp.vec3i]"
    """Coordinates (n, 3), in blocks of this level from the root's lowest one."""
    keys: "wp.array[wp.int64]"
    """Their keys (n), by which they are ordered and found."""
    spans: "wp.array[wp.vec2i]"
    """First texel, and one past the last, of each block's tape in `tape` (n, 2)."""
    tape: "wp.array[wp.vec4]"
    children: "wp.array[wp.int32]"
    """For each child of the level above its index in this one, or SURELY_OUTSIDE, SURELY_INSIDE."""
    sources: "wp.array[wp.int32]"
    """For each block its index in the same level before the edit, −1 if it has changed."""

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def arrays(self) -> Any:
        """The blocks and their tapes as an argument of kernels."""
        arrays: Any = LevelBlocks()
        arrays.blocks, arrays.keys, arrays.spans, arrays.tape = self.blocks, self.keys, self.spans, self.tape
        return arrays


@dataclass(frozen=True, eq=False)
class SparseCells:
    """The cells of a grid, in the blocks that the surface may cross alone.

    Those of many models lie one after the other, see `joint_cells`.
    """

    grid: Grid
    levels: tuple[Level, ...]
    """From the root, which is one block, to the finest."""
    device: str
    tape: Tape
    models: tuple[Grid, ...] = ()
    """The grid of each model, if there are several; all are as deep."""

    @property
    def leaves(self) -> Level:
        """The finest level."""
        return self.levels[-1]

    @property
    def arrays(self) -> Any:
        """The finest blocks, their lattice and the whole tape as an argument of kernels."""
        arrays: Any = CellBlocks()
        leaves, grid = self.leaves, self.grid
        arrays.blocks, arrays.keys = leaves.blocks, leaves.keys
        arrays.spans, arrays.tape = leaves.spans, leaves.tape
        arrays.base, arrays.corner = wp.vec3i(*grid.base_of(grid.depth)), wp.vec3(*grid.corner)
        arrays.cell = grid.cell_size
        arrays.whole = self.levels[0].tape
        arrays.whole_span = wp.vec2i(self.tape.start, len(self.tape.data))
        arrays.models = lattices(self.models, grid.depth, self.device)
        return arrays


def build_cells(
    tape: Tape,
    grid: Grid,
    *,
    device: str | None = None,
    previous: SparseCells | None = None,
    report: Progress = lambda _stage, _fraction: None,
) -> SparseCells:
    """Build the sparse cells of a tape, level by level; copy the blocks that are unchanged since `previous`.

    Raises
    ------
    InvalidResolution
        The surface crosses more than MAX_BLOCKS blocks of a level, or the tapes do not fit into memory.
    InvalidNode
        The tape is longer than MAX_TEXELS.
    """
    if len(tape.data) > MAX_TEXELS:
        raise InvalidNode(
            f"tree: expected a tape of at most {MAX_TEXELS:,} texels, got {len(tape.data):,}; split the model"
        )
    device = known_device(device)
    if previous is not None and not _comparable(previous, tape, grid, device):
        previous = None
    root = SparseCells(grid, (_root(tape, grid, previous, device),), device, tape)
    return refined(root, report, previous, pieces_to_cull(tape, device))


def refined(
    root: SparseCells,
    report: Progress,
    previous: SparseCells | None = None,
    pieces: Int32Array | None = None,
) -> SparseCells:
    """Return cells with all levels below the root; `pieces` are of the root's tape, if it is to be culled."""
    cells, depth = root, root.grid.depth
    for number in range(1, depth + 1):
        report("finding the surface", (number - 1) / depth)
        level = _Refinement(cells, previous).level(pieces if number == 1 else None)
        cells = replace(cells, levels=(*cells.levels, level))
    report("finding the surface", 1.0)
    return cells


def _comparable(previous: SparseCells, tape: Tape, grid: Grid, device: str) -> bool:
    """Return True if two sets of cells can share blocks: same lattice, device, codes and data region."""
    other = previous.grid
    same_cells = (grid.cell_size, grid.corner, device) == (other.cell_size, other.corner, previous.device)
    same_codes = tape.instruction_set == previous.tape.instruction_set
    return same_cells and same_codes and _same_bits(_data_region(tape), _data_region(previous.tape))


def _root(tape: Tape, grid: Grid, previous: SparseCells | None, device: str) -> Level:
    """Return the level of the root block."""
    uploaded = tape.on(device)
    same = previous is not None and previous.grid == grid and _same_bits(previous.tape.data, tape.data)
    return Level(
        wp.zeros(1, dtype=wp.vec3i, device=device),
        wp.zeros(1, dtype=wp.int64, device=device),
        wp.array([uploaded.span], dtype=wp.vec2i, device=device),
        uploaded.data,
        wp.zeros(0, dtype=wp.int32, device=device),
        wp.array([0 if same else -1], dtype=wp.int32, device=device),
    )


def _data_region(tape: Tape) -> Float32Array:
    return tape.data[: tape.start]


def _same_bits(first: Float32Array, second: Float32Array) -> bool:
    """Return True if texels (n, 4) are the same bit for bit, so that −0 differs from 0."""
    return np.array_equal(first.view(np.int32), second.view(np.int32))


class _Refinement:
    """The step from the last level to the next."""

    def __init__(self, cells: SparseCells, previous: SparseCells | None) -> None:
        above, number, grid, tape = cells.leaves, len(cells.levels), cells.grid, cells.tape
        self._above, self._device = above, cells.device
        self._kernel, self._start = tape.instruction_set.kernel_for, tape.start
        self._grid = child_grid(grid, number)
        self._models = lattices(cells.models, number, cells.device, above=number - 1)
        self._old, self._shift = _old_level(previous, grid, number)
        if self._old is not None and previous is not None and previous.grid.pad == grid.pad:
            self._changed = where_negative(above.sources)
            self._unchanged = where_negative(above.sources, negative=False)
        else:
            self._changed, self._unchanged = arange(len(above), cells.device), arange(0, cells.device)
        in_place = self._old is not None and not any(self._shift)
        self._runs = long_runs(self._unchanged, above.sources) if in_place else None

    def level(self, pieces: Int32Array | None) -> Level:
        """Return the level below; `pieces` are those of the root's tape, if it is to be culled."""
        if pieces is not None and len(self._changed):
            return self._culled(wp.array(pieces, dtype=wp.vec4i, device=self._device))
        count = len(self._above) * CHILDREN
        children: DeviceArray = wp.empty(count, dtype=wp.int32, device=self._device)
        flags, texels = self._counts(count), self._counts(count)
        self._count_texels([children, flags, texels])
        slots, blocks = exclusive_scan(flags, "blocks")
        starts, total = exclusive_scan(texels, "texels of the blocks' tapes", start=self._start)
        if blocks > MAX_BLOCKS:
            raise InvalidResolution(
                f"expected a surface that crosses at most {MAX_BLOCKS:,} blocks of {BRANCHING}³ cells, got "
                f"{blocks:,}; take larger cells"
            )
        level = self._empty_level(blocks, total, children)
        self._write(level, slots, starts)
        return level

    def _counts(self, count: int) -> DeviceArray:
        """Return `count` zeros, and one more for the total."""
        return wp.zeros(count + 1, dtype=wp.int32, device=self._device)

    def _empty_level(self, blocks: int, texels: int, children: DeviceArray) -> Level:
        """Return a level whose arrays are not written yet, save the data region."""
        device = self._device
        demand_memory(TEXEL_BYTES * texels, device, f"the tapes of {blocks:,} blocks")
        level = Level(
            wp.empty(blocks, dtype=wp.vec3i, device=device),
            wp.empty(blocks, dtype=wp.int64, device=device),
            wp.empty(blocks, dtype=wp.vec2i, device=device),
            wp.empty(texels, dtype=wp.vec4, device=device),
            children,
            wp.full(blocks, -1, dtype=wp.int32, device=device),
        )
        if self._start > 0:
            wp.copy(level.tape, self._above.tape, count=self._start)
        return level

    def _culled(self, pieces: DeviceArray) -> Level:
        """Return the root's children that primitives reach."""
        count = CHILDREN * len(pieces)
        children: DeviceArray = wp.empty(CHILDREN, dtype=wp.int32, device=self._device)
        flags, texels = self._counts(CHILDREN), self._counts(count)
        inputs = [pieces, self._above.tape, self._grid]
        launch(self._kernel(count_reaching), count, inputs, [flags, texels], self._device)
        slots, blocks = exclusive_scan(flags, "blocks")
        starts, total = exclusive_scan(texels, "texels of the blocks' tapes", start=self._start)
        level = self._empty_level(blocks, total, children)
        launch(self._kernel(write_reaching), count, [*inputs, starts], [level.tape], self._device)
        outputs = [children, level.arrays]
        launch(write_reached_children, CHILDREN, [len(pieces), slots, starts], outputs, self._device)
        self._match(level, slots)
        return level

    def _count_texels(self, outputs: list[DeviceArray]) -> None:
        """Count the texels of each child, and flag the children to keep."""
        inputs = [self._changed, self._above.arrays, self._grid, self._models, False]
        count = len(self._changed) * CHILDREN
        launch(self._kernel(refine_children), count, inputs, [*outputs, self._above.arrays], self._device)
        if self._runs is not None:
            self._inherit_texels(self._runs, *(array.numpy() for array in outputs))
        elif self._old is not None and len(self._unchanged):
            inputs = [self._unchanged, self._above.sources, self._old.children, self._old.arrays]
            count = len(self._unchanged) * CHILDREN
            launch(inherit_child_texels, count, inputs, outputs, self._device)

    def _write(self, level: Level, slots: DeviceArray, starts: DeviceArray) -> None:
        """Write the blocks that are kept, their tapes and their sources."""
        above, outputs = self._above.arrays, [level.children, level.arrays]
        inputs = [self._changed, above, self._grid, self._models, True]
        count = len(self._changed) * CHILDREN
        written = [level.children, slots, starts, level.arrays]
        launch(self._kernel(refine_children), count, inputs, written, self._device)
        if self._old is None:
            return
        self._match(level, slots)
        if self._runs is not None:
            self._copy_children(self._runs, level, slots.numpy(), starts.numpy())
            return
        inputs = [self._unchanged, self._above.sources, above, self._old.children, self._old.arrays]
        inputs += [slots, starts]
        count = len(self._unchanged) * CHILDREN
        launch(copy_children, count, inputs, [*outputs, level.sources], self._device)

    def _inherit_texels(
        self, runs: Runs, children: Int32Array, flags: Int32Array, texels: Int32Array
    ) -> None:
        """Do the same as the kernel `inherit_child_texels` for runs of parents."""
        assert self._old is not None
        old_children, spans = self._old.children.numpy(), self._old.spans.numpy()
        for first, old_first, count in (CHILDREN * runs).tolist():
            inherited = old_children[old_first : old_first + count]
            kept = np.flatnonzero(inherited >= 0)
            children[first : first + count] = inherited
            if len(kept):
                begins, ends = spans[inherited[kept[0]] : inherited[kept[-1]] + 1].T
                flags[first + kept] = 1
                texels[first + kept] = np.diff(begins, append=ends[-1] + 1)

    def _copy_children(self, runs: Runs, level: Level, slots: Int32Array, starts: Int32Array) -> None:
        """Do the same as the kernel `copy_children` for runs of parents whose blocks have not moved."""
        assert self._old is not None
        blocks: list[list[int]] = []
        texels: list[list[int]] = []
        old, old_spans = self._old, self._old.spans.numpy()
        children, spans, sources = level.children.numpy(), level.spans.numpy(), level.sources.numpy()
        for first, _, count in (CHILDREN * runs).tolist():
            inherited = children[first : first + count]
            kept = np.flatnonzero(inherited >= 0)
            if not len(kept):
                continue
            slot, source, number = int(slots[first]), int(inherited[kept[0]]), len(kept)
            begin, end = int(old_spans[source, 0]) - 1, int(old_spans[source + number - 1, 1])
            blocks.append([slot, source, number])
            texels.append([int(starts[first]), begin, end - begin])
            inherited[kept] += slot - source
            spans[slot : slot + number] = old_spans[source : source + number] + (starts[first] - begin)
            sources[slot : slot + number] = np.arange(source, source + number)
        block_runs, texel_runs = (np.array(rows, np.int64).reshape(-1, 3) for rows in (blocks, texels))
        copy_runs(block_runs, old.blocks.numpy(), level.blocks.numpy())
        copy_runs(block_runs, old.keys.numpy(), level.keys.numpy())
        copy_runs(texel_runs, old.tape.numpy(), level.tape.numpy())

    def _match(self, level: Level, slots: DeviceArray) -> None:
        """Find the sources of rebuilt blocks that are the same as before."""
        old = self._old
        if old is None:
            return
        inputs = [self._changed, slots, level.arrays, level.tape.view(wp.vec4i)]
        inputs += [wp.vec3i(*self._shift), old.arrays, old.tape.view(wp.vec4i)]
        launch(match_children, len(self._changed) * CHILDREN, inputs, [level.sources], self._device)


def child_grid(grid: Grid, number: int) -> Any:
    """Return the lattice of the blocks of a level as an argument of kernels."""
    lattice: Any = ChildGrid()
    lattice.base, lattice.corner = wp.vec3i(*grid.base_of(number)), wp.vec3(*grid.corner)
    lattice.size, lattice.pad = grid.cell_size * grid.cells_along(number), grid.pad
    return lattice


def first_blocks(count: int, level: int) -> NDArray[np.int64]:
    """Return the coordinates (count, 3) of the first block of a level of each of many models in one list.

    The root blocks of the models are the first blocks of a lattice, in the order of keys.
    """
    places = np.zeros((count, 3), np.int64)
    for digit in range(KEY_DIGITS):
        children = np.arange(count) >> (3 * BRANCHING_BITS * digit)
        for axis, shift in enumerate((2 * BRANCHING_BITS, BRANCHING_BITS, 0)):
            places[:, axis] += (children >> shift & (BRANCHING - 1)) << (BRANCHING_BITS * digit)
    return places << (BRANCHING_BITS * level)


def lattices(models: Sequence[Grid], number: int, device: str, *, above: int | None = None) -> Any:
    """Return the lattices of a level of many models as an argument of kernels; none for one model alone.

    Models are found by the keys of the blocks of this level, or of the one above.
    """
    result: Any = Lattices()
    if models:
        along = models[0].cells_along(number)  # all are as deep
        bases = np.array([grid.base for grid in models]) // along
        values: dict[str, ArrayLike] = {
            "base": bases - first_blocks(len(models), number),
            "corner": [grid.corner for grid in models],
            "size": [grid.cell_size * along for grid in models],
            "pad": [grid.pad for grid in models],
        }
        single: Any = ChildGrid()
        result.grids = struct_rows(ChildGrid, single, len(models), device, parts={}, values=values)
        result.shift = 3 * BRANCHING_BITS * (number if above is None else above)
    return result


def _old_level(
    previous: SparseCells | None, grid: Grid, number: int
) -> tuple[Level | None, tuple[int, int, int]]:
    """Return the old level with blocks of the same size, and the shift from new coordinates to old ones."""
    if previous is None:
        return None, (0, 0, 0)
    old_number = previous.grid.depth - grid.depth + number
    if old_number < 1:
        return None, (0, 0, 0)
    x, y, z = (a - b for a, b in zip(grid.base_of(number), previous.grid.base_of(old_number), strict=True))
    return previous.levels[old_number], (x, y, z)


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
    run = (code >= 0) & ~warped & np.isin(operator, _NEUTRAL_OPERATORS)
    if lengths[run].sum() < MIN_CULLED_SHARE * (len(tape.data) - tape.start):
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
