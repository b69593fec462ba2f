"""Queries of a document's surfaces: nearest points, ray hits, picks, and outlines of decals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.validation import describe, finite_vector, point_array
from decals.editing.document import Document
from decals.errors import InvalidEdit, InvalidPoints, InvalidScene
from decals.field.evaluate import Samples, evaluate
from decals.field.extras import WALKS
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact, contact_mode
from decals.model import Decals
from decals.record import DEFAULT_CONTACT
from decals.scattering.decal_normals import mean_normals
from decals.scenes.objects import SceneObject, TreeObject
from decals.surfaces.implicit import project_without_mesh
from decals.surfaces.surface import unit_rows
from decals.validation import instance, member, whole_number

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
    queries = point_array(points)
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
    origins = point_array([finite_vector("origin", origin, InvalidPoints)])
    directions = unit_rows(np.array([finite_vector("direction", direction, InvalidPoints)]))
    _check_objects(objects)
    distances = [float(item.surface.raycast(origins, directions)[0]) for item in objects]
    if not distances or not np.isfinite(min(distances)):
        return SurfacePoints(origins[:0], origins[:0], np.zeros(0, np.int32))
    index = int(np.argmin(distances))
    hits = origins + np.float32(distances[index]) * directions
    positions, normals = objects[index].surface.project(hits)
    return SurfacePoints(positions, normals, np.array([index], np.int32))


def mean_normal(
    objects: Sequence[SceneObject], position: ArrayLike, normal: ArrayLike, radius: float
) -> Float32Array:
    """Return the normal for a decal at a surface point: at an edge the mean of its sides, shape (3,).

    Parameters
    ----------
    objects
        Objects of a scene.
    position, normal
        Surface point and unit normal there, shape (3,) each.
    radius
        Radius of the decal.

    Examples
    --------
    >>> import pyvista
    >>> from decals.editing.queries import mean_normal
    >>> from decals.scenes.objects import as_objects
    >>> mean_normal(as_objects([pyvista.Cube()]), (0.5, 0.0, 0.5), (0, 0, 1), radius=0.2).round(1)
    array([0.7, 0. , 0.7], dtype=float32)
    """
    center = np.array([finite_vector("position", position, InvalidPoints)], np.float32)
    own = unit_rows(np.array([finite_vector("normal", normal, InvalidPoints)]))

    def near(points: Float32Array, _: Int64Array) -> tuple[Float32Array, Float32Array, Int64Array]:
        found = [part for item in objects if (part := _surface_near(item, points)) is not None]
        positions, normals = (
            np.concatenate([points[:0], *(part[column] for part in found)]) for column in (0, 1)
        )
        return positions, normals, np.tile(np.arange(len(points)), len(found))

    mean: Float32Array = mean_normals(center, own, np.array([radius], np.float64), near)[0]
    return mean


def _surface_near(item: SceneObject, points: Float32Array) -> tuple[Float32Array, Float32Array] | None:
    """Return the surface of an object near points; None where a tree has none."""
    if isinstance(item, TreeObject):
        return project_without_mesh(item.tree, points)
    return item.surface.project(points)


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
    document: Document,
    origin: ArrayLike,
    direction: ArrayLike,
    *,
    contact: AnyContact | str = DEFAULT_CONTACT,
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
    numbers = [number for number, item in enumerate(document.objects) if item.shown is not None]
    hit = first_hit(document.shown_objects, origin, direction)
    if not len(hit.objects):
        return None
    owner = -1
    if len(document.decals):
        on = document.objects[numbers[int(hit.objects[0])]]
        owner = int(evaluate(document.decals, hit.positions, hit.normals, contact=contact, on=on).owner[0])
    return SurfacePick(numbers[int(hit.objects[0])], hit.positions[0], hit.normals[0], owner)


def inside_polygon(points: ArrayLike, corners: ArrayLike) -> BoolArray:
    """Return True for each point in a polygon, by the even-odd rule.

    Parameters
    ----------
    points
        Points of a plane, shape (n, 2); NaN is outside.
    corners
        Corners of the polygon, shape (m, 2); the last is joined to the first.

    Examples
    --------
    >>> from decals.editing.queries import inside_polygon
    >>> inside_polygon([(1, 1), (3, 1)], [(0, 0), (2, 0), (2, 2), (0, 2)]).tolist()
    [True, False]
    """
    x, y = np.asarray(points, np.float64).reshape(-1, 2).T[..., None]
    first = np.asarray(corners, np.float64).reshape(-1, 2)
    (x0, y0), (x1, y1) = first.T, np.roll(first, -1, axis=0).T
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed = spans & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    inside: BoolArray = crossed.sum(axis=1) % 2 == 1
    return inside


FACING = 0.3
"""Cosine between view and normal up to which a decal at an edge still counts as facing the viewer."""

HIDDEN_DEPTH = 0.5
"""A decal counts as hidden if another surface lies so far in front of its centre, in its radii."""

AT_CENTER = 1e-3
"""Distance, in radii, from a centre to the first surface along a ray, up to which the centre is seen."""


def facing_decals(
    document: Document, numbers: ArrayLike, rays: Sequence[tuple[ArrayLike, ArrayLike]]
) -> BoolArray:
    """Return True for each decal that a viewer sees, given the ray from the viewer to its centre."""
    decals = document.decals.take(numbers)
    if not len(decals):
        return np.zeros(0, np.bool_)
    origins, directions = (point_array(np.array([ray[part] for ray in rays])) for part in (0, 1))
    directions = unit_rows(directions)
    depths = np.einsum("ni,ni->n", decals.positions - origins, directions)
    first = np.full(len(decals), np.inf)
    for item in document.shown_objects:
        first = np.minimum(first, item.surface.raycast(origins, directions))
    toward = np.einsum("ni,ni->n", decals.normals, directions) < FACING
    seen: BoolArray = toward & (first > depths - HIDDEN_DEPTH * decals.radii)
    seen |= np.abs(first - depths) < AT_CENTER * decals.radii
    return seen


def on_shown_surfaces(document: Document, numbers: ArrayLike) -> BoolArray:
    """Return True for each decal that reaches a surface which is not hidden."""
    decals, objects = document.decals.take(numbers), document.shown_objects
    if not len(decals) or not any(item.hidden for item in document.objects):
        return np.ones(len(decals), np.bool_)
    if not objects:
        return np.zeros(len(decals), np.bool_)
    nearest = nearest_points(objects, decals.positions)
    reached: BoolArray = np.linalg.norm(nearest.positions - decals.positions, axis=1) < decals.radii
    return reached


ANGLES, RINGS = 48, 12
"""Directions in which an outline is sampled, and steps from the centre to the rim."""

LIFT = 0.01
"""Height of a line above the surface, in radii."""

RIM_STEPS = 4
"""Steps along the surface to the rim; each one leaves a small part of the remaining distance."""

SEPARATION = 16.0
"""Distance between decals that are evaluated as if each were alone, in radii."""

TESTED = 0.98, 0.75, 0.5, 0.25
"""Distances from the centre at which directions are tested, in radii."""

OTHER_PLACE = 0.2
"""Distance in the image, in radii, from which a point is that of another walk."""

INSIDE_TOLERANCE = 1.003
"""Distance from an image's centre, in its radii, up to which a point counts as inside."""


def outline(
    document: Document,
    number: int,
    *,
    contact: AnyContact | str = DEFAULT_CONTACT,
    mapping: ImageMapping | str = ImageMapping.CORRECTED,
) -> Float32Array:
    """Return the line around the visible part of a decal.

    The line ends at neighbours that push the decal. A decal that does not show at its own centre gets the rim
    that it would have without neighbours.

    Parameters
    ----------
    document
        The document, such as ``session.document``.
    number
        Number of the decal.
    contact, mapping
        As for `decals.evaluate`.

    Returns
    -------
    float32, shape (49, 3)
        Points of the closed line, slightly above the surface.

    Raises
    ------
    InvalidEdit
        The decal does not exist.

    Examples
    --------
    >>> from blobtree import Point
    >>> from decals import cover
    >>> from decals.editing import EditSession, outline
    >>> session = EditSession(cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"]))
    >>> outline(session.document, 3).shape
    (49, 3)
    """
    instance("document", document, Document, InvalidEdit, "session.document is one")
    whole_number("decal", number, 0, document.decals.next_number - 1, InvalidEdit)
    line: Float32Array = outlines(document, [number], contact=contact, mapping=mapping)[0]
    return line


def outlines(
    document: Document,
    numbers: ArrayLike,
    *,
    contact: AnyContact | str = DEFAULT_CONTACT,
    mapping: ImageMapping | str = ImageMapping.CORRECTED,
    angles: int = ANGLES,
) -> Float32Array:
    """Return the lines of `outline` for several decals, float32, shape (n, angles + 1, 3).

    Parameters
    ----------
    document
        The document.
    numbers
        Numbers of decals.
    contact, mapping
        As for `outline`.
    angles
        Directions in which each outline is sampled.
    """
    mapping = member("mapping", mapping, ImageMapping, InvalidEdit)
    numbers = np.asarray(numbers, np.int64)
    decals = document.decals.take(numbers)
    if not len(decals):
        return np.zeros((0, angles + 1, 3), np.float32)
    walked = WALKS and mapping is ImageMapping.WALKED
    walks = WALKS["for"](mapping, document.decals, document.objects, only=numbers) if walked else None
    own_walks = None if walks is None else walks.take(numbers)
    alone = {"mapping": mapping, "walks": own_walks}
    rims = _rim_points(document, decals, angles, alone)
    spokes = _spokes(document, decals, angles, alone)
    modes = {"contact": contact_mode(contact, InvalidEdit), "mapping": mapping, "walks": walks}

    def shown(fractions: Float64Array) -> Float64Array:
        points = _along_spokes(decals, rims, spokes, own_walks, fractions)
        return _visible_fractions(document, numbers, points, fractions, modes)

    visible = shown(np.broadcast_to(np.arange(RINGS + 1) / RINGS, (*rims.shape[:2], RINGS + 1)))
    finer = shown(np.minimum(visible[..., None] + np.arange(RINGS + 1) / RINGS**2, 1.0))
    lengths = np.where(visible.max(axis=1, keepdims=True) > 0.0, finer, 1.0)[..., None]
    return _lifted(document, _along_spokes(decals, rims, spokes, own_walks, lengths)[:, :, 0], decals.radii)


def _along_spokes(
    decals: Decals,
    rims: Float64Array,
    spokes: Float64Array,
    walks: Any,
    fractions: Float64Array,
) -> Float64Array:
    """Return points at fractions (n, angles, k) of the ways from centres to rims (n, angles, 3).

    They lie on the surface where `Walks` lead along spokes (n, angles, 2), otherwise on straight lines.
    """
    centers = decals.positions[:, None, None].astype(np.float64)
    points: Float64Array = centers + fractions[..., None] * (rims[:, :, None] - centers)
    if walks is not None:
        places = fractions[..., None] * spokes[:, :, None]
        led = walks.points(places.reshape(len(decals), -1, 2)).reshape(points.shape)
        points = np.where(np.isnan(led), points, centers + decals.radii[:, None, None, None] * led)
    return points


def _spokes(document: Document, decals: Decals, angles: int, alone: Mapping[str, Any]) -> Float64Array:
    """Return directions in the images of decals, float64, shape (n, angles, 2).

    Where another walk is shorter than the one that leads there, it is the last direction before. Only the
    last place of a direction to which a walk leads is tested.
    """
    directions = np.broadcast_to(_directions(angles), (len(decals), angles, 2))
    walks = alone["walks"]
    if walks is None:
        return directions
    places = np.asarray(TESTED)[:, None] * directions[:, :, None]
    led = walks.points(places.reshape(len(decals), -1, 2)).reshape(*places.shape[:3], 3)
    there = ~np.isnan(led[..., 0])
    last = np.arange(len(decals))[:, None], np.arange(angles), there.argmax(axis=2)
    there, led, places = there.any(axis=2), np.nan_to_num(led[last]), places[last]
    radii = decals.radii[:, None, None].astype(np.float64)
    centers = decals.positions[:, None].astype(np.float64)
    nearest = nearest_points(document.objects, (centers + radii * led).reshape(-1, 3))
    offsets = (nearest.positions.reshape(led.shape) - centers) / radii
    samples, _ = _alone(decals, offsets.reshape(-1, 3), nearest.normals.astype(np.float64), alone)
    apart = np.linalg.norm(2.0 * samples.uv.reshape(places.shape) - 1.0 - places, axis=2)
    reached = (there & (apart < OTHER_PLACE)) | ~there.any(axis=1, keepdims=True)
    turns = np.arange(2 * angles)
    before = np.maximum.accumulate(np.where(np.tile(reached, 2), turns, -1), axis=1)[:, angles:]
    chosen = np.where(before >= 0, before, turns[:angles]) % angles
    result: Float64Array = np.take_along_axis(directions, chosen[..., None], axis=1)
    return result


def _directions(angles: int) -> Float64Array:
    """Return unit vectors in so many directions of an image, float64, shape (angles, 2)."""
    turn = np.linspace(0.0, 2.0 * np.pi, angles, endpoint=False)
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


def _lifted(document: Document, points: Float64Array, radii: Float32Array) -> Float32Array:
    """Return lines (n, k, 3) put onto the surface, slightly above it, and closed."""
    nearest = nearest_points(document.objects, points.reshape(-1, 3))
    lifts = LIFT * np.repeat(radii, points.shape[1])[:, None]
    lines = (nearest.positions + lifts * nearest.normals).reshape(points.shape)
    closed: Float32Array = np.concatenate([lines, lines[:, :1]], axis=1).astype(np.float32)
    return closed


def _rim_points(document: Document, decals: Decals, angles: int, alone: Mapping[str, Any]) -> Float64Array:
    """Return points on the rims of decals without neighbours, float64, shape (n, angles, 3)."""
    axes = np.stack([decals.tangents, decals.bitangents], axis=1).astype(np.float64)
    directions = (_directions(angles) @ axes).reshape(-1, 3)
    centers = np.repeat(decals.positions.astype(np.float64), angles, axis=0)
    radii = np.repeat(decals.radii.astype(np.float64), angles)[:, None]
    points, remaining = centers, np.ones((len(centers), 1))
    for _ in range(RIM_STEPS):
        nearest = nearest_points(document.objects, points + remaining * radii * directions)
        points, normals = nearest.positions.astype(np.float64), nearest.normals.astype(np.float64)
        offsets = (points - centers) / radii
        directions = offsets - np.einsum("ni,ni->n", offsets, normals)[:, None] * normals
        directions = unit_rows(directions).astype(np.float64)
        remaining = 1.0 - _image_distances(decals, offsets, normals, alone)[:, None]
    return points.reshape(len(decals), angles, 3)


def _image_distances(
    decals: Decals, offsets: Float64Array, normals: Float64Array, alone: Mapping[str, Any]
) -> Float64Array:
    """Return distances from the image centres, in image radii, at offsets from decals without neighbours.

    The result is at least 1 outside.
    """
    samples, rows = _alone(decals, offsets, normals, alone)
    lengths = 2.0 * np.linalg.norm(samples.uv - 0.5, axis=1)
    outside = np.maximum(np.linalg.norm(offsets, axis=1), 1.0)
    result: Float64Array = np.where(samples.owner == rows, lengths, outside)
    return result


def _alone(
    decals: Decals, offsets: Float64Array, normals: Float64Array, alone: Mapping[str, Any]
) -> tuple[Samples, Int64Array]:
    """Return samples of decals without neighbours, and the row of the decal of each sample.

    Offsets (n · k, 3) from the centres are in radii, k for each decal.
    """
    centers = np.zeros((len(decals), 3))
    centers[:, 0] = SEPARATION * np.arange(len(decals))
    separate = decals.replace(positions=centers, radii=np.ones(len(decals)), receivers=None)
    rows = np.repeat(np.arange(len(decals)), len(offsets) // len(decals))
    return evaluate(separate, centers[rows] + offsets, normals, **alone), rows


def _visible_fractions(
    document: Document,
    numbers: Int64Array,
    points: Float64Array,
    fractions: Float64Array,
    modes: Mapping[str, Any],
) -> Float64Array:
    """Return per spoke the largest fraction up to which its decal shows without a gap, else the first one.

    Points have the shape (n, angles, k, 3), fractions (n, angles, k).
    """
    nearest = nearest_points(document.objects, points.reshape(-1, 3))
    owners = np.full(len(nearest.objects), -1, np.int32)
    for number in np.unique(nearest.objects):
        rows = np.flatnonzero(nearest.objects == number)
        samples = evaluate(
            document.decals,
            nearest.positions[rows],
            nearest.normals[rows],
            on=document.objects[int(number)],
            **modes,
        )
        inside = np.linalg.norm(samples.uv - 0.5, axis=1) <= 0.5 * INSIDE_TOLERANCE
        owners[rows] = np.where(inside, samples.owner, -1)
    shows = owners.reshape(fractions.shape) == numbers[:, None, None]
    last = np.logical_and.accumulate(shows, axis=2).sum(axis=2) - 1
    result: Float64Array = np.take_along_axis(fractions, np.maximum(last, 0)[..., None], axis=2)[..., 0]
    return result
