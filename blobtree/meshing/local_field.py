"""Typed functions: the field at a point of the model, by the pruned tape of the point's block."""

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, find_block
from blobtree.cells.grid import BRANCHING
from blobtree.device import KERNEL_OPTIONS
from blobtree.formulas.falloff import ISO
from blobtree.tape.interpreter import field_gradient, field_value

wp.set_module_options(KERNEL_OPTIONS)

UNDEFINED_DISTANCE = 1e9
"""Distance to the surface from a point at which the field is flat."""


@wp.func
def block_at(p: wp.vec3, cells: CellBlocks) -> wp.int32:
    """Return the block of p, −1 if there is none."""
    index = (p - cells.corner) / (cells.cell * float(BRANCHING))
    block = wp.vec3i(int(wp.floor(index[0])), int(wp.floor(index[1])), int(wp.floor(index[2])))
    return find_block(block - cells.base, cells.keys)


@wp.func
def value_at(p: wp.vec3, cells: CellBlocks) -> wp.float32:
    """Return the field at p, by the whole tape if p is in no block."""
    block = block_at(p, cells)
    if block < 0:
        return field_value(p, cells.whole, wp.vec2i(0, cells.whole.shape[0]))
    return field_value(p, cells.tape, cells.spans[block])


@wp.func
def gradient_at(p: wp.vec3, cells: CellBlocks) -> wp.vec4:
    """Return (value, ∂x, ∂y, ∂z) at p, by the whole tape if p is in no block."""
    block = block_at(p, cells)
    if block < 0:
        return field_gradient(p, cells.whole, wp.vec2i(0, cells.whole.shape[0]))
    return field_gradient(p, cells.tape, cells.spans[block])


@wp.func
def distance_at(p: wp.vec3, cells: CellBlocks) -> wp.float32:
    """Return the distance of p to the surface in cells, to first order; huge where the field is flat."""
    f = gradient_at(p, cells)
    steepness = wp.length(wp.vec3(f[1], f[2], f[3]))
    if steepness == 0.0:
        return UNDEFINED_DISTANCE / cells.cell
    return wp.abs(f[0] - ISO) / steepness / cells.cell
