"""Normals of decals: means around centres near creases, and turns at lips and behind thin walls."""

from collections.abc import Callable
from copy import copy
from typing import TypeAlias

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals.model import FACING_LIMIT
from decals.scattering.domain import OrientedPoints
from decals.scattering.neighbors import NearestFacing
from decals.scattering.sizing import EXPECTED_RADIUS, WithNormals
from decals.surfaces.surface import unit_rows

MEAN_RADIUS = 0.5
"""Radius within which normals are averaged, in radii of the decal."""

BEND_ANGLE = 40.0
"""Angle in degrees by which the surface must bend within that radius, or the decal keeps its own normal."""

MIN_ALONG = 0.98
"""Least cosine between the step of a projection and the normal where it ends; on an edge it is smaller."""

TOLERANCE = 1e-3
"""Length of a step whose direction is rounding, in radii of the ball."""

PROBES, TRIALS = 24, 192
"""Points in the ball around a centre that find a bend, and that average its normals."""

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
"""Angle between neighbours of a Fibonacci lattice on the sphere."""

PLASTIC_STEP = 0.7548776662466927
"""Inverse of the plastic number: step of a sequence of low discrepancy (Roberts 2018)."""

LIP_RATIO = 1.2
"""Distance of the nearest facing decal, in expected radii, from which a point may lie at a lip."""

LIP_NEARNESS = 0.95
"""Share of that distance within which a decal that faces away must lie, or the point lies at no lip."""

ON_EDGE = 0.7
"""Least cosine between the normal of a decal turned to a lip and that of the surface at its centre."""

MAX_BEHIND, BEHIND = 0.25, 0.02
"""Largest cosine between the normals of a decal and of surface behind a wall, and least product of the
heights of the centre above that surface and of that surface above the decal's, in squared distances."""

EVEN_AROUND, MAX_ASIDE, MIN_ASIDE = 0.995, 0.05, 0.3
"""Least cosine between the normals of a decal and of its surface where the surface around it is flat; largest
cosine between the normals of such a decal and of surface that it sees edge-on, and for other decals the
largest absolute value; and least height of that
surface's points over the centre, along their normals, in distances."""

TURN_MARGIN = 0.03
"""Amount by which a decal turns beyond the facing limit, as a cosine."""

SMALL_MOVE = 0.05
"""Distance in spacings up to which decals keep their mean normals while a place for them is looked for."""

MAX_TURN = 20.0
"""Largest angle in degrees by which a decal turns away from surface behind a wall."""

Near: TypeAlias = Callable[[Float32Array, Int64Array], tuple[Float32Array, Float32Array, Int64Array]]
"""A function of points and their decals that returns surface points near them, the normals there, and the row
of the point that each was found from."""


def mean_normals(
    positions: Float32Array, normals: Float32Array, radii: Float64Array, near: Near
) -> Float32Array:
    """Return the normals of decals: at a bend of the surface the mean around the centre, else the own ones.

    A decal with the normal of one of the faces at an edge loses a dimension of its image on the other. With
    the mean normal, both faces are seen at the same angle. The points of a ball of half a radius around the
    centre are projected onto the surface. Those do not count that face away from the centre, end outside the
    ball, or end on an edge itself, where the normal is that of either side.

    Parameters
    ----------
    positions, normals
        Centres, and the unit normals of the surface there, ``float32[n, 3]`` each.
    radii
        Expected radii of the decals, ``float64[n]``.
    near
        Finds the surface near points.

    Returns
    -------
    float32[n, 3]
    """
    result = normals.copy()
    reaches = MEAN_RADIUS * radii
    rows: Int64Array = np.arange(len(positions))
    for count in (PROBES, TRIALS):
        points, centers = _ball_points(positions, reaches, rows, count)
        found, directions, sources = near(points, centers)
        owners = centers[sources]
        steps = points[sources].astype(np.float64) - found
        along = np.abs(np.einsum("ni,ni->n", steps, directions))
        direct = along >= MIN_ALONG * np.linalg.norm(steps, axis=1) - TOLERANCE * reaches[owners]
        offsets = np.linalg.norm(found.astype(np.float64) - positions[owners], axis=1)
        cosines = np.einsum("ni,ni->n", directions, normals[owners])
        counts = direct & (offsets <= reaches[owners]) & (cosines > FACING_LIMIT)
        directions, owners, cosines = directions[counts], owners[counts], cosines[counts]
        bent = owners[cosines < np.cos(np.radians(BEND_ANGLE))]
        rows = np.unique(bent)
        if len(rows) == 0:
            return result
    result[rows] = unit_rows(_sums(directions, owners, len(positions))[rows])
    return result


def _ball_points(
    positions: Float32Array, reaches: Float64Array, rows: Int64Array, count: int
) -> tuple[Float32Array, Int64Array]:
    """Return points spread evenly in the balls around some centres, and the rows of the centres."""
    steps = np.arange(count) + 0.5
    heights = 1.0 - 2.0 * steps / count
    angles = GOLDEN_ANGLE * np.arange(count)
    sides = np.sqrt(1.0 - heights**2)
    directions = np.stack([sides * np.cos(angles), sides * np.sin(angles), heights], axis=1)
    lengths = ((np.arange(count) * PLASTIC_STEP + 0.5) % 1.0) ** (1 / 3)
    ball = directions * lengths[:, None]
    points = positions[rows][:, None] + reaches[rows][:, None, None] * ball
    return points.reshape(-1, 3).astype(np.float32), np.repeat(rows, count)


class DecalNormals:
    """Finds the normals of decals, again while some of their centres move.

    Parameters
    ----------
    centers
        Centres, with the normals of their surfaces.
    spacings
        Spacing at each centre, ``float32[n]``.
    samples
        Points spread evenly over the area to cover.
    with_normals
        Gives centres the normals of decals, before some turn.
    """

    def __init__(
        self,
        centers: OrientedPoints,
        spacings: Float32Array,
        samples: OrientedPoints,
        with_normals: WithNormals,
    ) -> None:
        self._spacings, self._samples, self._with_normals = spacings, samples, with_normals
        self._tolerance = 0.0
        self._decals = with_normals(centers, spacings)
        self._nearest = NearestFacing(samples.positions, samples.normals)

    def part(self, rows: Int64Array, samples: OrientedPoints) -> "DecalNormals":
        """Return one for some of the decals and the samples around them.

        It keeps the normals of decals that move at most `SMALL_MOVE` spacings.
        """
        other = copy(self)
        other._spacings, other._samples, other._decals = self._spacings[rows], samples, self._decals[rows]
        other._nearest = NearestFacing(samples.positions, samples.normals)
        other._tolerance = SMALL_MOVE
        return other

    def of(self, centers: OrientedPoints) -> OrientedPoints:
        """Return the decals at centres, turned as `turned_normals` says."""
        distances = np.linalg.norm(centers.positions - self._decals.positions, axis=1)
        moved = np.flatnonzero(distances > self._tolerance * self._spacings)
        self._decals = self._decals.replaced(moved, self._with_normals(centers[moved], self._spacings[moved]))
        radii = EXPECTED_RADIUS * self._spacings.astype(np.float64)
        bent = OrientedPoints(centers.positions, self._decals.normals, centers.surface_ids)
        normals = turned_normals(bent, centers.normals, self._samples, self._nearest, radii)
        return OrientedPoints(centers.positions, normals, centers.surface_ids)


def turned_normals(
    decals: OrientedPoints,
    own: Float32Array,
    samples: OrientedPoints,
    nearest: NearestFacing,
    radii: Float64Array,
) -> Float32Array:
    """Return the normals of decals, turned toward lips and away from surface behind walls, ``float32[n, 3]``.

    At the edge of a thin wall, a ledge or an ear, the decals next to a point may all face away from it. The
    next that faces it would need an outsized radius, and cover its neighbours. A decal on the edge itself
    that is next to such points gets the mean of their normals and its own; its image bends over the edge.

    The floor of a thin cup, seen through the wall from a decal outside, may face that decal, as their normals
    are nearly perpendicular. The decal turns away, by at most `MAX_TURN` degrees. So does a decal on flat
    surface from faces that it sees edge-on, where its image would be stretched.

    Parameters
    ----------
    decals
        Centres and normals of the decals.
    own
        Normals of the surfaces at the centres, ``float32[n, 3]``.
    samples
        Points spread evenly over the area to cover.
    nearest
        Finds the decals nearest to the samples.
    radii
        Expected radius of each decal, ``float64[n]``.
    """
    normals = decals.normals.astype(np.float64)
    changed = np.zeros(len(decals), np.bool_)
    facing, owners = nearest.of(decals.positions, decals.normals)
    owned = owners >= 0
    lips = np.flatnonzero(owned & (facing > LIP_RATIO * radii[owners]))
    if len(lips):
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        distances, rows = cKDTree(decals.positions).query(samples.positions[lips])
        close = distances < LIP_NEARNESS * facing[lips]
        lips, rows = lips[close], rows[close]
        toward = unit_rows(_sums(samples.normals[lips], rows, len(decals))).astype(np.float64)
        turned = unit_rows(toward + normals).astype(np.float64)
        on_edge = toward.any(axis=1) & (np.einsum("ni,ni->n", turned, own) > ON_EDGE)
        normals[on_edge] = turned[on_edge]
        changed |= on_edge
    cosines = np.einsum("ni,ni->n", normals.astype(np.float32)[owners], samples.normals)
    seen = np.flatnonzero(owned & (cosines < max(MAX_BEHIND, MAX_ASIDE)))
    rows, cosines = owners[seen], cosines[seen]
    offsets = samples.positions[seen].astype(np.float64) - decals.positions[rows]
    depths = np.einsum("ni,ni->n", offsets, normals[rows])
    heights = np.einsum("ni,ni->n", offsets, samples.normals[seen].astype(np.float64))
    squared = np.einsum("ni,ni->n", offsets, offsets)
    flat = (np.einsum("ni,ni->n", normals, own.astype(np.float64)) > EVEN_AROUND)[rows]
    seen_aside = (flat | (cosines > -MAX_ASIDE)) & (cosines < MAX_ASIDE)
    edge_on = seen_aside & (heights > MIN_ASIDE * np.sqrt(squared))
    behind = ((cosines < MAX_BEHIND) & (depths * heights > BEHIND * squared)) | edge_on
    rows = rows[behind]
    away = unit_rows(_sums(samples.normals[seen[behind]], rows, len(decals))).astype(np.float64)
    worst = np.full(len(decals), -1.0)
    np.maximum.at(worst, rows, cosines[behind])
    angles = np.arccos(FACING_LIMIT - TURN_MARGIN) - np.arccos(np.clip(worst, -1.0, 1.0))
    turn = np.flatnonzero(away.any(axis=1) & (angles > 0) & (angles <= np.radians(MAX_TURN)))
    across = away[turn] - np.einsum("ni,ni->n", away[turn], normals[turn])[:, None] * normals[turn]
    angle = angles[turn, None]
    normals[turn] = np.cos(angle) * normals[turn] - np.sin(angle) * unit_rows(across)
    changed[turn] = True
    result = decals.normals.copy()
    result[changed] = unit_rows(normals[changed])
    return result


def _sums(vectors: Float32Array, rows: Int64Array, count: int) -> Float64Array:
    """Return the sum of the vectors of each row, ``float64[count, 3]``."""
    return np.stack([np.bincount(rows, vectors[:, k], count) for k in range(3)], axis=1)
