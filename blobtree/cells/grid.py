"""The lattice of cells: cubes of one size, counted from the world's origin, in blocks that nest 4³ to one.

A cell's coordinates depend on its position in the world alone, not on the model. After an edit, cells and
blocks therefore have the same coordinates as before.
"""

import math
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float64Array, FloatArray
from blobtree.errors import InvalidResolution
from blobtree.lazy import Lazy

BRANCHING_BITS = 2
BRANCHING = 1 << BRANCHING_BITS
"""A block has BRANCHING³ children; a block of the finest level has BRANCHING³ cells."""

CHILDREN = BRANCHING**3

KEY_DIGITS = 10
"""Most levels below the root: a block's key has one digit for each."""

MAX_CELL_COORDINATE = 1 << 20
"""Cells from the world's origin to the farthest one: float32 resolves 8 positions along that one."""

RELATIVE_PAD = 2.0**-20
"""Margin for rounding around a block, over the largest coordinate of the grid."""


@dataclass(frozen=True)
class Grid:
    """Cubes that tile a root block.

    Cell (i, j, k) spans corner + cell_size · [i, i + 1] × …. The root block starts at cell `base` and has
    4^depth blocks along each side; block (a, b, c) of the finest level holds cells base + 4a … 4a + 3 × ….
    """

    cell_size: float
    base: tuple[int, int, int]
    depth: int
    """Levels below the root, at least one."""
    corner: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def blocks_per_side(self) -> int:
        """Blocks of the finest level along each side of the root block."""
        return 1 << (BRANCHING_BITS * self.depth)

    @property
    def origin(self) -> Float64Array:
        """The root block's lowest corner (3,)."""
        return np.array(self.corner) + np.array(self.base) * self.cell_size

    @Lazy
    def pad(self) -> float:
        """Margin for rounding around a block; a power of two, so that it seldom changes with the grid."""
        far = self.origin + self.blocks_per_side * BRANCHING * self.cell_size
        largest = float(np.abs([self.origin, far]).max())
        return RELATIVE_PAD * 2.0 ** math.ceil(math.log2(largest))

    def cells_along(self, level: int) -> int:
        """Return the number of cells along the side of a block of a level, 0 being the root's."""
        return 1 << (BRANCHING_BITS * (self.depth - level + 1))

    def divided(self, times: int) -> "Grid":
        """Return the grid of the same root, each of whose cells is cut into BRANCHING³, so many times."""
        factor = BRANCHING**times
        i, j, k = (first * factor for first in self.base)
        return Grid(self.cell_size / factor, (i, j, k), self.depth + times, self.corner)

    def base_of(self, level: int) -> tuple[int, int, int]:
        """Return the root's lowest block of a level, in blocks of that level from `corner`."""
        i, j, k = (first // self.cells_along(level) for first in self.base)
        return i, j, k


def aligned_grid(lower: FloatArray, upper: FloatArray, cell_size: float) -> Grid:
    """Return the grid of the world's cells whose root block holds the box from `lower` (3,) to `upper` (3,).

    The root lies at a multiple of its children's size, so that every block below it is one of the world's.

    Raises
    ------
    InvalidResolution
        The cells are too small for float32 to resolve where the box lies.
    """
    first, last = (np.asarray(end, np.float64) / cell_size for end in (lower, upper))
    farthest = float(np.abs([first, last]).max())
    if not farthest <= MAX_CELL_COORDINATE:
        distance = farthest * cell_size
        raise InvalidResolution(
            f"the model is too far from the origin, {distance:.3g}: float32 tells no cells of {cell_size:g} "
            "apart there; move it to the origin, or mesh it with a cell_size of "
            f"{distance / MAX_CELL_COORDINATE:.3g} at least"
        )
    depth = 1
    while True:
        step = BRANCHING**depth
        base = np.floor(first / step) * step
        if (last <= base + BRANCHING * step).all():
            i, j, k = (int(start) for start in base)
            return Grid(cell_size, (i, j, k), depth)
        depth += 1


def grid_from(lower: FloatArray, upper: FloatArray, cell_size: float) -> Grid:
    """Return a grid that starts at `lower` (3,) itself and holds the box up to `upper` (3,)."""
    longest = float((np.asarray(upper, np.float64) - np.asarray(lower, np.float64)).max())
    depth = 1
    while BRANCHING ** (depth + 1) * cell_size < longest:
        depth += 1
    x, y, z = (float(start) for start in lower)
    return Grid(cell_size, (0, 0, 0), depth, (x, y, z))
