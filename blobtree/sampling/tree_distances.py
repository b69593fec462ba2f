"""Signed distances from the surface of a tree."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, FloatArray
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import ISO
from blobtree.meshing.polygonize import polygonize
from blobtree.sampling.mesh_distances import DistanceMeter, Triangles
from blobtree.tape.model import ImplicitModel, checked_tree, gradients_at
from blobtree.validation import points_or_point

SAFETY = 1.1
"""Stated error over the largest gap that was found. Between the middles the gap may be a little larger."""


@dataclass(frozen=True, eq=False)
class SignedDistances:
    """Distances of points from a surface.

    Attributes
    ----------
    values
        float32[n], below 0 inside; a number for one point.
    error
        Distance, in model units, by which the values differ from exact ones at most. It is 1.1 times the
        largest gap between the surface and the mesh to which distances are measured, estimated by gradients
        at the middles of all triangles and edges. Parts that the mesh misses are not in it.

    Examples
    --------
    >>> from blobtree import Point, to_sdf
    >>> from blobtree.sampling import SignedDistances
    >>> distances = to_sdf(Point((0, 0, 0), radius=1.0), [[3, 0, 0]], resolution=32)
    >>> isinstance(distances, SignedDistances), bool(abs(distances.values[0] - 2.0) <= distances.error)
    (True, True)
    """

    values: Float32Array
    error: float


def to_sdf(tree: ImplicitModel, points: ArrayLike, *, resolution: int = 64) -> SignedDistances:
    """Return the signed distances of points from the surface of a tree.

    Distances are measured to a mesh of the surface. Parts of the surface that are thinner than a cell of the
    mesh may be missed, such as the tip of a cone: there, errors may be a few times the stated one. The error
    falls with the square of the resolution.

    Parameters
    ----------
    tree : Node
        The tree.
    points : array-like (n, 3), or (3,) for one point
        Points, in model units; those of a grid give distances for `from_sdf`.
    resolution : int
        Cells along the longest side of the tree's support.

    Returns
    -------
    SignedDistances
        The distances, below 0 inside, and their error.

    Raises
    ------
    InvalidNode
        `tree` is no tree, or has no surface.
    InvalidPoints
        The points are not n rows of three finite numbers.
    InvalidResolution
        The resolution is out of range.

    Examples
    --------
    >>> from blobtree import Point, to_sdf
    >>> distances = to_sdf(Point((0, 0, 0), radius=1.0), [[2, 0, 0], [0.5, 0, 0]])
    >>> distances.values.round(2).tolist(), distances.error < 0.01
    ([1.0, -0.5], True)
    """
    array, single = points_or_point(points)
    meter = TreeMeter(tree, resolution)
    values = meter.measure(array)
    return SignedDistances(values[0] if single else values, meter.error)


class TreeMeter:
    """Measures signed distances from the surface of a tree.

    Attributes
    ----------
    error : float
        See `SignedDistances`.
    """

    def __init__(self, tree: ImplicitModel, resolution: int) -> None:
        mesh = polygonize(checked_tree(tree), resolution=resolution, creases=True)
        if not len(mesh.faces):
            raise InvalidNode(f"tree: expected a surface, got none in {resolution} cells; take smaller cells")
        self._triangles = Triangles(mesh.vertices, mesh.faces)
        self._meter = DistanceMeter(self._triangles, solid=True)
        self.error = SAFETY * _largest_gap(tree, mesh.vertices[mesh.faces])

    def measure(self, points: FloatArray) -> Float32Array:
        """Return distances of points (n, 3), below 0 inside."""
        lower, upper = self._triangles.lower, self._triangles.upper
        middle = 0.5 * (lower + upper)
        reach = np.abs(points - middle).max(initial=0.0) + np.abs(upper - middle).max()
        return self._meter.measure(points, 2.0 * float(reach))


def _largest_gap(tree: ImplicitModel, corners: Float32Array) -> float:
    """Return the largest distance of the middles of triangles and edges from the surface, by gradients."""
    middles = [corners.mean(axis=1), *(0.5 * (corners[:, k] + corners[:, k - 1]) for k in range(3))]
    found = gradients_at(tree.tape, np.concatenate(middles)).astype(np.float64)
    slopes = np.linalg.norm(found[:, 1:], axis=1)
    gaps = np.abs(found[:, 0] - ISO)[slopes > 0.0] / slopes[slopes > 0.0]
    return float(gaps.max(initial=0.0))
