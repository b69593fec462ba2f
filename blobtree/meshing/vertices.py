"""Vertices of the dual surface: one per patch of every cell, taken onto the surface."""

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.dual import SAMPLES, corner_place, corner_sample
from blobtree.meshing.patches import EDGES
from blobtree.sparse.blocks import child_place, grid_point
from blobtree.sparse.grid import CHILDREN
from blobtree.tapes.evaluate import field_color
from blobtree.tapes.project import STALLED, project_to_surface

wp.set_module_options(KERNEL_OPTIONS)

MOST_PATCHES = 4
"""Patches in one cell."""

EDGE_FIRST = wp.types.vector(length=12, dtype=wp.int32)(*(a for a, _ in EDGES))
EDGE_LAST = wp.types.vector(length=12, dtype=wp.int32)(*(b for _, b in EDGES))


@wp.kernel
def list_patches(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    rows: wp.array(dtype=wp.int16),
    patch_count: wp.array(dtype=wp.int8),
    starts: wp.array(dtype=wp.int32),
    patches: wp.array(dtype=wp.int32),
) -> None:
    """Every patch of the listed blocks as (place in the list · CHILDREN + cell) · MOST_PATCHES + patch."""
    slot = first + wp.tid()
    block = listed[slot]
    at = starts[slot]
    for c in range(CHILDREN):
        for patch in range(int(patch_count[int(rows[block * CHILDREN + c])])):
            patches[at] = (slot * CHILDREN + c) * MOST_PATCHES + patch
            at += 1


@wp.kernel
def place_vertices(
    first: wp.int32,
    patches: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec3i),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    base: wp.vec3i,
    corner: wp.vec3,
    cell: wp.float32,
    values: wp.array(dtype=wp.float32),
    rows: wp.array(dtype=wp.int16),
    offsets: wp.array(dtype=wp.uint8),
    patch_of_edge: wp.array(dtype=wp.int8),
    vertex_starts: wp.array(dtype=wp.int32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    colors: wp.array(dtype=wp.vec3),
    strays: wp.array(dtype=wp.int32),
) -> None:
    """The vertex of a patch: the mean of its edge crossings, taken onto the surface; strays are counted."""
    entry = patches[first + wp.tid()]
    patch = entry % MOST_PATCHES
    c = (entry // MOST_PATCHES) % CHILDREN
    slot = entry // (MOST_PATCHES * CHILDREN)
    block = listed[slot]
    row = int(rows[block * CHILDREN + c])
    lowest = grid_point(corner_place(base + blocks[block], 0, 0, 0), corner, cell)
    start = lowest + crossing_mean(slot, c, row, patch, values, patch_of_edge) * cell
    p, f = project_to_surface(start, 0.5 * cell, tape, spans[block])
    if is_stray(f[0], p, start, cell):
        wp.atomic_add(strays, 0, 1)
    color = field_color(p, tape, spans[block])
    vertex = vertex_starts[block] + int(offsets[block * CHILDREN + c]) + patch
    positions[vertex] = p
    normals[vertex] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
    colors[vertex] = wp.vec3(color[1], color[2], color[3])


@wp.func
def is_stray(value: wp.float32, p: wp.vec3, start: wp.vec3, cell: wp.float32) -> wp.bool:
    """Whether Newton's method missed the surface, or left the cells whose part of the tape it knows."""
    return wp.abs(value - ISO) > STALLED * ISO or wp.length(p - start) > cell


@wp.func
def crossing_mean(
    slot: wp.int32,
    cell: wp.int32,
    row: wp.int32,
    patch: wp.int32,
    values: wp.array(dtype=wp.float32),
    patch_of_edge: wp.array(dtype=wp.int8),
) -> wp.vec3:
    """Mean of the points where the edges of a patch cross the surface, in cells from the block's corner."""
    total = wp.vec3(0.0, 0.0, 0.0)
    crossings = float(0.0)
    for edge in range(12):
        if int(patch_of_edge[row * 12 + edge]) == patch:
            a = EDGE_FIRST[edge]
            b = EDGE_LAST[edge]
            value_a = values[slot * SAMPLES + corner_sample(cell, a)]
            value_b = values[slot * SAMPLES + corner_sample(cell, b)]
            share = (ISO - value_a) / (value_b - value_a)
            total += corner_offset(cell, a) * (1.0 - share) + corner_offset(cell, b) * share
            crossings += 1.0
    return total / crossings


@wp.func
def corner_offset(cell: wp.int32, corner: wp.int32) -> wp.vec3:
    """A cell's corner in cells from its block's lowest one."""
    place = child_place(cell)
    return wp.vec3(
        float(place[0] + (corner & 1)), float(place[1] + ((corner >> 1) & 1)), float(place[2] + (corner >> 2))
    )
