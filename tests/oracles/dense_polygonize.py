"""The polygonizer by brute force: every cell of a dense grid, and the whole tape at every sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blobtree import ISO, Mesh, Node
from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from blobtree.meshing.bisection_kernels import HALVINGS
from blobtree.meshing.patches import EDGES, FLIPPED, KNOTTED_FACE, PATCH_COUNT, PATCH_OF_EDGE
from blobtree.tape.evaluate_kernels import STALLED
from blobtree.tape.model import colors_at, values_at
from tests.blobtree.tape.evaluations import project


@dataclass(frozen=True)
class _Grid:
    """Sample points cell · (first + (i, j, k)), `shape` of them."""

    first: Float64Array
    cell: float
    shape: tuple[int, int, int]

    def points(self, indices: NDArray[np.floating | np.integer]) -> Float32Array:
        return (self.first + indices).astype(np.float32) * np.float32(self.cell)


@dataclass(frozen=True)
class _Crossings:
    """Grid edges that cross the surface, one entry for each patch that they belong to."""

    vertices: Int32Array
    inner: Float64Array
    """Grid coordinates (n, 3) of the corner inside, and `outer` of the one outside."""
    outer: Float64Array
    crossing_points: Float64Array
    """Where a field that is linear along the edge crosses it, in grid coordinates (n, 3)."""

    def means(self) -> Float64Array:
        """Mean crossing (m, 3) of every patch, in grid coordinates."""
        counts = np.bincount(self.vertices)
        sums = np.stack([np.bincount(self.vertices, axis) for axis in self.crossing_points.T], axis=1)
        return sums / counts[:, None]

    def nearest(self, tree: Node, grid: _Grid) -> Float32Array:
        """Of every patch the crossing (m, 3) nearest to their mean, found by halving."""
        inner, outer = self.inner.copy(), self.outer.copy()
        for _ in range(HALVINGS):
            middle = 0.5 * (inner + outer)
            inside = (values_at(tree.tape, grid.points(middle)) >= ISO)[:, None]
            inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
        distances = np.linalg.norm(inner - self.means()[self.vertices], axis=1)
        order = np.lexsort((distances, self.vertices))
        _, first = np.unique(self.vertices[order], return_index=True)
        return grid.points(inner[order[first]])


def polygonize(tree: Node, *, cell_size: float) -> Mesh:
    """The surface of `tree` over the same grid as `blobtree.meshing.polygonize`."""
    grid = _make_grid(tree, cell_size)
    values = values_at(tree.tape, grid.points(np.argwhere(np.ones(grid.shape, bool)))).reshape(grid.shape)
    crossings, quads = _dual_surface(values, grid)
    starts = grid.points(crossings.means())
    positions, normals = project(tree.tape, starts, longest_step=0.5 * grid.cell)
    off = np.abs(values_at(tree.tape, positions) - ISO) > STALLED * ISO
    unconverged = np.flatnonzero(off | (np.linalg.norm(positions - starts, axis=1) > grid.cell))
    positions[unconverged] = crossings.nearest(tree, grid)[unconverged]
    normals[unconverged] = project(tree.tape, positions[unconverged], longest_step=0.0)[1]
    return Mesh(positions, _split_quads(quads, positions), normals, colors_at(tree.tape, positions))


def _make_grid(tree: Node, cell_size: float) -> _Grid:
    """The cells of the world over the support, one more on every side."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    first = np.floor(lower / cell_size) - 1.0
    nx, ny, nz = (int(n) for n in np.ceil(upper / cell_size) + 3.0 - first)
    return _Grid(first, cell_size, (nx, ny, nz))


def _dual_surface(values: Float32Array, grid: _Grid) -> tuple[_Crossings, Int32Array]:
    """The crossings of every patch, which has one vertex, and one quad (m, 4) per crossed grid edge."""
    inside = values >= ISO
    codes = _rows(_cell_codes(inside))
    active = np.flatnonzero(PATCH_COUNT[codes.ravel()])
    active_codes = codes.ravel()[active]
    counts = PATCH_COUNT[active_codes].astype(np.int64)
    first_vertex = np.zeros(codes.size, np.int32)
    first_vertex[active] = np.cumsum(counts) - counts
    crossings = _crossings(values, codes.shape, active, active_codes, first_vertex)
    quads = [_quads_along(axis, inside, codes, first_vertex.reshape(codes.shape)) for axis in range(3)]
    return crossings, np.concatenate(quads)


def _cell_codes(inside: BoolArray) -> UInt8Array:
    """Code of every cell: bit c tells whether its corner c is inside."""
    codes = np.zeros(tuple(n - 1 for n in inside.shape), np.uint8)
    for corner in range(8):
        codes |= inside[_shifted(corner, codes.shape)].astype(np.uint8) << corner
    return codes


def _rows(codes: UInt8Array) -> NDArray[np.int16]:
    """Rows of the patch tables: a cell's code, + FLIPPED where its knotted face is its neighbour's too."""
    rows = codes.astype(np.int16)
    knotted = np.pad(KNOTTED_FACE[codes], 1, constant_values=-1)
    for face in range(6):
        axis, side = divmod(face, 2)
        across = np.roll(knotted, 1 - 2 * side, axis=axis)
        both = (knotted == face) & (across == face ^ 1)
        rows[both[1:-1, 1:-1, 1:-1]] += FLIPPED
    return rows


def _shifted(corner: int, shape: tuple[int, ...]) -> tuple[slice, ...]:
    """Slices that give every cell the sample at its `corner`."""
    return tuple(slice(corner >> axis & 1, (corner >> axis & 1) + n) for axis, n in enumerate(shape))


def _crossings(
    values: Float32Array,
    shape: tuple[int, ...],
    active: Int64Array,
    codes: NDArray[np.int16],
    first_vertex: Int32Array,
) -> _Crossings:
    """All crossings of all patches."""
    cells = np.stack(np.unravel_index(active, shape), axis=1)
    vertices, inner, outer, crossing_points = [], [], [], []
    for edge, (a, b) in enumerate(EDGES):
        patch = PATCH_OF_EDGE[codes, edge]
        members = np.flatnonzero(patch >= 0)
        ends = [
            (cells[members] + [corner & 1, corner >> 1 & 1, corner >> 2]).astype(np.float64)
            for corner in (a, b)
        ]
        value_a, value_b = (values[tuple(end.astype(int).T)].astype(np.float64)[:, None] for end in ends)
        t = (ISO - value_a) / (value_b - value_a)
        vertices.append(first_vertex[active[members]] + patch[members])
        crossing_points.append(ends[0] + t * (ends[1] - ends[0]))
        inner.append(np.where(value_a >= ISO, ends[0], ends[1]))
        outer.append(np.where(value_a >= ISO, ends[1], ends[0]))
    return _Crossings(*(np.concatenate(parts) for parts in (vertices, inner, outer, crossing_points)))


def _quads_along(
    axis: int, inside: BoolArray, codes: NDArray[np.int16], first_vertex: Int32Array
) -> Int32Array:
    """Quads (m, 4) around the crossed grid edges along `axis`, counter-clockwise from outside."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    crossed = np.diff(inside, axis=axis)
    i = np.stack(np.nonzero(crossed), axis=1)
    corners = []
    for du, dv in ((1, 1), (0, 1), (0, 0), (1, 0)):  # the four cells around the edge, in order about `axis`
        cell = i.copy()
        cell[:, u] -= du
        cell[:, v] -= dv
        edge = EDGES.index((du << u | dv << v, du << u | dv << v | 1 << axis))
        where = tuple(cell.T)
        corners.append(first_vertex[where] + PATCH_OF_EDGE[codes[where], edge])
    quads = np.stack(corners, axis=1).astype(np.int32)
    leaving = inside[tuple(i.T)]
    return np.where(leaving[:, None], quads, quads[:, ::-1])


def _split_quads(quads: Int32Array, positions: Float32Array) -> Int32Array:
    """Two triangles (2m, 3) per quad, along its shorter diagonal."""
    a, b, c, d = quads.T
    first = np.linalg.norm(positions[a] - positions[c], axis=1)
    second = np.linalg.norm(positions[b] - positions[d], axis=1)
    along_ac = np.stack([a, b, c, a, c, d], axis=1)
    along_bd = np.stack([b, c, d, b, d, a], axis=1)
    triangles: Int32Array = np.where((first <= second)[:, None], along_ac, along_bd).reshape(-1, 3)
    return triangles
