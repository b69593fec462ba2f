"""Field → triangle mesh on sparse cells: one vertex per patch of surface in a cell, Newton onto the surface.

Dual marching cubes (Nielson 2004) over the blocks that the surface may cross, so cost grows with the
surface's area; vertices lie on the surface as exactly as float32 can tell.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .cells import CHILDREN, SparseCells, build_cells
from .dual import SAMPLES, classify_cells, connect_vertices, place_vertices, sample_blocks, settle_rows
from .errors import InvalidResolution
from .launch import launch
from .patches import KNOTTED_FACE, PATCH_COUNT, PATCH_OF_EDGE
from .progress import Progress
from .tree import Node

DEFAULT_RESOLUTION = 64
FINEST_RESOLUTION = 1 << 20
"""Cells along a side beyond which their places do not fit into 32 bits."""

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: float32[n, 3] `vertices`, outward unit `normals` and `colors`; int32[m, 3] `faces`."""

    vertices: Floats
    faces: Ints
    normals: Floats
    colors: Floats


def polygonize(
    tree: Node,
    *,
    resolution: int | None = None,
    cell_size: float | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """The surface of `tree` as closed, consistently oriented triangles (counter-clockwise from outside).

    Parameters
    ----------
    resolution
        Cells along the longest side of the tree's box; 64 by default.
    cell_size
        Side of a cell in the model's units, in place of `resolution`; thinner features may be lost.
    device
        Warp device that does the work, by default the current one.

    Raises
    ------
    InvalidResolution
        Both or a senseless value were given, or more cells than can be counted.
    """
    report = progress or (lambda _stage, _fraction: None)
    size = _cell_size(tree, resolution, cell_size)
    report("finding the surface", 0.0)
    cells = build_cells(tree.tape, _grid_box(tree, size), size, device=device)
    report("finding the surface", 1.0)
    return mesh_cells(cells, report)


def _cell_size(tree: Node, resolution: int | None, cell_size: float | None) -> float:
    """Side of a cell that the caller asked for in one way or the other."""
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
    if longest / cell_size > FINEST_RESOLUTION:
        raise InvalidResolution(
            f"cell_size: {cell_size:g} makes {longest / cell_size:.3g} cells along the model, at most "
            f"{FINEST_RESOLUTION:,} can be counted; take larger cells"
        )
    return float(cell_size)


def _grid_box(tree: Node, cell_size: float) -> tuple[Floats, Floats]:
    """The box of influence, one cell wider so that the grid's rim lies outside the surface."""
    lower, upper = tree.bounds
    return lower - np.float32(cell_size), upper + np.float32(cell_size)


def mesh_cells(cells: SparseCells, report: Progress) -> Mesh:
    """The triangles of the surface in `cells`."""
    leaves, device = cells.leaves, cells.device
    count = len(leaves)
    geometry = [leaves.blocks, leaves.spans, leaves.tape, wp.vec3(*cells.origin), cells.cell_size]
    tables = _tables(device)

    def array(size: int, dtype: Any) -> Any:
        return wp.empty(size, dtype=dtype, device=device)

    report("sampling the field", 0.0)
    values = array(count * SAMPLES, wp.float32)
    launch(cells.vocabulary.kernel(sample_blocks), count * SAMPLES, geometry, [values], device)
    codes = array(count * CHILDREN, wp.uint8)
    quad_counts, vertex_counts = array(count, wp.int32), array(count, wp.int32)
    launch(classify_cells, count, [values], [codes, quad_counts], device)
    rows = array(count * CHILDREN, wp.int16)
    inputs: list[Any] = [leaves.blocks, codes, tables.patch_count, tables.knotted_face]
    launch(settle_rows, count, inputs, [rows, vertex_counts], device)
    report("sampling the field", 1.0)
    vertex_starts, vertex_total = _starts(vertex_counts, device)
    quad_starts, quad_total = _starts(quad_counts, device)
    first_vertices = array(count * CHILDREN, wp.int32)
    positions, normals, colors = (array(vertex_total, wp.vec3) for _ in range(3))
    report("placing vertices", 0.0)
    inputs = [*geometry, values, rows, tables.patch_count, tables.patch_of_edge, vertex_starts]
    outputs = [first_vertices, positions, normals, colors]
    launch(cells.vocabulary.kernel(place_vertices), count, inputs, outputs, device)
    report("placing vertices", 1.0)
    faces = array(2 * quad_total, wp.vec3i)
    inputs = [leaves.blocks, rows, tables.patch_of_edge, quad_starts, first_vertices, positions]
    launch(connect_vertices, count, inputs, [faces], device)
    report("connecting vertices", 1.0)
    return Mesh(positions.numpy(), faces.numpy(), normals.numpy(), colors.numpy())


@dataclass(frozen=True)
class _Tables:
    """`patches`' tables in a device's memory."""

    patch_count: Any
    patch_of_edge: Any
    knotted_face: Any


@cache
def _tables(device: str) -> _Tables:
    return _Tables(
        wp.array(PATCH_COUNT, dtype=wp.int8, device=device),
        wp.array(PATCH_OF_EDGE.ravel(), dtype=wp.int8, device=device),
        wp.array(KNOTTED_FACE, dtype=wp.int8, device=device),
    )


def _starts(counts: Any, device: str) -> tuple[Any, int]:
    """Where each block's share begins, with one more place for the end; and the total."""
    ends = np.cumsum(counts.numpy(), dtype=np.int64)
    total = int(ends[-1]) if len(ends) else 0
    if total > np.iinfo(np.int32).max:
        raise InvalidResolution(f"{total:,} vertices cannot be numbered in 32 bits; take larger cells")
    return wp.array(np.concatenate([[0], ends]).astype(np.int32), dtype=wp.int32, device=device), total
