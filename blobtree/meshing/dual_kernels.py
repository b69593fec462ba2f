"""Kernels of the dual surface: field samples of blocks, codes and rows of their cells, and triangles.

The samples of a block lie at its 5³ cell corners. Two blocks that share a face both compute the samples on
it, from two prunings of one tape, with the same result. Each kernel works on the `listed` blocks alone;
`reuse_kernels` copies the others.
"""

import warp as wp

from blobtree.cells.block_kernels import (
    CellBlocks,
    ChildGrid,
    Lattices,
    child_number,
    child_offset,
    find_block,
    grid_point,
    lattice_of,
)
from blobtree.cells.grid import BRANCHING, CHILDREN
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.patches import FLIPPED
from blobtree.tape.interpreter import field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

SAMPLES_PER_SIDE = BRANCHING + 1

CELLS = wp.constant(float(BRANCHING))
"""Cells along a block."""

SAMPLES = SAMPLES_PER_SIDE**3
"""Samples of a block."""

FACING = wp.constant(0.5)
"""Cosine between the normals at the ends of an edge, below which the edge may bridge a gap."""

_Neighbours = wp.types.vector(length=8, dtype=wp.int32)
_Quad = wp.vec4i


@wp.struct
class PatchTables:
    """The tables of `patches`."""

    patch_count: wp.array(dtype=wp.int8)
    patch_of_edge: wp.array(dtype=wp.int8)
    knotted_face: wp.array(dtype=wp.int8)


@wp.struct
class CellPatches:
    """The patches of all cells, and the vertices of these."""

    rows: wp.array(dtype=wp.int16)
    """By cell, its row in the tables of `patches`."""
    offsets: wp.array(dtype=wp.uint8)
    """By cell, its first vertex counted from its block's."""
    vertex_starts: wp.array(dtype=wp.int32)
    """By block, its first vertex."""
    patch_of_edge: wp.array(dtype=wp.int8)


@wp.func
def sample_index(block: wp.vec3i, x: wp.int32, y: wp.int32, z: wp.int32) -> wp.vec3i:
    """Return the grid coordinates of the sample (x, y, z) of a block."""
    return block * BRANCHING + wp.vec3i(x, y, z)


@wp.func
def corner_sample(cell: wp.int32, corner: wp.int32) -> wp.int32:
    """Return the number, among a block's samples, of a corner of one of its cells."""
    offset = child_offset(cell)
    x = offset[0] + (corner & 1)
    y = offset[1] + ((corner >> 1) & 1)
    return (x * SAMPLES_PER_SIDE + y) * SAMPLES_PER_SIDE + offset[2] + (corner >> 2)


@wp.kernel
def sample_blocks(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    spans: wp.array(dtype=wp.vec2i),
    tape: Texels,
    single: ChildGrid,
    models: Lattices,
    values: wp.array(dtype=wp.float32),
) -> None:
    """Evaluate the field at the samples of every listed block.

    A struct of the blocks would be copied for every sample, which costs a tenth of the kernel.
    """
    i = first + wp.tid()
    block = listed[i // SAMPLES]
    sample = i % SAMPLES
    x = sample // (SAMPLES_PER_SIDE * SAMPLES_PER_SIDE)
    y = (sample // SAMPLES_PER_SIDE) % SAMPLES_PER_SIDE
    grid = lattice_of(block, keys, single, models)
    index = sample_index(grid.base + blocks[block], x, y, sample % SAMPLES_PER_SIDE)
    values[i] = field_value(grid_point(index, grid.corner, grid.size / CELLS), tape, spans[block])


@wp.kernel
def classify_cells(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float32),
    codes: wp.array(dtype=wp.uint8),
    quads: wp.array(dtype=wp.int32),
) -> None:
    """Write the codes of a block's cells, and count its quads: one per crossed edge at a lowest corner."""
    slot = first + wp.tid()
    block = listed[slot]
    total = int(0)
    for column in range(BRANCHING * BRANCHING):
        cell = column * BRANCHING
        lower = inside_corners(values, slot * SAMPLES + corner_sample(cell, 0))
        for z in range(BRANCHING):
            upper = inside_corners(values, slot * SAMPLES + corner_sample(cell + z, 4))
            code = lower | (upper << 4)
            codes[block * CHILDREN + cell + z] = wp.uint8(code)
            total += ((code ^ (code >> 1)) & 1) + ((code ^ (code >> 2)) & 1) + ((code ^ (code >> 4)) & 1)
            lower = upper
    quads[block] = total


@wp.func
def inside_corners(values: wp.array(dtype=wp.float32), first: wp.int32) -> wp.int32:
    """Return which of a cell's four samples of one height are inside, as bits; `first` is the lowest one."""
    bits = int(0)
    if values[first] >= ISO:
        bits = 1
    if values[first + SAMPLES_PER_SIDE * SAMPLES_PER_SIDE] >= ISO:
        bits += 2
    if values[first + SAMPLES_PER_SIDE] >= ISO:
        bits += 4
    if values[first + SAMPLES_PER_SIDE * SAMPLES_PER_SIDE + SAMPLES_PER_SIDE] >= ISO:
        bits += 8
    return bits


@wp.kernel
def choose_rows(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    cells: CellBlocks,
    codes: wp.array(dtype=wp.uint8),
    tables: PatchTables,
    rows: wp.array(dtype=wp.int16),
    offsets: wp.array(dtype=wp.uint8),
    vertices: wp.array(dtype=wp.int32),
) -> None:
    """Write the rows and vertex offsets of a block's cells, and the block's number of vertices."""
    block = listed[first + wp.tid()]
    total = int(0)
    for cell in range(CHILDREN):
        row = int(codes[block * CHILDREN + cell])
        face = int(tables.knotted_face[row])
        if face >= 0:
            other = cell_across(block, cell, face, cells)
            if int(tables.knotted_face[int(codes[other])]) == (face ^ 1):
                row += FLIPPED
        rows[block * CHILDREN + cell] = wp.int16(row)
        offsets[block * CHILDREN + cell] = wp.uint8(total)
        total += int(tables.patch_count[row])
    vertices[block] = total


@wp.func
def cell_across(block: wp.int32, cell: wp.int32, face: wp.int32, cells: CellBlocks) -> wp.int32:
    """Return the index among all cells of the one behind a crossed face.

    Its block exists, because the surface enters it.
    """
    axis = face // 2
    offset = child_offset(cell)
    offset[axis] = offset[axis] + 2 * (face % 2) - 1
    if offset[axis] >= 0 and offset[axis] < BRANCHING:
        return block * CHILDREN + child_number(offset)
    neighbour = cells.blocks[block]
    neighbour[axis] = neighbour[axis] + 2 * (face % 2) - 1
    offset[axis] = offset[axis] & (BRANCHING - 1)
    return find_block(neighbour, cells.keys) * CHILDREN + child_number(offset)


@wp.kernel
def connect_vertices(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    cells: CellBlocks,
    patches: CellPatches,
    quad_starts: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """Write two triangles, counter-clockwise from outside, around each crossed edge at a lowest corner."""
    block = listed[first + wp.tid()]
    if quad_starts[block] == quad_starts[block + 1]:
        return
    neighbours = _Neighbours()
    for step in range(8):
        offset = wp.vec3i(step & 1, (step >> 1) & 1, step >> 2)
        neighbours[step] = find_block(cells.blocks[block] - offset, cells.keys)
    face = 2 * quad_starts[block]
    for c in range(CHILDREN):
        code = int(patches.rows[block * CHILDREN + c])
        for axis in range(3):
            if ((code ^ (code >> (1 << axis))) & 1) == 1:
                quad = _Quad()
                for k in range(4):
                    quad[k] = vertex_around(c, axis, k, neighbours, patches)
                if (code & 1) == 0:
                    quad = _Quad(quad[3], quad[2], quad[1], quad[0])
                write_quad(quad, positions, face, faces)
                face += 2


@wp.func
def write_quad(
    quad: wp.vec4i, positions: wp.array(dtype=wp.vec3), face: wp.int32, faces: wp.array(dtype=wp.vec3i)
) -> None:
    """Write a quad as two triangles, split along its shorter diagonal."""
    ac = wp.length_sq(positions[quad[0]] - positions[quad[2]])
    bd = wp.length_sq(positions[quad[1]] - positions[quad[3]])
    if ac <= bd:
        faces[face] = wp.vec3i(quad[0], quad[1], quad[2])
        faces[face + 1] = wp.vec3i(quad[0], quad[2], quad[3])
    else:
        faces[face] = wp.vec3i(quad[1], quad[2], quad[3])
        faces[face + 1] = wp.vec3i(quad[1], quad[3], quad[0])


@wp.func
def vertex_around(
    cell: wp.int32, axis: wp.int32, k: wp.int32, neighbours: _Neighbours, patches: CellPatches
) -> wp.int32:
    """Return the vertex of the k-th of the four cells around a cell's lowest edge along `axis`, in order."""
    u = (axis + 1) % 3
    v = (axis + 2) % 3
    du = int(0)
    dv = int(0)
    if k == 0 or k == 3:
        du = 1
    if k < 2:
        dv = 1
    offset = child_offset(cell)
    offset[u] = offset[u] - du
    offset[v] = offset[v] - dv
    step = int(0)
    for i in range(3):
        if offset[i] < 0:
            offset[i] = offset[i] + BRANCHING
            step = step | (1 << i)
    block = neighbours[step]
    other = block * CHILDREN + child_number(offset)
    edge = axis * 4 + edge_rank(axis, du, dv)
    patch = int(patches.patch_of_edge[int(patches.rows[other]) * 12 + edge])
    return patches.vertex_starts[block] + int(patches.offsets[other]) + patch


@wp.func
def edge_rank(axis: wp.int32, du: wp.int32, dv: wp.int32) -> wp.int32:
    """Return the rank, among a cell's four edges along `axis`, of the one shifted by du, dv across it."""
    if axis == 1:
        return dv + 2 * du
    return du + 2 * dv


@wp.func
def may_bridge(
    a: wp.int32, b: wp.int32, positions: wp.array(dtype=wp.vec3), normals: wp.array(dtype=wp.vec3)
) -> wp.bool:
    """Return True if an edge leaves the surface at both ends, where the normals differ much."""
    if wp.dot(normals[a], normals[b]) >= FACING:
        return False
    step = positions[b] - positions[a]
    return wp.dot(normals[a], step) > 0.0 and wp.dot(normals[b], step) < 0.0


@wp.kernel
def mark_bridging(
    first: wp.int32,
    faces: wp.array(dtype=wp.vec3i),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    bridging: wp.array(dtype=wp.bool),
) -> None:
    """Mark triangles with an edge that may bridge a gap."""
    i = first + wp.tid()
    face = faces[i]
    for side in range(3):
        if may_bridge(face[side], face[(side + 1) % 3], positions, normals):
            bridging[i] = True
