"""Field → triangle mesh on sparse cells: one vertex per patch of surface in a cell, Newton onto the surface.

Dual marching cubes (Nielson 2004) over the blocks that the surface may cross, so cost grows with the
surface's area; vertices lie on the surface as exactly as float32 can tell.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.errors import InvalidResolution
from blobtree.launch import fresh_memory
from blobtree.meshing.chord import FIRST_RESOLUTION, MOST_PASSES, SMALLEST, finer, largest_error
from blobtree.meshing.creases import sharpened
from blobtree.meshing.surface import Surface, extract_surface
from blobtree.nodes.tree import Node, checked_tree
from blobtree.progress import Cancel, Progress, watched
from blobtree.sparse.cells import build_cells
from blobtree.sparse.grid import Grid, aligned_grid

DEFAULT_RESOLUTION = 64
FINEST_RESOLUTION = 1 << 20
"""Cells along a side beyond which their places do not fit into 32 bits."""

SMALLEST_MODEL, LARGEST_MODEL = 1e-15, 1e15
"""Sizes between which squared distances, in cells too, neither vanish nor overflow in float32."""
_STAGES = (
    "finding the surface",
    "sampling the field",
    "placing vertices",
    "connecting vertices",
    "finding creases",
    "measuring chords",
)
"""What work reports, in order."""

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
    chord_error: float | None = None,
    creases: bool = False,
    device: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Mesh:
    """The surface of `tree` as closed, consistently oriented triangles (counter-clockwise from outside).

    Parameters
    ----------
    resolution
        Cells along the longest side of the tree's box; 64 by default.
    cell_size
        Side of a cell in the model's units, in place of `resolution`; thinner features may be lost.
    chord_error
        In place of either, how far the triangles may lie from the surface, in the model's units. Passes with
        smaller and smaller cells are measured at seven samples in every triangle, until none lies farther.
        Parts of the model thinner than a 32nd of its box may be lost, as in any cells of that size.
    creases
        Vertices lie on the edges and corners that unions, intersections and differences leave.
    device
        Warp device that does the work, by default the current one.
    progress
        Called with a stage in plain words and the fraction done.
    cancel
        Asked many times whether to stop.

    Raises
    ------
    InvalidNode, InvalidDevice
        `tree` or `device` is none.
    InvalidResolution
        Several or senseless sizes were given, more cells than can be counted, or none that are small enough.
    Cancelled
        `cancel` said so.
    """
    checked_tree(tree)
    if chord_error is None:
        return Polygonizer(
            tree,
            resolution=resolution,
            cell_size=cell_size,
            creases=creases,
            device=device,
            progress=progress,
            cancel=cancel,
        ).mesh
    if resolution is not None or cell_size is not None:
        raise InvalidResolution(
            "expected one of resolution, cell_size and chord_error, got several; drop the others"
        )
    chord_error = _above_zero("chord_error", "length", chord_error)
    smallest = SMALLEST * float(np.abs(tree.bounds).max())
    if chord_error < smallest:
        raise InvalidResolution(
            f"chord_error: {chord_error:g} is below what float32 can tell there; allow {smallest:.2g} or more"
        )
    report = watched(progress, cancel)
    tried: list[tuple[float, float]] = []
    size = _cell_size(tree, FIRST_RESOLUTION, None)
    for number in range(1, MOST_PASSES + 1):
        passing = _numbered(report, number)
        polygonizer = Polygonizer(tree, cell_size=size, creases=creases, device=device, progress=passing)
        error = largest_error(polygonizer.shown, passing)
        if error <= chord_error:
            return polygonizer.mesh
        tried.append((size, error))
        size = finer(tried, chord_error)
    raise InvalidResolution(
        f"chord_error: {chord_error:g} was not reached in {MOST_PASSES} passes, the last with cells of "
        f"{tried[-1][0]:g} came to {tried[-1][1]:g}; allow more, or ask for creases where CSG cuts edges"
    )


def _numbered(report: Progress, number: int) -> Progress:
    """Reports of one pass among several, its stages taken together."""
    return lambda stage, fraction: report(
        f"meshing, pass {number}", (_STAGES.index(stage) + fraction) / len(_STAGES)
    )


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
    InvalidNode, InvalidDevice, InvalidResolution, Cancelled
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
        cancel: Cancel | None = None,
    ) -> None:
        checked_tree(tree)
        self._device = device
        self._creases = creases
        self._cell_size = _cell_size(tree, resolution, cell_size)
        self._surface, self._shown, self._meetings = self._extract(tree, None, watched(progress, cancel))
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
    def shown(self) -> Surface:
        """The same with its vertices on creases, where these were asked for."""
        return self._shown

    @property
    def mesh(self) -> Mesh:
        """The triangles as NumPy arrays."""
        if self._mesh is None:
            self._mesh = download(self._shown, self._meetings)
        return self._mesh

    def update(self, tree: Node, *, progress: Progress | None = None, cancel: Cancel | None = None) -> Mesh:
        """The mesh of `tree`, the parts that are as before being taken over; creases are found anew."""
        self.update_surface(tree, progress=progress, cancel=cancel)
        return self.mesh

    def update_surface(
        self, tree: Node, *, progress: Progress | None = None, cancel: Cancel | None = None
    ) -> Surface:
        """The same without bringing the triangles to the host."""
        report = watched(progress, cancel)
        checked_tree(tree)
        self._surface, self._shown, self._meetings = self._extract(tree, self._surface, report)
        self._tree, self._mesh = tree, None
        return self._shown

    def _extract(
        self, tree: Node, previous: Surface | None, report: Progress
    ) -> tuple[Surface, Surface, NDArray[np.uint8] | None]:
        """The surface, how it is shown, and what meets in the vertices then."""
        grid = _grid(tree, self._cell_size)
        before = previous.cells if previous is not None else None
        cells = build_cells(tree.tape, grid, device=self._device, previous=before, report=report)
        surface = extract_surface(cells, report, previous)
        return (surface, *sharpened(surface, report)) if self._creases else (surface, surface, None)


def download(surface: Surface, meetings: NDArray[np.uint8] | None = None) -> Mesh:
    """The triangles of a surface as NumPy arrays."""
    arrays = [surface.vertices, surface.faces, surface.normals, surface.colors]
    vertices, faces, normals, colors = map(_on_host, arrays)
    return Mesh(vertices, faces, normals, colors, meetings)


def _on_host(array: Any) -> Any:
    """A device's vectors as NumPy array; the CPU's own memory is handed out as it is."""
    if array.device.is_cpu:
        return array.numpy()
    host = fresh_memory((len(array), 3), np.int32 if array.dtype == wp.vec3i else np.float32)
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
    cell_size = _above_zero("cell_size", "size", cell_size)
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
    return cell_size


def _above_zero(name: str, noun: str, value: object) -> float:
    """`value` as a finite number above zero; InvalidResolution otherwise."""
    try:
        number = float(cast(Any, value))
    except (TypeError, ValueError):
        number = np.nan
    if not 0.0 < number < np.inf:
        raise InvalidResolution(f"{name}: expected a finite {noun} above 0, got {value!r}")
    return number


def _grid(tree: Node, cell_size: float) -> Grid:
    """Cells around the box of influence, one more on every side so that the rim lies outside the surface."""
    lower, upper = (corner.astype(np.float64) for corner in tree.bounds)
    return aligned_grid(lower - cell_size, upper + cell_size, cell_size)
