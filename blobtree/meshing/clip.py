"""Parts of triangle meshes where a function is above 0, their outlines, and enclosed volumes."""

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array


def enclosed_volume(vertices: Float32Array, faces: Int32Array) -> float:
    """Return the volume inside a closed mesh with vertices (n, 3) and faces (m, 3) oriented outward."""
    if not len(faces):
        return 0.0
    points = vertices.astype(np.float64) - vertices.mean(axis=0, dtype=np.float64)
    first, second, third = (points[faces[:, corner]] for corner in range(3))
    return float((first * np.cross(second, third)).sum()) / 6.0


def clipped(
    vertices: Float32Array, faces: Int32Array, values: Float64Array
) -> tuple[Float64Array, Int32Array]:
    """Return the part of a mesh where a function is above 0.

    Parameters
    ----------
    vertices, faces
        Triangles: (n, 3) and (m, 3).
    values
        Values (n,) of the function at the vertices; it is linear along edges.

    Returns
    -------
    tuple[Float64Array, Int32Array]
        Vertices and faces. Triangles that share an edge of the mesh share the vertices on it.
    """
    inside = values > 0.0
    crossing = faces[inside[faces].any(axis=1)]
    edges = np.sort(np.stack([crossing, np.roll(crossing, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    cut = np.unique(edges[inside[edges[:, 0]] != inside[edges[:, 1]]], axis=0)
    ends = values[cut]
    share = (ends[:, 0] / (ends[:, 0] - ends[:, 1]))[:, None]
    points = vertices.astype(np.float64)
    new = (1.0 - share) * points[cut[:, 0]] + share * points[cut[:, 1]]
    triangles, rows = _triangles_inside(crossing, inside, cut, len(points))
    order = np.argsort(rows, kind="stable")
    used, renumbered = np.unique(triangles[order], return_inverse=True)
    return np.concatenate([points, new])[used], renumbered.reshape(-1, 3).astype(np.int32)


def _triangles_inside(
    faces: Int32Array, inside: BoolArray, cut: Int64Array, count: int
) -> tuple[Int64Array, Int64Array]:
    """Return the triangles of the parts of faces inside, and the row of the face of each.

    New vertices on the edges `cut` (k, 2), sorted, have the numbers from `count` on.
    """
    keys = cut[:, 0].astype(np.int64) * count + cut[:, 1]
    triangles, rows = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for pattern in np.ndindex(2, 2, 2):
        here = np.flatnonzero((inside[faces] == np.array(pattern, np.bool_)).all(axis=1))
        part = faces[here].astype(np.int64)
        corners: list[Int64Array] = []
        for first, second in ((0, 1), (1, 2), (2, 0)):
            if pattern[first]:
                corners.append(part[:, first])
            if pattern[first] != pattern[second]:
                ends = np.sort(part[:, [first, second]], axis=1)
                corners.append(count + np.searchsorted(keys, ends[:, 0] * count + ends[:, 1]))
        for second in range(1, len(corners) - 1):
            triangles.append(np.stack([corners[0], corners[second], corners[second + 1]], axis=1))
            rows.append(here)
    return np.concatenate(triangles), np.concatenate(rows)


def outlines_of(vertices: Float64Array, faces: Int32Array) -> tuple[Float64Array, ...]:
    """Return the outlines of a mesh as closed polylines (n, 3), whose last point is the first."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    keys, opposite = directed @ (len(vertices), 1), directed @ (1, len(vertices))
    following: dict[int, list[int]] = {}
    for start, end in directed[~np.isin(keys, opposite)].tolist():
        following.setdefault(start, []).append(end)
    outlines: list[Float64Array] = []
    while following:
        start = next(iter(following))
        chain = [start]
        while chain[-1] != start or len(chain) == 1:
            ahead = following[chain[-1]]
            step = ahead.pop()
            if not ahead:
                del following[chain[-1]]
            chain.append(step)
        outlines.append(vertices[chain])
    return tuple(outlines)
