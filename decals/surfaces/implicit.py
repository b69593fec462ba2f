"""A BlobTree as a surface for decals."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree import ISO, Node, polygonize
from blobtree.launch import launch
from blobtree.tracing.trace import trace
from decals.checks import shown
from decals.errors import InvalidMesh
from decals.surfaces.ground import asked, inside, vectors
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Flags, Floats, as_points, as_rays, as_reaches
from decals.surfaces.tree_ground import ARRIVED, TreeGround
from decals.surfaces.tree_queries import approach
from decals.wishes import device_or_error, whole

RESOLUTION = 64
"""Cells along the longest side of the tree's box from which area and samples are taken."""

STEP = 0.5
"""Longest Newton step, in cells."""

ROUNDS = 4
"""How often Newton's method goes on from where it stopped, before a mesh is asked."""


class ImplicitSurface:
    """The iso surface of a BlobTree: exact points and normals, area and samples from a coarse mesh.

    Points are taken to the surface by Newton's method along the exact field gradient; from where the
    field is flat or the way too long, they start at the closest point of the coarse mesh instead.

    Parameters
    ----------
    tree
        The model.
    resolution
        Cells of the coarse mesh along the longest side of the tree's box. Parts thinner than a cell
        may get no samples.
    device
        Warp device that answers questions of the host, rays aside.

    Raises
    ------
    InvalidMesh
        If the tree has no surface at that resolution.
    """

    def __init__(self, tree: Node, *, resolution: int = RESOLUTION, device: str = "cpu") -> None:
        if not isinstance(tree, Node):
            raise InvalidMesh(f"tree: expected a BlobTree, got {shown(tree)}; meshes go into MeshSurface")
        whole("resolution", resolution, 1)
        self.tree, self.device = tree, device_or_error(device)
        coarse = polygonize(tree, resolution=resolution, device=device)
        if len(coarse.faces) == 0:
            raise InvalidMesh(
                f"expected a tree with a surface, got none in {resolution} cells; "
                "its parts may be too small, or cut each other away"
            )
        self._coarse = MeshSurface(coarse.vertices, coarse.faces, device=device)
        self._longest_step = _longest_step(tree, resolution)
        self._grounds: dict[str, TreeGround] = {}

    def __repr__(self) -> str:
        return f"ImplicitSurface({self.tree!r})"

    @property
    def area(self) -> float:
        """Area of the coarse mesh."""
        return self._coarse.area

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Corners of the box around the coarse mesh."""
        return self._coarse.bounds

    def sample(self, count: int, seed: int) -> tuple[Floats, Floats]:
        """Points uniform by area on the coarse mesh, taken to the surface."""
        return self.project(self._coarse.sample(count, seed)[0])

    def on(self, device: str) -> TreeGround:
        """Return the tree in the memory of a device; it is taken there once."""
        if device not in self._grounds:
            self._grounds[device] = TreeGround(self.tree, self._coarse.on(device), self._longest_step)
        return self._grounds[device]

    def project(self, points: ArrayLike, *, within: Floats | None = None) -> tuple[Floats, Floats]:
        """Surface points near the points and the normals there."""
        queries = as_points(points)
        reaches = as_reaches(within, len(queries))
        return asked(self.on(self.device), queries, reaches, self.device)

    def normal(self, points: ArrayLike) -> Floats:
        """Return the normals of the surface where it is closest to the points."""
        return self.project(points)[1]

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Floats:
        """Distance to the first point inside; 0 for a ray that starts there."""
        starts, ways = as_rays(origins, directions)
        distances = np.full(len(starts), np.inf, np.float32)
        aimed = ways.any(axis=1)
        if aimed.any():
            distances[aimed] = trace(self.tree, starts[aimed], ways[aimed])
        return distances

    def contains(self, points: ArrayLike) -> Flags:
        """Whether the field is above the iso value."""
        return inside(self.on(self.device), as_points(points), self.device)


def _longest_step(tree: Node, resolution: int) -> float:
    low, high = tree.bounds
    return STEP * float((high - low).max()) / resolution


def straight_onto(tree: Node, points: ArrayLike, *, device: str = "cpu") -> tuple[Floats, Floats] | None:
    """Surface points near the points and the normals there, without making an `ImplicitSurface`.

    The same as that gives, but for points from which it would start again at its mesh: those go on along the
    gradient. None where there is no point, or where one does not arrive.
    """
    positions = as_points(points).copy()
    normals = np.zeros_like(positions)
    rows = np.arange(len(positions))
    for _ in range(ROUNDS):
        positions[rows], normals[rows], arrived = _approached(tree, positions[rows], device)
        rows = rows[~arrived]
    return (positions, normals) if len(positions) and not len(rows) else None


def _approached(tree: Node, points: Floats, device: str) -> tuple[Floats, Floats, Flags]:
    """Where Newton's method leads to, the normals there, and whether it arrived."""
    tape = tree.tape.on(device)
    positions: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    normals: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    arrived: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    inputs = [tape.data, tape.span, _longest_step(tree, RESOLUTION), ARRIVED * ISO, vectors(points, device)]
    kernel = tree.tape.vocabulary.kernel(approach)
    launch(kernel, len(points), inputs, [positions, normals, arrived], device=device)
    return positions.numpy(), normals.numpy(), arrived.numpy() == 1
