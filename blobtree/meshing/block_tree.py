"""A tree of blocks that is refined where its users ask for it, each block with its pruned tape and samples.

The blocks of the base are those of `sparse_cells`. A cell of a block can be refined into a block of 4³ cells,
a quarter as large. All blocks are numbered in the order in which they are made; number · CHILDREN + cell
identifies a cell of any level.
"""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, IndexArray, Int32Array
from blobtree.cells.block_kernels import Lattices, LevelBlocks
from blobtree.cells.grid import CHILDREN, KEY_DIGITS, MAX_CELL_COORDINATE, Grid
from blobtree.cells.refine_kernels import refine_children
from blobtree.cells.scan import DeviceArray, exclusive_scan
from blobtree.cells.sparse_cells import MAX_BLOCKS, TEXEL_BYTES, SparseCells, child_grid
from blobtree.device import demand_memory, launch
from blobtree.errors import InvalidResolution
from blobtree.meshing.adaptive_kernels import BlockTreeArrays
from blobtree.meshing.dual_kernels import SAMPLES, SAMPLES_PER_SIDE, sample_blocks

GROWTH = 1.5
"""Room of a `Rows` that is full, over its rows: the rows are copied about thrice, however often it grows."""

UNREFINED = -3
"""Mark of a cell without a block of its own, of which nothing else is known."""


class Rows:
    """An array that grows at its end, in NumPy or on a device."""

    def __init__(self, rows: Any) -> None:
        self._room = self.all = rows

    def extend(self, count: int) -> Any:
        """Add rows, and return them, which are not set; `all` is another array then."""
        old, new = len(self.all), len(self.all) + count
        if new > len(self._room):
            room = max(new, int(GROWTH * old))
            if isinstance(self.all, np.ndarray):
                longer: Any = np.empty((room, *self.all.shape[1:]), self.all.dtype)
                longer[:old] = self.all
            else:
                longer = wp.empty(room, dtype=self.all.dtype, device=self.all.device)
                wp.copy(longer, self.all, count=old)
            self._room = longer
        self.all = self._room[:new]
        return self.all[old:]

    def append(self, rows: NDArray[Any]) -> None:
        """Add rows of NumPy."""
        self.extend(len(rows))[:] = rows


class BlockTree:
    """Blocks of several levels, the base being level 0; `samples` holds its field, if it is known."""

    def __init__(self, cells: SparseCells, samples: DeviceArray | None = None) -> None:
        self._cells, self._device = cells, cells.device
        self._kernel = cells.tape.instruction_set.kernel_for
        leaves = cells.leaves
        self._level_rows = [Rows(array) for array in (leaves.blocks, leaves.keys, leaves.spans, leaves.tape)]
        blocks = len(leaves)
        self._levels = Rows(np.zeros(blocks, np.int64))
        self._coordinates = Rows(leaves.blocks.numpy().reshape(-1, 3))
        self._children = Rows(np.full(blocks * CHILDREN, UNREFINED, np.int32))
        self._parents = Rows(np.full(blocks, -1, np.int64))
        self._values = Rows(_by_block(self._sample(0, 0, blocks) if samples is None else samples))

    def __len__(self) -> int:
        return len(self.levels)

    @property
    def levels(self) -> IndexArray:
        """Level of each block (n,)."""
        levels: IndexArray = self._levels.all
        return levels

    @property
    def coordinates(self) -> Int32Array:
        """Coordinates (n, 3), in blocks of their level from the root's lowest one."""
        coordinates: Int32Array = self._coordinates.all
        return coordinates

    @property
    def children(self) -> Int32Array:
        """For each cell the block that refines it, SURELY_OUTSIDE, SURELY_INSIDE or UNREFINED (64 n,)."""
        children: Int32Array = self._children.all
        return children

    @property
    def parents(self) -> IndexArray:
        """For each block the cell that it refines (n,), −1 at the base."""
        parents: IndexArray = self._parents.all
        return parents

    @property
    def values(self) -> Float32Array:
        """The field at the corners of each block's cells (n, 5, 5, 5)."""
        values: Float32Array = self._values.all
        return values

    @property
    def cells(self) -> SparseCells:
        """The cells of the base."""
        return self._cells

    @property
    def depth(self) -> int:
        """The finest level."""
        return int(self.levels.max(initial=0))

    @property
    def max_level(self) -> int:
        """The finest level whose cells float32 can tell apart."""
        base = self._cells.grid
        far = base.origin + base.blocks_per_side * 4 * base.cell_size
        farthest = float(np.abs([base.origin, far]).max()) / base.cell_size
        room = int(np.log2(MAX_CELL_COORDINATE / farthest) // 2)
        return max(0, min(room, KEY_DIGITS - 1 - base.depth))

    def grid(self, level: int) -> Grid:
        """Return the lattice of the cells of a level."""
        base = self._cells.grid
        i, j, k = (first << (2 * level) for first in base.base)
        return Grid(base.cell_size / 4.0**level, (i, j, k), base.depth + level, base.corner)

    def arrays(self) -> Any:
        """Return the blocks and their lattice as an argument of kernels, coordinates in the finest cells."""
        arrays: Any = BlockTreeArrays()
        finest = self.grid(self.depth)
        arrays.keys, arrays.spans, arrays.tape = self._cells.leaves.keys, self.spans, self.tape
        arrays.children = on_device(self.children, wp.int32, self._device)
        arrays.base, arrays.corner = wp.vec3i(*finest.base), wp.vec3(*finest.corner)
        arrays.cell, arrays.depth = finest.cell_size, self.depth
        whole = self._cells.tape.on(self._device)
        arrays.whole, arrays.whole_span = whole.data, whole.span
        return arrays

    @property
    def spans(self) -> DeviceArray:
        """First texel of each block's tape, and one past its last (n, 2)."""
        return self._level_rows[2].all

    @property
    def tape(self) -> DeviceArray:
        """The tapes of all blocks."""
        return self._level_rows[3].all

    def level_arrays(self) -> Any:
        """Return all blocks and their tapes as an argument of kernels."""
        arrays: Any = LevelBlocks()
        arrays.blocks, arrays.keys, arrays.spans, arrays.tape = (array.all for array in self._level_rows)
        return arrays

    def refine(self, cells: IndexArray) -> int:
        """Refine cells that the surface may cross, and return the number of new blocks.

        Cells that have a block, or that the surface surely does not cross, stay as they are.

        Raises
        ------
        InvalidResolution
            There are too many blocks, or cells too small for float32.
        """
        before = len(self)
        cells = np.unique(cells[self.children[cells] == UNREFINED])
        levels = self.levels[cells // CHILDREN]
        if levels.max(initial=-1) >= self.max_level:
            raise InvalidResolution(
                f"cells of {self.grid(self.max_level).cell_size:g} are the smallest that float32 can tell "
                "apart there; allow a larger error, or move the model to the origin"
            )
        for level in np.unique(levels):
            self._refine_level(cells[levels == level], int(level))
        return len(self) - before

    def _refine_level(self, cells: IndexArray, level: int) -> None:
        """Refine cells of one level, in ascending order."""
        device = self._device
        grid = self.grid(level + 1)
        lattice = child_grid(grid, grid.depth)
        parents, rows = np.unique(cells // CHILDREN, return_inverse=True)
        count, local = len(parents) * CHILDREN, rows * CHILDREN + cells % CHILDREN
        above: Any = LevelBlocks()
        above.blocks = on_device(self.coordinates[parents], wp.vec3i, device)
        above.spans = on_device(self.spans.numpy()[parents], wp.vec2i, device)
        above.tape = self.tape
        of_parents = self.children.reshape(-1, CHILDREN)
        children = on_device(of_parents[parents].ravel(), wp.int32, device)
        flags, texels = (wp.zeros(count + 1, dtype=wp.int32, device=device) for _ in range(2))
        inputs = [on_device(np.arange(len(parents)), wp.int32, device), above, lattice, Lattices()]
        outputs = [children, flags, texels, self.level_arrays()]
        launch(self._kernel(refine_children), count, [*inputs, False], outputs, device)
        wanted = np.zeros(count + 1, np.int32)
        wanted[local] = 1
        flags, texels = (on_device(array.numpy() * wanted, wp.int32, device) for array in (flags, texels))
        old, old_texels = len(self), len(self.tape)
        slots, blocks = exclusive_scan(flags, "blocks", start=old)
        starts, total = exclusive_scan(texels, "texels of the blocks' tapes", start=old_texels)
        if blocks > MAX_BLOCKS:
            raise InvalidResolution(
                f"expected at most {MAX_BLOCKS:,} blocks of cells, got {blocks:,}; allow a larger error"
            )
        if blocks > old:
            demand_memory(TEXEL_BYTES * total, device, f"the tapes of {blocks:,} blocks")
            for array, length in zip(self._level_rows, (blocks,) * 3 + (total,), strict=True):
                array.extend(length - len(array.all))
            outputs = [children, slots, starts, self.level_arrays()]
            launch(self._kernel(refine_children), count, [*inputs, True], outputs, device)
        of_parents[parents] = children.numpy().reshape(-1, CHILDREN)
        if blocks > old:
            refined = np.flatnonzero(flags.numpy()[:-1])
            self._children.append(np.full((blocks - old) * CHILDREN, UNREFINED, np.int32))
            self._parents.append(parents[refined // CHILDREN] * CHILDREN + refined % CHILDREN)
            self._levels.append(np.full(blocks - old, level + 1))
            self._coordinates.append(self._level_rows[0].all[old:].numpy().reshape(-1, 3))
            self._values.append(_by_block(self._sample(level + 1, old, blocks)))

    def _sample(self, level: int, first: int, end: int) -> DeviceArray:
        """Return the field at the corners of the cells of blocks of one level."""
        grid, count = self.grid(level), end - first
        listed = on_device(np.arange(first, end), wp.int32, self._device)
        values: DeviceArray = wp.empty(count * SAMPLES, dtype=wp.float32, device=self._device)
        arrays = self.level_arrays()
        inputs: list[Any] = [listed, arrays.blocks, arrays.keys, arrays.spans, arrays.tape]
        inputs += [child_grid(grid, grid.depth), Lattices()]
        launch(self._kernel(sample_blocks), count * SAMPLES, inputs, [values], self._device)
        return values


def _by_block(values: DeviceArray) -> Float32Array:
    """Return samples in host memory (n, 5, 5, 5)."""
    samples: Float32Array = values.numpy().reshape(-1, *(SAMPLES_PER_SIDE,) * 3)
    return samples


def on_device(values: NDArray[Any], dtype: Any, device: str) -> DeviceArray:
    """Return a copy of an array on a device."""
    return wp.array(values, dtype=dtype, device=device)
