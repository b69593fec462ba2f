"""Bisection of edges, for the few vertices that Newton's method does not bring to the surface.

Most meshes have no such vertex, so that these kernels are rarely compiled.
"""

import warp as wp

from blobtree.cells.block_kernels import CellBlocks, model_of
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.dual_kernels import SAMPLES, CellPatches, corner_sample
from blobtree.meshing.vertex_kernels import (
    EDGE_FIRST,
    EDGE_LAST,
    Patch,
    VertexArrays,
    block_frame,
    corner_offset,
    crossing_mean,
    is_unconverged,
    patch_of,
    write_vertex,
)
from blobtree.tape.interpreter import field_color, field_gradient, field_value

wp.set_module_options(KERNEL_OPTIONS)

HALVINGS = 30
"""Bisection steps along an edge: more than float32 can resolve."""


@wp.func
def bisect_edge(
    patch: Patch,
    edge: wp.int32,
    corner: wp.vec3,
    cell: wp.float32,
    cells: CellBlocks,
    values: wp.array(dtype=wp.float32),
) -> wp.vec3:
    """Return the inner end of the interval where an edge crosses the surface, in cells from `corner`."""
    a = EDGE_FIRST[edge]
    inner = corner_offset(patch.cell, a)
    outer = corner_offset(patch.cell, EDGE_LAST[edge])
    if values[patch.slot * SAMPLES + corner_sample(patch.cell, a)] < ISO:
        inner, outer = outer, inner
    for _halving in range(HALVINGS):
        middle = 0.5 * (inner + outer)
        if field_value(corner + middle * cell, cells.tape, cells.spans[patch.block]) >= ISO:
            inner = middle
        else:
            outer = middle
    return inner


@wp.kernel
def bisect_unconverged(
    first: wp.int32,
    identifiers: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
    cells: CellBlocks,
    values: wp.array(dtype=wp.float32),
    patches: CellPatches,
    unconverged: wp.array(dtype=wp.int32),
    vertices: VertexArrays,
) -> None:
    """Move each unconverged vertex to the edge crossing of its patch nearest to the mean of these.

    Models without such a vertex stay as they are: another evaluation may judge a vertex otherwise.
    """
    patch = patch_of(identifiers[first + wp.tid()], listed, patches)
    if unconverged[model_of(patch.block, cells.keys, cells.models)] == 0:
        return
    span = cells.spans[patch.block]
    corner, cell = block_frame(patch.block, cells)
    mean = crossing_mean(patch, values, patches)
    position = vertices.positions[patch.vertex]
    value = field_value(position, cells.tape, span)
    if not is_unconverged(value, position, corner + mean * cell, cell):
        return
    nearest = float(wp.inf)
    best = wp.vec3(0.0, 0.0, 0.0)
    for edge in range(12):
        if int(patches.patch_of_edge[patch.row * 12 + edge]) == patch.number:
            crossing = bisect_edge(patch, edge, corner, cell, cells, values)
            distance = wp.length(crossing - mean)
            if distance < nearest:
                nearest = distance
                best = crossing
    p = corner + best * cell
    f = field_gradient(p, cells.tape, span)
    write_vertex(vertices, patch.vertex, p, f, field_color(p, cells.tape, span))
