"""Which cells of the decal index a decal's ball touches: shared by building and editing.

All in float64, where the cells of float32 centres and radii are found without rounding that matters.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.field.contact import REACH
from decals.grid.lookup import HALF_RANGE, cell_hash

wp.set_module_options({"enable_backward": False})

SLACK = 1e-5
"""Relative growth of each ball, above the rounding of a float32 distance."""

FINEST = 22
"""Cells are at least the largest coordinate / 2²²: about the spacing of float32 numbers there."""

EXPONENTS = 256
"""Number of cell sizes that there may be: 2^(e − EXPONENT_OF_ONE) for e from 0."""

EXPONENT_OF_ONE = 128

ALONE = -1
"""In place of a parity: each size of decals has its own cells. With one, sizes join in pairs (`joined`)."""

NEIGHBOURHOOD = 125
"""Most cells of a decal: of its own size at most 3 along each axis, of half its size 5."""

LEVEL_SHIFT = 24
EMPTY = -1

HALF_OF_CELLS = wp.constant(wp.float64(HALF_RANGE))
REACH_WITH_SLACK = REACH * (1.0 + SLACK)
GROWTH = wp.constant(wp.float64(REACH_WITH_SLACK))
ZERO = wp.constant(wp.float64(0.0))
ONE = wp.constant(wp.float64(1.0))
HALF = wp.constant(wp.float64(0.5))
TWO = wp.constant(wp.float64(2.0))
LARGEST = wp.constant(wp.float64(2.0**100))


@wp.func
def grown_reach(influence: wp.float32) -> wp.float64:
    """Radius of the ball in which a decal acts, with slack."""
    return wp.min(wp.float64(influence) * GROWTH, LARGEST)


@wp.func
def exponent_above(x: wp.float64) -> wp.int32:
    """Least e with x < 2^e; 0 for 0."""
    e = wp.int32(0)
    if x <= ZERO:
        return e
    power = wp.float64(ONE)
    while power <= x:
        power = power * TWO
        e += 1
    while power * HALF > x:
        power = power * HALF
        e -= 1
    return e


@wp.func
def power_of_two(exponent: wp.int32) -> wp.float64:
    """2^e, without rounding."""
    power = wp.float64(ONE)
    for _up in range(exponent):
        power = power * TWO
    for _down in range(-exponent):
        power = power * HALF
    return power


@wp.func
def widened(v: wp.vec3) -> wp.vec3d:
    """A float32 vector in float64."""
    return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))


@wp.func
def joined(exponent: wp.int32, parity: wp.int32) -> wp.int32:
    """Exponent of the cells that a size has: its own, or the next finer if it is not of the given parity."""
    if parity != ALONE and (exponent & 1) != parity:
        return exponent - 1
    return exponent


@wp.func
def cell_exponent(position: wp.vec3, influence: wp.float32, parity: wp.int32) -> wp.int32:
    """Exponent e of a decal's cell size 2^e in (ρ, 2ρ], of half that where it joins smaller decals.

    It is larger where float32 positions are coarser.
    """
    centre = widened(position)
    reach = grown_reach(influence)
    farthest = wp.max(wp.max(wp.abs(centre[0]), wp.abs(centre[1])), wp.abs(centre[2])) + reach
    return wp.max(joined(exponent_above(reach), parity), exponent_above(wp.min(farthest, LARGEST)) - FINEST)


@wp.func
def cell_at(point: wp.vec3d, width: wp.float64) -> wp.vec3d:
    """Cell of a point, counted from the origin."""
    return wp.vec3d(wp.floor(point[0] / width), wp.floor(point[1] / width), wp.floor(point[2] / width))


@wp.func
def lowest_cell(position: wp.vec3, influence: wp.float32, width: wp.float64) -> wp.vec3d:
    """Lowest of the block of cells that holds a decal's ball, counted from the origin."""
    reach = grown_reach(influence)
    return cell_at(widened(position) - wp.vec3d(reach, reach, reach), width)


@wp.func
def cells_across(position: wp.vec3, influence: wp.float32, width: wp.float64) -> wp.vec3i:
    """Number of cells in that block, along each axis."""
    reach = grown_reach(influence)
    highest = cell_at(widened(position) + wp.vec3d(reach, reach, reach), width)
    apart = highest - lowest_cell(position, influence, width)
    return wp.vec3i(wp.int32(apart[0]) + 1, wp.int32(apart[1]) + 1, wp.int32(apart[2]) + 1)


@wp.func
def beside(x: wp.float64, cell: wp.float64, width: wp.float64) -> wp.float64:
    """How far a coordinate lies outside a cell."""
    return wp.max(wp.max(cell * width - x, x - (cell + ONE) * width), ZERO)


@wp.func
def cells_in(across: wp.vec3i) -> wp.int32:
    """Number of cells of a block."""
    return across[0] * across[1] * across[2]


@wp.func
def neighbour(lowest: wp.vec3d, across: wp.vec3i, number: wp.int32) -> wp.vec3d:
    """One cell of a block."""
    row = number / across[2]
    return lowest + wp.vec3d(
        wp.float64(row / across[1]), wp.float64(row % across[1]), wp.float64(number % across[2])
    )


@wp.func
def touches(position: wp.vec3, influence: wp.float32, cell: wp.vec3d, width: wp.float64) -> wp.bool:
    """Whether a decal's ball touches a cell."""
    centre = widened(position)
    reach = grown_reach(influence)
    x = beside(centre[0], cell[0], width)
    y = beside(centre[1], cell[1], width)
    z = beside(centre[2], cell[2], width)
    return x * x + y * y + z * z <= reach * reach


@wp.func
def cell_key(cell: wp.vec3d, level: wp.int32) -> wp.vec3i:
    """Key of a cell in the table."""
    return wp.vec3i(
        wp.int32(cell[0] + HALF_OF_CELLS) + (level << LEVEL_SHIFT),
        wp.int32(cell[1] + HALF_OF_CELLS),
        wp.int32(cell[2] + HALF_OF_CELLS),
    )


@wp.func
def first_slot(key: wp.vec3i, mask: wp.int32) -> wp.int32:
    """Where the search for a key begins."""
    return wp.int32(cell_hash(key[0], key[1], key[2]) & wp.uint32(mask))
