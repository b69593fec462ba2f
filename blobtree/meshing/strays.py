"""Vertices that Newton's method did not bring to the surface go to a crossing on an edge of their cell.

Where cells are several times as wide as a part, the mean of a patch's crossings may lie where the field is
flat, or so far off that other parts of the tree count than those of its cells. But each crossing lies between
two corners of the cell, so halving finds it for certain.
"""

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.dual import SAMPLES, corner_place, corner_sample
from blobtree.meshing.vertices import (
    EDGE_FIRST,
    EDGE_LAST,
    MOST_PATCHES,
    corner_offset,
    crossing_mean,
    is_stray,
)
from blobtree.sparse.blocks import grid_point
from blobtree.sparse.grid import CHILDREN
from blobtree.tapes.evaluate import field_color, field_gradient, field_value

wp.set_module_options(KERNEL_OPTIONS)

HALVINGS = 30
"""More than float32 can tell apart along an edge."""


@wp.kernel
def mend_vertices(
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
) -> None:
    """Put a vertex that lies off the surface onto the crossing of its patch nearest to their mean."""
    entry = patches[first + wp.tid()]
    patch = entry % MOST_PATCHES
    c = (entry // MOST_PATCHES) % CHILDREN
    slot = entry // (MOST_PATCHES * CHILDREN)
    block = listed[slot]
    span = spans[block]
    vertex = vertex_starts[block] + int(offsets[block * CHILDREN + c]) + patch
    row = int(rows[block * CHILDREN + c])
    lowest = grid_point(corner_place(base + blocks[block], 0, 0, 0), corner, cell)
    mean = crossing_mean(slot, c, row, patch, values, patch_of_edge)
    was = positions[vertex]
    if not is_stray(field_value(was, tape, span), was, lowest + mean * cell, cell):
        return
    nearest = float(wp.inf)
    best = wp.vec3(0.0, 0.0, 0.0)
    for edge in range(12):
        if int(patch_of_edge[row * 12 + edge]) == patch:
            a = EDGE_FIRST[edge]
            inner = corner_offset(c, a)
            outer = corner_offset(c, EDGE_LAST[edge])
            if values[slot * SAMPLES + corner_sample(c, a)] < ISO:
                inner, outer = outer, inner
            for _halving in range(HALVINGS):
                middle = 0.5 * (inner + outer)
                if field_value(lowest + middle * cell, tape, span) >= ISO:
                    inner = middle
                else:
                    outer = middle
            apart = wp.length(inner - mean)
            if apart < nearest:
                nearest = apart
                best = inner
    p = lowest + best * cell
    f = field_gradient(p, tape, span)
    color = field_color(p, tape, span)
    positions[vertex] = p
    normals[vertex] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))
    colors[vertex] = wp.vec3(color[1], color[2], color[3])
