"""Crumbs: pieces of a mesh that break off at sharp edges and tips.

Where a solid ends in a wedge that is thinner than a cell, a sample may lie inside while all around it lie
outside. The mesh then has a closed piece around that sample, as small as the cell, beside the end of the
larger piece. The end of a wedge thinner than a cell is missed anyway, so such pieces carry no shape.
"""

from dataclasses import replace

import numpy as np

from blobtree._typing import BoolArray, Float32Array, IndexArray, Int32Array
from blobtree.meshing.mesh import Mesh

LARGEST_CRUMB = 3.0
"""Diagonal of the box of a crumb, over the chord error, at most."""

FARTHEST_CRUMB = 2.0
"""Distance of a crumb from a larger piece, over the chord error, at most."""


SPECK_VERTICES = 12
"""Vertices of the closed piece around two samples; cells that resolve a part have more samples in it."""


def without_specks(mesh: Mesh) -> Mesh:
    """Return a mesh, whose cells resolve all parts, without the pieces around one sample or two."""
    labels = _pieces(mesh.faces, len(mesh.vertices))
    return _without(mesh, (np.bincount(labels) <= SPECK_VERTICES)[labels])


def without_crumbs(mesh: Mesh, chord_error: float) -> Mesh:
    """Return a mesh without its crumbs; alone in space, a piece of any size stays."""
    labels = _pieces(mesh.faces, len(mesh.vertices))
    small = _diagonals(mesh.vertices, labels) <= LARGEST_CRUMB * chord_error
    if not small.any() or small.all():
        return mesh
    from scipy.spatial import cKDTree  # most meshes have no crumbs

    candidates = small[labels]
    distances, _ = cKDTree(mesh.vertices[~candidates]).query(mesh.vertices[candidates])
    nearest = np.full(len(small), np.inf)
    np.minimum.at(nearest, labels[candidates], distances)
    return _without(mesh, (nearest <= FARTHEST_CRUMB * chord_error)[labels])


def _pieces(faces: Int32Array, count: int) -> IndexArray:
    """Return for each of `count` vertices the number of its connected piece."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    rows, columns = faces[:, :2].ravel(), faces[:, 1:].ravel()
    edges = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), (count, count))
    _, labels = connected_components(edges, directed=False)
    result: IndexArray = labels.astype(np.intp)
    return result


def _diagonals(vertices: Float32Array, labels: IndexArray) -> Float32Array:
    """Return the diagonals of the boxes around pieces."""
    count = int(labels.max(initial=-1)) + 1
    lower, upper = np.full((count, 3), np.inf, np.float32), np.full((count, 3), -np.inf, np.float32)
    np.minimum.at(lower, labels, vertices)
    np.maximum.at(upper, labels, vertices)
    result: Float32Array = np.linalg.norm(upper - lower, axis=1)
    return result


def _without(mesh: Mesh, dropped: BoolArray) -> Mesh:
    """Return a mesh without some vertices, and without the faces at them."""
    if not dropped.any():
        return mesh
    places = np.cumsum(~dropped, dtype=np.int32) - 1
    counts = None if mesh.sheet_counts is None else mesh.sheet_counts[~dropped]
    return replace(
        mesh,
        vertices=mesh.vertices[~dropped],
        faces=places[mesh.faces[~dropped[mesh.faces[:, 0]]]],
        normals=mesh.normals[~dropped],
        colors=mesh.colors[~dropped],
        sheet_counts=counts,
    )
