"""Dual surface of the sparse cells: kernels that sample blocks, place a vertex per patch and connect them.

Samples of a block lie at its 5³ cell corners; corners on a face shared by two blocks are computed by both,
from two prunings of one tape, and come out the same.
"""

import warp as wp

from .cells import BRANCHING, BRANCHING_BITS, CHILDREN, find_block
from .evaluate import field_color, field_gradient, field_value
from .kernel_options import KERNEL_OPTIONS
from .kernels import ISO
from .patches import EDGES, FLIPPED
from .project import project_to_surface

wp.set_module_options(KERNEL_OPTIONS)

SIDE = BRANCHING + 1
"""Samples along the side of a block."""

SAMPLES = SIDE**3

_EDGE_FIRST = wp.types.vector(length=12, dtype=wp.int32)(*(a for a, _ in EDGES))
_EDGE_LAST = wp.types.vector(length=12, dtype=wp.int32)(*(b for _, b in EDGES))


_Neighbours = wp.types.vector(length=8, dtype=wp.int32)
_Quad = wp.vec4i


@wp.func
def corner_place(block: wp.vec3i, x: wp.int32, y: wp.int32, z: wp.int32) -> wp.vec3i:
    """Grid coordinates of a block's sample."""
    return wp.vec3i(block[0] * BRANCHING + x, block[1] * BRANCHING + y, block[2] * BRANCHING + z)


@wp.func
def grid_point(place: wp.vec3i, origin: wp.vec3, cell: wp.float32) -> wp.vec3:
    """Position of a grid corner: one formula, so that every block computes the same point."""
    return origin + wp.vec3(float(place[0]), float(place[1]), float(place[2])) * cell


@wp.kernel
def sample_blocks(
    first: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    origin: wp.vec3,
    cell: wp.float32,
    values: wp.array(dtype=wp.float32),
) -> None:
    """Field at the samples of every block."""
    i = first + wp.tid()
    block = i // SAMPLES
    sample = i % SAMPLES
    place = corner_place(blocks[block], sample // (SIDE * SIDE), (sample // SIDE) % SIDE, sample % SIDE)
    values[i] = field_value(grid_point(place, origin, cell), tape, spans[block])


@wp.func
def corner_sample(cell: wp.int32, corner: wp.int32) -> wp.int32:
    """Index among a block's samples of a corner of one of its cells."""
    place = cell_place(cell)
    x = place[0] + (corner & 1)
    y = place[1] + ((corner >> 1) & 1)
    return (x * SIDE + y) * SIDE + place[2] + (corner >> 2)


@wp.kernel
def classify_cells(
    first: wp.int32,
    values: wp.array(dtype=wp.float32),
    codes: wp.array(dtype=wp.uint8),
    quads: wp.array(dtype=wp.int32),
) -> None:
    """The codes of a block's cells, and their number of quads: one per crossed edge at a lowest corner."""
    block = first + wp.tid()
    total = int(0)
    for cell in range(CHILDREN):
        code = int(0)
        for corner in range(8):
            if values[block * SAMPLES + corner_sample(cell, corner)] >= ISO:
                code = code | (1 << corner)
        codes[block * CHILDREN + cell] = wp.uint8(code)
        for axis in range(3):
            if ((code ^ (code >> (1 << axis))) & 1) == 1:
                total += 1
    quads[block] = total


@wp.kernel
def settle_rows(
    first: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    codes: wp.array(dtype=wp.uint8),
    patch_count: wp.array(dtype=wp.int8),
    knotted_face: wp.array(dtype=wp.int8),
    rows: wp.array(dtype=wp.int16),
    vertices: wp.array(dtype=wp.int32),
) -> None:
    """The rows of a block's cells in the tables of `patches`, and how many vertices they make."""
    block = first + wp.tid()
    total = int(0)
    for cell in range(CHILDREN):
        row = int(codes[block * CHILDREN + cell])
        face = int(knotted_face[row])
        if face >= 0:
            other = cell_across(block, cell, face, blocks)
            if int(knotted_face[int(codes[other])]) == (face ^ 1):
                row += FLIPPED
        rows[block * CHILDREN + cell] = wp.int16(row)
        total += int(patch_count[row])
    vertices[block] = total


@wp.func
def cell_place(cell: wp.int32) -> wp.vec3i:
    """Coordinates of a cell in its block."""
    return wp.vec3i(
        cell >> (2 * BRANCHING_BITS), (cell >> BRANCHING_BITS) & (BRANCHING - 1), cell & (BRANCHING - 1)
    )


@wp.func
def cell_number(place: wp.vec3i) -> wp.int32:
    """The cell at these coordinates in a block."""
    return (place[0] << (2 * BRANCHING_BITS)) + (place[1] << BRANCHING_BITS) + place[2]


@wp.func
def cell_across(
    block: wp.int32, cell: wp.int32, face: wp.int32, blocks: wp.array(dtype=wp.vec3i)
) -> wp.int32:
    """Index among all cells of the one behind a crossed face; its block exists, for the surface enters it."""
    axis = face // 2
    place = cell_place(cell)
    place[axis] = place[axis] + 2 * (face % 2) - 1
    if place[axis] >= 0 and place[axis] < BRANCHING:
        return block * CHILDREN + cell_number(place)
    neighbour = blocks[block]
    neighbour[axis] = neighbour[axis] + 2 * (face % 2) - 1
    place[axis] = place[axis] & (BRANCHING - 1)
    return find_block(neighbour, blocks) * CHILDREN + cell_number(place)


@wp.kernel
def place_vertices(
    first: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    origin: wp.vec3,
    cell: wp.float32,
    values: wp.array(dtype=wp.float32),
    rows: wp.array(dtype=wp.int16),
    patch_count: wp.array(dtype=wp.int8),
    patch_of_edge: wp.array(dtype=wp.int8),
    starts: wp.array(dtype=wp.int32),
    first_vertices: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    colors: wp.array(dtype=wp.vec3),
) -> None:
    """A vertex per patch of every cell: the mean of its edge crossings, taken onto the surface."""
    block = first + wp.tid()
    vertex = starts[block]
    for c in range(CHILDREN):
        row = int(rows[block * CHILDREN + c])
        first_vertices[block * CHILDREN + c] = vertex
        for patch in range(int(patch_count[row])):
            start = crossing_mean(block, c, row, patch, blocks, origin, cell, values, patch_of_edge)
            p = project_to_surface(start, 0.5 * cell, tape, spans[block])
            f = field_gradient(p, tape, spans[block])
            color = field_color(p, tape, spans[block])
            positions[vertex] = p
            normals[vertex] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
            colors[vertex] = wp.vec3(color[1], color[2], color[3])
            vertex += 1


@wp.func
def crossing_mean(
    block: wp.int32,
    cell: wp.int32,
    row: wp.int32,
    patch: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    cell_size: wp.float32,
    values: wp.array(dtype=wp.float32),
    patch_of_edge: wp.array(dtype=wp.int8),
) -> wp.vec3:
    """Mean of the points at which the edges of a patch cross the surface."""
    total = wp.vec3(0.0, 0.0, 0.0)
    crossings = float(0.0)
    for edge in range(12):
        if int(patch_of_edge[row * 12 + edge]) == patch:
            a = _EDGE_FIRST[edge]
            b = _EDGE_LAST[edge]
            value_a = values[block * SAMPLES + corner_sample(cell, a)]
            value_b = values[block * SAMPLES + corner_sample(cell, b)]
            share = (ISO - value_a) / (value_b - value_a)
            total += corner_offset(cell, a) * (1.0 - share) + corner_offset(cell, b) * share
            crossings += 1.0
    base = corner_place(blocks[block], 0, 0, 0)
    return grid_point(base, origin, cell_size) + total * (cell_size / crossings)


@wp.func
def corner_offset(cell: wp.int32, corner: wp.int32) -> wp.vec3:
    """A cell's corner in cells from its block's lowest one."""
    place = cell_place(cell)
    return wp.vec3(
        float(place[0] + (corner & 1)), float(place[1] + ((corner >> 1) & 1)), float(place[2] + (corner >> 2))
    )


@wp.kernel
def connect_vertices(
    first: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    rows: wp.array(dtype=wp.int16),
    patch_of_edge: wp.array(dtype=wp.int8),
    starts: wp.array(dtype=wp.int32),
    first_vertices: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """Two triangles around every crossed edge at a cell's lowest corner, counter-clockwise from outside."""
    block = first + wp.tid()
    if starts[block] == starts[block + 1]:
        return
    neighbours = _Neighbours()
    for step in range(8):
        neighbours[step] = find_block(blocks[block] - wp.vec3i(step & 1, (step >> 1) & 1, step >> 2), blocks)
    face = 2 * starts[block]
    for c in range(CHILDREN):
        code = int(rows[block * CHILDREN + c])
        for axis in range(3):
            if ((code ^ (code >> (1 << axis))) & 1) == 1:
                quad = _Quad()
                for k in range(4):
                    quad[k] = vertex_around(c, axis, k, neighbours, rows, patch_of_edge, first_vertices)
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
    patch_of_edge: wp.array(dtype=wp.int8),
    first_vertices: wp.array(dtype=wp.int32),
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
    place = cell_place(cell)
    place[u] = place[u] - du
    place[v] = place[v] - dv
    step = int(0)
    for i in range(3):
        if place[i] < 0:
            place[i] = place[i] + BRANCHING
            step = step | (1 << i)
    other = neighbours[step] * CHILDREN + cell_number(place)
    edge = axis * 4 + edge_rank(axis, du, dv)
    return first_vertices[other] + int(patch_of_edge[int(rows[other]) * 12 + edge])


@wp.func
def edge_rank(axis: wp.int32, du: wp.int32, dv: wp.int32) -> wp.int32:
    """Place among a cell's four edges along `axis` of the one shifted by du, dv along the next two axes."""
    if axis == 1:
        return dv + 2 * du
    return du + 2 * dv
