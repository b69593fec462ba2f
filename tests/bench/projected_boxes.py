"""Projected box decals of engines, for the comparison of methods.

A decal is a box, drawn after the surface: each visible surface point inside the box gets the box's planar
coordinates. Opacity fades with the angle between surface and decal, from full at 60° to none at 90°. The
coordinates, and so their errors, are those of mesh-clipped decals. Left out: blending of normals and
materials, and the engines' sorting and clustering of boxes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from decals import Decals
from tests.bench.clipped_decals import MeshDecals, box_coordinates

Float64Array = NDArray[np.float64]
FULL = 0.5
"""Cosine of the angle up to which a decal is opaque."""

RECORD_BYTES = 64
"""A matrix of float32 for each decal."""


def opacity(cosine: Float64Array) -> Float64Array:
    """Return the opacity by the cosine of the angle between the surface's normal and the decal's."""
    return np.clip(cosine / FULL, 0.0, 1.0)


@dataclass(frozen=True)
class Marks:
    """What boxes mark, as shares of area.

    Attributes
    ----------
    backward : float
        Share of the marked area that faces away from its decal.
    other : float
        Share that is not connected with the surface at the decal's centre inside its box.
    other_faded : float
        The same share of the area times opacity.
    own_lost : float
        Share of the opacity that fading takes from the connected surface.
    """

    backward: float
    other: float
    other_faded: float
    own_lost: float


def marks(mesh: MeshDecals, faces: NDArray[np.int32], decals: Decals) -> Marks:
    """Return what the boxes of decals mark; a triangle counts where its centroid lies."""
    decal, face = mesh.candidates(decals)
    local = box_coordinates(decals, decal, mesh.corners[face].mean(axis=1, keepdims=True))[:, 0]
    inside = (np.abs(local) <= 1).all(axis=1)
    decal, face, local = decal[inside], face[inside], local[inside]
    a, b, c = (mesh.corners[face, i] for i in range(3))
    normals = np.cross(b - a, c - a)
    area = np.linalg.norm(normals, axis=1) / 2
    cosine = (normals * decals.normals[decal]).sum(axis=1) / (2 * area)
    corners = decal[:, None] * (int(faces.max()) + 1) + faces[face]
    nodes, place = np.unique(corners, return_inverse=True)
    place = place.reshape(-1, 3)
    ends = np.concatenate([place[:, :2], place[:, 1:]]).T
    links = coo_matrix((np.ones(ends.shape[1]), tuple(ends)), shape=(len(nodes), len(nodes)))
    part = connected_components(links, directed=False)[1][place[:, 0]]
    order = np.lexsort([np.linalg.norm(local, axis=1), decal])
    nearest = order[np.unique(decal[order], return_index=True)[1]]
    own = np.isin(part, part[nearest])
    seen = area * opacity(cosine)
    return Marks(
        backward=float(area[cosine <= 0].sum() / area.sum()),
        other=float(area[~own].sum() / area.sum()),
        other_faded=float(seen[~own].sum() / seen.sum()),
        own_lost=float(1.0 - seen[own].sum() / area[own].sum()),
    )


def fragments(decals: Decals, eye: Float64Array, points: Float64Array) -> tuple[float, float]:
    """Return the boxes drawn at a visible point, and those of them that contain it, on average.

    The back faces of boxes are drawn where they lie behind the surface.
    """
    frames = np.stack([decals.tangents, decals.bitangents, decals.normals], axis=1).astype(np.float64)
    frames /= decals.radii.astype(np.float64)[:, None, None]
    drawn = used = 0
    for frame, position in zip(frames, decals.positions.astype(np.float64), strict=True):
        start, ends = frame @ (eye - position), (points - position) @ frame.T
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = (np.array([[[-1.0]], [[1.0]]]) - start) / (ends - start)
        near, far = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
        behind = (near <= far) & (far >= 1)
        drawn += int(behind.sum())
        used += int((behind & (near <= 1)).sum())
    return drawn / len(points), used / len(points)
