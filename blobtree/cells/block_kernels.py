"""Typed functions on blocks of cells: coordinates, keys, and the search for a block."""

import warp as wp

from blobtree.cells.grid import BRANCHING, BRANCHING_BITS, CHILDREN, KEY_DIGITS
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)


@wp.struct
class LevelBlocks:
    """The arrays of a `sparse_cells.Level` that kernels read."""

    blocks: wp.array(dtype=wp.vec3i)
    keys: wp.array(dtype=wp.int64)
    spans: wp.array(dtype=wp.vec2i)
    tape: Texels


@wp.struct
class ChildGrid:
    """The lattice on which the blocks of one level lie."""

    base: wp.vec3i
    """The root's lowest block of this level, in blocks of this level from `corner`."""
    corner: wp.vec3
    size: wp.float32
    """Side of a block."""
    pad: wp.float32
    """Margin for rounding around a block."""


@wp.struct
class Lattices:
    """Lattices of the models whose blocks lie in one list.

    With several models, the first digits of a block's key are the number of its model.
    """

    grids: wp.array(dtype=ChildGrid)
    """The lattice of each model; empty for a list of one model."""
    shift: wp.int64
    """Bits of a key behind the number of the model."""


@wp.struct
class CellBlocks:
    """The finest blocks with their pruned tapes, their lattice, and the whole tape for all other points."""

    blocks: wp.array(dtype=wp.vec3i)
    keys: wp.array(dtype=wp.int64)
    spans: wp.array(dtype=wp.vec2i)
    tape: Texels
    base: wp.vec3i
    corner: wp.vec3
    cell: wp.float32
    """Side of a cell."""
    whole: Texels
    whole_span: wp.vec2i
    models: Lattices
    """The lattices of the blocks, if they are those of many models."""


@wp.func
def model_of(block: wp.int32, keys: wp.array(dtype=wp.int64), models: Lattices) -> wp.int32:
    """Return the number of the model of a block; 0 in a list of one model."""
    if models.grids.shape[0] == 0:
        return 0
    return int(keys[block] >> models.shift)


@wp.func
def lattice_of(
    block: wp.int32, keys: wp.array(dtype=wp.int64), single: ChildGrid, models: Lattices
) -> ChildGrid:
    """Return the lattice of a block's model; `single` is that of a list of one model."""
    if models.grids.shape[0] == 0:
        return single
    return models.grids[model_of(block, keys, models)]


@wp.func
def child_offset(number: wp.int32) -> wp.vec3i:
    """Return the coordinates in its block of a child, or of a cell, from its number."""
    return wp.vec3i(
        number >> (2 * BRANCHING_BITS), (number >> BRANCHING_BITS) & (BRANCHING - 1), number & (BRANCHING - 1)
    )


@wp.func
def child_number(offset: wp.vec3i) -> wp.int32:
    """Return the number of the child, or of the cell, at these coordinates in its block."""
    return (offset[0] << (2 * BRANCHING_BITS)) + (offset[1] << BRANCHING_BITS) + offset[2]


@wp.func
def child_block(parent: wp.vec3i, number: wp.int32) -> wp.vec3i:
    """Return the coordinates of a block's child, in blocks of the child's level."""
    return parent * BRANCHING + child_offset(number)


@wp.func
def grid_point(index: wp.vec3i, corner: wp.vec3, cell: wp.float32) -> wp.vec3:
    """Return the position of a grid corner, by one formula so that all blocks compute the same point."""
    return corner + wp.vec3(float(index[0]), float(index[1]), float(index[2])) * cell


@wp.func
def block_center(block: wp.vec3i, corner: wp.vec3, size: wp.float32) -> wp.vec3:
    """Return the centre of a block."""
    return corner + wp.vec3(float(block[0]) + 0.5, float(block[1]) + 0.5, float(block[2]) + 0.5) * size


@wp.func
def block_key(block: wp.vec3i) -> wp.int64:
    """Return a block's rank in the order of refinement: its ancestors' child numbers, coarsest first."""
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
    """Return the index of a block in a level, −1 if absent, by bisection of the level's ascending keys."""
    side = 1 << (KEY_DIGITS * BRANCHING_BITS)
    for axis in range(3):
        if block[axis] < 0 or block[axis] >= side:
            return -1
    key = block_key(block)
    low = int(0)
    high = keys.shape[0]
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    if low < keys.shape[0] and keys[low] == key:
        return low
    return -1
