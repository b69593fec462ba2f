"""A BlobTree as a surface for decals."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import ISO, Node, polygonize
from blobtree.project import project
from blobtree.trace import trace
from decals.errors import InvalidMesh
from decals.mesh_surface import MeshSurface
from decals.surface import Flags, Floats, as_points, as_rays

RESOLUTION = 64
"""Cells along the longest side of the tree's box from which area and samples are taken."""

STEP = 0.5
"""Longest Newton step, in cells."""

ARRIVED = 1e-4
"""Largest field error, in units of the iso value, of a point that has reached the surface."""


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

    Raises
    ------
    InvalidMesh
        If the tree has no surface at that resolution.
    """

    def __init__(self, tree: Node, *, resolution: int = RESOLUTION) -> None:
        self.tree = tree
        coarse = polygonize(tree, resolution=resolution)
        if len(coarse.faces) == 0:
            raise InvalidMesh(
                f"expected a tree with a surface, got none in {resolution} cells; "
                "its parts may be too small, or cut each other away"
            )
        self._coarse = MeshSurface(coarse.vertices, coarse.faces)
        low, high = tree.bounds
        self._longest_step = STEP * float((high - low).max()) / resolution

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

    def project(self, points: ArrayLike, *, within: Floats | None = None) -> tuple[Floats, Floats]:
        """Surface points near the points and the normals there."""
        queries = as_points(points)
        positions, normals, lost = self._descend(queries)
        if lost.any():
            starts, coarse_normals = self._coarse.project(queries[lost])
            found, found_normals, still = self._descend(starts)
            positions[lost] = np.where(still[:, None], starts, found)
            normals[lost] = np.where(still[:, None], coarse_normals, found_normals)
        return positions, normals

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
        queries = as_points(points)
        low, high = self.tree.bounds
        inside: Flags = np.all((queries >= low) & (queries <= high), axis=1)
        if inside.any():
            inside[inside] = self.tree(queries[inside]) > ISO
        return inside

    def _descend(self, starts: Floats) -> tuple[Floats, Floats, Flags]:
        """Newton's method: positions, normals, and which of them did not arrive."""
        if len(starts) == 0:
            return starts.copy(), starts.copy(), np.zeros(0, np.bool_)
        positions, normals = project(self.tree.tape, starts, self._longest_step)
        errors: NDArray[np.float32] = np.abs(self.tree(positions) - ISO)
        return positions, normals, (errors > ARRIVED * ISO) | ~normals.any(axis=1)
