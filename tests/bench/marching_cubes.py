"""Marching cubes on sparse cells: the reference for the cost of the dual polygonizer.

Cells, samples and corner tests are those of the dual polygonizer. Each crossed edge gets one vertex by linear
interpolation, shared by the cells around it, and each cell up to five triangles from a table (Lorensen &
Cline 1987). There are no Newton steps, normals or colours.
"""

# mypy: disable-error-code="arg-type, index, no-any-return, operator, valid-type, var-annotated"

from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree import ISO
from blobtree.cells.block_kernels import Lattices, child_number, child_offset, find_block, grid_point
from blobtree.cells.grid import BRANCHING, CHILDREN
from blobtree.cells.scan import arange, exclusive_scan
from blobtree.cells.sparse_cells import SparseCells, child_grid
from blobtree.device import launch
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.dual_kernels import (
    SAMPLES,
    classify_cells,
    corner_sample,
    sample_blocks,
    sample_index,
)
from blobtree.meshing.patches import EDGES, FACES

wp.set_module_options(KERNEL_OPTIONS)

MAX_TRIANGLES = 5
_Neighbours = wp.types.vector(length=8, dtype=wp.int32)


def _crossed(code: int, face: tuple[int, ...]) -> list[int]:
    """Return the edges of a face whose ends differ."""
    return [
        edge
        for edge, (a, b) in enumerate(EDGES)
        if {a, b} <= set(face) and (code >> a & 1) != (code >> b & 1)
    ]


def _links(code: int) -> list[tuple[int, int]]:
    """Return pairs of edges that the surface joins across a face; it separates alternating inside corners."""
    links = []
    for face in FACES:
        crossed = _crossed(code, face)
        if len(crossed) == 2:
            links.append((crossed[0], crossed[1]))
        elif len(crossed) == 4:
            for corner in (c for c in face if code >> c & 1):
                first, second = (edge for edge in crossed if corner in EDGES[edge])
                links.append((first, second))
    return links


def _loops(code: int) -> list[list[int]]:
    """Return the crossed edges of a cell, in order around each sheet of surface."""
    links, loops = _links(code), []
    while links:
        loop = list(links.pop())
        while True:
            link = next((pair for pair in links if loop[-1] in pair), None)
            if link is None:
                break
            links.remove(link)
            loop.append(link[0] if link[1] == loop[-1] else link[1])
        loops.append(loop[:-1])
    return loops


def _faces_outward(code: int, loop: list[int]) -> bool:
    """Return True if a loop runs counter-clockwise seen from outside."""
    corner = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)], float)
    points = np.array([corner[list(EDGES[edge])].mean(axis=0) for edge in loop])
    normal = np.sum(np.cross(points, np.roll(points, -1, axis=0)), axis=0)
    outward = sum(
        (corner[b] - corner[a]) * (1.0 if code >> a & 1 else -1.0) for a, b in (EDGES[edge] for edge in loop)
    )
    return float(normal @ outward) > 0.0


def _table() -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """Return for each code the edges of the triangles (256, 15) and their number (256)."""
    edges, counts = np.full((256, 3 * MAX_TRIANGLES), -1, np.int8), np.zeros(256, np.int8)
    for code in range(256):
        corners: list[int] = []
        for loop in _loops(code):
            ordered = loop if _faces_outward(code, loop) else loop[::-1]
            for second, third in pairwise(ordered[1:]):
                corners += [ordered[0], second, third]
        edges[code, : len(corners)] = corners
        counts[code] = len(corners) // 3
    return edges, counts


TRIANGLE_EDGES, TRIANGLE_COUNT = _table()


@wp.kernel
def _count(
    first: wp.int32,
    codes: wp.array(dtype=wp.uint8),
    triangle_count: wp.array(dtype=wp.int8),
    offsets: wp.array(dtype=wp.uint8),
    triangles: wp.array(dtype=wp.int32),
) -> None:
    """Count the triangles of a block, and the vertices before each of its cells."""
    block = first + wp.tid()
    vertices = int(0)
    total = int(0)
    for c in range(CHILDREN):
        code = int(codes[block * CHILDREN + c])
        offsets[block * CHILDREN + c] = wp.uint8(vertices)
        vertices += ((code ^ (code >> 1)) & 1) + ((code ^ (code >> 2)) & 1) + ((code ^ (code >> 4)) & 1)
        total += int(triangle_count[code])
    triangles[block] = total


@wp.kernel
def _interpolate(
    first: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    base: wp.vec3i,
    corner: wp.vec3,
    cell: wp.float32,
    values: wp.array(dtype=wp.float32),
    codes: wp.array(dtype=wp.uint8),
    starts: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
) -> None:
    """Interpolate the vertices on the crossed edges at the lowest corners of a block's cells."""
    block = first + wp.tid()
    vertex = starts[block]
    for c in range(CHILDREN):
        code = int(codes[block * CHILDREN + c])
        if code > 0 and code < 255:
            place = child_offset(c)
            lowest = sample_index(base + blocks[block], place[0], place[1], place[2])
            for axis in range(3):
                if ((code ^ (code >> (1 << axis))) & 1) == 1:
                    a = values[block * SAMPLES + corner_sample(c, 0)]
                    b = values[block * SAMPLES + corner_sample(c, 1 << axis)]
                    p = grid_point(lowest, corner, cell)
                    p[axis] = p[axis] + cell * (ISO - a) / (b - a)
                    positions[vertex] = p
                    vertex += 1


@wp.kernel
def _triangulate(
    first: wp.int32,
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    codes: wp.array(dtype=wp.uint8),
    offsets: wp.array(dtype=wp.uint8),
    triangle_count: wp.array(dtype=wp.int8),
    triangle_edges: wp.array(dtype=wp.int8),
    vertex_starts: wp.array(dtype=wp.int32),
    triangle_starts: wp.array(dtype=wp.int32),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    block = first + wp.tid()
    face = triangle_starts[block]
    if triangle_starts[block + 1] == face:
        return
    neighbours = _Neighbours()
    for step in range(8):
        neighbours[step] = find_block(blocks[block] + wp.vec3i(step & 1, (step >> 1) & 1, step >> 2), keys)
    for c in range(CHILDREN):
        code = int(codes[block * CHILDREN + c])
        for t in range(int(triangle_count[code])):
            triangle = wp.vec3i()
            for k in range(3):
                edge = int(triangle_edges[code * 15 + 3 * t + k])
                triangle[k] = _edge_vertex(c, edge, neighbours, codes, offsets, vertex_starts)
            faces[face] = triangle
            face += 1


@wp.func
def _edge_vertex(
    c: wp.int32,
    edge: wp.int32,
    neighbours: _Neighbours,
    codes: wp.array(dtype=wp.uint8),
    offsets: wp.array(dtype=wp.uint8),
    vertex_starts: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Return the vertex on an edge; it belongs to the cell whose lowest corner begins the edge."""
    axis = edge // 4
    low = edge % 4
    corner = int(0)
    if axis == 0:
        corner = low << 1
    elif axis == 1:
        corner = (low & 1) | ((low >> 1) << 2)
    else:
        corner = low
    place = child_offset(c) + wp.vec3i(corner & 1, (corner >> 1) & 1, corner >> 2)
    step = int(0)
    for i in range(3):
        if place[i] == BRANCHING:
            place[i] = 0
            step = step | (1 << i)
    block = neighbours[step]
    cell = block * CHILDREN + child_number(place)
    code = int(codes[cell])
    rank = int(0)
    for before in range(axis):
        rank += (code ^ (code >> (1 << before))) & 1
    return vertex_starts[block] + int(offsets[cell]) + rank


def marching_cubes(cells: SparseCells) -> tuple[Any, Any]:
    """Vertices and triangles of the surface in `cells`, in the device's memory."""
    leaves, device, grid = cells.leaves, cells.device, cells.grid
    count = len(leaves)
    listed = arange(count, device)
    frame: list[Any] = [wp.vec3i(*grid.base_of(grid.depth)), wp.vec3(*grid.corner), grid.cell_size]
    values: Any = wp.empty(count * SAMPLES, dtype=wp.float32, device=device)
    kernel = cells.tape.instruction_set.kernel_for(sample_blocks)
    inputs = [listed, leaves.blocks, leaves.keys, leaves.spans, leaves.tape]
    inputs += [child_grid(grid, grid.depth), Lattices()]
    launch(kernel, count * SAMPLES, inputs, [values], device)
    codes, offsets = (wp.empty(count * CHILDREN, dtype=wp.uint8, device=device) for _ in range(2))
    vertex_counts, triangle_counts = (wp.zeros(count + 1, dtype=wp.int32, device=device) for _ in range(2))
    launch(classify_cells, count, [listed, values], [codes, vertex_counts], device)
    numbers = wp.array(TRIANGLE_COUNT, dtype=wp.int8, device=device)
    edges = wp.array(TRIANGLE_EDGES.ravel(), dtype=wp.int8, device=device)
    launch(_count, count, [codes, numbers], [offsets, triangle_counts], device)
    vertex_starts, vertices = exclusive_scan(vertex_counts, "vertices")
    triangle_starts, triangles = exclusive_scan(triangle_counts, "triangles")
    positions: Any = wp.empty(vertices, dtype=wp.vec3, device=device)
    launch(_interpolate, count, [leaves.blocks, *frame, values, codes, vertex_starts], [positions], device)
    faces: Any = wp.empty(triangles, dtype=wp.vec3i, device=device)
    inputs = [leaves.blocks, leaves.keys, codes, offsets, numbers, edges, vertex_starts, triangle_starts]
    launch(_triangulate, count, inputs, [faces], device)
    return positions, faces
