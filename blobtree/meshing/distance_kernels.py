"""The field at any point of a model, by the pruned tape of its block, and distances to the surface."""

from typing import Any

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, find_block
from blobtree.cells.grid import BRANCHING
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.interpreter import field_gradient, field_value

wp.set_module_options(KERNEL_OPTIONS)

UNDEFINED_DISTANCE = 1e9
"""Distance to the surface from a point at which the field is flat."""

NEWTON_STEPS = 30
"""Most steps to the surface; beside a kink, steps alternate between its sides."""

CONVERGED = wp.constant(1e-5)
"""Field error, in units of ISO, at which a sample is on the surface."""

SAMPLE_WEIGHTS = (
    (1 / 3, 1 / 3, 1 / 3),
    *((1 / 2, 1 / 2, 0.0), (0.0, 1 / 2, 1 / 2), (1 / 2, 0.0, 1 / 2)),
    *((2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6), (1 / 6, 1 / 6, 2 / 3)),
)
"""Barycentric coordinates: the centroid, the midpoints of edges, and points between centroid and corners."""

_Weights: Any = wp.types.matrix(shape=(len(SAMPLE_WEIGHTS), 3), dtype=wp.float32)
_WEIGHTS = _Weights(*(number for sample in SAMPLE_WEIGHTS for number in sample))


@wp.func
def block_at(p: wp.vec3, cells: CellBlocks) -> wp.int32:
    """Return the block of p, −1 outside all blocks."""
    index = (p - cells.corner) / (cells.cell * float(BRANCHING))
    block = wp.vec3i(int(wp.floor(index[0])), int(wp.floor(index[1])), int(wp.floor(index[2])))
    return find_block(block - cells.base, cells.keys)


@wp.func
def value_at(p: wp.vec3, cells: CellBlocks) -> wp.float32:
    """Return the field at p, by the whole tape if p is in no block."""
    block = block_at(p, cells)
    if block < 0:
        return field_value(p, cells.whole, cells.whole_span)
    return field_value(p, cells.tape, cells.spans[block])


@wp.func
def gradient_at(p: wp.vec3, cells: CellBlocks) -> wp.vec4:
    """Return (value, ∂x, ∂y, ∂z) at p, by the whole tape if p is in no block."""
    block = block_at(p, cells)
    if block < 0:
        return field_gradient(p, cells.whole, cells.whole_span)
    return field_gradient(p, cells.tape, cells.spans[block])


@wp.func
def distance_at(p: wp.vec3, cells: CellBlocks) -> wp.float32:
    """Return the distance of p to the surface in cells, to first order; huge where the field is flat."""
    f = gradient_at(p, cells)
    steepness = wp.length(wp.vec3(f[1], f[2], f[3]))
    if steepness == 0.0:
        return UNDEFINED_DISTANCE / cells.cell
    return wp.abs(f[0] - ISO) / steepness / cells.cell


@wp.func
def distance_by_projection(start: wp.vec3, cells: CellBlocks) -> wp.float32:
    """Return the distance from `start` to its projection onto the surface, or a cell's side if that fails."""
    p = start
    for _step in range(NEWTON_STEPS):
        f = gradient_at(p, cells)
        gap = ISO - f[0]
        g = wp.vec3(f[1], f[2], f[3])
        steepness = wp.length(g)
        if steepness == 0.0:
            return cells.cell
        if wp.abs(gap) <= CONVERGED * ISO:
            return wp.length(p - start) + wp.abs(gap) / steepness
        p += g * (wp.clamp(gap / steepness, -0.5 * cells.cell, 0.5 * cells.cell) / steepness)
    return cells.cell


@wp.kernel
def measure_triangles(
    first: wp.int32,
    cells: CellBlocks,
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    errors: wp.array(dtype=wp.float32),
) -> None:
    """Write the largest distance of each triangle's samples to the surface."""
    i = first + wp.tid()
    a = vertices[faces[i][0]]
    b = vertices[faces[i][1]]
    c = vertices[faces[i][2]]
    largest = float(0.0)
    for k in range(wp.static(len(SAMPLE_WEIGHTS))):
        sample = a * _WEIGHTS[k, 0] + b * _WEIGHTS[k, 1] + c * _WEIGHTS[k, 2]
        largest = wp.max(largest, distance_by_projection(sample, cells))
    errors[i] = largest
