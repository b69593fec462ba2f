"""Places on the surfaces of a document: nearest ones, first hits of rays, and frames carried between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.checks import shown, triple
from decals.errors import InvalidPoints, InvalidScene
from decals.model import Decals
from decals.scenes.scene import SceneObject
from decals.surfaces.surface import Floats, as_points, unit_rows

Ints = NDArray[np.int32]
Doubles = NDArray[np.float64]

OPPOSITE = -0.999999
"""Cosine below which two normals are opposite: no shortest turn leads from one to the other."""


@dataclass(frozen=True, eq=False)
class Places:
    """Points on surfaces: ``float32[n, 3]``, unit normals, and the object that each lies on (−1: none)."""

    positions: Floats
    normals: Floats
    objects: Ints


def nearest(objects: Sequence[SceneObject], points: ArrayLike) -> Places:
    """Closest place to each point on any object; the first object where two are equally close."""
    wished = as_points(points)
    _check(objects)
    best = Places(wished.copy(), np.zeros_like(wished), np.full(len(wished), -1, np.int32))
    if len(wished) == 0:
        return best
    least = np.full(len(wished), np.inf)
    for number, item in enumerate(objects):
        positions, normals = item.surface.project(wished)
        gaps = np.linalg.norm(positions.astype(np.float64) - wished, axis=1)
        closer = gaps < least
        least[closer] = gaps[closer]
        best.positions[closer], best.normals[closer] = positions[closer], normals[closer]
        best.objects[closer] = number
    return best


def first_hit(objects: Sequence[SceneObject], origin: ArrayLike, direction: ArrayLike) -> Places:
    """Where a ray first meets an object: one place, or none for a miss."""
    start = as_points(triple("origin", origin, InvalidPoints)[None])
    way = unit_rows(triple("direction", direction, InvalidPoints)[None])
    _check(objects)
    distances = [float(item.surface.raycast(start, way)[0]) for item in objects]
    if not distances or not np.isfinite(min(distances)):
        return Places(start[:0], start[:0], np.zeros(0, np.int32))
    number = int(np.argmin(distances))
    positions, normals = objects[number].surface.project(start + np.float32(distances[number]) * way)
    return Places(positions, normals, np.array([number], np.int32))


def _check(objects: Sequence[SceneObject]) -> None:
    """Refuse what are no objects of a scene."""
    if not isinstance(objects, Sequence) or not all(hasattr(item, "surface") for item in objects):
        raise InvalidScene(f"objects: expected those of a scene, got {shown(objects)}")


def turns(before: ArrayLike, after: ArrayLike) -> Doubles:
    """Shortest turns from unit vectors to others, ``float64[n, 3, 3]``, acting on columns.

    Between opposite vectors it is half a turn about an axis that depends on the vector alone.
    """
    a, b = np.asarray(before, np.float64), np.asarray(after, np.float64)
    cosine = np.einsum("ni,ni->n", a, b)
    axis = np.cross(a, b)
    opposite = cosine < OPPOSITE
    if opposite.any():
        helper = np.eye(3)[np.abs(a[opposite]).argmin(axis=1)]
        across = unit_rows(np.cross(a[opposite], helper)).astype(np.float64)
        halves = 2.0 * np.einsum("ni,nj->nij", across, across) - np.eye(3)
    cross = np.zeros((len(a), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]], cross[:, [1, 2, 0], [2, 0, 1]] = axis, -axis
    factor = 1.0 / np.where(opposite, 1.0, 1.0 + cosine)
    result: Doubles = np.eye(3) + cross + factor[:, None, None] * (cross @ cross)
    if opposite.any():
        result[opposite] = halves
    return result


def carried(decals: Decals, places: Places) -> Decals:
    """Decals at other places: frames are carried by the shortest turn of the normal, never spun."""
    turned = np.einsum("nij,nj->ni", turns(decals.normals, places.normals), decals.tangents)
    return decals.replace(positions=places.positions, normals=places.normals, tangents=turned)
