"""Sparse cells: where the surface may be, and the part of the tape that matters there.

Blocks of 4³ cells form a tree of branching 4³. From level to level a block's tape is pruned to its children;
children that are surely empty or surely inside end there. What is left at the finest level is, for a sum of
many points, a handful of primitives per block and a handful of cells per cell that the surface crosses.
The polygonizer samples these blocks, the tracer walks through them, an edit rebuilds those that it touches.

An edit finds by itself what it touches. All that happens in a block is a function of its place and of its
pruned tape, so a block whose pruned tape came out as before, bit for bit, is as before, and with it all the
blocks inside. A primitive is on the tapes of blocks that its influence reaches and on no others, so what
changes is where an edited node's old or new influence is, whatever maps, warps and operators stand above it.
Nothing has to be proven about trees, and what cannot be told apart from a change is built anew.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.errors import InvalidNode, InvalidResolution
from blobtree.formulas.vocabulary import Vocabulary
from blobtree.launch import known_device, launch
from blobtree.memory import demand_memory
from blobtree.progress import Progress
from blobtree.sparse.cull import count_reaching, name_children, pieces_of, write_reaching
from blobtree.sparse.grid import BRANCHING, CHILDREN, Grid
from blobtree.sparse.refine import inherit, match, measure, take_over, write
from blobtree.sparse.scan import everything, starts_of, where_negative
from blobtree.tapes.tape import Tape

MOST_BLOCKS = 1 << 21
"""Blocks of a level, at most; a mesh in as many takes a few gigabytes, and 3000 cells span a ball."""

TEXEL_BYTES = 16

MOST_TEXELS = 1 << 24
"""Texels of a tape that float32 can count."""


@dataclass(frozen=True, eq=False)
class Level:
    """The blocks of one level that the surface may cross, in key order.

    `tape` holds the pruned tape of every block, each behind a texel (its length, 0, 0, 0).
    """

    blocks: "wp.array[wp.vec3i]"
    """Coordinates (n, 3), in blocks of this level from the root's lowest one."""
    keys: "wp.array[wp.int64]"
    """Their keys (n), by which they are ordered and found."""
    spans: "wp.array[wp.vec2i]"
    """Where in `tape` each block's tape begins and ends (n, 2)."""
    tape: "wp.array[wp.vec4]"
    children: "wp.array[wp.int32]"
    """For every child of the level above its place in this one, or SURELY_OUTSIDE, SURELY_INSIDE."""
    sources: "wp.array[wp.int32]"
    """For every block its place in the same level of the cells before the edit, −1 where it has changed."""

    def __len__(self) -> int:
        return len(self.blocks)


@dataclass(frozen=True, eq=False)
class SparseCells:
    """The cells of a grid, of which only those in blocks that the surface may cross exist."""

    grid: Grid
    levels: tuple[Level, ...]
    """From the root, a single block, to the finest."""
    device: str
    tape: Tape

    @property
    def leaves(self) -> Level:
        """The finest level."""
        return self.levels[-1]


def build_cells(
    tape: Tape,
    grid: Grid,
    *,
    device: str | None = None,
    previous: SparseCells | None = None,
    report: Progress = lambda _stage, _fraction: None,
) -> SparseCells:
    """The sparse cells of a tape, level by level; blocks that `previous` has just so are taken from there.

    Raises
    ------
    InvalidResolution
        The surface crosses more than MOST_BLOCKS blocks of a level, or its tapes would not fit into memory.
    InvalidNode
        The tape is longer than can be counted.
    """
    if len(tape.data) > MOST_TEXELS:
        raise InvalidNode(
            f"tree: its tape takes {len(tape.data):,} texels, at most {MOST_TEXELS:,} can be counted; "
            "split the model"
        )
    place = known_device(device)
    if previous is not None and not _comparable(previous, tape, grid, place):
        previous = None
    levels = [_root(tape, grid, previous, place)]
    for number in range(1, grid.depth + 1):
        report("finding the surface", (number - 1) / grid.depth)
        step = _Refinement(levels[-1], number, grid, previous, place, tape.vocabulary)
        levels.append(step.level(pieces_of(tape, place) if number == 1 else None))
    report("finding the surface", 1.0)
    return SparseCells(grid, tuple(levels), place, tape)


def _comparable(previous: SparseCells, tape: Tape, grid: Grid, device: str) -> bool:
    """Whether two sets of cells can have blocks in common: same cells, and codes that mean the same."""
    other = previous.grid
    same_cells = (grid.cell_size, grid.corner, device) == (other.cell_size, other.corner, previous.device)
    return same_cells and tape.vocabulary == previous.tape.vocabulary


def _root(tape: Tape, grid: Grid, previous: SparseCells | None, device: str) -> Level:
    """The level of the root block."""
    uploaded = tape.on(device)
    same = previous is not None and previous.grid == grid and _same_bits(previous.tape, tape)
    return Level(
        wp.zeros(1, dtype=wp.vec3i, device=device),
        wp.zeros(1, dtype=wp.int64, device=device),
        wp.array([uploaded.span], dtype=wp.vec2i, device=device),
        uploaded.data,
        wp.zeros(0, dtype=wp.int32, device=device),
        wp.array([0 if same else -1], dtype=wp.int32, device=device),
    )


def _same_bits(first: Tape, second: Tape) -> bool:
    """Whether two tapes are the same, −0 being another number than 0."""
    return np.array_equal(first.data.view(np.int32), second.data.view(np.int32))


class _Refinement:
    """The step from one level to the next."""

    def __init__(
        self,
        above: Level,
        number: int,
        grid: Grid,
        previous: SparseCells | None,
        device: str,
        vocabulary: Vocabulary,
    ) -> None:
        self._above, self._number, self._grid, self._device = above, number, grid, device
        self._vocabulary = vocabulary
        self._old, self._shift = self._counterpart(previous)
        if self._old is not None and previous is not None and previous.grid.pad == grid.pad:
            self._fresh = where_negative(above.sources)
            self._same = where_negative(above.sources, negative=False)
        else:
            self._fresh, self._same = everything(len(above), device), everything(0, device)

    def _counterpart(self, previous: SparseCells | None) -> tuple[Level | None, tuple[int, int, int]]:
        """The old level of blocks of the same size, and what takes our coordinates to its own."""
        if previous is None:
            return None, (0, 0, 0)
        number = previous.grid.depth - self._grid.depth + self._number
        if number < 1:
            return None, (0, 0, 0)
        ours, theirs = self._grid.base_of(self._number), previous.grid.base_of(number)
        x, y, z = (a - b for a, b in zip(ours, theirs, strict=True))
        return previous.levels[number], (x, y, z)

    def level(self, pieces: NDArray[np.int32] | None) -> Level:
        """The level below; `pieces` of the root's tape, where many threads are to look at it."""
        if pieces is not None and len(self._fresh):
            return self._culled(wp.array(pieces, dtype=wp.vec4i, device=self._device))
        above, device = self._above, self._device
        count = len(above) * CHILDREN
        children: Any = wp.empty(count, dtype=wp.int32, device=device)
        kept, texels = (wp.zeros(count + 1, dtype=wp.int32, device=device) for _ in range(2))
        self._judge([children, kept, texels])
        places, blocks = starts_of(kept, "blocks")
        starts, total = starts_of(texels, "texels of the blocks' tapes")
        if blocks > MOST_BLOCKS:
            raise InvalidResolution(
                f"the surface crosses {blocks:,} blocks of {BRANCHING}³ cells, at most {MOST_BLOCKS:,} are "
                "made; take larger cells"
            )
        new = _empty_level(blocks, total, children, device)
        self._fill(new, places, starts)
        return new

    def _culled(self, pieces: Any) -> Level:
        """The root's children, all that primitives reach."""
        device, vocabulary, count = self._device, self._vocabulary, CHILDREN * len(pieces)
        children: Any = wp.empty(CHILDREN, dtype=wp.int32, device=device)
        kept, texels = (wp.zeros(n + 1, dtype=wp.int32, device=device) for n in (CHILDREN, count))
        inputs = [pieces, self._above.tape, *self._geometry()[3:]]
        launch(vocabulary.kernel(count_reaching), count, inputs, [kept, texels], device)
        places, blocks = starts_of(kept, "blocks")
        starts, total = starts_of(texels, "texels of the blocks' tapes")
        new = _empty_level(blocks, total, children, device)
        launch(vocabulary.kernel(write_reaching), count, [*inputs, starts], [new.tape], device)
        outputs = [children, new.blocks, new.keys, new.spans]
        launch(name_children, CHILDREN, [len(pieces), places, starts], outputs, device)
        self._match(new, places)
        return new

    def _geometry(self) -> list[Any]:
        """The blocks above, and where their children lie."""
        above, grid = self._above, self._grid
        size = grid.cell_size * grid.cells_along(self._number)
        base = wp.vec3i(*grid.base_of(self._number))
        return [above.blocks, above.spans, above.tape, base, wp.vec3(*grid.corner), size, grid.pad]

    def _judge(self, outputs: list[Any]) -> None:
        """Which children are kept, and how many texels each needs."""
        inputs = [self._fresh, *self._geometry()]
        launch(self._vocabulary.kernel(measure), len(self._fresh) * CHILDREN, inputs, outputs, self._device)
        if self._old is not None and len(self._same):
            inputs = [self._same, self._above.sources, self._old.children, self._old.spans]
            launch(inherit, len(self._same) * CHILDREN, inputs, outputs, self._device)

    def _fill(self, new: Level, places: Any, starts: Any) -> None:
        """The blocks that are kept: coordinates, tapes and where they come from."""
        fresh = len(self._fresh) * CHILDREN
        outputs = [new.children, new.blocks, new.keys, new.spans, new.tape]
        inputs: list[Any] = [self._fresh, *self._geometry(), places, starts]
        launch(self._vocabulary.kernel(write), fresh, inputs, outputs, self._device)
        old, above = self._old, self._above
        if old is None:
            return
        self._match(new, places)
        inputs = [self._same, above.sources, above.blocks, old.children, old.spans, old.tape, places, starts]
        launch(take_over, len(self._same) * CHILDREN, inputs, [*outputs, new.sources], self._device)

    def _match(self, new: Level, places: Any) -> None:
        """Which of the blocks made anew came out as before."""
        old = self._old
        if old is None:
            return
        there = [old.keys, old.spans, old.tape.view(wp.vec4i)]
        inputs = [self._fresh, places, new.blocks, new.spans, new.tape.view(wp.vec4i)]
        inputs += [wp.vec3i(*self._shift), *there]
        launch(match, len(self._fresh) * CHILDREN, inputs, [new.sources], self._device)


def _empty_level(blocks: int, texels: int, children: Any, device: str) -> Level:
    """Room for a level."""
    demand_memory(TEXEL_BYTES * texels, device, f"the tapes of {blocks:,} blocks")
    return Level(
        wp.empty(blocks, dtype=wp.vec3i, device=device),
        wp.empty(blocks, dtype=wp.int64, device=device),
        wp.empty(blocks, dtype=wp.vec2i, device=device),
        wp.empty(texels, dtype=wp.vec4, device=device),
        children,
        wp.full(blocks, -1, dtype=wp.int32, device=device),
    )
