"""`Polygonizer`: the surface of a field as a triangle mesh, with cells of one size.

Dual marching cubes (Nielson 2004) on sparse cells: one vertex per patch of surface in a cell, projected onto
the surface by Newton's method. The cost grows with the area of the surface, and vertices lie on the surface
as exactly as float32 can tell.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.cells.grid import Grid, aligned_grid
from blobtree.cells.sparse_cells import CELL_KERNELS, build_cells
from blobtree.cells.surface_box import MAX_SIDE, MIN_SIDE, longest_side, surface_box
from blobtree.device import known_device
from blobtree.errors import InvalidResolution
from blobtree.kernels import load_together
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.meshing.mesh import DeviceMesh, Mesh, download, extract_mesh
from blobtree.meshing.vertex_kernels import place_vertices
from blobtree.progress import Cancel, Progress, reporting
from blobtree.tape.model import ImplicitModel, checked_tree
from blobtree.validation import LARGEST_NUMBER, describe, is_whole, real_number, truth

DEFAULT_RESOLUTION = 64

MAX_RESOLUTION = 1 << 20
"""Cells along a side beyond which 32 bits cannot hold their coordinates."""

Sharpened: TypeAlias = tuple[DeviceMesh, NDArray[np.uint8] | None]
"""A mesh with vertices on creases, and the number of sheets that meet in each."""

SHARPENERS: list[tuple[Callable[[], wp.Kernel], Callable[[DeviceMesh, Progress], Sharpened]]] = []
"""What moves vertices onto creases: a kernel to load, and a function; `creases` adds its own."""


def load_kernels(tree: ImplicitModel, device: str | None, creases: bool, *kernels: wp.Kernel) -> None:
    """Load kernels of meshing, and those for cells and creases, so that they compile at the same time."""
    instruction_set = tree.tape.instruction_set
    together = [*kernels, *CELL_KERNELS]
    if creases and not instruction_set.reads_gradients:
        together[:0] = [kernel() for kernel, _ in SHARPENERS]
    load_together(map(instruction_set.kernel_for, together), known_device(device))


class Polygonizer:
    """The mesh of a tree that is being edited, of which an update computes the changed parts alone.

    Each mesh is the one that `polygonize` returns for that tree and `cell_size`, bit for bit. The caller need
    not say what was edited: blocks of cells are compared by the primitives and operators that act in them.
    Cells are counted from the world's origin, so the grid stays in place while the model changes its size.

    Parameters
    ----------
    tree, resolution, cell_size, creases, device, progress, cancel
        As for `polygonize`. `resolution` sets the cell size by the box of the first tree.

    Raises
    ------
    InvalidNode, InvalidDevice, InvalidResolution, Cancelled
        As for `polygonize`. If an update raises, the last mesh stays.

    Examples
    --------
    >>> from blobtree import Point, Polygonizer
    >>> polygonizer = Polygonizer(Point((0, 0, 0), radius=1.0), resolution=16)
    >>> before = len(polygonizer.mesh.vertices)
    >>> after = len(polygonizer.update(Point((0, 0, 0), radius=2.0)).vertices)
    >>> after > 3 * before  # four times the area in cells of the same size
    True
    """

    def __init__(
        self,
        tree: ImplicitModel,
        *,
        resolution: int | None = None,
        cell_size: float | None = None,
        creases: bool = False,
        device: str | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> None:
        checked_tree(tree)
        self._device = device
        self._creases = truth("creases", creases, InvalidResolution)
        self._cell_size = cell_size_of(tree, resolution, cell_size, device)
        with reporting(progress, cancel) as report:
            load_kernels(tree, device, self._creases, sample_blocks, place_vertices)
            self._dual_mesh, self._device_mesh, self._sheet_counts = self._extract(tree, None, report)
        self._tree = tree
        self._mesh: Mesh | None = None

    @property
    def tree(self) -> ImplicitModel:
        """The tree of the mesh."""
        return self._tree

    @property
    def cell_size(self) -> float:
        """Side of a cell, in the model's units."""
        return self._cell_size

    @property
    def dual_mesh(self) -> DeviceMesh:
        """The triangles in the device's memory, before vertices are moved onto creases."""
        return self._dual_mesh

    @property
    def device_mesh(self) -> DeviceMesh:
        """The triangles in the device's memory, with vertices on creases if these were asked for."""
        return self._device_mesh

    @property
    def mesh(self) -> Mesh:
        """The triangles as NumPy arrays."""
        if self._mesh is None:
            self._mesh = download(self._device_mesh, self._sheet_counts)
        return self._mesh

    def update(
        self, tree: ImplicitModel, *, progress: Progress | None = None, cancel: Cancel | None = None
    ) -> Mesh:
        """Return the mesh of `tree`, in which unchanged parts are copied; creases are computed again."""
        self.update_device_mesh(tree, progress=progress, cancel=cancel)
        return self.mesh

    def update_device_mesh(
        self, tree: ImplicitModel, *, progress: Progress | None = None, cancel: Cancel | None = None
    ) -> DeviceMesh:
        """Do the same as `update`, and leave the triangles on the device."""
        checked_tree(tree)
        with reporting(progress, cancel) as report:
            extracted = self._extract(tree, self._dual_mesh, report)
        self._dual_mesh, self._device_mesh, self._sheet_counts = extracted
        self._tree, self._mesh = tree, None
        return self._device_mesh

    def _extract(
        self, tree: ImplicitModel, previous: DeviceMesh | None, report: Progress
    ) -> tuple[DeviceMesh, DeviceMesh, NDArray[np.uint8] | None]:
        """Return `dual_mesh`, `device_mesh` and the sheet counts of the vertices."""
        grid = grid_around(tree, self._cell_size, self._device)
        old_cells = previous.cells if previous is not None else None
        cells = build_cells(tree.tape, grid, device=self._device, previous=old_cells, report=report)
        mesh = extract_mesh(cells, report, previous)
        return mesh, *sharpened(mesh, self._creases, report)


def sharpened(mesh: DeviceMesh, creases: bool, report: Progress) -> Sharpened:
    """Return a mesh with vertices on creases if asked for, and its sheet counts."""
    sheet_counts = None
    for _, sharpen in SHARPENERS if creases else ():
        mesh, sheet_counts = sharpen(mesh, report)
    return mesh, sheet_counts


def cell_size_of(
    tree: ImplicitModel, resolution: int | None, cell_size: float | None, device: str | None
) -> float:
    """Return the side of a cell from `resolution` or `cell_size`, once it is checked."""
    longest = longest_side(surface_box(tree, device))
    if resolution is not None and cell_size is not None:
        raise InvalidResolution("expected either resolution or cell_size, got both; drop one")
    if cell_size is None:
        cells = DEFAULT_RESOLUTION if resolution is None else resolution
        if not is_whole(cells) or not 1 <= cells <= MAX_RESOLUTION:
            raise InvalidResolution(
                f"resolution: expected a whole number of cells from 1 to {MAX_RESOLUTION:,}, "
                f"got {describe(resolution)}"
            )
        cell_size = longest / int(cells)
    cell_size = above_zero("cell_size", "size", cell_size)
    if not MIN_SIDE < longest < MAX_SIDE:
        raise InvalidResolution(
            f"the model is {longest:.3g} long; between {MIN_SIDE:g} and {MAX_SIDE:g} float32 can "
            "square its distances: scale it"
        )
    if longest / cell_size > MAX_RESOLUTION:
        raise InvalidResolution(
            f"cell_size: expected at most {MAX_RESOLUTION:,} cells along the model, got "
            f"{longest / cell_size:.3g} with cells of {cell_size:g}; take larger cells"
        )
    return cell_size


def above_zero(name: str, noun: str, value: object) -> float:
    """Return `value` as a finite number above zero; raise `InvalidResolution` otherwise."""
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not 0.0 < number <= LARGEST_NUMBER:
        raise InvalidResolution(f"{name}: expected a finite {noun} above 0, got {describe(value)}")
    return number


def grid_around(tree: ImplicitModel, cell_size: float, device: str | None) -> Grid:
    """Return cells around the surface's box, and one more on every side so that the surface is closed."""
    lower, upper = (corner.astype(np.float64) for corner in surface_box(tree, device))
    return aligned_grid(lower - cell_size, upper + cell_size, cell_size)
