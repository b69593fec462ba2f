"""Box atlas: charts that are projections of a surface along the six axes, as the sides of a box see it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from decals.baking.meshes import BakeMesh
from decals.baking.packing import pack
from decals.baking.unwrapped import Unwrapped
from decals.sorting import distinct_numbers, groups
from decals.surfaces.topology import components

SIDES = 6
"""Sides of a box; axes 0 to 2 are +x, +y and +z, and 3 to 5 are −x, −y and −z."""

MIN_COSINE = 0.35
"""Least cosine between a face and the axis along which it is projected, unless no axis is closer."""

SMOOTHING = 0.3
"""What a neighbour with the same axis counts beside the cosine."""

SMOOTHING_ROUNDS = 12

MAX_CHARTS = 1000
"""Most charts of an atlas; surfaces that need more are too rugged for it."""

ANGLES = np.arange(0.0, 90.0, 5.0)
"""Turns of a chart, in degrees, of which that with the smallest rectangle is taken."""


@dataclass(frozen=True, eq=False)
class BoxSides:
    """Side of a box that sees each face of a mesh.

    Attributes
    ----------
    normals : float64[m, 3]
    doubled : float64[m]
        Twice the areas.
    neighbors : int64[m, 3]
        Index of the face on the other side of each edge; −1 at open edges.
    axis : int64[m]
        One of `SIDES`.
    """

    normals: Float64Array
    doubled: Float64Array
    neighbors: Int64Array
    axis: Int64Array

    @classmethod
    def of(cls, mesh: BakeMesh, tick: Callable[[], None]) -> "BoxSides":
        """Return the sides of a mesh: close to the normals, and alike among neighbours.

        ``tick`` is called after each step; an error that it raises ends the work.
        """
        faces = mesh.faces.astype(np.int64)
        corners = mesh.vertices[faces].astype(np.float64)
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(crosses, axis=1)
        tick()
        neighbors = np.where(mesh.twins >= 0, mesh.twins // 3, -1).reshape(-1, 3)
        tick()
        normals = crosses / np.maximum(doubled, 1e-300)[:, None]
        return cls(normals, doubled, neighbors, _smoothed(np.hstack([normals, -normals]), neighbors, tick))


@dataclass(frozen=True, eq=False)
class _Charts:
    """Charts of one mesh in its own units.

    Attributes
    ----------
    rows : int64[k]
        Vertices of the mesh, a copy for each chart.
    faces : int64[m, 3]
    places : float64[k, 2]
        From the lower corner of the chart's rectangle.
    chart_of_row : int64[k]
    sides : float64[c, 2]
        Of the rectangles.
    """

    rows: Int64Array
    faces: Int64Array
    places: Float64Array
    chart_of_row: Int64Array
    sides: Float64Array


def box_atlas(
    meshes: Sequence[BakeMesh],
    groups: Sequence[Int64Array],
    size: int,
    tiles: int,
    padding: float,
    tick: Callable[[], None],
) -> list[Unwrapped] | None:
    """Return places for meshes on textures ``size`` texels wide, or None if there are too many charts.

    All charts have about the same number of texels per area. A chart has faces of one group. Charts may lie
    over themselves, see `decals.baking.layouts`. ``tick`` is called after each step.
    """
    made = [_charts(mesh, group, tick) for mesh, group in zip(meshes, groups, strict=True)]
    sides = np.concatenate([charts.sides for charts in made])
    if len(sides) > MAX_CHARTS:
        return None
    scale = 0.0
    while scale == 0.0 and padding >= 0.25:
        scale, corners, squares = pack(sides, padding / size, tiles)
        padding /= 2.0
    if scale == 0.0:
        return None
    unwrapped, first = [], 0
    for charts in made:
        own = charts.chart_of_row + first
        first += len(charts.sides)
        places = (charts.places * scale + corners[own]) * size
        tile = squares[own[charts.faces[:, 0]]].astype(np.int32)
        faces = charts.faces.astype(np.int32)
        unwrapped.append(Unwrapped(charts.rows, faces, places.astype(np.float32), tile))
    return unwrapped


def _charts(mesh: BakeMesh, group: Int64Array, tick: Callable[[], None]) -> _Charts:
    faces = mesh.faces.astype(np.int64)
    sides = BoxSides.of(mesh, tick)
    axis, neighbors, doubled = sides.axis, sides.neighbors, sides.doubled
    label = group * SIDES + axis
    face, side = np.nonzero((neighbors >= 0) & (label[neighbors] == label[:, None]))
    links = np.stack([face, neighbors[face, side]], axis=1)
    chart = components(links, len(faces))
    tick()
    keys = (chart[:, None] * len(mesh.vertices) + faces).reshape(-1)
    first, copies, _ = groups(keys)
    chart_of_row, rows = np.divmod(keys[first], len(mesh.vertices))
    tick()
    axis_of_chart = np.zeros(int(chart.max()) + 1, np.int64)
    axis_of_chart[chart] = axis
    flat = np.bincount(chart, doubled * np.abs(sides.normals[np.arange(len(faces)), axis % 3]))
    stretch = np.sqrt(np.bincount(chart, doubled) / np.maximum(flat, 1e-300))
    places = _projected(mesh.vertices[rows].astype(np.float64), axis_of_chart[chart_of_row])
    places *= np.minimum(stretch, 1.0 / MIN_COSINE)[chart_of_row, None]
    tick()
    places, rectangles = _turned(places, chart_of_row)
    return _Charts(rows, copies.reshape(-1, 3), places, chart_of_row, rectangles)


def _smoothed(cosines: Float64Array, neighbors: Int64Array, tick: Callable[[], None]) -> Int64Array:
    """Return the axis of each face: close to its normal, and alike among neighbours."""
    axis: Int64Array = cosines.argmax(axis=1)
    votes = np.vstack([SMOOTHING * np.eye(SIDES), np.zeros(SIDES)])  # the last one is at open edges
    with_none = np.append(axis, SIDES)
    faces = np.flatnonzero((with_none[neighbors] != axis[:, None]).any(axis=1))
    for _ in range(SMOOTHING_ROUNDS):
        tick()
        own = cosines[faces]
        allowed = (own >= MIN_COSINE) | (own >= own.max(axis=1, keepdims=True))
        total = own + votes[with_none[neighbors[faces]]].sum(axis=1)
        chosen = np.where(allowed, total, -np.inf).argmax(axis=1)
        moved = faces[chosen != with_none[faces]]
        with_none[faces] = chosen
        beside = neighbors[moved]
        faces = distinct_numbers(beside[beside >= 0], len(axis))  # no others can change now
    return with_none[:-1]


def _projected(points: Float64Array, axis: Int64Array) -> Float64Array:
    """Return points as an eye sees them that looks against an axis, ``float64[n, 2]``, y downward."""
    along, negative = axis % 3, axis >= 3
    rows = np.arange(len(points))
    right, up = points[rows, (along + 1) % 3], points[rows, (along + 2) % 3]
    return np.stack([np.where(negative, -right, right), -up], axis=1)


def _turned(places: Float64Array, chart: Int64Array) -> tuple[Float64Array, Float64Array]:
    """Return places from the corners of the smallest rectangles around charts, and these rectangles.

    The places come chart after chart.
    """
    starts = np.flatnonzero(np.diff(chart, prepend=-1))
    best = np.full(len(starts), np.inf)
    angles, low, sides = np.zeros(len(starts)), np.zeros((2, len(starts))), np.zeros((2, len(starts)))
    for angle in np.radians(ANGLES):
        now = _rotated(places.T, angle)
        lower, upper = (fold.reduceat(now, starts, axis=1) for fold in (np.minimum, np.maximum))
        area = (upper - lower).prod(axis=0)
        better = area < best * (1.0 - 1e-6)
        best[better], angles[better] = area[better], angle
        low[:, better], sides[:, better] = lower[:, better], (upper - lower)[:, better]
    return (_rotated(places.T, angles[chart]) - low[:, chart]).T, sides.T


def _rotated(places: Float64Array, angle: float | Float64Array) -> Float64Array:
    """Return places ``float64[2, n]`` turned by an angle."""
    (x, y), cosine, sine = places, np.cos(angle), np.sin(angle)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x])
