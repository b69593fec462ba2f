"""Field → triangle mesh on sparse cells: one vertex per patch of surface in a cell, Newton onto the surface.

Dual marching cubes (Nielson 2004) over the blocks that the surface may cross, so cost grows with the
surface's area; vertices lie on the surface as exactly as float32 can tell.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .cells import build_cells
from .creases import sharpened
from .errors import InvalidResolution
from .grid import Grid, aligned_grid
from .progress import Progress
from .surface import Surface, extract_surface
from .tree import Node

DEFAULT_RESOLUTION = 64
FINEST_RESOLUTION = 1 << 20
"""Cells along a side beyond which their places do not fit into 32 bits."""

SMALLEST_MODEL, LARGEST_MODEL = 1e-15, 1e15
"""Sizes between which squared distances, in cells too, neither vanish nor overflow in float32."""

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: float32[n, 3] `vertices`, outward unit `normals` and `colors`; int32[m, 3] `faces`.

    A normal on a crease is the mean of those on either side.
    """

    vertices: Floats
    faces: Ints
    normals: Floats
    colors: Floats
    meetings: NDArray[np.uint8] | None = None
    """Where creases were asked for, how many smooth pieces meet in each vertex (n,), see `creases`."""


def polygonize(
    tree: Node,
    *,
    resolution: int | None = None,
    cell_size: float | None = None,
    creases: bool = False,
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
    creases
        Vertices lie on the edges and corners that unions, intersections and differences leave.
    device
        Warp device that does the work, by default the current one.

    Raises
    ------
    InvalidResolution
        Both or a senseless value were given, or more cells than can be counted.
    """
    return Polygonizer(
        tree, resolution=resolution, cell_size=cell_size, creases=creases, device=device, progress=progress
    ).mesh


class Polygonizer:
    """The mesh of a tree that is being edited: after an edit only what it touched is made anew.

        polygonizer = Polygonizer(tree, resolution=128)
        show(polygonizer.mesh)
        show(polygonizer.update(edited_tree))

    Every mesh is the one that `polygonize` makes of that tree with this `cell_size`, bit for bit and in the
    same order. Which parts of the tree differ need not be said: blocks of cells are compared by what acts in
    them. Cells count from the world's origin, so the grid stays where it is while the model changes its size.

    Parameters are those of `polygonize`; `resolution` settles the size of the cells by the first tree.

    Raises
    ------
    InvalidResolution
        As for `polygonize`; the last mesh stays.
    """

    def __init__(
        self,
        tree: Node,
        *,
        resolution: int | None = None,
        cell_size: float | None = None,
        creases: bool = False,
        device: str | None = None,
        progress: Progress | None = None,
    ) -> None:
        self._device = device
        self._creases = creases
        self._cell_size = _cell_size(tree, resolution, cell_size)
        self._surface = self._extract(tree, None, progress)
        self._tree = tree
        self._mesh: Mesh | None = None

    @property
    def tree(self) -> Node:
        """The tree that the mesh shows."""
        return self._tree

    @property
    def cell_size(self) -> float:
        """Side of a cell in the model's units."""
        return self._cell_size

    @property
    def surface(self) -> Surface:
        """The triangles as arrays in the device's memory, before vertices go onto creases."""
        return self._surface

    @property
    def mesh(self) -> Mesh:
        """The triangles as NumPy arrays."""
        if self._mesh is None:
            self._mesh = download(*sharpened(self._surface)) if self._creases else download(self._surface)
        return self._mesh

    def update(self, tree: Node, *, progress: Progress | None = None) -> Mesh:
        """The mesh of `tree`, the parts that are as before being taken over."""
        self.update_surface(tree, progress=progress)
        return self.mesh

    def update_surface(self, tree: Node, *, progress: Progress | None = None) -> Surface:
        """The same without bringing the triangles to the host."""
        self._surface = self._extract(tree, self._surface, progress)
        self._tree, self._mesh = tree, None
        return self._surface

    def _extract(self, tree: Node, previous: Surface | None, progress: Progress | None) -> Surface:
        report = progress or (lambda _stage, _fraction: None)
        report("finding the surface", 0.0)
        grid = _grid(tree, self._cell_size)
        before = previous.cells if previous is not None else None
        cells = build_cells(tree.tape, grid, device=self._device, previous=before)
        report("finding the surface", 1.0)
        return extract_surface(cells, report, previous)


def download(surface: Surface, meetings: NDArray[np.uint8] | None = None) -> Mesh:
    """The triangles of a surface as NumPy arrays."""
    arrays = [surface.vertices, surface.faces, surface.normals, surface.colors]
    vertices, faces, normals, colors = map(_on_host, arrays)
    return Mesh(vertices, faces, normals, colors, meetings)


def _on_host(array: Any) -> Any:
    """A device's vectors as NumPy array; the CPU's own memory is handed out as it is.

    NumPy takes large arrays in large pages, which a graphics card fills far faster than Warp's small ones.
    """
    if array.device.is_cpu:
        return array.numpy()
    host = np.empty((len(array), 3), np.int32 if array.dtype == wp.vec3i else np.float32)
    wp.copy(wp.array(host, dtype=array.dtype, device="cpu", copy=False), array)
    wp.synchronize_device(array.device)
    return host


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
    if not SMALLEST_MODEL < longest < LARGEST_MODEL:
        raise InvalidResolution(
            f"the model is {longest:.3g} long; between {SMALLEST_MODEL:g} and {LARGEST_MODEL:g} float32 can "
            "square its distances: scale it"
        )
    if longest / cell_size > FINEST_RESOLUTION:
        raise InvalidResolution(
            f"cell_size: {cell_size:g} makes {longest / cell_size:.3g} cells along the model, at most "
            f"{FINEST_RESOLUTION:,} can be counted; take larger cells"
        )
    return float(cell_size)


def _grid(tree: Node, cell_size: float) -> Grid:
    """Cells around the box of influence, one more on every side so that the rim lies outside the surface."""
    lower, upper = (corner.astype(np.float64) for corner in tree.bounds)
    return aligned_grid(lower - cell_size, upper + cell_size, cell_size)
