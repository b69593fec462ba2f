"""Normals of a triangle mesh for drawing: smooth within a crease angle, and split at creases."""

from dataclasses import dataclass, replace

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from decals.surfaces.base_color import BaseColor
from decals.surfaces.topology import components

CREASE_ANGLE = 35.0
"""Default crease angle, in degrees."""

MAX_FACES_PER_EDGE = 4
"""Number of faces at an edge that are compared with each other; at an edge of more, some are not."""


COPY_COSINE = 1.0 - 1e-6
"""Cosine between faces that run along an edge in the same direction from which on they count as copies."""


@dataclass(frozen=True, eq=False)
class SplitMesh:
    """A mesh whose vertices at creases are split, so that each has one normal.

    Attributes
    ----------
    rows : int64[n]
        Vertex of the mesh for each split vertex; the mesh's own vertices come first, in their order.
    faces : int32[m, 3]
        The same triangles, as indices of split vertices.
    normals : float32[n, 3]
        Unit normal of each split vertex.
    color : BaseColor, optional
        Base colour whose rows are the split vertices.
    """

    rows: Int64Array
    faces: Int32Array
    normals: Float32Array
    color: BaseColor | None = None


def split_at_creases(
    vertices: Float32Array, faces: Int32Array, crease_angle: float = CREASE_ANGLE
) -> SplitMesh:
    """Split a mesh at its creases.

    A crease is an edge where the normals of two faces differ by more than the crease angle. An edge along
    which two faces run in the same direction, like pages of a book, is a crease too, unless they are copies.
    The faces around a vertex on a crease form groups: two faces that share another edge belong to one group.
    Each group gets a vertex, and its normal is the sum of the group's normals weighted by area. A vertex
    without crease keeps the normal of `vertex_normals`.

    Parameters
    ----------
    vertices : float32[n, 3]
        Positions. Vertices at the same position are not joined.
    faces : int32[m, 3]
        Corner indices.
    crease_angle : float
        In degrees, from 0 (flat faces) to 180 (no creases).

    Returns
    -------
    SplitMesh

    Examples
    --------
    >>> import pyvista
    >>> from decals.surfaces.normals import split_at_creases
    >>> cube = pyvista.Cube().triangulate().clean()
    >>> len(split_at_creases(cube.points, cube.regular_faces).rows)
    24
    """
    rows: Int64Array = np.arange(len(vertices))
    normals, joined, sharp = _neighbors(vertices, faces, crease_angle)
    if not sharp.any():
        return SplitMesh(rows, faces, vertex_normals(vertices, faces))
    at_crease = np.zeros(len(vertices), np.bool_)
    corners = faces.reshape(-1)
    at_crease[corners[joined[sharp]]] = True
    kept = joined[~sharp]
    kept = kept[at_crease[corners[kept[:, 0]]]]
    groups = components(kept, len(corners))
    crowded = np.flatnonzero(at_crease[corners])
    pairs = np.stack([corners[crowded].astype(np.int64), groups[crowded]], axis=1)
    distinct, of_corner = np.unique(pairs, axis=0, return_inverse=True)
    first = np.ones(len(distinct), np.bool_)
    first[1:] = distinct[1:, 0] != distinct[:-1, 0]
    numbers = np.where(first, distinct[:, 0], len(vertices) + np.cumsum(~first) - 1)
    split = corners.astype(np.int64)
    split[crowded] = numbers[of_corner.reshape(-1)]
    rows = np.concatenate([rows, distinct[~first, 0]])
    split_faces: Int32Array = split.reshape(-1, 3).astype(np.int32)
    return SplitMesh(rows, split_faces, _weighted_normals(normals, split_faces, len(rows)))


def split_at_colors(split: SplitMesh, color: BaseColor) -> SplitMesh:
    """Split a mesh further where its base colour jumps, until each vertex has one colour and one texture.

    Vertices that no face uses are left out, unless nothing is split.
    """
    if color.corners is None and color.texture_of_face is None:
        return replace(split, color=color.of_rows(split.rows))
    of_face = color.texture_of_face
    textures = np.zeros(len(split.faces), np.int64) if of_face is None else of_face + 1
    rows = split.rows[split.faces] if color.corners is None else color.corners.astype(np.int64)
    kinds, keys = len(color.textures) + 1, len(color) * (len(color.textures) + 1)
    pairs = split.faces * np.int64(keys) + rows * kinds + textures[:, None]
    distinct, faces = np.unique(pairs, return_inverse=True)
    own, row = distinct // keys, distinct % keys // kinds
    corners: Int32Array = faces.reshape(-1, 3).astype(np.int32)
    return SplitMesh(split.rows[own], corners, split.normals[own], color.of_rows(row))


def vertex_normals(vertices: Float32Array, faces: Int32Array) -> Float32Array:
    """Return unit normals at the vertices, each the sum of its faces' normals weighted by area.

    A vertex without any face, or whose faces cancel, gets the z axis.
    """
    return _weighted_normals(_crosses(vertices, faces), faces, len(vertices))


def _crosses(vertices: Float32Array, faces: Int32Array) -> Float64Array:
    """Return the normals of faces, as long as their doubled areas."""
    a, b, c = np.moveaxis(vertices.astype(np.float64)[faces], 1, 0)
    crosses: Float64Array = np.cross(b - a, c - a)
    return crosses


def _weighted_normals(crosses: Float64Array, faces: Int32Array, count: int) -> Float32Array:
    """Return the unit sums of the faces' normals at `count` vertices, or the z axis where they vanish."""
    corners = faces.reshape(-1)
    sums = np.stack([np.bincount(corners, np.repeat(crosses[:, i], 3), count) for i in range(3)], axis=1)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    units = np.where(lengths > 0, sums / np.where(lengths > 0, lengths, 1), [0.0, 0.0, 1.0])
    return units.astype(np.float32)


def _neighbors(
    vertices: Float32Array, faces: Int32Array, crease_angle: float
) -> tuple[Float64Array, Int64Array, BoolArray]:
    """Return the normals of faces, pairs of corners at one vertex, and True for those across a crease.

    Corners are numbered 3 f + c. The normals are as long as the doubled areas of the faces.
    """
    crosses = _crosses(vertices, faces)
    lengths = np.linalg.norm(crosses, axis=1, keepdims=True)
    units = crosses / np.where(lengths > 0, lengths, 1.0)
    starts = faces.reshape(-1).astype(np.int64)
    ends = np.roll(faces, -1, axis=1).reshape(-1).astype(np.int64)
    keys = np.minimum(starts, ends) * len(vertices) + np.maximum(starts, ends)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    pairs = []
    for lag in range(1, MAX_FACES_PER_EDGE):
        same = np.flatnonzero(ordered[lag:] == ordered[:-lag])
        pairs.append(np.stack([order[same], order[same + lag]], axis=1))
        if len(same) == 0:
            break
    edges = np.concatenate(pairs)
    cosines = np.einsum("ni,ni->n", units[edges[:, 0] // 3], units[edges[:, 1] // 3])
    sharp = np.clip(cosines, -1.0, 1.0) < np.cos(np.radians(crease_angle)) - 1e-9
    following = edges - edges % 3 + (edges + 1) % 3
    alike = starts[edges[:, :1]] == starts[edges[:, 1:]]
    sharp |= alike[:, 0] & (cosines < COPY_COSINE)  # one face folds back onto the other
    at_start = np.where(alike, edges, np.stack([edges[:, 0], following[:, 1]], axis=1))
    at_end = np.where(alike, following, np.stack([following[:, 0], edges[:, 1]], axis=1))
    return crosses, np.concatenate([at_start, at_end]), np.concatenate([sharp, sharp])
