"""Which closed parts of a mesh lie inside which others, and which of them to turn."""

import itertools
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float64Array, Int64Array
from blobtree.device import launch
from decals.surfaces.mesh_kernels import mark_within

MAX_SAMPLES = 200
"""Most points of a part that are tested whether they lie inside another."""

TOUCHING = 1e-5
"""Distance from a surface, in sizes of the mesh, within which a point touches it."""


def outward_turns(
    parts: Int64Array, numbers: Int64Array, volumes: Float64Array, corners: Float64Array
) -> BoolArray:
    """Return which closed parts to turn, ``bool[count]``.

    Outermost parts turn outward, and what lies inside one turns with it. If a part then winds inward where
    there is no solid to cut from, the windings do not tell what is solid. Windings then follow the parity of
    nesting.

    Parameters
    ----------
    parts : int64[m]
        Number of the part of each face.
    numbers : int64[count]
        Numbers of the closed parts.
    volumes : float64[count]
        Their volumes, negative for a part that winds inward.
    corners : float64[m, 3, 3]
        Positions of the corners of the faces.
    """
    count = len(numbers)
    order = np.argsort(-np.abs(volumes), kind="stable")
    containers = _containers(parts, numbers, volumes, corners, order)
    inward = volumes < 0.0
    turned, depth = np.zeros(count, np.bool_), np.zeros(count, np.int64)
    root = np.arange(count)
    solid = np.zeros(count, np.int64)  # how often closed parts wind around the inside of a part
    for part in order.tolist():
        around = containers[part]
        if around:
            parent = min(around, key=lambda other: (abs(volumes[other]), other))
            root[part] = root[parent]
            depth[part] = 1 + max(depth[other] for other in around)
        turned[part] = inward[root[part]]
        signs = np.where(inward[[*around, part]] ^ turned[[*around, part]], -1, 1)
        solid[part] = signs.sum()
    if (solid >= 0).all():
        return turned
    by_parity: BoolArray = inward ^ (depth % 2 == 1)
    return by_parity


def _containers(
    parts: Int64Array, numbers: Int64Array, volumes: Float64Array, corners: Float64Array, order: Int64Array
) -> list[list[int]]:
    """Return, for each closed part, the parts that contain it."""
    index = np.full(int(parts.max()) + 1, -1)
    index[numbers] = np.arange(len(numbers))
    own = index[parts]
    by_part = np.argsort(own, kind="stable")
    ends = np.searchsorted(own[by_part], np.arange(len(numbers) + 1))
    faces = [by_part[first:last] for first, last in itertools.pairwise(ends)]
    triangles = [corners[rows] for rows in faces]
    low = np.array([part.min(axis=(0, 1)) for part in triangles])
    high = np.array([part.max(axis=(0, 1)) for part in triangles])
    margin = TOUCHING * float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
    axis = int(np.argmax((high.max(axis=0) - low.min(axis=0)) / np.mean(high - low, axis=0).clip(1e-300)))
    sorted_rows = np.argsort(low[:, axis], kind="stable")
    sorted_low = low[sorted_rows, axis]
    containers: list[list[int]] = [[] for _ in faces]
    rank = np.empty(len(faces), np.int64)
    rank[order] = np.arange(len(faces))
    samples: dict[int, Float64Array] = {}
    for outer in order.tolist():
        first, last = np.searchsorted(sorted_low, [low[outer, axis] - margin, high[outer, axis] + margin])
        near = sorted_rows[first:last]
        fits = (low[near] >= low[outer] - margin) & (high[near] <= high[outer] + margin)
        inner = near[fits.all(axis=1) & (rank[near] > rank[outer])]
        if len(inner):
            for part in inner.tolist():
                if part not in samples:
                    samples[part] = _samples(triangles[part])
            points = [samples[part] for part in inner.tolist()]
            sides = _sides(triangles[outer], volumes[outer] < 0.0, np.concatenate(points), margin)
            pieces = np.split(sides, np.cumsum([len(part) for part in points])[:-1])
            for part, side in zip(inner.tolist(), pieces, strict=True):
                coincident = not side.any() and (volumes[part] < 0.0) != (volumes[outer] < 0.0)
                if ((side > 0).any() and not (side < 0).any()) or coincident:
                    containers[part].append(outer)
    return containers


def _samples(triangles: Float64Array) -> Float64Array:
    """Return corners, middles of sides and centres of some faces, the outermost ones among them."""
    wide = np.concatenate([triangles, 0.5 * (triangles + np.roll(triangles, -1, axis=1))], axis=1)
    points: Float64Array = np.concatenate([wide, triangles.mean(axis=1, keepdims=True)], axis=1).reshape(
        -1, 3
    )
    if len(points) <= MAX_SAMPLES:
        return points
    directions = np.indices((3, 3, 3)).reshape(3, -1).T - 1.0
    outermost = np.argmax(points @ directions.T, axis=0)
    some = np.linspace(0, len(points) - 1, MAX_SAMPLES - len(directions)).astype(np.int64)
    chosen: Float64Array = points[np.concatenate([outermost, some])]
    return chosen


def _sides(triangles: Float64Array, inward: bool, points: Float64Array, margin: float) -> Int64Array:
    """Return 1 for points inside a closed surface, −1 outside, and 0 for those that touch it."""
    middle = triangles.mean(axis=(0, 1))
    corners = (triangles[:, ::-1] if inward else triangles) - middle
    vertices: Any = wp.array(corners.reshape(-1, 3).astype(np.float32), dtype=wp.vec3, device="cpu")
    indices: Any = wp.array(np.arange(3 * len(triangles), dtype=np.int32), dtype=wp.int32, device="cpu")
    mesh = wp.Mesh(points=vertices, indices=indices, support_winding_number=True)
    queries: Any = wp.array((points - middle).astype(np.float32), dtype=wp.vec3, device="cpu")
    reach = 2.0 * float(np.linalg.norm(corners, axis=2).max() + np.linalg.norm(points - middle, axis=1).max())
    sides: Any = wp.zeros(len(points), dtype=wp.int32, device="cpu")
    launch(mark_within, len(points), [mesh.id, queries, reach, margin], [sides], device="cpu")
    result: Int64Array = sides.numpy().astype(np.int64)
    return result
