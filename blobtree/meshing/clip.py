"""Parts of triangle meshes where a function is above 0, their outlines, and enclosed volumes."""

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int32Array


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
    number = {(int(a), int(b)): len(points) + i for i, (a, b) in enumerate(cut)}
    triangles: list[tuple[int, int, int]] = []
    for face in crossing.tolist():
        corners: list[int] = []
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            if inside[a]:
                corners.append(a)
            if inside[a] != inside[b]:
                corners.append(number[min(a, b), max(a, b)])
        triangles += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
    used, renumbered = np.unique(np.array(triangles, np.int64).reshape(-1, 3), return_inverse=True)
    return np.concatenate([points, new])[used], renumbered.reshape(-1, 3).astype(np.int32)


def outlines_of(vertices: Float64Array, faces: Int32Array) -> tuple[Float64Array, ...]:
    """Return the outlines of a mesh as closed polylines (n, 3), whose last point is the first."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).tolist()
    known = set(map(tuple, directed))
    following: dict[int, list[int]] = {}
    for a, b in directed:
        if (b, a) not in known:
            following.setdefault(a, []).append(b)
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
