"""Kernels of adaptive cells that read no tape: the cell of a point, the rows of cells, and their polygons.

Coordinates are those of the cells of the finest level, from the root's lowest one. A cell that no block
refines is a *leaf*. Eight equal cells of a block may be merged to one leaf. Leaves that the surface crosses
are numbered.
"""

import warp as wp

from blobtree.cells.block_kernels import child_number, find_block
from blobtree.cells.grid import CHILDREN
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.dual_kernels import PatchTables, edge_rank
from blobtree.meshing.patches import FLIPPED
from blobtree.meshing.vertex_kernels import EDGE_FIRST, EDGE_LAST

wp.set_module_options(KERNEL_OPTIONS)

EMPTY = -1
"""Number of a leaf that the surface does not cross."""


@wp.struct
class LeafArrays:
    """The leaves of a `block_tree.BlockTree`."""

    keys: wp.array(dtype=wp.int64)
    """Of the blocks of the base, which come first."""
    links: wp.array(dtype=wp.int32)
    """By cell of a block, the block that replaces it, or −1."""
    merged: wp.array(dtype=wp.uint8)
    """By cell of a block, 1 if it is part of a leaf of 2³ cells."""
    numbers: wp.array(dtype=wp.int32)
    """By cell of a block, the number of its leaf, or EMPTY."""
    depth: wp.int32
    """The finest level, the base being 0."""
    lowest: wp.array(dtype=wp.vec3i)
    """By leaf, its lowest corner."""
    sizes: wp.array(dtype=wp.int32)
    """By leaf, its side."""
    codes: wp.array(dtype=wp.uint8)
    """By leaf, its corners that are inside, as bits."""
    rows: wp.array(dtype=wp.int16)
    """By leaf, its row in the tables of `patches`."""
    starts: wp.array(dtype=wp.int32)
    """By leaf, its first vertex."""


@wp.func
def base_block(index: wp.vec3i, depth: wp.int32, keys: wp.array(dtype=wp.int64)) -> wp.vec4i:
    """Return the block of the base that holds a cell of the finest level: coordinates, and number or −1."""
    shift = 2 * depth + 2
    block = wp.vec3i(index[0] >> shift, index[1] >> shift, index[2] >> shift)
    return wp.vec4i(block[0], block[1], block[2], find_block(block, keys))


@wp.func
def base_block_beside(
    index: wp.vec3i, depth: wp.int32, keys: wp.array(dtype=wp.int64), near: wp.vec4i
) -> wp.int32:
    """Return the number of `base_block`, which is found at once if it is the one of a cell nearby."""
    shift = 2 * depth + 2
    block = wp.vec3i(index[0] >> shift, index[1] >> shift, index[2] >> shift)
    if block == wp.vec3i(near[0], near[1], near[2]):
        return near[3]
    return find_block(block, keys)


@wp.func
def cell_in_block(index: wp.vec3i, shift: wp.int32) -> wp.int32:
    """Return the number in its block of the cell, `shift` doublings above the finest, that holds a cell."""
    return child_number(wp.vec3i((index[0] >> shift) & 3, (index[1] >> shift) & 3, (index[2] >> shift) & 3))


@wp.func
def locate(index: wp.vec3i, near: wp.vec4i, leaves: LeafArrays) -> wp.vec3i:
    """Return the leaf that holds a cell of the finest level: (its number, its side, its cell of a block).

    Outside all blocks it is (EMPTY, a base block's side, −1). `near` is the `base_block` of a cell nearby.
    """
    block = base_block_beside(index, leaves.depth, leaves.keys, near)
    shift = 2 * leaves.depth
    cell = int(-1)
    if block < 0:
        return wp.vec3i(EMPTY, 4 << shift, -1)
    while block >= 0:
        cell = block * CHILDREN + cell_in_block(index, shift)
        block = leaves.links[cell]
        shift -= 2
    return wp.vec3i(leaves.numbers[cell], 1 << (shift + 2 + int(leaves.merged[cell])), cell)


@wp.kernel
def choose_leaf_rows(
    first: wp.int32, tables: PatchTables, leaves: LeafArrays, rows: wp.array(dtype=wp.int16)
) -> None:
    """Write the row of each leaf in the tables of `patches`."""
    i = first + wp.tid()
    row = int(leaves.codes[i])
    face = int(tables.knotted_face[row])
    if face >= 0:
        index = leaves.lowest[i]
        axis = face // 2
        if face % 2 == 1:
            index[axis] = index[axis] + leaves.sizes[i]
        else:
            index[axis] = index[axis] - 1
        other = locate(index, base_block(leaves.lowest[i], leaves.depth, leaves.keys), leaves)
        if other[0] >= 0 and other[1] == leaves.sizes[i]:  # noqa: SIM102  (Warp evaluates both sides)
            if int(tables.knotted_face[int(leaves.codes[other[0]])]) == (face ^ 1):
                row += FLIPPED
    rows[i] = wp.int16(row)


@wp.kernel
def write_polygons(
    first: wp.int32,
    patch_of_edge: wp.array(dtype=wp.int8),
    leaves: LeafArrays,
    listed: wp.array(dtype=wp.int32),
    write: wp.bool,
    polygon_starts: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    owned: wp.array(dtype=wp.int16),
    irregular: wp.array(dtype=wp.uint8),
    pierced: wp.array(dtype=wp.uint8),
    polygons: wp.array(dtype=wp.vec4i),
) -> None:
    """Write, or count, the polygons around crossed edges of listed leaves, counter-clockwise from outside.

    An edge along which a smaller leaf lies is left to that leaf; of equal leaves the first one around it
    takes it. A polygon joins the three or four leaves around the edge; of three, the last corner is −1.
    Leaves with a smaller one along a crossed edge are flagged as irregular, and as pierced, by their cells of
    blocks, if they are empty. Counting, `owned` receives the edges of each leaf's polygons, as bits.
    """
    i = listed[first + wp.tid()]
    size = leaves.sizes[i]
    code = int(leaves.codes[i])
    near = base_block(leaves.lowest[i], leaves.depth, leaves.keys)
    total = int(0)
    bits = int(0)
    for edge in range(12):
        a = EDGE_FIRST[edge]
        if (write and ((int(owned[i]) >> edge) & 1) == 1) or (
            not write and ((code >> a) & 1) != ((code >> EDGE_LAST[edge]) & 1)
        ):
            axis = edge // 4
            u = (axis + 1) % 3
            v = (axis + 2) % 3
            low = leaves.lowest[i] + wp.vec3i(a & 1, (a >> 1) & 1, a >> 2) * size
            owner = int(-1)
            minimal = bool(True)
            polygon = wp.vec4i(-1, -1, -1, -1)
            found = wp.vec4i(-1, -1, -1, -1)
            corners = int(0)
            for k in range(4):
                du = int(0)
                dv = int(0)
                if k == 0 or k == 3:
                    du = 1
                if k < 2:
                    dv = 1
                index = low
                index[u] = index[u] - du
                index[v] = index[v] - dv
                leaf = wp.vec3i(i, size, 0)
                if du != ((a >> u) & 1) or dv != ((a >> v) & 1):
                    leaf = locate(index, near, leaves)
                number = leaf[0]
                if leaf[1] < size:
                    minimal = False
                elif leaf[1] == size:
                    if owner < 0:
                        owner = number
                    if number >= 0:
                        row = int(leaves.rows[number])
                        patch = int(patch_of_edge[row * 12 + axis * 4 + edge_rank(axis, du, dv)])
                        polygon[corners] = leaves.starts[number] + patch
                        corners += 1
                else:
                    if number >= 0:
                        irregular[number] = wp.uint8(1)
                        repeated = bool(False)
                        for other in range(4):
                            if found[other] == number:
                                repeated = True
                        if not repeated:
                            polygon[corners] = leaves.starts[number]
                            corners += 1
                    elif leaf[2] >= 0:
                        pierced[leaf[2]] = wp.uint8(1)
                found[k] = number
            if not minimal:
                irregular[i] = wp.uint8(1)
            elif owner == i:
                if write:
                    if ((code >> a) & 1) == 0:
                        if corners == 4:
                            polygon = wp.vec4i(polygon[3], polygon[2], polygon[1], polygon[0])
                        else:
                            polygon = wp.vec4i(polygon[2], polygon[1], polygon[0], -1)
                    polygons[polygon_starts[i] + total] = polygon
                total += 1
                bits += 1 << edge
    if not write:
        counts[i] = total
        owned[i] = wp.int16(bits)
