"""Mesh-clipped decals, as in the DecalGeometry of three.js.

A decal is a box. Each triangle of the mesh that overlaps the box is clipped by its six planes. Texture
coordinates are the coordinates in the box along two of its axes: a planar projection. three.js tests each
triangle for each decal; here a tree finds the candidates of all decals, which are clipped together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals import Decals

Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.intp]

BATCH = 100_000
"""Triangles that are clipped together: few enough for the processor's cache."""


@dataclass(frozen=True)
class ClippedMesh:
    """Corners float64[k, 3] with uv float64[k, 2], and m triangles with their decals int[m]."""

    vertices: Float64Array
    uv: Float64Array
    faces: IndexArray
    decals: IndexArray

    @property
    def nbytes(self) -> int:
        """Size on a graphics card in bytes: position, normal and uv in float32, indices in int32."""
        return len(self.vertices) * 32 + self.faces.size * 4


class MeshDecals:
    """A mesh from which decals are clipped.

    Parameters
    ----------
    vertices, faces
        float[n, 3] and int[m, 3].
    """

    def __init__(self, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
        self.corners = vertices.astype(np.float64)[faces]
        self._centres = self.corners.mean(axis=1)
        self._reach = np.linalg.norm(self.corners - self._centres[:, None], axis=2).max(initial=0.0)
        self._tree = cKDTree(self._centres)

    def clip(self, decals: Decals) -> ClippedMesh:
        """Clip the mesh by the boxes of all decals: cubes with sides of twice the radius."""
        decal, face = self.candidates(decals)
        parts = [
            self._clipped(decals, decal[i : i + BATCH], face[i : i + BATCH])
            for i in range(0, max(1, len(decal)), BATCH)
        ]
        return _joined(parts)

    def candidates(self, decals: Decals) -> tuple[IndexArray, IndexArray]:
        """Return pairs of decal and triangle that may overlap."""
        reach = np.sqrt(3.0) * decals.radii.astype(np.float64) + self._reach
        faces = self._tree.query_ball_point(decals.positions, reach)
        counts = np.array([len(face) for face in faces])
        return np.repeat(np.arange(len(decals)), counts), np.concatenate(faces).astype(np.intp)

    def _clipped(self, decals: Decals, decal: IndexArray, face: IndexArray) -> ClippedMesh:
        local = box_coordinates(decals, decal, self.corners[face])
        low = np.minimum(np.minimum(local[:, 0], local[:, 1]), local[:, 2])
        high = np.maximum(np.maximum(local[:, 0], local[:, 1]), local[:, 2])
        outside = ((low > 1) | (high < -1)).any(axis=1)
        inside = ((low >= -1) & (high <= 1)).all(axis=1)
        whole, cut = np.flatnonzero(inside), np.flatnonzero(~inside & ~outside)
        points, owner = _clip_by_box(local[cut])
        triangles, rows = _fans(owner)
        points = np.concatenate([local[whole].reshape(-1, 3), points])
        origin = np.concatenate([np.repeat(decal[whole], 3), decal[cut][owner]])
        faces = np.concatenate([np.arange(3 * len(whole)).reshape(-1, 3), triangles + 3 * len(whole)])
        radii = decals.radii.astype(np.float64)[origin, None]
        world = np.einsum("nk,nik->ni", points * radii, _frames(decals)[origin])
        of_face = np.concatenate([decal[whole], decal[cut][owner[rows]]])
        return ClippedMesh(world + decals.positions[origin], 0.5 + 0.5 * points[:, :2], faces, of_face)


def box_coordinates(decals: Decals, decal: NDArray[np.integer], points: Float64Array) -> Float64Array:
    """Return points [n, k, 3] in the coordinates of decals int[n], whose boxes are [-1, 1]³."""
    offsets = points - decals.positions[decal][:, None]
    radii = decals.radii.astype(np.float64)[decal][:, None, None]
    coordinates: Float64Array = np.matmul(offsets, _frames(decals)[decal]) / radii
    return coordinates


def _frames(decals: Decals) -> Float64Array:
    """Return the axes of the boxes in columns: float64[n, 3, 3]."""
    return np.stack([decals.tangents, decals.bitangents, decals.normals], axis=2).astype(np.float64)


def _clip_by_box(triangles: Float64Array) -> tuple[Float64Array, IndexArray]:
    """Clip triangles by Sutherland and Hodgman's method; return corners and the triangle of each."""
    points = triangles.reshape(-1, 3)
    owner = np.repeat(np.arange(len(triangles)), 3)
    for axis in range(3):
        for side in (-1.0, 1.0):
            points, owner = _clip_by_plane(points, owner, 1.0 - side * points[:, axis])
    return points, owner


def _clip_by_plane(
    points: Float64Array, owner: IndexArray, height: Float64Array
) -> tuple[Float64Array, IndexArray]:
    """Return the part of polygons where the height is not negative; `owner` is the polygon of each corner."""
    following = np.arange(1, len(points) + 1)
    last = np.flatnonzero(np.append(owner[1:] != owner[:-1], True))[: len(points)]
    following[last] = np.append(0, last + 1)[: len(last)]
    next_height = height[following]
    kept, crossed = height >= 0, (height >= 0) != (next_height >= 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = height / (height - next_height)
    crossing = points + np.where(crossed, fraction, 0.0)[:, None] * (points[following] - points)
    both = np.stack([points, crossing], axis=1).reshape(-1, 3)
    used = np.stack([kept, crossed], axis=1).reshape(-1)
    return both[used], np.repeat(owner, 2)[used]


def _fans(owner: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return the triangles of convex polygons, and a corner of the polygon of each."""
    if not len(owner):
        return np.zeros((0, 3), np.intp), np.zeros(0, np.intp)
    starts = np.flatnonzero(np.append(True, owner[1:] != owner[:-1]))
    counts = np.diff(np.append(starts, len(owner)))
    fans = np.maximum(counts - 2, 0)
    first = np.repeat(starts, fans)
    number = np.arange(len(first)) - np.repeat(np.cumsum(fans) - fans, fans)
    return np.column_stack([first, first + number + 1, first + number + 2]), first


def _joined(parts: list[ClippedMesh]) -> ClippedMesh:
    shifts = np.cumsum([0] + [len(part.vertices) for part in parts])
    return ClippedMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.faces + shift for part, shift in zip(parts, shifts, strict=False)]),
        np.concatenate([part.decals for part in parts]),
    )
