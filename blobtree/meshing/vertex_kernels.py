"""Kernels of the dual surface's vertices: one per patch of every cell, projected onto the surface.

A patch is identified by (index of its block in the list · CHILDREN + cell) · MAX_PATCHES + patch.
"""

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, child_offset, grid_point, model_of
from blobtree.cells.grid import CHILDREN
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.dual_kernels import CELLS, SAMPLES, CellPatches, corner_sample, sample_index
from blobtree.meshing.patches import EDGES, MAX_PATCHES
from blobtree.tape.evaluate_kernels import STALLED, project_to_surface
from blobtree.tape.interpreter import field_color

wp.set_module_options(KERNEL_OPTIONS)

EDGE_FIRST = wp.types.vector(length=12, dtype=wp.int32)(*(a for a, _ in EDGES))
EDGE_LAST = wp.types.vector(length=12, dtype=wp.int32)(*(b for _, b in EDGES))


@wp.struct
class VertexArrays:
    """The vertices of a mesh."""

    positions: wp.array(dtype=wp.vec3)
    normals: wp.array(dtype=wp.vec3)
    colors: wp.array(dtype=wp.vec3)


@wp.struct
class Patch:
    """A patch of a cell of a listed block."""

    number: wp.int32
    """In its cell."""
    cell: wp.int32
    """In its block."""
    slot: wp.int32
    """Index of its block in the list."""
    block: wp.int32
    row: wp.int32
    vertex: wp.int32


@wp.kernel
def count_listed(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
) -> None:
    """Write the number of items of each listed block, in the order of the list."""
    slot = first + wp.tid()
    counts[slot] = starts[listed[slot] + 1] - starts[listed[slot]]


@wp.kernel
def list_patches(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    rows: wp.array(dtype=wp.int16),
    patch_count: wp.array(dtype=wp.int8),
    starts: wp.array(dtype=wp.int32),
    patches: wp.array(dtype=wp.int32),
) -> None:
    """Write the identifier of every patch of the listed blocks."""
    slot = first + wp.tid()
    block = listed[slot]
    at = starts[slot]
    for c in range(CHILDREN):
        for patch in range(int(patch_count[int(rows[block * CHILDREN + c])])):
            patches[at] = (slot * CHILDREN + c) * MAX_PATCHES + patch
            at += 1


@wp.func
def patch_of(identifier: wp.int32, listed: wp.array(dtype=wp.int32), patches: CellPatches) -> Patch:
    """Return the patch of an identifier."""
    patch = Patch()
    patch.number = identifier % MAX_PATCHES
    patch.cell = (identifier // MAX_PATCHES) % CHILDREN
    patch.slot = identifier // (MAX_PATCHES * CHILDREN)
    patch.block = listed[patch.slot]
    cell = patch.block * CHILDREN + patch.cell
    patch.row = int(patches.rows[cell])
    patch.vertex = patches.vertex_starts[patch.block] + int(patches.offsets[cell]) + patch.number
    return patch


@wp.func
def block_frame(block: wp.int32, cells: CellBlocks) -> tuple[wp.vec3, wp.float32]:
    """Return the lowest corner of a block, and the side of its cells."""
    base = cells.base
    corner = cells.corner
    cell = cells.cell
    if cells.models.grids.shape[0] > 0:
        model = model_of(block, cells.keys, cells.models)
        base = cells.models.grids[model].base
        corner = cells.models.grids[model].corner
        cell = cells.models.grids[model].size / CELLS
    return grid_point(sample_index(base + cells.blocks[block], 0, 0, 0), corner, cell), cell


@wp.func
def write_vertex(vertices: VertexArrays, vertex: wp.int32, p: wp.vec3, f: wp.vec4, color: wp.vec4) -> None:
    """Write a vertex at p, where the field and its gradient are `f`, and the colour is color[1:]."""
    vertices.positions[vertex] = p
    vertices.normals[vertex] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
    vertices.colors[vertex] = wp.vec3(color[1], color[2], color[3])


@wp.kernel
def place_vertices(
    first: wp.int32,
    identifiers: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
    cells: CellBlocks,
    values: wp.array(dtype=wp.float32),
    patches: CellPatches,
    vertices: VertexArrays,
    unconverged: wp.array(dtype=wp.int32),
) -> None:
    """Project the mean of each patch's edge crossings onto the surface; count the unconverged by model."""
    patch = patch_of(identifiers[first + wp.tid()], listed, patches)
    span = cells.spans[patch.block]
    corner, cell = block_frame(patch.block, cells)
    start = corner + crossing_mean(patch, values, patches) * cell
    p, f = project_to_surface(start, 0.5 * cell, cells.tape, span)
    if is_unconverged(f[0], p, start, cell):
        wp.atomic_add(unconverged, model_of(patch.block, cells.keys, cells.models), 1)
    write_vertex(vertices, patch.vertex, p, f, field_color(p, cells.tape, span))


@wp.func
def is_unconverged(value: wp.float32, p: wp.vec3, start: wp.vec3, cell: wp.float32) -> wp.bool:
    """Return True if Newton's method missed the surface, or left the cells in which the tape is valid."""
    return wp.abs(value - ISO) > STALLED * ISO or wp.length(p - start) > cell


@wp.func
def crossing_mean(patch: Patch, values: wp.array(dtype=wp.float32), patches: CellPatches) -> wp.vec3:
    """Return the mean of a patch's edge crossings, in cells from the block's corner.

    The field is taken to be linear along the edges.
    """
    total = wp.vec3(0.0, 0.0, 0.0)
    crossings = float(0.0)
    for edge in range(12):
        if int(patches.patch_of_edge[patch.row * 12 + edge]) == patch.number:
            a = EDGE_FIRST[edge]
            b = EDGE_LAST[edge]
            value_a = values[patch.slot * SAMPLES + corner_sample(patch.cell, a)]
            value_b = values[patch.slot * SAMPLES + corner_sample(patch.cell, b)]
            t = (ISO - value_a) / (value_b - value_a)
            total += corner_offset(patch.cell, a) * (1.0 - t) + corner_offset(patch.cell, b) * t
            crossings += 1.0
    return total / crossings


@wp.func
def corner_offset(cell: wp.int32, corner: wp.int32) -> wp.vec3:
    """Return a cell's corner, in cells from its block's lowest one."""
    offset = child_offset(cell)
    x = float(offset[0] + (corner & 1))
    y = float(offset[1] + ((corner >> 1) & 1))
    return wp.vec3(x, y, float(offset[2] + (corner >> 2)))
