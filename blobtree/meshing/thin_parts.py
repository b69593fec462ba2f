"""Meshes with smaller cells where parts are thin or nearly touch."""

from blobtree.cells.grid import Grid
from blobtree.cells.sparse_cells import build_cells
from blobtree.declare.skeleton import BALL_CELLS
from blobtree.errors import InvalidResolution
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.meshing.mesh import Mesh, download
from blobtree.meshing.polygonizer import (
    DEFAULT_RESOLUTION,
    Polygonizer,
    cell_size_of,
    grid_around,
    load_kernels,
    sharpened,
)
from blobtree.meshing.vertex_kernels import place_vertices
from blobtree.progress import Cancel, Progress, reporting
from blobtree.tape.model import ImplicitModel
from blobtree.tape.operands import has_walls
from blobtree.tape.part_sizes import has_small_parts, has_warps, sized_tape
from blobtree.validation import truth


def polygonize_parts(
    tree: ImplicitModel,
    *,
    resolution: int = DEFAULT_RESOLUTION,
    creases: bool = False,
    device: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Mesh:
    """Return the mesh with cells of `resolution`, and smaller ones where parts are thin, see `polygonize`."""
    from blobtree.meshing.gaps import mesh_without_gaps  # imported here: cells of one size need none

    truth("creases", creases, InvalidResolution)
    with reporting(progress, cancel) as report:
        size = cell_size_of(tree, resolution, None, device)
        if not shows_thin_parts(tree, resolution, device):
            load_kernels(tree, device, creases, sample_blocks, place_vertices)
            cells = build_cells(tree.tape, grid_around(tree, size, device), device=device, report=report)
            mesh = mesh_without_gaps(cells, report)
            if mesh is not None:
                return download(*sharpened(mesh, creases, report))
        return _mesh_of_thin_parts(tree, size, creases, device, report)


def shows_thin_parts(tree: ImplicitModel, resolution: int, device: str | None) -> bool:
    """Return True if cells of `resolution` do not show a part or a wall of a tree."""
    return shows_small_parts(tree, resolution, BALL_CELLS, device) or has_walls(tree._program)


def shows_small_parts(tree: ImplicitModel, resolution: int, size: float, device: str | None) -> bool:
    """Return True if a part is thinner than `size` cells of `resolution`; where there are warps, look."""
    cell = cell_size_of(tree, resolution, None, device)
    small = has_small_parts(tree, size * cell)
    if not small or not has_warps(tree):
        return small
    from blobtree.meshing.parts import PART_KERNELS, least_size  # imported here, as above

    load_kernels(tree, device, False, *PART_KERNELS)
    cells = build_cells(sized_tape(tree), grid_around(tree, cell, device), device=device)
    return least_size(cells, 0.0) < size * cell


def _mesh_of_thin_parts(
    tree: ImplicitModel, size: float, creases: bool, device: str | None, report: Progress
) -> Mesh:
    """Return a mesh that shows thin parts; the cells of all others have the given size."""
    from blobtree.meshing.parts import PART_KERNELS  # imported here, as above
    from blobtree.meshing.thickening import mesh_of_thin_parts

    def uniform(model: ImplicitModel) -> Mesh:
        return Polygonizer(model, cell_size=size, creases=creases, device=device, progress=report).mesh

    def grid_of(model: ImplicitModel, scale: float) -> Grid:
        return grid_around(model, scale * size, device)

    load_kernels(tree, device, creases, *PART_KERNELS)
    return mesh_of_thin_parts(tree, grid_of, uniform, device, creases, report)
