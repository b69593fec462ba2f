"""Queries of a document's surfaces: nearest points, ray hits, picks, and decals moved between points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, Int32Array
from decals.editing.document import Document
from decals.errors import InvalidEdit, InvalidPoints, InvalidScene
from decals.field.evaluate import evaluate
from decals.model import Decals
from decals.record import Contact
from decals.scenes.objects import SceneObject
from decals.surfaces.surface import as_points, unit_rows
from decals.validation import describe, finite_vector, instance

OPPOSITE_COSINE = -0.999999
"""Cosine below which two normals count as opposite: the shortest rotation between them is not unique."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on surfaces.

    Attributes
    ----------
    positions, normals
        Points and unit normals, float32, shape (n, 3).
    objects
        Index of the object of each point, int32, shape (n,); −1 for none.
    """

    positions: Float32Array
    normals: Float32Array
    objects: Int32Array


def nearest_points(objects: Sequence[SceneObject], points: ArrayLike) -> SurfacePoints:
    """Return the closest point of any object to each point; the first object wins a tie.

    Parameters
    ----------
    objects
        Objects of a scene.
    points
        Points, shape (n, 3).

    Raises
    ------
    InvalidPoints, InvalidScene
        The points are not finite points, or the objects are not a scene's.

    Examples
    --------
    >>> from blobtree import Point
    >>> from decals import TreeObject
    >>> from decals.editing import nearest_points
    >>> ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    >>> nearest_points([ball], [[0, 0, 3]]).positions.round(3)
    array([[0., 0., 1.]], dtype=float32)
    """
    queries = as_points(points)
    _check_objects(objects)
    best = SurfacePoints(queries.copy(), np.zeros_like(queries), np.full(len(queries), -1, np.int32))
    if len(queries) == 0:
        return best
    distances = np.full(len(queries), np.inf)
    for index, item in enumerate(objects):
        positions, normals = item.surface.project(queries)
        gaps = np.linalg.norm(positions.astype(np.float64) - queries, axis=1)
        closer = gaps < distances
        distances[closer] = gaps[closer]
        best.positions[closer], best.normals[closer] = positions[closer], normals[closer]
        best.objects[closer] = index
    return best


def first_hit(objects: Sequence[SceneObject], origin: ArrayLike, direction: ArrayLike) -> SurfacePoints:
    """Return the point at which a ray first meets an object: one point, or no points for a miss.

    Parameters
    ----------
    objects
        Objects of a scene.
    origin, direction
        The ray, shape (3,) each; the direction has any length above 0.

    Raises
    ------
    InvalidPoints, InvalidScene
        The ray is not made of finite numbers, or the objects are not a scene's.

    Examples
    --------
    >>> from blobtree import Point
    >>> from decals import TreeObject
    >>> from decals.editing import first_hit
    >>> ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    >>> first_hit([ball], (0, 0, 5), (0, 0, -1)).positions.round(3)
    array([[0., 0., 1.]], dtype=float32)
    """
    origins = as_points(finite_vector("origin", origin, InvalidPoints)[None])
    directions = unit_rows(finite_vector("direction", direction, InvalidPoints)[None])
    _check_objects(objects)
    distances = [float(item.surface.raycast(origins, directions)[0]) for item in objects]
    if not distances or not np.isfinite(min(distances)):
        return SurfacePoints(origins[:0], origins[:0], np.zeros(0, np.int32))
    index = int(np.argmin(distances))
    hits = origins + np.float32(distances[index]) * directions
    positions, normals = objects[index].surface.project(hits)
    return SurfacePoints(positions, normals, np.array([index], np.int32))


def _check_objects(objects: Sequence[SceneObject]) -> None:
    """Raise `InvalidScene` for anything but a sequence of a scene's objects."""
    if not isinstance(objects, Sequence) or not all(hasattr(item, "surface") for item in objects):
        raise InvalidScene(f"objects: expected those of a scene, got {describe(objects)}")


def shortest_rotations(before: ArrayLike, after: ArrayLike) -> Float64Array:
    """Return the shortest rotations between pairs of unit vectors, float64, shape (n, 3, 3).

    The matrices act on columns. Between opposite vectors the rotation is half a turn about an axis that
    depends on the first vector alone.
    """
    a, b = np.asarray(before, np.float64), np.asarray(after, np.float64)
    cosine = np.einsum("ni,ni->n", a, b)
    axis = np.cross(a, b)
    opposite = cosine < OPPOSITE_COSINE
    if opposite.any():
        helper = np.eye(3)[np.abs(a[opposite]).argmin(axis=1)]
        across = unit_rows(np.cross(a[opposite], helper)).astype(np.float64)
        halves = 2.0 * np.einsum("ni,nj->nij", across, across) - np.eye(3)
    cross = np.zeros((len(a), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]], cross[:, [1, 2, 0], [2, 0, 1]] = axis, -axis
    factor = 1.0 / np.where(opposite, 1.0, 1.0 + cosine)
    result: Float64Array = np.eye(3) + cross + factor[:, None, None] * (cross @ cross)
    if opposite.any():
        result[opposite] = halves
    return result


def move_decals(decals: Decals, points: SurfacePoints) -> Decals:
    """Return decals at other points; the shortest rotation of the normal turns the tangents along."""
    rotations = shortest_rotations(decals.normals, points.normals)
    tangents = np.einsum("nij,nj->ni", rotations, decals.tangents)
    return decals.replace(positions=points.positions, normals=points.normals, tangents=tangents)


@dataclass(frozen=True, eq=False)
class SurfacePick:
    """The first surface point along a ray.

    Attributes
    ----------
    object
        Index of the object.
    position, normal
        Point and unit normal, float32, shape (3,).
    owner
        Number of the decal that shows there; −1 for none.
    """

    object: int
    position: Float32Array
    normal: Float32Array
    owner: int


def pick(
    document: Document, origin: ArrayLike, direction: ArrayLike, *, contact: Contact = Contact.PRODUCT
) -> SurfacePick | None:
    """Return the first surface point along a ray and its owner, or None for a miss.

    Parameters
    ----------
    document
        The document, such as ``session.document``.
    origin, direction
        The ray, shape (3,) each.
    contact
        Contact mode of the decals.

    Examples
    --------
    >>> from blobtree import Point
    >>> from decals import cover
    >>> from decals.editing import EditSession, pick
    >>> session = EditSession(cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"]))
    >>> pick(session.document, (0, 0, 5), (0, 0, -1)).position.round(3)
    array([0., 0., 1.], dtype=float32)
    """
    instance("document", document, Document, InvalidEdit, "session.document is one")
    hit = first_hit(document.objects, origin, direction)
    if not len(hit.objects):
        return None
    owner = -1
    if len(document.decals):
        owner = int(evaluate(document.decals, hit.positions, hit.normals, contact=contact).owner[0])
    return SurfacePick(int(hit.objects[0]), hit.positions[0], hit.normals[0], owner)
