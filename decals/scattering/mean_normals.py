"""Mean normals of the surface around decals, for centres on and near creases."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals.model import FACING_LIMIT
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
    sums: Float64Array = np.stack(
        [np.bincount(owners, directions[:, k], len(positions)) for k in range(3)], axis=1
    )
    result[rows] = unit_rows(sums[rows])
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
