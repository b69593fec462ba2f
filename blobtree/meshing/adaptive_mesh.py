"""The dual mesh of cells of several sizes.

Each leaf has one vertex per patch of surface, and each edge that no smaller leaf divides, and that the
surface crosses, gives a polygon through the vertices of the three or four leaves around it (Ju et al. 2002).

The result is a closed manifold. Each strand of surface on a face between two leaves becomes an edge of the
mesh. It belongs to the polygons of the two crossed edges that it joins, so every edge has two polygons. A
vertex is the loop of strands around its leaf. Leaves without smaller neighbours are those of `patches`, whose
loops are told apart. A leaf with a smaller neighbour at a crossed edge has one vertex. It must have one loop,
no two strands to one neighbour, and a simple code (`adaptive_cells`): otherwise it is divided. This ends at
cells of one size at the latest.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, IndexArray, Int32Array, Int64Array
from blobtree.cells.block_kernels import CellBlocks
from blobtree.cells.grid import CHILDREN, KEY_DIGITS
from blobtree.cells.scan import exclusive_scan
from blobtree.device import launch
from blobtree.errors import InvalidResolution
from blobtree.meshing.adaptive_cell_kernels import EMPTY, LeafArrays, choose_leaf_rows, write_polygons
from blobtree.meshing.adaptive_cells import CELLS_OF_OCTANT, OCTANTS, SIMPLE, AdaptiveCells, Leaves
from blobtree.meshing.adaptive_kernels import PatchArrays, measure_distances, place_on_surface
from blobtree.meshing.block_tree import on_device
from blobtree.meshing.crease_kernels import find_choices, move_onto_creases, turn_diagonals
from blobtree.meshing.leaf_changes import BESIDE, FAR, LeafChanges
from blobtree.meshing.mesh import Mesh, cell_patches, patch_tables, vertex_arrays
from blobtree.meshing.patches import EDGES, FLIPPED, MAX_PATCHES, PATCH_COUNT, PATCH_OF_EDGE
from blobtree.progress import Progress

SLOTS = CHILDREN + OCTANTS
"""Leaves that a block can have, of either size."""

SINGLE_REPAIRS = 6
"""Rounds of repairs without polygons in which no leaves but wrong ones are divided."""

WIDEST_REPAIR = 8.0
"""Distance from a wrong leaf, in sides of it, within which leaves are divided in later rounds."""

MAX_REPAIRS = 100
"""Most rounds in which leaves are divided until the mesh is a manifold; each makes some leaves smaller."""


NO_PLACES: Float64Array = np.empty((0, 3))


class OpenMesh(InvalidResolution):
    """The mesh does not close."""

    def __init__(self, message: str, places: Float64Array = NO_PLACES) -> None:
        super().__init__(message)
        self.places = places
        """Middles of the cells at which it is open (n, 3)."""


@dataclass
class Vertices:
    """Vertices by ascending identifier: (block · SLOTS + slot) · 2 · MAX_PATCHES + patch, flipped or not."""

    identifiers: Int64Array
    positions: Float32Array
    normals: Float32Array
    colors: Float32Array
    sheet_counts: NDArray[np.uint8]

    @staticmethod
    def none() -> "Vertices":
        """Return no vertices."""
        no_vectors = np.empty((0, 3), np.float32)
        return Vertices(np.empty(0, np.int64), no_vectors, no_vectors, no_vectors, np.empty(0, np.uint8))

    def among(self, identifiers: Int64Array) -> BoolArray:
        """Return which identifiers are known (n,)."""
        at = np.searchsorted(self.identifiers, identifiers)
        return np.asarray(np.append(self.identifiers, -1)[at] == identifiers)

    def chosen(self, indices: IndexArray) -> "Vertices":
        """Return some of the vertices."""
        return Vertices(*(array[indices] for array in vars(self).values()))

    def with_more(self, other: "Vertices") -> "Vertices":
        """Return the vertices of both."""
        both = [np.concatenate(pair) for pair in zip(vars(self).values(), vars(other).values(), strict=True)]
        return Vertices(*(array[np.argsort(both[0], kind="stable")] for array in both))


@dataclass(frozen=True)
class AdaptiveMesh:
    """A mesh and the leaves that its vertices lie in."""

    leaves: Leaves
    vertices: Vertices
    owners: IndexArray
    """For each vertex its leaf."""
    faces: Int32Array
    quads: int
    """Number of quads, whose pairs of triangles come first."""

    def mesh(self, creases: bool) -> Mesh:
        """Return the triangles with their vertices."""
        vertices = self.vertices
        counts = vertices.sheet_counts if creases else None
        return Mesh(vertices.positions, self.faces, vertices.normals, vertices.colors, counts)


@dataclass
class LeafEdges:
    """What is known of the crossed edges of leaves."""

    numbers: Int32Array
    """By cell of a block, the number of its leaf, or EMPTY."""
    counts: Int32Array
    """Polygons of each leaf."""
    owned: NDArray[np.int16]
    """Edges of each leaf's polygons, as bits."""
    irregular: BoolArray
    """Leaves with smaller ones along a crossed edge."""
    pierced: IndexArray
    """Cells of empty leaves with smaller ones along a crossed edge, ascending."""


class AdaptiveMesher:
    """Meshes of cells whose leaves are divided more and more; vertices are placed once."""

    def __init__(self, cells: AdaptiveCells, creases: bool) -> None:
        self._cells, self._tree = cells, cells.tree
        self._base = cells.tree.cells
        self._device = self._base.device
        self._kernel = self._base.tape.instruction_set.kernel_for
        self._creases = creases
        self._known = Vertices.none()
        self._changes = LeafChanges(cells)
        self._known_edges: LeafEdges

    def mesh(
        self,
        report: Progress,
        max_repairs: int = MAX_REPAIRS,
        max_growth: float = np.inf,
        max_leaves: float = np.inf,
    ) -> AdaptiveMesh:
        """Return the mesh of the leaves; divide those at which it would not be a manifold.

        Raises
        ------
        OpenMesh
            Cells cannot be divided any further, or their blocks have grown by more than a factor, or all
            rounds together have had too many leaves.
        """
        most, stuck, seen, places = max_growth * len(self._tree), 0, 0, NO_PLACES
        for repair in range(max_repairs):
            if len(self._tree) > most or seen > max_leaves:
                break
            report("connecting vertices", repair / max_repairs)
            self._cells.settle()
            leaves = self._cells.leaves()
            seen += len(leaves)
            rows, polygons, irregular, pierced = self._polygons(leaves)
            if polygons is None:
                wrong = np.flatnonzero(irregular & ~SIMPLE[leaves.codes])
                places = self._middles(leaves, wrong)
                self._divide(leaves, _widened(leaves, wrong, stuck - SINGLE_REPAIRS), pierced)
                stuck += 1
                continue
            counts = PATCH_COUNT[rows].astype(np.int64)
            owners = np.repeat(np.arange(len(leaves)), counts)
            vertices = self._vertices(leaves, rows, owners, counts, report)
            faces, quads = _triangles(polygons, vertices.positions)
            torn = _torn_vertices(faces, irregular[owners])
            if not len(torn) and not _is_closed(faces, len(owners)):
                torn = _torn_vertices(faces, np.ones(len(owners), bool))
            if not len(torn):
                report("connecting vertices", 1.0)
                mesh = AdaptiveMesh(leaves, vertices, owners, faces, quads)
                return self._with_turned_diagonals(mesh) if self._creases else mesh
            wrong = np.unique(owners[torn])
            places = self._middles(leaves, wrong)
            self._divide(leaves, wrong[irregular[wrong]] if irregular[wrong].any() else wrong, pierced)
            stuck = 0
        raise OpenMesh("cells could not be divided to a closed mesh; allow a smaller error", places)

    def _middles(self, leaves: Leaves, chosen: IndexArray) -> Float64Array:
        """Return the middles of some leaves (n, 3), in world units."""
        grid = self._tree.grid(self._tree.depth)
        middles = leaves.lowest[chosen] + 0.5 * leaves.sizes[chosen, None]
        result: Float64Array = grid.origin + middles * grid.cell_size
        return result

    def _divide(self, leaves: Leaves, wrong: IndexArray, pierced: IndexArray) -> None:
        """Divide leaves at which the mesh is no manifold, and empty leaves at which it has a hole."""
        once = np.zeros(len(wrong), bool)
        changed = self._cells.divide(leaves.blocks[wrong], leaves.slots[wrong], once)
        changed |= self._cells.divide_pierced(pierced)
        if not changed:
            raise OpenMesh(
                "the field differs between two evaluations at one point; allow another error",
                self._middles(leaves, wrong),
            )

    # -- polygons -----------------------------------------------------------------------------------

    def _polygons(self, leaves: Leaves) -> tuple[NDArray[np.int16], Int32Array | None, BoolArray, IndexArray]:
        """Return rows and polygons (n, 4), irregular leaves, and cells of empty leaves that are pierced.

        If a pierced leaf, or an irregular one without a simple code, is to be divided, there are no polygons.
        """
        device, count = self._device, len(leaves)
        arrays: Any = LeafArrays()
        merged = ~self._cells.open_cells.ravel()
        numbers = self._numbers(leaves)
        arrays.keys, arrays.depth = self._base.leaves.keys, self._tree.depth
        arrays.links = on_device(np.where(merged, -1, self._cells.links), wp.int32, device)
        arrays.merged = on_device(merged, wp.uint8, device)
        arrays.numbers = on_device(numbers, wp.int32, device)
        arrays.lowest = on_device(leaves.lowest, wp.vec3i, device)
        arrays.sizes = on_device(leaves.sizes, wp.int32, device)
        arrays.codes = on_device(leaves.codes, wp.uint8, device)
        arrays.rows = wp.zeros(count, dtype=wp.int16, device=device)
        tables = patch_tables(device)
        rows = wp.zeros(count, dtype=wp.int16, device=device)
        launch(choose_leaf_rows, count, [tables, arrays], [rows], device)
        arrays.rows = rows
        starts = np.cumsum(PATCH_COUNT[rows.numpy()], dtype=np.int64)
        arrays.starts = on_device(np.append(0, starts)[:-1], wp.int32, device)
        inputs = [tables.patch_of_edge, arrays]
        self._known_edges = known = self._edges(leaves, numbers, inputs)
        if len(known.pierced) or (known.irregular & ~SIMPLE[leaves.codes]).any():
            return rows.numpy(), None, known.irregular, known.pierced
        polygon_starts, total = exclusive_scan(
            on_device(np.append(known.counts, 0), wp.int32, device), "polygons"
        )
        polygons = wp.empty(total, dtype=wp.vec4i, device=device)
        inputs += [on_device(np.arange(count), wp.int32, device), True, polygon_starts]
        flags = [wp.empty(length, dtype=wp.uint8, device=device) for length in (count, len(numbers))]
        outputs = [polygon_starts, on_device(known.owned, wp.int16, device), *flags, polygons]
        launch(write_polygons, count, inputs, outputs, device)
        return rows.numpy(), polygons.numpy().reshape(-1, 4), known.irregular, known.pierced

    def _numbers(self, leaves: Leaves) -> Int32Array:
        """Return by cell of a block the number of its leaf, or EMPTY."""
        numbers = np.full(len(self._tree) * CHILDREN, EMPTY, np.int32)
        merged = leaves.slots >= CHILDREN
        numbers[first_cells(leaves)[~merged]] = np.flatnonzero(~merged)
        cells = CELLS_OF_OCTANT[leaves.slots[merged] - CHILDREN]
        numbers[leaves.blocks[merged][:, None] * CHILDREN + cells] = np.flatnonzero(merged)[:, None]
        return numbers

    def _edges(self, leaves: Leaves, numbers: Int32Array, inputs: list[Any]) -> "LeafEdges":
        """Return what `write_polygons` counts, anew beside leaves that changed since the last round."""
        device, count = self._device, len(leaves)
        self._changes.update()
        nearness = self._changes.of_leaves(leaves)
        listed, kept = np.flatnonzero(nearness != FAR), np.flatnonzero(nearness != BESIDE)
        counts = wp.zeros(count, dtype=wp.int32, device=device)
        owned = wp.zeros(count, dtype=wp.int16, device=device)
        irregular = wp.zeros(count, dtype=wp.uint8, device=device)
        pierced = wp.zeros(len(numbers), dtype=wp.uint8, device=device)
        inputs = [*inputs, on_device(listed, wp.int32, device), False, counts]
        outputs = [counts, owned, irregular, pierced, wp.empty(0, dtype=wp.vec4i, device=device)]
        launch(write_polygons, len(listed), inputs, outputs, device)
        flags, cells = irregular.numpy().astype(bool), np.flatnonzero(pierced.numpy())
        result = LeafEdges(numbers, counts.numpy(), owned.numpy(), flags, cells)
        if len(kept):
            before = self._known_edges
            old = before.numbers[first_cells(leaves)[kept]]
            result.counts[kept], result.owned[kept] = before.counts[old], before.owned[old]
            result.irregular[kept] = before.irregular[old]
            new = cells[self._changes.of_cells(cells) == BESIDE]
            rest = before.pierced[self._changes.of_cells(before.pierced) != BESIDE]
            result.pierced = np.union1d(new, rest)
        return result

    # -- vertices -----------------------------------------------------------------------------------

    def _vertices(
        self,
        leaves: Leaves,
        rows: NDArray[np.int16],
        owners: IndexArray,
        counts: Int64Array,
        report: Progress,
    ) -> Vertices:
        """Return the vertices in the order of the leaves; place those that are new."""
        patches = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
        flipped = rows[owners] >= FLIPPED
        leaf_numbers = leaves.blocks.astype(np.int64) * SLOTS + leaves.slots
        identifiers = (2 * leaf_numbers[owners] + flipped) * MAX_PATCHES + patches
        new = np.flatnonzero(~self._known.among(identifiers))
        if len(new):
            placed = self._placed(leaves, rows, owners[new], patches[new], identifiers[new], report)
            if self._creases:
                self._move_onto_creases(leaves, rows, owners[new], patches[new], placed, report)
            self._known = self._known.with_more(placed)
        return self._known.chosen(np.searchsorted(self._known.identifiers, identifiers))

    def _placed(
        self,
        leaves: Leaves,
        rows: NDArray[np.int16],
        owners: IndexArray,
        patches: IndexArray,
        identifiers: Int64Array,
        report: Progress,
    ) -> Vertices:
        """Return the vertices of patches, placed on the surface."""
        device, count = self._device, len(owners)
        arrays: Any = PatchArrays()
        values = self._cells.corner_values(leaves, owners)
        edges = (PATCH_OF_EDGE[rows[owners]] == patches[:, None]) @ (1 << np.arange(len(EDGES)))
        arrays.values = on_device(values, wp.float32, device)
        arrays.edges = on_device(edges, wp.int16, device)
        arrays.lowest = on_device(leaves.lowest[owners], wp.vec3i, device)
        arrays.sizes = on_device(leaves.sizes[owners], wp.int32, device)
        arrays.blocks = on_device(leaves.blocks[owners], wp.int32, device)
        positions, normals, colors = (wp.empty(count, dtype=wp.vec3, device=device) for _ in range(3))
        launch(
            self._kernel(place_on_surface),
            count,
            [arrays, self._tree.arrays()],
            [vertex_arrays(positions, normals, colors)],
            device,
            step=partial(report, "placing vertices"),
        )
        sheet_counts = np.ones(count, np.uint8)
        return Vertices(identifiers, positions.numpy(), normals.numpy(), colors.numpy(), sheet_counts)

    # -- errors -------------------------------------------------------------------------------------

    def errors(self, mesh: AdaptiveMesh, chosen: IndexArray, report: Progress) -> Float32Array:
        """Return the distances of some of the triangles to the surface, the largest of each one's samples."""
        device, count = self._device, len(chosen)
        errors = wp.zeros(count, dtype=wp.float32, device=device)
        faces = mesh.faces[chosen]
        sizes = mesh.leaves.sizes[mesh.owners][faces].max(axis=1, initial=0)
        world = sizes * self._tree.grid(self._tree.depth).cell_size
        inputs = [self._tree.arrays(), on_device(mesh.vertices.positions, wp.vec3, device)]
        inputs += [on_device(faces, wp.vec3i, device)]
        inputs += [on_device(world, wp.float32, device)]
        step = partial(report, "measuring chords")
        launch(self._kernel(measure_distances), count, inputs, [errors], device, step=step)
        distances: Float32Array = errors.numpy()
        return distances

    # -- creases ------------------------------------------------------------------------------------

    def _move_onto_creases(
        self,
        leaves: Leaves,
        rows: NDArray[np.int16],
        owners: IndexArray,
        patches: IndexArray,
        vertices: Vertices,
        report: Progress,
    ) -> None:
        """Move vertices onto the creases that their patches contain, as `creases.sharpened` does."""
        device = self._device
        for size in np.unique(leaves.sizes[owners]):
            listed = np.flatnonzero(leaves.sizes[owners] == size)
            lattice, blocks, cells = self._lattice(leaves, owners[listed], int(size))
            order = np.lexsort((patches[listed], cells, blocks))
            listed, blocks, cells = listed[order], blocks[order], cells[order]
            count = len(lattice.blocks)
            starts = np.searchsorted(blocks, np.arange(count + 1))
            cell_rows, offsets = np.zeros(count * CHILDREN, np.int16), np.zeros(count * CHILDREN, np.uint8)
            first = patches[listed] == 0
            at = (blocks * CHILDREN + cells)[first]
            cell_rows[at] = rows[owners[listed[first]]]
            offsets[at] = (np.arange(len(listed)) - starts[blocks])[first]
            positions, normals, colors = (
                on_device(array[listed], wp.vec3, device)
                for array in (vertices.positions, vertices.normals, vertices.colors)
            )
            sheet_counts = wp.ones(len(listed), dtype=wp.uint8, device=device)
            choosing = wp.empty(count, dtype=wp.uint8, device=device)
            launch(self._kernel(find_choices), count, [lattice.spans, lattice.tape], [choosing], device)
            tables = patch_tables(device)
            vertex_starts = on_device(starts, wp.int32, device)
            rows_offsets = (
                on_device(cell_rows, wp.int16, device),
                on_device(offsets, wp.uint8, device),
            )
            inputs = [
                lattice,
                choosing,
                cell_patches(*rows_offsets, vertex_starts, device),
                tables.patch_count,
            ]
            outputs = [vertex_arrays(positions, normals, colors), sheet_counts]
            step = partial(report, "finding creases")
            launch(self._kernel(move_onto_creases), count * CHILDREN, inputs, outputs, device, step=step)
            vertices.positions[listed], vertices.normals[listed] = positions.numpy(), normals.numpy()
            vertices.colors[listed], vertices.sheet_counts[listed] = colors.numpy(), sheet_counts.numpy()

    def _with_turned_diagonals(self, mesh: AdaptiveMesh) -> AdaptiveMesh:
        """Return the mesh with the diagonals that lie nearer to the surface at creases."""
        device, faces = self._device, mesh.faces.copy()
        quads = faces[: 2 * mesh.quads].reshape(-1, 6)
        sizes = mesh.leaves.sizes[mesh.owners][quads].max(axis=1, initial=0)
        sharp = (mesh.vertices.sheet_counts[quads] > 1).any(axis=1)
        positions = on_device(mesh.vertices.positions, wp.vec3, device)
        sheet_counts = on_device(mesh.vertices.sheet_counts, wp.uint8, device)
        for size in np.unique(sizes[sharp]):
            listed = np.flatnonzero(sharp & (sizes == size))
            lattice, _, _ = self._lattice(mesh.leaves, np.flatnonzero(mesh.leaves.sizes == size), int(size))
            turned = on_device(quads[listed].reshape(-1, 3), wp.vec3i, device)
            inputs = [lattice, positions, sheet_counts]
            launch(self._kernel(turn_diagonals), len(listed), inputs, [turned], device)
            quads[listed] = turned.numpy().reshape(-1, 6)
        return replace(mesh, faces=_with_single_diagonals(faces, mesh.faces, mesh.quads))

    def _lattice(self, leaves: Leaves, chosen: IndexArray, size: int) -> tuple[Any, IndexArray, IndexArray]:
        """Return blocks of cells as large as some leaves, and for each of these its block and its cell.

        The blocks take the place of `SparseCells.arrays`: each has the tape of a block of the tree around it.
        """
        tree, finest = self._tree, self._tree.grid(self._tree.depth)
        at = leaves.lowest[chosen] // size
        coordinates, first, blocks = np.unique(at >> 2, axis=0, return_index=True, return_inverse=True)
        keys = _block_keys(coordinates)
        order = np.argsort(keys)
        rank = np.empty(len(order), np.intp)
        rank[order] = np.arange(len(order))
        holders = leaves.blocks[chosen][first[order]]
        merged = leaves.slots[chosen][first[order]] >= CHILDREN
        holders = np.where(merged, tree.parents[holders] // CHILDREN, holders)
        arrays: Any = CellBlocks()
        arrays.blocks = on_device(coordinates[order], wp.vec3i, self._device)
        arrays.keys = on_device(keys[order], wp.int64, self._device)
        arrays.spans = on_device(tree.spans.numpy()[holders], wp.vec2i, self._device)
        arrays.tape = tree.tape
        arrays.base = wp.vec3i(*(int(first_cell) // (4 * size) for first_cell in finest.base))
        arrays.corner, arrays.cell = wp.vec3(*finest.corner), size * finest.cell_size
        whole = self._base.tape.on(self._device)
        arrays.whole, arrays.whole_span = whole.data, whole.span
        offset = at & 3
        return arrays, rank[blocks.ravel()], offset[:, 0] * 16 + offset[:, 1] * 4 + offset[:, 2]


def _widened(leaves: Leaves, wrong: IndexArray, rounds: int) -> IndexArray:
    """Return leaves to divide after some rounds that found wrong ones: others around them too.

    Between two sides that lie near each other, each divided leaf makes the next one wrong. Alone, these
    would take a round for each leaf on the way.
    """
    if rounds < 0 or not len(wrong):
        return wrong
    from scipy.spatial import cKDTree  # most meshes need few repairs

    reach = min(2.0 ** (rounds // 2), WIDEST_REPAIR)
    others = np.flatnonzero(~SIMPLE[leaves.codes])
    middles = leaves.lowest + 0.5 * leaves.sizes[:, None]
    distances, nearest = cKDTree(middles[wrong]).query(middles[others], p=np.inf)
    side, sizes = leaves.sizes[wrong][nearest], leaves.sizes[others]
    return np.union1d(wrong, others[(sizes >= side) & (distances < reach * side + 0.5 * sizes)])


def first_cells(leaves: Leaves) -> IndexArray:
    """Return the lowest cell of a block that each leaf holds."""
    slots = np.append(np.arange(CHILDREN), CELLS_OF_OCTANT[:, 0])[leaves.slots]
    return leaves.blocks * CHILDREN + slots


def _block_keys(blocks: Int32Array) -> Int64Array:
    """Return the keys of blocks (n, 3), see `block_kernels.block_key`."""
    keys = np.zeros(len(blocks), np.int64)
    for digit in range(KEY_DIGITS - 1, -1, -1):
        x, y, z = ((blocks[:, axis] >> (2 * digit)) & 3 for axis in range(3))
        keys = keys * CHILDREN + (x * 16 + y * 4 + z)
    return keys


def _triangles(polygons: Int32Array, positions: Float32Array) -> tuple[Int32Array, int]:
    """Return triangles (n, 3), and the number of quads, which are split along their shorter diagonals."""
    quads, triangles = polygons[polygons[:, 3] >= 0], polygons[polygons[:, 3] < 0][:, :3]
    a, b, c, d = (positions[quads[:, corner]] for corner in range(4))
    turned = ((a - c) ** 2).sum(axis=1) > ((b - d) ** 2).sum(axis=1)
    quads = np.where(turned[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), triangles]).astype(np.int32), len(
        quads
    )


def _with_single_diagonals(turned: Int32Array, faces: Int32Array, quads: int) -> Int32Array:
    """Return faces with turned diagonals, except those that are edges already or would serve two quads."""
    while True:
        edges = np.sort(np.stack([turned, np.roll(turned, -1, axis=1)], axis=2), axis=2)
        keys = edges[..., 0].astype(np.int64) * (int(turned.max(initial=0)) + 1) + edges[..., 1]
        _, places, counts = np.unique(keys, return_inverse=True, return_counts=True)
        uses = counts[places.reshape(-1)].reshape(-1, 3)[: 2 * quads].reshape(-1, 6)
        rows, before = turned[: 2 * quads].reshape(-1, 6), faces[: 2 * quads].reshape(-1, 6)
        wrong = (uses > 2).any(axis=1) & (rows != before).any(axis=1)
        if not wrong.any():
            return turned
        rows[wrong] = before[wrong]


def _is_closed(faces: Int32Array, vertices: int) -> bool:
    """Return True if each edge has two triangles, on which it runs in opposite directions.

    The vertex of a leaf that is not irregular then has one fan, as its patch has one loop.
    """
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    rising = start < end
    first = np.sort(start[rising] * vertices + end[rising])
    other = np.sort(end[~rising] * vertices + start[~rising])
    return np.array_equal(first, other) and bool((np.diff(first) > 0).all())


def _torn_vertices(faces: Int32Array, chosen: BoolArray) -> IndexArray:
    """Return the chosen ones of all vertices (n,) around which the triangles do not form one closed fan."""
    vertices = len(chosen)
    if not chosen.all():
        faces = faces[chosen[faces[:, 0]] | chosen[faces[:, 1]] | chosen[faces[:, 2]]]
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    keys = np.minimum(start, end) * vertices + np.maximum(start, end)
    order = np.argsort(keys)
    same = np.diff(keys[order]) == 0
    before, after = np.append(False, same), np.append(same, False)
    first = np.flatnonzero(~before & after & ~np.append(same[1:], [False, False]))  # edges of two triangles
    one, other = order[first], order[first + 1]
    opposite = start[one] == end[other]
    twin = np.full(len(keys), -1, np.int64)
    twin[one[opposite]], twin[other[opposite]] = other[opposite], one[opposite]
    alone = twin < 0
    wrong: IndexArray = np.unique(np.concatenate([start[alone], end[alone]]))
    if chosen[wrong].any():
        return wrong[chosen[wrong]]
    degrees = np.bincount(start, minlength=vertices)
    firsts = np.full(vertices, -1, np.int64)
    firsts[start] = np.arange(len(start))
    walking = np.flatnonzero(chosen & (degrees > 0))
    at, steps = firsts[walking], np.zeros(vertices, np.int64)
    while len(walking):  # to the next edge from the same vertex, until the first one comes again
        at = twin[at - at % 3 + (at + 2) % 3]
        steps[walking] += 1
        going = at != firsts[walking]
        walking, at = walking[going], at[going]
    return np.flatnonzero(chosen & ((steps != degrees) | (degrees == 0)))
