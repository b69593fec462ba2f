"""The box around a surface that is much smaller than the box of its field.

A field ends far from its surface where a primitive is much wider than its radius, or where one operand cuts
most of another away. Cells in the box of the field would be too large for the surface then.
"""

from operator import attrgetter
from typing import TypeAlias

import numpy as np

from blobtree._typing import Float32Array
from blobtree.cells.grid import BRANCHING, RELATIVE_PAD, grid_from
from blobtree.cells.sparse_cells import build_cells
from blobtree.sized_cache import kept_with
from blobtree.tape.model import ImplicitModel
from blobtree.tape.tape import Tape

MAX_SHARE = 0.25
"""Largest box of a surface over that of its field, by their longest sides; a larger one is not searched."""

MAX_STEP_SHARE = 0.6
"""The same for a box over the one before; the search ends at a box that is larger."""

DEPTH, LONG_DEPTH = 2, 1
"""Levels of blocks of each step for a short and a long tape, four blocks
each along the longest side. Bounds of some fields are loose in large blocks."""

LONG_TAPE = 1000
"""Texels of a long tape, for which the search must not take longer than a tenth of the mesh."""

MIN_SIDE, MAX_SIDE = 1e-15, 1e15
"""Sides between which squared distances, in cells too, neither vanish nor overflow in float32."""

Corners: TypeAlias = tuple[Float32Array, Float32Array]
"""Lower and upper corner (3,) of a box."""


@kept_with(attrgetter("tape"))
def surface_box(tree: ImplicitModel, device: str | None = None) -> Corners:
    """Return the lower and upper corner (3,) of a box that holds the surface of a tree.

    It is the support, unless the surface takes less than a quarter of the support's longest side, or an
    eighth where bounds of the field are loose. `device` is the Warp device of the first search, by default
    the current one; later calls return the same box.
    """
    box = whole = tree.support
    texels = len(tree.tape.data) - tree.tape.start
    depth = LONG_DEPTH if texels > LONG_TAPE else DEPTH
    before = np.inf
    while longest_side(box) <= MAX_STEP_SHARE * before and _is_divisible(box, depth):
        before = longest_side(box)
        crossed = _crossed(tree.tape, box, depth, device)
        if crossed is None:
            return whole
        box = crossed
    return box if longest_side(box) <= MAX_SHARE * longest_side(whole) else whole


def longest_side(box: Corners) -> float:
    """Return the longest side of a box."""
    lower, upper = (corner.astype(np.float64) for corner in box)
    return float((upper - lower).max())


def _is_divisible(box: Corners, depth: int) -> bool:
    """Return True if float32 can tell the blocks of a box apart."""
    side, farthest = longest_side(box), float(np.abs(box).max())
    return MIN_SIDE < side < MAX_SIDE and side > BRANCHING ** (depth + 1) * RELATIVE_PAD * farthest


def _crossed(tape: Tape, box: Corners, depth: int, device: str | None) -> Corners | None:
    """Return the box around the blocks in a box that the surface may cross; None if there are none."""
    lower, upper = (corner.astype(np.float64) for corner in box)
    grid = grid_from(lower, upper, longest_side(box) / BRANCHING ** (depth + 1) * (1.0 + 1e-6))
    blocks = build_cells(tape, grid, device=device).leaves.blocks.numpy()
    if not len(blocks):
        return None
    side = BRANCHING * grid.cell_size
    low = np.maximum(grid.origin + side * blocks.min(axis=0), lower).astype(np.float32)
    high = np.minimum(grid.origin + side * (blocks.max(axis=0) + 1), upper).astype(np.float32)
    return np.nextafter(low, np.float32(-np.inf)), np.nextafter(high, np.float32(np.inf))
