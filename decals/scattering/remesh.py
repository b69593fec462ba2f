"""Vertices of a uniform remesh as positions of decals, the alternative that the paper names."""

import warnings
from importlib import import_module
from typing import Any

import numpy as np

from blobtree._typing import Float32Array
from decals.errors import InvalidScattering
from decals.surfaces.convert import Model, as_mesh_surface
from decals.surfaces.surface import Surface
from decals.validation import count_number

VERTICES_PER_CLUSTER = 12
"""Vertices that a mesh needs for each cluster; coarser meshes are subdivided first."""

MAX_SUBDIVISIONS = 6

MAX_POINTS = 1_000_000
"""Largest number of points of a remesh; clustering takes a minute for so many."""


def remeshed_points(surface: Model | Surface, count: int) -> Float32Array:
    """Return the vertices of a uniform remesh, projected back onto the mesh.

    The remesh uses approximated centroidal Voronoi diagrams (Valette and Chassery 2004) of pyacvd. Pass the
    points to `scatter` as `fixed`, and their number as `count`. Particles that repel each other lie more
    evenly. A remesh keeps the connectivity of the mesh, so it never mixes two sides of a wall.

    Parameters
    ----------
    surface : Model
        A mesh of any kind that `scatter` takes.
    count : int
        Approximate number of points, from 4 to 1,000,000.

    Returns
    -------
    float32[n, 3]

    Raises
    ------
    InvalidScattering
        If pyacvd is not installed, the surface is no mesh, or the count is out of range.

    Examples
    --------
    >>> import decals
    >>> square = decals.surfaces.MeshSurface(
    ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
    ... )
    >>> points = decals.scattering.remeshed_points(square, 30)
    >>> rivets = decals.scatter(square, fixed=points, count=len(points))
    """
    given = as_mesh_surface(surface, "polygonize a tree first", name="surface", error=InvalidScattering)
    count = count_number("count", count, 4, MAX_POINTS, InvalidScattering)
    try:
        clustering, pyvista = import_module("pyacvd").Clustering, import_module("pyvista")
    except ImportError as error:
        raise InvalidScattering(
            "expected the package pyacvd, which is not installed; run pip install 'implicit-decals[remesh]'"
        ) from error
    faces = np.column_stack([np.full(len(given.sound), 3), given.faces[given.sound]])
    mesh: Any = pyvista.PolyData(given.vertices.astype(np.float64), faces.reshape(-1)).clean()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyacvd 0.4 asks pyvista for names that it has deprecated
        clusters = clustering(mesh)
        clusters.subdivide(_subdivisions(mesh.n_points, count))
        clusters.cluster(count)
        vertices: Float32Array = np.asarray(clusters.create_mesh().points, np.float32)
    return given.project(vertices)[0]


def _subdivisions(vertices: int, count: int) -> int:
    """Return the number of times that each face must be cut in four."""
    missing_factor = max(VERTICES_PER_CLUSTER * count / max(vertices, 1), 1.0)
    return min(int(np.ceil(np.log(missing_factor) / np.log(4.0))), MAX_SUBDIVISIONS)
