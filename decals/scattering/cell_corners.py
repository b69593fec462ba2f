"""Corners of the cells of decals, and the decals whose cells they prove to be covered."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from blobtree._typing import BoolArray, Float64Array, Int64Array
from decals.scattering.domain import OrientedPoints
from decals.scattering.owned_points import DOUBTFUL, OWNERS, OwnedPoints, firsts
from decals.surfaces.surface import tangent_axes

MAX_CORNER = 0.5
"""Largest distance of a corner of a cell from the point by which it is found, in radii."""

CORNER_SLACK = 0.1
"""Power of a fourth decal at such a corner below that of its three, in squared radii, up to which it counts:
the surface bends."""

SMOOTH = 0.85
"""Least cosine between the normals of a decal and of the points of its cell, where the surface is smooth.

An arc to such a point is at most 1.4 % longer than its chord."""

AROUND = np.radians(125.0)
"""Widest angle between neighbouring corners of a cell that they enclose, seen from its decal.

At an open border, the corners beyond it are missing."""

SURE = 0.985
"""Largest distance from a decal, in its radii, of points and corners of a cell that is surely covered."""


def power_corners(owned: OwnedPoints, radii: Float64Array) -> OrientedPoints:
    """Return the corners of cells near points: where three of the four least powers are equal.

    On a flat face without bends, the point of a cell that is farthest from its decal is one of its corners,
    or lies on an edge of the surface.
    """
    found: list[OrientedPoints] = []
    for rows, steps, _, _ in _corners(owned, radii):
        corners = (owned.points.positions[rows].astype(np.float64) + steps).astype(np.float32)
        found.append(replace(owned.points[rows], positions=corners))
    return OrientedPoints.joined(found)


def surely_covered(owned: OwnedPoints, peaks: OwnedPoints, radii: Float64Array) -> BoolArray:
    """Return True for decals whose cells have no bare point, ``bool[n]``; others may have none either.

    The surface is smooth over such a cell, and its corners in tangent planes are covered and go all around
    it. In a plane, the distance from a decal is greatest at a corner of its cell.

    Parameters
    ----------
    owned
        Points all over the cells.
    peaks
        One near each corner of a cell.
    radii
        Radius of each decal, ``float64[n]``.
    """
    sure = np.ones(len(radii), np.bool_)
    centers = owned.centers.points
    if centers.heights is not None:
        sure &= ~np.isfinite(centers.heights)
    cosines = np.einsum("ni,ni->n", centers.normals[owned.decals[:, 0]], owned.points.normals)
    rough = (owned.doubts < DOUBTFUL) | (cosines < SMOOTH) | (owned.shares(radii) > SURE)
    near = owned.decals[rough, :OWNERS]
    sure[near[near >= 0]] = False
    ids, places = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for rows, steps, decals, powers in _corners(peaks, radii):
        beyond = powers[:, None] > (SURE**2 - 1.0) * radii[decals] ** 2
        sure[decals[beyond.any(axis=1)]] = False
        ids.append(decals.reshape(-1))
        places.append(np.repeat(peaks.points.positions[rows] + steps, 3, axis=0))
    enclosed: BoolArray = _widest_gaps(centers, np.concatenate(ids), np.concatenate(places)) < AROUND
    return sure & enclosed


def _widest_gaps(centers: OrientedPoints, ids: Int64Array, places: Float64Array) -> Float64Array:
    """Return the widest angle between the directions to neighbouring corners of each cell, ``float64[n]``.

    `places` are corners ``[k, 3]`` of the cells of decals `ids`. Without corners it is a full turn.
    """
    first, second = tangent_axes(centers.normals.astype(np.float64))
    offsets = places - centers.positions[ids]
    x, y = (np.einsum("ni,ni->n", offsets, axes[ids]) for axes in (first, second))
    angles = np.arctan2(y, x)
    order = np.lexsort((angles, ids))
    angles, ids = angles[order], ids[order]
    last = np.ones(len(ids), np.bool_)
    last[:-1] = ids[1:] != ids[:-1]
    begins = np.flatnonzero(np.roll(last, 1))
    following = np.roll(angles, -1)
    following[last] = angles[begins] + 2.0 * np.pi
    gaps = np.zeros(len(centers))
    np.maximum.at(gaps, ids, following - angles)
    return np.where(gaps > 0.0, gaps, 2.0 * np.pi)


def _corners(
    owned: OwnedPoints, radii: Float64Array
) -> Iterator[tuple[Int64Array, Float64Array, Int64Array, Float64Array]]:
    """Return, of corners near points, the points, steps from them, the three decals, and their power.

    With the offsets w of the centres and the powers c at a point q, the powers at q + a are c − 2 a·w + |a|².
    So the corners in the tangent plane at q solve two linear equations.
    """
    decals, powers, offsets = owned.lowest(radii, 4)
    reach = MAX_CORNER * radii[decals[:, 0]]
    for triple in combinations(range(decals.shape[1]), 3):
        ids = np.sort(decals[:, triple], axis=1)
        order = np.lexsort((powers[:, 0], *ids.T))
        first = order[firsts(ids[order])]
        rows = first[decals[first][:, triple].min(axis=1) >= 0]
        w, c = offsets[rows][:, triple], powers[rows][:, triple]
        a, b = w[:, 1] - w[:, 0], w[:, 2] - w[:, 0]
        rises = 0.5 * (c[:, 1:] - c[:, :1])
        cross = np.cross(a, b)
        squared = np.einsum("ni,ni->n", cross, cross)
        step = rises[:, :1] * np.cross(b, cross) + rises[:, 1:] * np.cross(cross, a)
        step /= np.where(squared > 0.0, squared, 1.0)[:, None]
        there = powers[rows] - 2.0 * np.einsum("nki,ni->nk", offsets[rows], step)
        lengths = np.einsum("ni,ni->n", step, step)
        near = (squared > 0.0) & (lengths < reach[rows] ** 2)
        near &= there[:, triple[0]] <= there.min(axis=1) + CORNER_SLACK * radii[decals[rows, 0]] ** 2
        corner = (there[:, triple[0]] + lengths)[near]
        yield rows[near], step[near], decals[rows[near]][:, triple], corner
