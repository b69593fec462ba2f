"""Taking over what an edit did not touch: kernels that mark its neighbourhood and copy the rest."""

import warp as wp

from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.sparse.blocks import find_block

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def mark_beside(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """The listed blocks and those behind their faces: which row a cell takes depends on a cell across."""
    block = listed[first + wp.tid()]
    flags[block] = 1
    for face in range(6):
        place = blocks[block]
        place[face // 2] = place[face // 2] + 2 * (face % 2) - 1
        other = find_block(place, keys)
        if other >= 0:
            flags[other] = 1


@wp.kernel
def mark_above(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    keys: wp.array(dtype=wp.int64),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """The blocks whose triangles use vertices of the listed ones."""
    block = listed[first + wp.tid()]
    for step in range(8):
        other = find_block(blocks[block] + wp.vec3i(step & 1, (step >> 1) & 1, step >> 2), keys)
        if other >= 0:
            flags[other] = 1


@wp.kernel
def invert(first: wp.int32, flags: wp.array(dtype=wp.int32), out: wp.array(dtype=wp.int32)) -> None:
    """1 for 0, and 0 for 1."""
    i = first + wp.tid()
    out[i] = 1 - flags[i]


@wp.kernel
def copy_words(
    first: wp.int32,
    words: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    before: wp.array(dtype=wp.vec4i),
    after: wp.array(dtype=wp.vec4i),
) -> None:
    """What the listed blocks' cells hold, `words` of 16 bytes a block."""
    i = first + wp.tid()
    block = listed[i // words]
    after[block * words + i % words] = before[sources[block] * words + i % words]


@wp.kernel
def copy_counts(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_starts: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
) -> None:
    """How much the listed blocks hold."""
    block = listed[first + wp.tid()]
    counts[block] = old_starts[sources[block] + 1] - old_starts[sources[block]]


@wp.kernel
def count_listed(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
) -> None:
    """How much the listed blocks hold, in the order of the list."""
    slot = first + wp.tid()
    counts[slot] = starts[listed[slot] + 1] - starts[listed[slot]]


@wp.kernel
def copy_vertices(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_starts: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    old_positions: wp.array(dtype=wp.vec3),
    old_normals: wp.array(dtype=wp.vec3),
    old_colors: wp.array(dtype=wp.vec3),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    colors: wp.array(dtype=wp.vec3),
    moved: wp.array(dtype=wp.int32),
) -> None:
    """The listed blocks' vertices; `moved` says which number each old one has now."""
    block = listed[first + wp.tid()]
    start = old_starts[sources[block]]
    shift = starts[block] - start
    for vertex in range(start, old_starts[sources[block] + 1]):
        positions[vertex + shift] = old_positions[vertex]
        normals[vertex + shift] = old_normals[vertex]
        colors[vertex + shift] = old_colors[vertex]
        moved[vertex] = vertex + shift


@wp.kernel
def copy_faces(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    sources: wp.array(dtype=wp.int32),
    old_starts: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.int32),
    old_faces: wp.array(dtype=wp.vec3i),
    moved: wp.array(dtype=wp.int32),
    faces: wp.array(dtype=wp.vec3i),
) -> None:
    """The listed blocks' triangles, their vertices renumbered."""
    block = listed[first + wp.tid()]
    start = 2 * old_starts[sources[block]]
    shift = 2 * starts[block] - start
    for face in range(start, 2 * old_starts[sources[block] + 1]):
        f = old_faces[face]
        faces[face + shift] = wp.vec3i(moved[f[0]], moved[f[1]], moved[f[2]])
