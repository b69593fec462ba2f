"""What is written on a mesh: densities at its vertices, regions of its vertices or faces."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from decals.checks import instance
from decals.errors import InvalidSeeding
from decals.seeds.population import Density, Mask
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Flags, Floats, as_points
from decals.wishes import numbers

Wide = NDArray[np.float64]

NEAREST = 3
"""Vertices from which a value is interpolated."""


def vertex_density(vertices: MeshSurface | ArrayLike, values: ArrayLike) -> Density:
    """Make a density of values at vertices, for `seed` and `Relaxation`.

    Parameters
    ----------
    vertices
        A mesh, in whose faces values are interpolated linearly; or ``float[n, 3]`` alone, between which the
        nearest three are blended by inverse distance, so that at a vertex its value holds.
    values
        ``float[n]``, above zero.

    Raises
    ------
    InvalidSeeding
        If values and vertices differ in number, or a value is not finite and above zero.
    """
    places = vertices.vertices if isinstance(vertices, MeshSurface) else as_points(vertices, "vertices")
    given = numbers("values", values)
    if given.shape != (len(places),) or len(places) == 0:
        raise InvalidSeeding(f"values: expected shape [{len(places)}], got {list(given.shape)}; one a vertex")
    if not (np.isfinite(given).all() and (given > 0).all()):
        raise InvalidSeeding("values: expected finite numbers above zero; bar places by a mask")
    return _within(vertices, given) if isinstance(vertices, MeshSurface) else _among(places, given)


def region_mask(surface: MeshSurface, flags: ArrayLike) -> Mask:
    """Make a mask of flags on a mesh: where seeds may lie, for `seed` and `Relaxation`.

    Parameters
    ----------
    surface
        The mesh. Where it has as many faces as vertices, flags are those of the faces.
    flags
        For each face, ``bool[m]``; or for each vertex, ``bool[n]``: then half of the way between a vertex
        inside and one outside belongs to the region.

    Raises
    ------
    InvalidSeeding
        If the surface is no mesh, or flags are not true or false for each face or vertex.
    """
    instance("surface", surface, MeshSurface, InvalidSeeding, "for a tree, give a function of points")
    given, (faces, vertices) = numbers("flags", flags), (len(surface.faces), len(surface.vertices))
    if given.shape not in ((faces,), (vertices,)) or not np.isin(given, (0.0, 1.0)).all():
        raise InvalidSeeding(
            f"flags: expected true or false for each of {faces} faces or {vertices} vertices, "
            f"got shape {list(given.shape)}"
        )
    corners = np.repeat(given[:, None], 3, axis=1) if given.shape == (faces,) else given[surface.faces]

    def mask(points: Floats) -> Flags:
        rows, weights = surface.locate(points)
        inside: Flags = (weights * corners[rows]).sum(axis=1) >= 0.5
        return inside

    return mask


def _within(mesh: MeshSurface, values: Wide) -> Density:
    """Linear interpolation in the closest face."""

    def density(points: Floats) -> Wide:
        faces, weights = mesh.locate(points)
        blended: Wide = (weights * values[mesh.faces[faces]]).sum(axis=1)
        kept: Wide = np.maximum(blended, values.min())  # weights may round below zero
        return kept

    return density


def _among(places: Floats, values: Wide) -> Density:
    """Inverse distances of the nearest vertices."""
    tree = cKDTree(places)
    columns = np.arange(1, min(NEAREST, len(places)) + 1)

    def density(points: Floats) -> Wide:
        distances, indices = tree.query(points, k=columns)
        weights = 1.0 / np.maximum(distances, 1e-9 * (distances[:, -1:] + 1e-30))
        blended: Wide = (weights * values[indices]).sum(axis=1) / weights.sum(axis=1)
        return blended

    return density
