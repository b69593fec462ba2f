"""Cells of the index that the ball of a decal touches, for building and editing.

The functions compute in float64, so that rounding cannot miss a cell of float32 centres and radii.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.index.lookup import HALF_RANGE, cell_hash
from decals.record import NEIGHBOR_REACH

wp.set_module_options({"enable_backward": False})

SLACK = 1e-5
"""Relative enlargement of each ball, larger than the rounding of a float32 distance."""

FINEST = 22
"""Exponent of the finest cells: the largest coordinate / 2²², about the spacing of float32 there."""

EXPONENTS = 256
"""Number of possible cell sizes: 2^(e − EXPONENT_OF_ONE) for e from 0."""

EXPONENT_OF_ONE = 128

NO_PARITY = -1
"""Parity value for which each size of decals has its own level; see `shared_exponent`."""

NO_FLOOR = -EXPONENT_OF_ONE
"""Exponent of the smallest cells where each size of decals may have cells of its own."""

MAX_CELLS_OF_DECAL = 125
"""Largest number of cells of a decal: 3 along each axis in its own size, 5 in half its size."""

LEVEL_SHIFT = 24
EMPTY = -1

HALF_OF_CELLS = wp.constant(wp.float64(HALF_RANGE))
REACH_WITH_SLACK = NEIGHBOR_REACH * (1.0 + SLACK)
GROWTH = wp.constant(wp.float64(REACH_WITH_SLACK))
ZERO = wp.constant(wp.float64(0.0))
ONE = wp.constant(wp.float64(1.0))
HALF = wp.constant(wp.float64(0.5))
TWO = wp.constant(wp.float64(2.0))
MAX_LENGTH = wp.constant(wp.float64(2.0**100))


@wp.func
def grown_reach(influence: wp.float32) -> wp.float64:
    """Return the neighbour reach of a decal, with slack."""
    return wp.min(wp.float64(influence) * GROWTH, MAX_LENGTH)


@wp.func
def exponent_above(x: wp.float64) -> wp.int32:
    """Return the smallest e with x < 2^e; 0 for x = 0."""
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
    """Return 2^e, exactly."""
    power = wp.float64(ONE)
    for _up in range(exponent):
        power = power * TWO
    for _down in range(-exponent):
        power = power * HALF
    return power


@wp.func
def to_float64(v: wp.vec3) -> wp.vec3d:
    """Return a vector in float64."""
    return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))


@wp.func
def shared_exponent(exponent: wp.int32, parity: wp.int32) -> wp.int32:
    """Return the exponent of the cells of a size: its own, or the next smaller if the parity differs."""
    if parity != NO_PARITY and (exponent & 1) != parity:
        return exponent - 1
    return exponent


@wp.func
def cell_exponent(position: wp.vec3, influence: wp.float32, parity: wp.int32, floor: wp.int32) -> wp.int32:
    """Return the exponent e of the cell size 2^e of a decal, at least the floor.

    The size lies in (ρ, 2ρ], or is half of that if the decal shares the level of smaller ones. It is larger
    where the spacing of float32 positions is larger.
    """
    centre = to_float64(position)
    reach = grown_reach(influence)
    farthest = wp.max(wp.max(wp.abs(centre[0]), wp.abs(centre[1])), wp.abs(centre[2])) + reach
    finest = wp.max(floor, exponent_above(wp.min(farthest, MAX_LENGTH)) - FINEST)
    return wp.max(shared_exponent(exponent_above(reach), parity), finest)


@wp.func
def cell_at(point: wp.vec3d, width: wp.float64) -> wp.vec3d:
    """Return the cell of a point, counted from the origin."""
    return wp.vec3d(wp.floor(point[0] / width), wp.floor(point[1] / width), wp.floor(point[2] / width))


@wp.func
def lowest_cell(position: wp.vec3, influence: wp.float32, width: wp.float64) -> wp.vec3d:
    """Return the lowest cell of the block around the ball of a decal, counted from the origin."""
    reach = grown_reach(influence)
    return cell_at(to_float64(position) - wp.vec3d(reach, reach, reach), width)


@wp.func
def cells_across(position: wp.vec3, influence: wp.float32, width: wp.float64) -> wp.vec3i:
    """Return the number of cells of that block along each axis."""
    reach = grown_reach(influence)
    highest = cell_at(to_float64(position) + wp.vec3d(reach, reach, reach), width)
    apart = highest - lowest_cell(position, influence, width)
    return wp.vec3i(wp.int32(apart[0]) + 1, wp.int32(apart[1]) + 1, wp.int32(apart[2]) + 1)


@wp.func
def distance_outside(x: wp.float64, cell: wp.float64, width: wp.float64) -> wp.float64:
    """Return the distance of a coordinate from a cell, 0 inside."""
    return wp.max(wp.max(cell * width - x, x - (cell + ONE) * width), ZERO)


@wp.func
def cells_in(across: wp.vec3i) -> wp.int32:
    """Return the number of cells of a block."""
    return across[0] * across[1] * across[2]


@wp.func
def cell_of_block(lowest: wp.vec3d, across: wp.vec3i, number: wp.int32) -> wp.vec3d:
    """Return one cell of a block, by its number."""
    row = number / across[2]
    return lowest + wp.vec3d(
        wp.float64(row / across[1]), wp.float64(row % across[1]), wp.float64(number % across[2])
    )


@wp.func
def touches(position: wp.vec3, influence: wp.float32, cell: wp.vec3d, width: wp.float64) -> wp.bool:
    """Return True if the ball of a decal touches a cell."""
    centre = to_float64(position)
    reach = grown_reach(influence)
    x = distance_outside(centre[0], cell[0], width)
    y = distance_outside(centre[1], cell[1], width)
    z = distance_outside(centre[2], cell[2], width)
    return x * x + y * y + z * z <= reach * reach


@wp.func
def cell_key(cell: wp.vec3d, level: wp.int32) -> wp.vec3i:
    """Return the key of a cell in the hash table."""
    return wp.vec3i(
        wp.int32(cell[0] + HALF_OF_CELLS) + (level << LEVEL_SHIFT),
        wp.int32(cell[1] + HALF_OF_CELLS),
        wp.int32(cell[2] + HALF_OF_CELLS),
    )


@wp.func
def first_slot(key: wp.vec3i, mask: wp.int32) -> wp.int32:
    """Return the slot at which the search for a key begins."""
    return wp.int32(cell_hash(key[0], key[1], key[2]) & wp.uint32(mask))
