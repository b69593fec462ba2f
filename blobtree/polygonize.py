"""Field → triangle mesh: a dense grid, one vertex per patch of surface in a cell, Newton onto the surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidResolution
from .evaluate import colors_at, values_at
from .kernels import ISO
from .patches import EDGES, PATCH_COUNT, PATCH_OF_EDGE
from .progress import Progress
from .project import project
from .tree import Node

DEFAULT_RESOLUTION = 64
LARGEST_GRID = 300_000_000
"""Samples beyond which a dense grid is refused: 1.2 GB of field values."""

_SAMPLES_PER_SLAB = 1 << 20

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: float32[n, 3] `vertices`, outward unit `normals` and `colors`; int32[m, 3] `faces`."""

    vertices: Floats
    faces: Ints
    normals: Floats
    colors: Floats


@dataclass(frozen=True)
class _Grid:
    """Sample points lower + cell · (i, j, k), `shape` of them."""

    lower: NDArray[np.float64]
    cell: float
    shape: tuple[int, int, int]

    def points(self, indices: NDArray[np.floating | np.integer]) -> Floats:
        return (self.lower + self.cell * indices).astype(np.float32)


def polygonize(
    tree: Node,
    *,
    resolution: int | None = None,
    cell_size: float | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """The surface of `tree` as closed, consistently oriented triangles (counter-clockwise from outside).

    Parameters
    ----------
    resolution
        Cells along the longest side of the tree's box; 64 by default.
    cell_size
        Side of a cell in the model's units, in place of `resolution`; thinner features may be lost.

    Raises
    ------
    InvalidResolution
        Both or a senseless value were given, or the grid would not fit in memory.
    """
    report = progress or (lambda _stage, _fraction: None)
    grid = _make_grid(tree, resolution, cell_size)
    values = _sample(tree, grid, report)
    report("connecting vertices", 0.0)
    vertices, faces = _dual_surface(values, grid)
    report("moving vertices onto the surface", 0.5)
    positions, normals = project(tree.tape, vertices, longest_step=0.5 * grid.cell)
    triangles = _split_quads(faces, positions)
    colors = colors_at(tree.tape, positions)
    report("moving vertices onto the surface", 1.0)
    return Mesh(positions, triangles, normals, colors)


def _make_grid(tree: Node, resolution: int | None, cell_size: float | None) -> _Grid:
    """A grid over the box of influence, one cell wider on every side so that its rim lies outside."""
    lower, upper = (corner.astype(np.float64) for corner in tree.bounds)
    longest = float((upper - lower).max())
    if resolution is not None and cell_size is not None:
        raise InvalidResolution("expected either resolution or cell_size, got both; drop one")
    if cell_size is None:
        cells = DEFAULT_RESOLUTION if resolution is None else resolution
        if not isinstance(cells, int | np.integer) or cells < 1:
            raise InvalidResolution(
                f"resolution: expected a whole number of cells from 1, got {resolution!r}"
            )
        cell_size = longest / int(cells)
    if not 0.0 < cell_size < np.inf:
        raise InvalidResolution(f"cell_size: expected a finite size above 0, got {cell_size!r}")
    shape = np.ceil((upper - lower) / cell_size) + 3.0
    if shape.prod() > LARGEST_GRID:
        raise InvalidResolution(
            f"a grid of {shape[0]:.0f}×{shape[1]:.0f}×{shape[2]:.0f} samples does not fit in memory "
            f"(at most {LARGEST_GRID:,}); take larger cells"
        )
    nx, ny, nz = (int(n) for n in shape)
    return _Grid(lower - cell_size, float(cell_size), (nx, ny, nz))


def _sample(tree: Node, grid: _Grid, report: Progress) -> Floats:
    """Field values on the whole grid, slab by slab along x."""
    nx, ny, nz = grid.shape
    values = np.empty(grid.shape, np.float32)
    thickness = max(1, _SAMPLES_PER_SLAB // (ny * nz))
    for start in range(0, nx, thickness):
        report("sampling the field", start / nx)
        stop = min(start + thickness, nx)
        indices = np.stack(
            np.meshgrid(np.arange(start, stop), np.arange(ny), np.arange(nz), indexing="ij"), axis=-1
        )
        values[start:stop] = values_at(tree.tape, grid.points(indices.reshape(-1, 3))).reshape(-1, ny, nz)
    report("sampling the field", 1.0)
    return values


def _dual_surface(values: Floats, grid: _Grid) -> tuple[Floats, Ints]:
    """One vertex per patch, at the mean of its edge crossings, and one quad (m, 4) per crossed grid edge."""
    inside = values >= ISO
    codes = _cell_codes(inside)
    active = np.flatnonzero(PATCH_COUNT[codes.ravel()])
    active_codes = codes.ravel()[active]
    counts = PATCH_COUNT[active_codes].astype(np.int64)
    first_vertex = np.zeros(codes.size, np.int32)
    first_vertex[active] = np.cumsum(counts) - counts
    vertices = _crossing_means(values, codes.shape, active, active_codes, first_vertex)
    quads = [_quads_along(axis, inside, codes, first_vertex.reshape(codes.shape)) for axis in range(3)]
    return grid.points(vertices), np.concatenate(quads)


def _cell_codes(inside: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Code of every cell: bit c tells whether its corner c is inside."""
    codes = np.zeros(tuple(n - 1 for n in inside.shape), np.uint8)
    for corner in range(8):
        codes |= inside[_shifted(corner, codes.shape)].astype(np.uint8) << corner
    return codes


def _shifted(corner: int, shape: tuple[int, ...]) -> tuple[slice, ...]:
    """Slices that give every cell the sample at its `corner`."""
    return tuple(slice(corner >> axis & 1, (corner >> axis & 1) + n) for axis, n in enumerate(shape))


def _crossing_means(
    values: Floats,
    shape: tuple[int, ...],
    active: NDArray[np.int64],
    codes: NDArray[np.uint8],
    first_vertex: Ints,
) -> NDArray[np.float64]:
    """Grid coordinates (n, 3) of every patch's vertex."""
    cells = np.stack(np.unravel_index(active, shape), axis=1)
    total = int(PATCH_COUNT[codes].astype(np.int64).sum())
    sums, crossings = np.zeros((total, 3)), np.zeros(total)
    for edge, (a, b) in enumerate(EDGES):
        patch = PATCH_OF_EDGE[codes, edge]
        here = np.flatnonzero(patch >= 0)
        ends = [cells[here] + [corner & 1, corner >> 1 & 1, corner >> 2] for corner in (a, b)]
        value_a, value_b = (values[tuple(end.T)].astype(np.float64) for end in ends)
        share = (ISO - value_a) / (value_b - value_a)
        vertex = first_vertex[active[here]] + patch[here]
        crossing = ends[0] + share[:, None] * (ends[1] - ends[0])
        for axis in range(3):
            sums[:, axis] += np.bincount(vertex, crossing[:, axis], minlength=total)
        crossings += np.bincount(vertex, minlength=total)
    return sums / np.maximum(crossings, 1.0)[:, None]


def _quads_along(axis: int, inside: NDArray[np.bool_], codes: NDArray[np.uint8], first_vertex: Ints) -> Ints:
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


def _split_quads(quads: Ints, positions: Floats) -> Ints:
    """Two triangles (2m, 3) per quad, along its shorter diagonal."""
    a, b, c, d = quads.T
    first = np.linalg.norm(positions[a] - positions[c], axis=1)
    second = np.linalg.norm(positions[b] - positions[d], axis=1)
    along_ac = np.stack([a, b, c, a, c, d], axis=1)
    along_bd = np.stack([b, c, d, b, d, a], axis=1)
    chosen: Ints = np.where((first <= second)[:, None], along_ac, along_bd).reshape(-1, 3)
    return chosen
