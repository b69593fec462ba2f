"""Blocks on the device: where they lie, in which order they come, how one is found."""

import warp as wp

from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.sparse.grid import BRANCHING, BRANCHING_BITS, CHILDREN, KEY_DIGITS

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def child_place(number: wp.int32) -> wp.vec3i:
    """Coordinates in its block of a child, or of a cell, given its number."""
    return wp.vec3i(
        number >> (2 * BRANCHING_BITS), (number >> BRANCHING_BITS) & (BRANCHING - 1), number & (BRANCHING - 1)
    )


@wp.func
def child_number(place: wp.vec3i) -> wp.int32:
    """Number of the child, or of the cell, at these coordinates in its block."""
    return (place[0] << (2 * BRANCHING_BITS)) + (place[1] << BRANCHING_BITS) + place[2]


@wp.func
def child_block(parent: wp.vec3i, number: wp.int32) -> wp.vec3i:
    """Coordinates of a block's child, in blocks of the child's level."""
    return parent * BRANCHING + child_place(number)


@wp.func
def grid_point(place: wp.vec3i, corner: wp.vec3, cell: wp.float32) -> wp.vec3:
    """Position of a grid corner: one formula, so that every block computes the same point."""
    return corner + wp.vec3(float(place[0]), float(place[1]), float(place[2])) * cell


@wp.func
def block_center(block: wp.vec3i, corner: wp.vec3, size: wp.float32) -> wp.vec3:
    """Middle of a block."""
    return corner + wp.vec3(float(block[0]) + 0.5, float(block[1]) + 0.5, float(block[2]) + 0.5) * size


@wp.func
def block_key(block: wp.vec3i) -> wp.int64:
    """A block's place in the order in which levels are refined: its children's numbers, coarsest first."""
    key = wp.int64(0)
    for digit in range(KEY_DIGITS):
        shift = (KEY_DIGITS - 1 - digit) * BRANCHING_BITS
        x = (block[0] >> shift) & (BRANCHING - 1)
        y = (block[1] >> shift) & (BRANCHING - 1)
        z = (block[2] >> shift) & (BRANCHING - 1)
        key = key * wp.int64(CHILDREN) + wp.int64(child_number(wp.vec3i(x, y, z)))
    return key


@wp.func
def find_block(block: wp.vec3i, keys: wp.array(dtype=wp.int64)) -> wp.int32:
    """Index of a block in a level, −1 where it is not there: bisection of the level's keys, which rise."""
    side = 1 << (KEY_DIGITS * BRANCHING_BITS)
    for axis in range(3):
        if block[axis] < 0 or block[axis] >= side:
            return -1
    wanted = block_key(block)
    low = int(0)
    high = keys.shape[0]
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    if low < keys.shape[0] and keys[low] == wanted:
        return low
    return -1
