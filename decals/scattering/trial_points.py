"""Trial points in the search for the points of surfaces that are farthest from their decals."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import TypeAlias

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from decals.scattering.domain import OrientedPoints
from decals.scattering.owned_points import OwnedPoints, firsts
from decals.surfaces.surface import unit_rows

LEAST_BEND = 0.05
"""Least sine between the normals of two faces whose edge is searched along."""

ON_PLANE = 0.01
"""Largest distance of a projected point from the plane of a face, in spreads, at which it lies there."""

MAX_CORNER = 0.5
"""Largest distance of a corner of a cell from the point by which it is found, in radii."""

CORNER_SLACK = 0.1
"""Power of a fourth decal at such a corner below that of its three, in squared radii, up to which it counts:
the surface bends."""

Project: TypeAlias = Callable[[OrientedPoints], tuple[OrientedPoints, Int64Array]]
"""Project points onto their own surfaces, drop those hidden there, and return the rows of the rest."""


def circumcenters(peaks: OwnedPoints, decals: OrientedPoints) -> OrientedPoints:
    """Return the centre of the circle through the three decals of each peak, as a guess of its corner."""
    corners = peaks.decals[:, :3]
    whole = np.flatnonzero((corners >= 0).all(axis=1))
    a, b, c = np.moveaxis(decals.positions[corners[whole]].astype(np.float64), 1, 0)
    ab, ac = b - a, c - a
    normal = np.cross(ab, ac)
    square = np.einsum("ni,ni->n", normal, normal)
    ab2, ac2 = np.einsum("ni,ni->n", ab, ab), np.einsum("ni,ni->n", ac, ac)
    offset = ac2[:, None] * np.cross(normal, ab) + ab2[:, None] * np.cross(ac, normal)
    offset /= np.where(square > 0, 2.0 * square, 1.0)[:, None]
    sound = (square > 0) & (np.linalg.norm(offset, axis=1) < 2.0 * peaks.distances[whole, 0])
    centers = (a + offset)[sound].astype(np.float32)
    return replace(peaks.points[whole[sound]], positions=centers)


def outward(owned: OwnedPoints, radii: Float64Array, reach: float) -> OrientedPoints:
    """Return points so far from given ones, away from their owners or along the border of the cells.

    On an edge or an open border of the surface, the point of a cell that is farthest from its decal is a
    vertex, or lies where the edge meets the border of the cell. These trials approach both: they lie as high
    above the surface, so that beyond an edge they are projected onto it, and so along it.
    """
    decals, powers, w = owned.lowest(radii, 2)
    normals = owned.points.normals.astype(np.float64)
    step = -reach * unit_rows(w[:, 0]).astype(np.float64)
    between = w[:, 1] - w[:, 0]
    lengths = np.linalg.norm(between, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = 0.5 * (powers[:, 1] - powers[:, 0]) / lengths
    near = np.flatnonzero((decals[:, 1] >= 0) & (height < reach))
    across = between[near] / lengths[near, None]
    along = np.cross(normals[near], across)
    along *= -np.sign(np.einsum("ni,ni->n", along, w[near, 0]))[:, None]
    height = height[near, None]
    step[near] = height * across + np.sqrt(reach**2 - height**2) * along
    lifted = (owned.points.positions.astype(np.float64) + step + reach * normals).astype(np.float32)
    return replace(owned.points, positions=lifted)


def projected(trials: list[OrientedPoints], height: float, project: Project) -> OrientedPoints:
    """Return projected points; those of the first trials come from a height over planes, to which they keep.

    One that falls onto the edge of its plane gets the normal of the plane, not that of the other face.
    """
    lifted, joined = len(trials[0]), OrientedPoints.joined(trials)
    points, rows = project(joined)
    normals = joined.normals[rows]
    risen = np.einsum("ni,ni->n", points.positions - joined.positions[rows], normals) + height
    on_plane = (rows < lifted) & (np.abs(risen) < ON_PLANE * height)
    return replace(points, normals=np.where(on_plane[:, None], normals, points.normals))


def along_edges(trials: OrientedPoints, height: float, project: Project) -> OrientedPoints:
    """Return the points of faces' edges that are nearest to trials, with the normals of the faces.

    The trials lie at a height over faces. The planes of such a face and of the one that a trial falls onto
    meet at the edge, if the faces do.
    """
    points, rows = project(trials)
    own, others = trials.normals[rows].astype(np.float64), points.normals.astype(np.float64)
    feet = trials.positions[rows] - height * own
    across = others - np.einsum("ni,ni->n", others, own)[:, None] * own
    squared = np.einsum("ni,ni->n", across, across)
    beyond = np.einsum("ni,ni->n", feet - points.positions, others)
    bent = np.flatnonzero((squared > LEAST_BEND**2) & (beyond**2 < squared * (2.0 * height) ** 2))
    meets = feet[bent] - (beyond[bent] / squared[bent])[:, None] * across[bent]
    edges = replace(trials[rows[bent]], positions=meets.astype(np.float32))
    points, rows = project(edges)
    moved = np.linalg.norm(points.positions - edges.positions[rows], axis=1)
    return edges[rows[moved < ON_PLANE * height]]


def power_corners(owned: OwnedPoints, radii: Float64Array) -> OrientedPoints:
    """Return the corners of cells near points: where three of the four least powers are equal.

    With the offsets w of the centres and the powers c at a point q, the powers at q + a are c − 2 a·w + |a|².
    So the corners in the tangent plane at q solve two linear equations. On a flat face without bends, the
    point of a cell that is farthest from its decal is one of its corners, or lies on an edge of the surface.
    """
    decals, powers, offsets = owned.lowest(radii, 4)
    reach = MAX_CORNER * radii[decals[:, 0]]
    found: list[OrientedPoints] = []
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
        near = (squared > 0.0) & (np.einsum("ni,ni->n", step, step) < reach[rows] ** 2)
        near &= there[:, triple[0]] <= there.min(axis=1) + CORNER_SLACK * radii[decals[rows, 0]] ** 2
        rows = rows[near]
        corners = (owned.points.positions[rows].astype(np.float64) + step[near]).astype(np.float32)
        found.append(replace(owned.points[rows], positions=corners))
    return OrientedPoints.joined(found)


def random_points_around(
    points: OrientedPoints, count: int, spread: float, rng: np.random.Generator
) -> OrientedPoints:
    """Return so many normally distributed points around each point."""
    repeated = points[np.repeat(np.arange(len(points)), count)]
    offsets = rng.normal(0.0, spread, repeated.positions.shape).astype(np.float32)
    return replace(repeated, positions=repeated.positions + offsets)
