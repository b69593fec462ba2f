"""Dual surface of sparse cells: kernels that sample blocks, tell their cells apart and connect vertices.

Samples of a block lie at its 5³ cell corners; corners on a face shared by two blocks are computed by both,
from two prunings of one tape, and come out the same.

Every kernel works on the listed blocks alone; what lies in the others is taken over by `reuse`.
"""

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.patches import FLIPPED
from blobtree.sparse.blocks import child_number, child_place, find_block, grid_point
from blobtree.sparse.grid import BRANCHING, CHILDREN
from blobtree.tapes.evaluate import field_value

wp.set_module_options(KERNEL_OPTIONS)

SIDE = BRANCHING + 1
"""Samples along the side of a block."""

SAMPLES = SIDE**3

_Neighbours = wp.types.vector(length=8, dtype=wp.int32)
_Quad = wp.vec4i


@wp.func
def corner_place(block: wp.vec3i, x: wp.int32, y: wp.int32, z: wp.int32) -> wp.vec3i:
    """Grid coordinates of a block's sample, blocks being counted like cells from the grid's corner."""
    return block * BRANCHING + wp.vec3i(x, y, z)


@wp.func
def corner_sample(cell: wp.int32, corner: wp.int32) -> wp.int32:
    """Index among a block's samples of a corner of one of its cells."""
    place = child_place(cell)
    x = place[0] + (corner & 1)
    y = place[1] + ((corner >> 1) & 1)
    return (x * SIDE + y) * SIDE + place[2] + (corner >> 2)


@wp.kernel
def sample_blocks(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    base: wp.vec3i,
    corner: wp.vec3,
    cell: wp.float32,
    values: wp.array(dtype=wp.float32),
) -> None:
    """Field at the samples of every listed block."""
    i = first + wp.tid()
    block = listed[i // SAMPLES]
    sample = i % SAMPLES
    x = sample // (SIDE * SIDE)
    y = (sample // SIDE) % SIDE
    place = corner_place(base + blocks[block], x, y, sample % SIDE)
    values[i] = field_value(grid_point(place, corner, cell), tape, spans[block])


@wp.kernel
def classify_cells(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.float32),
    codes: wp.array(dtype=wp.uint8),
    quads: wp.array(dtype=wp.int32),
) -> None:
    """The codes of a block's cells, and their number of quads: one per crossed edge at a lowest corner."""
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
    """Which of four samples of one height are inside, the lowest being `first`: bits as in a cell's code."""
    bits = int(0)
    if values[first] >= ISO:
        bits = 1
    if values[first + SIDE * SIDE] >= ISO:
        bits += 2
    if values[first + SIDE] >= ISO:
        bits += 4
    if values[first + SIDE * SIDE + SIDE] >= ISO:
        bits += 8
    return bits


@wp.kernel
def settle_rows(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    codes: wp.array(dtype=wp.uint8),
    patch_count: wp.array(dtype=wp.int8),
    knotted_face: wp.array(dtype=wp.int8),
    rows: wp.array(dtype=wp.int16),
    offsets: wp.array(dtype=wp.uint8),
    vertices: wp.array(dtype=wp.int32),
) -> None:
    """The rows of a block's cells in the tables of `patches`, their first vertices and the block's number."""
    block = listed[first + wp.tid()]
    total = int(0)
    for cell in range(CHILDREN):
        row = int(codes[block * CHILDREN + cell])
        face = int(knotted_face[row])
        if face >= 0:
            other = cell_across(block, cell, face, blocks, keys)
            if int(knotted_face[int(codes[other])]) == (face ^ 1):
                row += FLIPPED
        rows[block * CHILDREN + cell] = wp.int16(row)
        offsets[block * CHILDREN + cell] = wp.uint8(total)
        total += int(patch_count[row])
    vertices[block] = total


@wp.func
def cell_across(
    block: wp.int32,
    cell: wp.int32,
    face: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
) -> wp.int32:
    """Index among all cells of the one behind a crossed face; its block exists, for the surface enters it."""
    axis = face // 2
    place = child_place(cell)
    place[axis] = place[axis] + 2 * (face % 2) - 1
    if place[axis] >= 0 and place[axis] < BRANCHING:
        return block * CHILDREN + child_number(place)
    neighbour = blocks[block]
    neighbour[axis] = neighbour[axis] + 2 * (face % 2) - 1
    place[axis] = place[axis] & (BRANCHING - 1)
    return find_block(neighbour, keys) * CHILDREN + child_number(place)


@wp.kernel
def connect_vertices(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    rows: wp.array(dtype=wp.int16),
    offsets: wp.array(dtype=wp.uint8),
    patch_of_edge: wp.array(dtype=wp.int8),
    quad_starts: wp.array(dtype=wp.int32),
    vertex_starts: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """Two triangles around every crossed edge at a cell's lowest corner, counter-clockwise from outside."""
    block = listed[first + wp.tid()]
    if quad_starts[block] == quad_starts[block + 1]:
        return
    neighbours = _Neighbours()
    for step in range(8):
        neighbours[step] = find_block(blocks[block] - wp.vec3i(step & 1, (step >> 1) & 1, step >> 2), keys)
    face = 2 * quad_starts[block]
    for c in range(CHILDREN):
        code = int(rows[block * CHILDREN + c])
        for axis in range(3):
            if ((code ^ (code >> (1 << axis))) & 1) == 1:
                quad = _Quad()
                for k in range(4):
                    quad[k] = vertex_around(
                        c, axis, k, neighbours, rows, offsets, patch_of_edge, vertex_starts
                    )
                if (code & 1) == 0:
                    quad = _Quad(quad[3], quad[2], quad[1], quad[0])
                ac = wp.length_sq(positions[quad[0]] - positions[quad[2]])
                bd = wp.length_sq(positions[quad[1]] - positions[quad[3]])
                if ac <= bd:
                    faces[face] = wp.vec3i(quad[0], quad[1], quad[2])
                    faces[face + 1] = wp.vec3i(quad[0], quad[2], quad[3])
                else:
                    faces[face] = wp.vec3i(quad[1], quad[2], quad[3])
                    faces[face + 1] = wp.vec3i(quad[1], quad[3], quad[0])
                face += 2


@wp.func
def vertex_around(
    cell: wp.int32,
    axis: wp.int32,
    k: wp.int32,
    neighbours: _Neighbours,
    rows: wp.array(dtype=wp.int16),
    offsets: wp.array(dtype=wp.uint8),
    patch_of_edge: wp.array(dtype=wp.int8),
    vertex_starts: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Vertex of the k-th of the four cells around a cell's lowest edge along `axis`, in order about it."""
    u = (axis + 1) % 3
    v = (axis + 2) % 3
    du = int(0)
    dv = int(0)
    if k == 0 or k == 3:
        du = 1
    if k < 2:
        dv = 1
    place = child_place(cell)
    place[u] = place[u] - du
    place[v] = place[v] - dv
    step = int(0)
    for i in range(3):
        if place[i] < 0:
            place[i] = place[i] + BRANCHING
            step = step | (1 << i)
    block = neighbours[step]
    other = block * CHILDREN + child_number(place)
    edge = axis * 4 + edge_rank(axis, du, dv)
    return vertex_starts[block] + int(offsets[other]) + int(patch_of_edge[int(rows[other]) * 12 + edge])


@wp.func
def edge_rank(axis: wp.int32, du: wp.int32, dv: wp.int32) -> wp.int32:
    """Place among a cell's four edges along `axis` of the one shifted by du, dv along the next two axes."""
    if axis == 1:
        return dv + 2 * du
    return du + 2 * dv
