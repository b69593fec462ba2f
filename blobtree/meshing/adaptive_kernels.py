"""Kernels of adaptive cells that evaluate the field: vertices, and the distances of triangles to the surface.

A point is evaluated by the tape of the finest block that holds it.
"""

import warp as wp

from blobtree.cells.grid import CHILDREN
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.adaptive_cell_kernels import base_block, base_block_beside, cell_in_block
from blobtree.meshing.bisection_kernels import HALVINGS
from blobtree.meshing.distance_kernels import CONVERGED, NEWTON_STEPS
from blobtree.meshing.vertex_kernels import EDGE_FIRST, EDGE_LAST, VertexArrays, is_unconverged, write_vertex
from blobtree.tape.evaluate_kernels import project_to_surface
from blobtree.tape.interpreter import field_color, field_gradient, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

SAMPLE_STEPS = 5
"""Steps along the edges of the lattice of samples in a triangle, whose corners are left out."""


@wp.struct
class BlockTreeArrays:
    """The arrays of a `block_tree.BlockTree` that kernels read."""

    keys: wp.array(dtype=wp.int64)
    """Of the blocks of the base, which come first."""
    spans: wp.array(dtype=wp.vec2i)
    tape: Texels
    children: wp.array(dtype=wp.int32)
    """By cell, the block that refines it; negative if none does."""
    base: wp.vec3i
    """The root's lowest cell of the finest level."""
    corner: wp.vec3
    cell: wp.float32
    """Side of a cell of the finest level."""
    depth: wp.int32
    """The finest level, the base being 0."""
    whole: Texels
    whole_span: wp.vec2i


@wp.func
def finest_cell(p: wp.vec3, tree: BlockTreeArrays) -> wp.vec3i:
    """Return the cell of the finest level at a point, from the root's lowest one."""
    q = (p - tree.corner) / tree.cell
    return wp.vec3i(int(wp.floor(q[0])), int(wp.floor(q[1])), int(wp.floor(q[2]))) - tree.base


@wp.func
def deepest_block(index: wp.vec3i, near: wp.vec4i, tree: BlockTreeArrays) -> wp.int32:
    """Return the finest block of a cell, −1 outside all blocks; `near` is the `base_block` of one nearby."""
    block = base_block_beside(index, tree.depth, tree.keys, near)
    child = int(block)
    shift = 2 * tree.depth
    while child >= 0:
        block = child
        child = tree.children[block * CHILDREN + cell_in_block(index, shift)]
        shift -= 2
    return block


@wp.func
def gradient_in_block(p: wp.vec3, block: wp.int32, tree: BlockTreeArrays) -> wp.vec4:
    """Return (value, ∂x, ∂y, ∂z) at p from the tape of a block; a block without one takes the whole tape."""
    if block < 0:
        return field_gradient(p, tree.whole, tree.whole_span)
    return field_gradient(p, tree.tape, tree.spans[block])


@wp.struct
class PatchArrays:
    """Patches of surface in leaves, for each of which there is a vertex."""

    values: wp.array2d(dtype=wp.float32)
    """The field at the corners of the leaf (n, 8)."""
    edges: wp.array(dtype=wp.int16)
    """The edges that the patch crosses, as bits."""
    lowest: wp.array(dtype=wp.vec3i)
    """The leaf's lowest corner, in cells of the finest level from the root's lowest one."""
    sizes: wp.array(dtype=wp.int32)
    """The leaf's side, in these cells."""
    blocks: wp.array(dtype=wp.int32)
    """The block that holds the leaf."""


@wp.func
def leaf_corner(corner: wp.int32) -> wp.vec3:
    """Return a corner of a leaf, in sides of it from the lowest one."""
    return wp.vec3(float(corner & 1), float((corner >> 1) & 1), float(corner >> 2))


@wp.func
def leaf_crossing(i: wp.int32, edge: wp.int32, patches: PatchArrays) -> wp.vec3:
    """Return where a field that is linear along an edge of a leaf is ISO."""
    a = EDGE_FIRST[edge]
    b = EDGE_LAST[edge]
    t = (ISO - patches.values[i, a]) / (patches.values[i, b] - patches.values[i, a])
    return leaf_corner(a) * (1.0 - t) + leaf_corner(b) * t


@wp.func
def mean_crossing(i: wp.int32, bits: wp.int32, patches: PatchArrays) -> wp.vec3:
    """Return the mean of the crossings on the edges of `bits`."""
    total = wp.vec3()
    count = float(0.0)
    for edge in range(12):
        if ((bits >> edge) & 1) == 1:
            total += leaf_crossing(i, edge, patches)
            count += 1.0
    return total / count


@wp.kernel
def place_on_surface(
    first: wp.int32, patches: PatchArrays, tree: BlockTreeArrays, vertices: VertexArrays
) -> None:
    """Project the mean of each patch's crossings onto the surface.

    If that fails, bisect the edge whose crossing is nearest to the mean.
    """
    i = first + wp.tid()
    bits = int(patches.edges[i])
    mean = mean_crossing(i, bits, patches)
    index = patches.lowest[i]
    cells = index + tree.base
    low = tree.corner + wp.vec3(float(cells[0]), float(cells[1]), float(cells[2])) * tree.cell
    size = float(patches.sizes[i]) * tree.cell
    start = low + mean * size
    span = tree.spans[patches.blocks[i]]
    p, f = project_to_surface(start, 0.5 * size, tree.tape, span)
    near = base_block(index, tree.depth, tree.keys)
    block = deepest_block(finest_cell(p, tree), near, tree)
    if block != deepest_block(finest_cell(start, tree), near, tree):
        f = gradient_in_block(p, block, tree)
    if is_unconverged(f[0], p, start, size):
        nearest = int(-1)
        least = float(0.0)
        for edge in range(12):
            if ((bits >> edge) & 1) == 1:
                distance = wp.length(leaf_crossing(i, edge, patches) - mean)
                if nearest < 0 or distance < least:
                    nearest = edge
                    least = distance
        inner = EDGE_FIRST[nearest]
        outer = EDGE_LAST[nearest]
        if patches.values[i, inner] < ISO:
            inner = EDGE_LAST[nearest]
            outer = EDGE_FIRST[nearest]
        inside = low + leaf_corner(inner) * size
        outside = low + leaf_corner(outer) * size
        for _halving in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            if field_value(middle, tree.tape, span) >= ISO:
                inside = middle
            else:
                outside = middle
        p = inside
        f = field_gradient(p, tree.tape, span)
    color = field_color(p, tree.tape, span)
    write_vertex(vertices, i, p, f, color)


@wp.func
def distance_in_tree(start: wp.vec3, size: wp.float32, near: wp.vec4i, tree: BlockTreeArrays) -> wp.float32:
    """Return the distance from `start` to its projection onto the surface, or `size` if that fails.

    Steps are no longer than half of `size`, the side of a cell.
    """
    p = start
    cell = finest_cell(p, tree)
    block = deepest_block(cell, near, tree)
    for _step in range(NEWTON_STEPS):
        f = gradient_in_block(p, block, tree)
        gap = ISO - f[0]
        g = wp.vec3(f[1], f[2], f[3])
        steepness = wp.length(g)
        if steepness == 0.0:
            return size
        if wp.abs(gap) <= CONVERGED * ISO:
            return wp.length(p - start) + wp.abs(gap) / steepness
        p += g * (wp.clamp(gap / steepness, -0.5 * size, 0.5 * size) / steepness)
        following = finest_cell(p, tree)
        if not (following == cell):  # noqa: SIM201  (vectors of integers have no !=)
            cell = following
            block = deepest_block(cell, near, tree)
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
    near = base_block(finest_cell(a, tree), tree.depth, tree.keys)
    largest = float(0.0)
    for k in range((SAMPLE_STEPS + 1) * (SAMPLE_STEPS + 1)):
        j = k // (SAMPLE_STEPS + 1)
        m = k % (SAMPLE_STEPS + 1)
        if j + m <= SAMPLE_STEPS and j < SAMPLE_STEPS and m < SAMPLE_STEPS and j + m > 0:
            sample = a + ((b - a) * float(j) + (c - a) * float(m)) / float(SAMPLE_STEPS)
            largest = wp.max(largest, distance_in_tree(sample, sizes[i], near, tree))
    errors[i] = largest
