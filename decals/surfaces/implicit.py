"""`ImplicitSurface`: the iso surface of a BlobTree, on the host and on devices."""

from functools import partial
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree import ISO, Node, polygonize
from blobtree._typing import BoolArray, Float32Array, Int64Array
from blobtree.cells.surface_box import longest_side, surface_box
from blobtree.device import known_device, launch
from blobtree.immutable import Immutable
from blobtree.lazy import Lazy
from blobtree.tape.codes import OPERATORS
from blobtree.tracing.trace import trace
from blobtree.tracing.tree_cells import DeviceCells, device_cells, point_cells
from blobtree.validation import describe, point_array
from decals.errors import InvalidMesh, InvalidScattering
from decals.surfaces.curved import CurvedMesh
from decals.surfaces.extras import SMALL_PARTS
from decals.surfaces.mesh import DeviceMeshSurface, MeshSurface, have_area
from decals.surfaces.surface import (
    Scalars,
    Vectors,
    as_rays,
    contains_host,
    project_host,
    vectors,
)
from decals.surfaces.tree_kernels import mark_above, project, project_with_mesh
from decals.surfaces.windings import MeshOrientation, Triangles
from decals.validation import whole_number

FIELD_TOLERANCE = 1e-4
"""Largest field error of a point on the surface, in units of the iso value."""


RESOLUTION = 64
"""Cells of the coarse mesh along the longest side of the surface's box."""

MAX_RESOLUTION = 128
"""Largest number of cells along the longest side of the surface's box in `ImplicitSurface.triangulated`."""

MAX_STEP = 0.5
"""Longest step of Newton's method, in cells."""

LEAST_WAY = 0.2
"""Way of a projected point, in longest steps, from which on it must not be far longer than to the mesh."""

CREASED = frozenset(map(OPERATORS.index, ("union", "intersection", "difference")))
"""Codes of the operators that leave creases; the coarse mesh of other trees needs no search for them."""

MAX_PROJECTION_ROUNDS = 4
"""Runs of Newton's method, each from the result of the one before, in `project_without_mesh`."""


class ImplicitSurface(Immutable):
    """Iso surface of a BlobTree, as a `Surface`.

    Points are projected by Newton's method along the exact field gradient. Where the field is flat, or the
    distance too large, they start at the closest point of a coarse mesh, which has the creases of unions,
    intersections and differences. Its cells are smaller where parts are thin. Bounds are those of the coarse
    mesh, and so is the area, but for parts that are small beside the model.

    Parameters
    ----------
    tree : blobtree.Node
        The model.
    resolution : int, optional
        Cells of the coarse mesh along the longest side of the tree's support, all of one size: parts thinner
        than a cell may get no samples. By default 64, and smaller cells where parts are thin.
    device : str, optional
        Warp device for queries of the host, except `raycast`. Default "cpu".

    Raises
    ------
    InvalidMesh
        The tree has no surface at this resolution.
    InvalidDevice
        Warp has no such device.

    See Also
    --------
    MeshSurface : the surface of a triangle mesh.

    Examples
    --------
    >>> import blobtree, decals
    >>> ball = decals.surfaces.ImplicitSurface(blobtree.Point((0, 0, 0), radius=2.0), resolution=16)
    >>> positions, normals = ball.project([[0, 0, 3]])
    >>> positions.round(3).tolist()
    [[0.0, 0.0, 2.0]]
    >>> ball.contains([[0, 0, 1.5], [0, 0, 2.5]])
    array([ True, False])
    """

    def __init__(self, tree: Node, *, resolution: int | None = None, device: str = "cpu") -> None:
        if not isinstance(tree, Node):
            raise InvalidMesh(f"tree: expected a BlobTree, got {describe(tree)}; meshes go into MeshSurface")
        if resolution is not None:
            whole_number("resolution", resolution, 1, None, InvalidScattering)
        self.tree, self.device = tree, known_device(device)
        creases = not CREASED.isdisjoint(tree.tape.operators)
        coarse = polygonize(tree, resolution=resolution, creases=creases, device=device)
        cells = RESOLUTION if resolution is None else resolution
        if not have_area(Triangles.of(coarse.vertices, coarse.faces)).any():
            raise InvalidMesh(
                f"expected a tree with a surface, got none in {cells} cells; its parts may be too small, "
                "or cut each other away, or the largest field value may be just the iso value"
            )
        self._finds_parts = resolution is None and bool(SMALL_PARTS)
        self.has_small_parts = self._finds_parts and SMALL_PARTS["find"](
            tree, cells, _cell_size(tree, cells), device
        )
        """True if parts of the tree are small beside it, not only what is cut out of it."""
        self._coarse = (
            CurvedMesh(coarse, partial(_marked, tree, ISO, device), device=device)
            if self.has_small_parts
            else MeshSurface(coarse.vertices, coarse.faces, device=device, orientation=MeshOrientation.KEEP)
        )
        self._max_step = MAX_STEP * _cell_size(tree, cells)

    def __repr__(self) -> str:
        return f"ImplicitSurface({self.tree!r})"

    @Lazy
    def _on_devices(self) -> dict[str, "DeviceImplicitSurface"]:
        return {}

    def triangulated(self, cell: float) -> MeshSurface:
        """Return a mesh of the surface with creases and cells of at most this size, within MAX_RESOLUTION.

        The mesh of a resolution stays the same as long as something holds it.
        """
        cells = longest_side(surface_box(self.tree)) / max(cell, 1e-30)
        resolution = RESOLUTION if cells <= RESOLUTION else MAX_RESOLUTION
        mesh = self._meshes.get(resolution)
        if mesh is None:
            refine = SMALL_PARTS["mesh"] if self._finds_parts else polygonize
            fine = refine(self.tree, resolution=resolution, creases=True, device=self.device)
            mesh = MeshSurface(
                fine.vertices, fine.faces, device=self.device, orientation=MeshOrientation.KEEP
            )
        return self._meshes.setdefault(resolution, mesh)

    @Lazy
    def _meshes(self) -> WeakValueDictionary[int, MeshSurface]:
        return WeakValueDictionary()

    @property
    def mesh(self) -> MeshSurface:
        """Coarse mesh of the surface."""
        return self._coarse

    @property
    def area(self) -> float:
        """Area of the coarse mesh."""
        return self._coarse.area

    @property
    def bounds(self) -> tuple[Float32Array, Float32Array]:
        """Corners of the box around the coarse mesh."""
        return self._coarse.bounds

    def sample(self, count: int, seed: int) -> tuple[Float32Array, Float32Array]:
        """Return points and normals, see `Surface.sample`.

        Points are uniform by area on the coarse mesh, and then projected onto the surface.
        """
        return self.project(self._coarse.sample(count, seed)[0])

    def on(self, device: str) -> "DeviceImplicitSurface":
        """Return the surface in the memory of a device; later calls return the same object.

        Raises
        ------
        InvalidDevice
            There is no such device.
        """
        device = known_device(device)
        if device not in self._on_devices:
            least_way = LEAST_WAY * self._max_step if self.has_small_parts else np.inf
            self._on_devices[device] = DeviceImplicitSurface(
                self.tree, self._coarse.on(device), self._max_step, least_way
            )
        return self._on_devices[device]

    def parts(self, points: Float32Array) -> Int64Array:
        """Return the leaf whose surface is nearest to each of the points (n,); 0 for trees of many leaves."""
        leaves: Int64Array = SMALL_PARTS["nearest"](self.tree, points)
        return leaves

    def project(
        self, points: ArrayLike, *, within: Float32Array | None = None
    ) -> tuple[Float32Array, Float32Array]:
        """Return surface points near the points, by Newton's method, and normals; see `Surface.project`."""
        return project_host(self.on(self.device), points, within, self.device)

    def normal(self, points: ArrayLike) -> Float32Array:
        """Return the normals of the surface where it is closest to the points."""
        return self.project(points)[1]

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Float32Array:
        """Return distances to the first points inside, 0 for rays that start there; see `Surface.raycast`."""
        starts, headings = as_rays(origins, directions)
        distances = np.full(len(starts), np.inf, np.float32)
        valid = headings.any(axis=1)
        if valid.any():
            distances[valid] = trace(self.tree, starts[valid], headings[valid])
        return distances

    def contains(self, points: ArrayLike) -> BoolArray:
        """Return True for each point whose field is above the iso value, ``bool[n]``."""
        return contains_host(self.on(self.device), points, self.device)


class DeviceImplicitSurface:
    """Cells of a tree, and the coarse mesh from which points start again, on one device."""

    def __init__(
        self, tree: Node, coarse: DeviceMeshSurface, max_step: float, least_way: float = np.inf
    ) -> None:
        self._least_way = least_way
        self.device = coarse.device
        self._tree, self._project = tree, tree.tape.instruction_set.kernel_for(project_with_mesh)
        self._coarse, self._max_step = coarse, max_step

    @Lazy
    def _cells(self) -> DeviceCells:
        return point_cells(self._tree, self.device).on(self.device)

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Write the points that Newton's method reaches, and the normals of the field there."""
        inputs: list[Any] = [self._cells.arrays, self._max_step, FIELD_TOLERANCE * ISO]
        inputs += [*self._coarse.query_inputs, self._least_way, points]
        launch(self._project, len(points), inputs, [positions, normals], device=self.device)

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Write 1 where the field is above the iso value."""
        _mark(self._tree, np.nextafter(np.float32(ISO), np.float32(1.0)), points, flags)


def _mark(tree: Node, least: float, points: Vectors, flags: Scalars) -> None:
    """Write 1 where the field is at least `least`, see `mark_above`."""
    device = str(points.device)
    kernel = tree.tape.instruction_set.kernel_for(mark_above)
    launch(kernel, len(points), [device_cells(tree, device=device).arrays, least, points], [flags], device)


def _marked(tree: Node, least: float, device: str, points: Float32Array) -> BoolArray:
    """Return True for each point where the field is at least `least`, see `mark_above`."""
    flags: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    _mark(tree, least, vectors(points, device), flags)
    marked: BoolArray = flags.numpy() == 1
    return marked


def _cell_size(tree: Node, resolution: int) -> float:
    """Return the size of the cells of a uniform mesh."""
    return longest_side(surface_box(tree)) / resolution


def project_without_mesh(
    tree: Node, points: ArrayLike, *, device: str = "cpu"
) -> tuple[Float32Array, Float32Array] | None:
    """Return surface points near the points and the normals there, without an `ImplicitSurface`.

    Results equal those of `ImplicitSurface.project`, except for points that it starts again at its mesh:
    these go on along the gradient.

    Returns
    -------
    positions, normals : float32[n, 3]
        None if there are no points, or if a point does not reach the surface.
    """
    positions = point_array(points).copy()
    normals = np.zeros_like(positions)
    rows = np.arange(len(positions))
    for _ in range(MAX_PROJECTION_ROUNDS):
        positions[rows], normals[rows], arrived = _approach(tree, positions[rows], device)
        rows = rows[~arrived]
    return (positions, normals) if len(positions) and not len(rows) else None


def _approach(tree: Node, points: Float32Array, device: str) -> tuple[Float32Array, Float32Array, BoolArray]:
    """Run Newton's method; return positions, normals, and True for each point that reached the surface."""
    tape = tree.tape.on(device)
    positions: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    normals: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    arrived: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    inputs = [
        tape.data,
        tape.span,
        MAX_STEP * _cell_size(tree, RESOLUTION),
        FIELD_TOLERANCE * ISO,
        vectors(points, device),
    ]
    kernel = tree.tape.instruction_set.kernel_for(project)
    launch(kernel, len(points), inputs, [positions, normals, arrived], device=device)
    return positions.numpy(), normals.numpy(), arrived.numpy() == 1
