"""Kernels of adaptive cells that evaluate the field: vertices, and the distances of triangles to the surface.

A point is evaluated by the tape of the finest block that holds it.
"""

import warp as wp

from blobtree.cells.grid import CHILDREN
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.adaptive_cell_kernels import base_block, cell_in_block
from blobtree.meshing.bisection_kernels import HALVINGS
from blobtree.meshing.distance_kernels import CONVERGED, NEWTON_STEPS
from blobtree.meshing.vertex_kernels import VertexArrays, is_unconverged, write_vertex
from blobtree.tape.evaluate_kernels import project_to_surface
from blobtree.tape.interpreter import field_color, field_gradient, field_value

wp.set_module_options(KERNEL_OPTIONS)

SAMPLE_STEPS = 5
"""Steps along the edges of the lattice of samples in a triangle, whose corners are left out."""


@wp.struct
class BlockTreeArrays:
    """The arrays of a `block_tree.BlockTree` that kernels read."""

    keys: wp.array(dtype=wp.int64)
    """Of the blocks of the base, which come first."""
    spans: wp.array(dtype=wp.vec2i)
    tape: wp.array(dtype=wp.vec4)
    children: wp.array(dtype=wp.int32)
    """By cell, the block that refines it; negative if none does."""
    base: wp.vec3i
    """The root's lowest cell of the finest level."""
    corner: wp.vec3
    cell: wp.float32
    """Side of a cell of the finest level."""
    depth: wp.int32
    """The finest level, the base being 0."""
    whole: wp.array(dtype=wp.vec4)
    whole_span: wp.vec2i


@wp.func
def deepest_block(p: wp.vec3, tree: BlockTreeArrays) -> wp.int32:
    """Return the finest block of a point, −1 outside all blocks."""
    q = (p - tree.corner) / tree.cell
    index = wp.vec3i(int(wp.floor(q[0])), int(wp.floor(q[1])), int(wp.floor(q[2]))) - tree.base
    block = base_block(index, tree.depth, tree.keys)
    child = int(block)
    shift = 2 * tree.depth
    while child >= 0:
        block = child
        child = tree.children[block * CHILDREN + cell_in_block(index, shift)]
        shift -= 2
    return block


@wp.func
def gradient_in_tree(p: wp.vec3, tree: BlockTreeArrays) -> wp.vec4:
    """Return (value, ∂x, ∂y, ∂z) at p, by the whole tape if p is in no block."""
    block = deepest_block(p, tree)
    if block < 0:
        return field_gradient(p, tree.whole, tree.whole_span)
    return field_gradient(p, tree.tape, tree.spans[block])


@wp.kernel
def place_on_surface(
    first: wp.int32,
    starts: wp.array(dtype=wp.vec3),
    inner: wp.array(dtype=wp.vec3),
    outer: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    blocks: wp.array(dtype=wp.int32),
    tree: BlockTreeArrays,
    vertices: VertexArrays,
) -> None:
    """Project each start onto the surface; if that fails, bisect from an inner point to an outer one.

    `sizes` are the sides of the cells, and `blocks` the blocks that hold them.
    """
    i = first + wp.tid()
    span = tree.spans[blocks[i]]
    start = starts[i]
    p, f = project_to_surface(start, 0.5 * sizes[i], tree.tape, span)
    if deepest_block(p, tree) != deepest_block(start, tree):
        f = gradient_in_tree(p, tree)
    if is_unconverged(f[0], p, start, sizes[i]):
        low = inner[i]
        high = outer[i]
        for _halving in range(HALVINGS):
            middle = 0.5 * (low + high)
            if field_value(middle, tree.tape, span) >= ISO:
                low = middle
            else:
                high = middle
        p = low
        f = field_gradient(p, tree.tape, span)
    color = field_color(p, tree.tape, span)
    write_vertex(vertices, i, p, f, color)


@wp.func
def distance_in_tree(start: wp.vec3, size: wp.float32, tree: BlockTreeArrays) -> wp.float32:
    """Return the distance from `start` to its projection onto the surface, or `size` if that fails.

    Steps are no longer than half of `size`, the side of a cell.
    """
    p = start
    for _step in range(NEWTON_STEPS):
        f = gradient_in_tree(p, tree)
        gap = ISO - f[0]
        g = wp.vec3(f[1], f[2], f[3])
        steepness = wp.length(g)
        if steepness == 0.0:
            return size
        if wp.abs(gap) <= CONVERGED * ISO:
            return wp.length(p - start) + wp.abs(gap) / steepness
        p += g * (wp.clamp(gap / steepness, -0.5 * size, 0.5 * size) / steepness)
    return size


@wp.kernel
def measure_distances(
    first: wp.int32,
    tree: BlockTreeArrays,
    positions: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    sizes: wp.array(dtype=wp.float32),
    errors: wp.array(dtype=wp.float32),
) -> None:
    """Write each triangle's largest distance to the surface at samples; `sizes` are the sides of cells."""
    i = first + wp.tid()
    a = positions[faces[i][0]]
    b = positions[faces[i][1]]
    c = positions[faces[i][2]]
    largest = float(0.0)
    for k in range((SAMPLE_STEPS + 1) * (SAMPLE_STEPS + 1)):
        j = k // (SAMPLE_STEPS + 1)
        m = k % (SAMPLE_STEPS + 1)
        if j + m <= SAMPLE_STEPS and j < SAMPLE_STEPS and m < SAMPLE_STEPS and j + m > 0:
            sample = a + ((b - a) * float(j) + (c - a) * float(m)) / float(SAMPLE_STEPS)
            largest = wp.max(largest, distance_in_tree(sample, sizes[i], tree))
    errors[i] = largest
