"""Kernels that reuse a mesh after an edit: they mark the blocks near a change, and copy the others."""

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, find_block
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.vertex_kernels import VertexArrays

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def mark_face_neighbors(
    first: wp.int32, listed: wp.array(dtype=wp.int32), cells: CellBlocks, flags: wp.array(dtype=wp.int32)
) -> None:
    """Flag the listed blocks and those behind their faces, on which the rows of their cells depend."""
    block = listed[first + wp.tid()]
    flags[block] = 1
    for face in range(6):
        neighbour = cells.blocks[block]
        neighbour[face // 2] = neighbour[face // 2] + 2 * (face % 2) - 1
        other = find_block(neighbour, cells.keys)
        if other >= 0:
            flags[other] = 1


@wp.kernel
def mark_vertex_users(
    first: wp.int32, listed: wp.array(dtype=wp.int32), cells: CellBlocks, flags: wp.array(dtype=wp.int32)
) -> None:
    """Flag the blocks whose triangles use vertices of the listed ones."""
    block = listed[first + wp.tid()]
    for step in range(8):
        offset = wp.vec3i(step & 1, (step >> 1) & 1, step >> 2)
        other = find_block(cells.blocks[block] + offset, cells.keys)
        if other >= 0:
            flags[other] = 1


@wp.kernel
def invert_flags(first: wp.int32, flags: wp.array(dtype=wp.int32), out: wp.array(dtype=wp.int32)) -> None:
    """Write 1 for 0, and 0 for 1."""
    i = first + wp.tid()
    out[i] = 1 - flags[i]


@wp.kernel
def copy_words(
    first: wp.int32,
    words: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    source: wp.array(dtype=wp.vec4i),
    target: wp.array(dtype=wp.vec4i),
) -> None:
    """Copy an array of the listed blocks' cells, `words` of 16 bytes per block."""
    i = first + wp.tid()
    block = listed[i // words]
    target[block * words + i % words] = source[sources[block] * words + i % words]


@wp.kernel
def copy_counts(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_starts: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
) -> None:
    """Write the number of items of each listed block."""
    block = listed[first + wp.tid()]
    counts[block] = old_starts[sources[block] + 1] - old_starts[sources[block]]


@wp.kernel
def copy_vertices(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_starts: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    source: VertexArrays,
    target: VertexArrays,
    new_index: wp.array(dtype=wp.int32),
) -> None:
    """Copy the vertices of the listed blocks, and write the new index of each old one."""
    block = listed[first + wp.tid()]
    start = old_starts[sources[block]]
    shift = starts[block] - start
    for vertex in range(start, old_starts[sources[block] + 1]):
        target.positions[vertex + shift] = source.positions[vertex]
        target.normals[vertex + shift] = source.normals[vertex]
        target.colors[vertex + shift] = source.colors[vertex]
        new_index[vertex] = vertex + shift


@wp.kernel
def copy_faces(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_starts: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    old_faces: wp.array(dtype=wp.vec3i),
    new_index: wp.array(dtype=wp.int32),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """Copy the triangles of the listed blocks with the new indices of their vertices."""
    block = listed[first + wp.tid()]
    start = 2 * old_starts[sources[block]]
    shift = 2 * starts[block] - start
    for face in range(start, 2 * old_starts[sources[block] + 1]):
        f = old_faces[face]
        faces[face + shift] = wp.vec3i(new_index[f[0]], new_index[f[1]], new_index[f[2]])
