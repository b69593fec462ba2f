"""Vertices of a remesh as places for decals: the other way that the paper names."""

import warnings
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.checks import instance
from decals.errors import InvalidSeeding
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Floats
from decals.wishes import whole

FINER = 12
"""Vertices that a mesh needs for each cluster; coarser ones are subdivided first."""

MOST_SUBDIVISIONS = 6

MOST_PLACES = 1_000_000
"""Places of a remesh; its clustering alone takes a minute for so many."""


def remeshed_points(surface: MeshSurface, count: int) -> Floats:
    """Vertices of a uniform remesh, ``float32[n, 3]``, put back onto the mesh; about so many.

    By approximated centroidal Voronoi diagrams (Valette and Chassery 2004), as pyacvd has them. Give them to
    `decals.seed` as its ``fixed`` places, with their number as its count. Particles that repel each other lie
    more evenly; a remesh takes its connectivity from the mesh, so that it never mixes two sides of a wall.

    Raises
    ------
    InvalidSeeding
        If pyacvd is not installed, the surface is no mesh, or the count is below 4 or above `MOST_PLACES`.
    """
    instance("surface", surface, MeshSurface, InvalidSeeding, "polygonize a tree first")
    whole("count", count, 4, most=MOST_PLACES)
    try:
        clustering, pyvista = import_module("pyacvd").Clustering, import_module("pyvista")
    except ImportError as error:
        raise InvalidSeeding(
            "expected pyacvd for a remesh, found none; pip install 'implicit-decals[remesh]'"
        ) from error
    faces = np.column_stack([np.full(len(surface.sound), 3), surface.faces[surface.sound]])
    mesh: Any = pyvista.PolyData(surface.vertices.astype(np.float64), faces.reshape(-1)).clean()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyacvd 0.4 asks pyvista for names that it has deprecated
        clusters = clustering(mesh)
        clusters.subdivide(_subdivisions(mesh.n_points, count))
        clusters.cluster(count)
        found: NDArray[np.float32] = np.asarray(clusters.create_mesh().points, np.float32)
    return surface.project(found)[0]


def _subdivisions(vertices: int, count: int) -> int:
    """How often each face must be cut in four."""
    lacking = max(FINER * count / max(vertices, 1), 1.0)
    return min(int(np.ceil(np.log(lacking) / np.log(4.0))), MOST_SUBDIVISIONS)
