"""Cells of decals: points of surfaces with the decals that may own them, and corners of cells near them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.field.radial import TOP_MARGIN
from decals.model import FACING_LIMIT
from decals.record import MIN_KEPT_RADIUS
from decals.scattering.domain import OrientedPoints
from decals.scattering.neighbors import FacingTree
from decals.surfaces.surface import tangent_axes, unit_rows

DOUBTFUL = 0.3
"""Difference of the cosine between a decal's and a point's normal from the facing limit, below which the
surface's smooth normals may decide whether the decal faces the point."""

BARELY = 0.045
"""Difference of that cosine from the facing limit, below which a decal barely faces a point."""

NEARLY_BARE = 0.975
"""Distance of a point from its owner, in the owner's radii, from which smooth normals may make it bare."""

CANDIDATES = 6
"""Nearest decals that face a point and may own it, whatever their radii."""

OWNERS = 3
"""Nearest decals that may own a point where the surface is smooth."""

ARC_REACH = 2.0
"""Ratio of the distances of two decals from a point up to which the length to the farther one is measured."""

TIE = 0.004
"""Difference of two powers at a point, in squared radii of its owner, up to which either decal may own it."""

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

Shade: TypeAlias = Callable[[OrientedPoints], OrientedPoints]
"""Return points on surfaces with the smooth normals of the picture; drop those whose normals are the same."""


@dataclass(frozen=True)
class Centers:
    """All decals, in a search tree; `gaps` are the distances to the nearest other decals, ``[n]``."""

    points: OrientedPoints
    tree: FacingTree
    gaps: Float64Array

    @staticmethod
    def of(decals: OrientedPoints) -> "Centers":
        """Return decals with their search tree."""
        tree = FacingTree(decals.positions, decals.normals, decals.heights)
        distances, _ = tree.around(2)
        gaps = distances[:, 1] if distances.shape[1] > 1 else np.full(len(decals), np.inf)
        return Centers(decals, tree, gaps)

    def find(self, points: OrientedPoints) -> "OwnedPoints":
        """Return points with their nearest decals."""
        decals = self.points
        distances, indices, doubts = self.tree.nearest_and_doubts(
            points.positions, points.normals, count=CANDIDATES
        )
        close = np.isfinite(distances) & (distances <= ARC_REACH * distances[:, :1])
        rows, owners = np.nonzero(close)[0], indices[close]
        offsets = points.positions[rows].astype(np.float64) - decals.positions[owners]
        n_p, n_q = decals.normals[owners].astype(np.float64), points.normals[rows].astype(np.float64)
        lengths = distances.copy()
        lengths[close] = arc_lengths(offsets, n_p, n_q)
        return OwnedPoints(points, lengths, distances, indices, doubts, self)


@dataclass(frozen=True)
class OwnedPoints:
    """Points, and the nearest `CANDIDATES` decals that face each: distances and indices, -1 for none.

    `lengths` are the distances along the surface, at which images end; straight ones for decals beyond
    `ARC_REACH`. All three are ``[n, k]``. `doubts` say how little decides which decals face it, ``[n]``.
    """

    points: OrientedPoints
    lengths: Float64Array
    distances: Float64Array
    decals: Int64Array
    doubts: Float32Array
    centers: Centers

    def within(self, limits: Float64Array) -> BoolArray:
        """Return True for points that a decal reaches at its largest radius."""
        reached = (self.decals >= 0) & (self.lengths <= limits[self.decals])
        return np.asarray(reached.any(axis=1))

    def belongs(self, flags: BoolArray) -> BoolArray:
        """Return True for points whose `OWNERS` nearest decals exist and have a flag, ``bool[n]`` each."""
        nearest = self.decals[:, :OWNERS]
        return np.asarray(((nearest >= 0) & flags[nearest]).all(axis=1))

    def __getitem__(self, rows: Int64Array) -> "OwnedPoints":
        return replace(
            self,
            points=self.points[rows],
            lengths=self.lengths[rows],
            distances=self.distances[rows],
            decals=self.decals[rows],
            doubts=self.doubts[rows],
        )

    def with_shading(self, shade: Shade | None, radii: Float64Array) -> "OwnedPoints":
        """Return the points, doubtful and nearly bare ones with the normals of `shade` as well.

        Points that their owner barely faces are returned with normals that it does not face, too: on curved
        surface it faces no points a little farther on.
        """
        if shade is None:
            return self
        rows = np.flatnonzero((self.doubts < DOUBTFUL) | (self.shares(radii) > NEARLY_BARE))
        others = OrientedPoints.joined([shade(self.points[rows]), self._averted(radii)])
        return self.joined(self.centers.find(others))

    def _averted(self, radii: Float64Array) -> OrientedPoints:
        """Return the points that their owner barely faces, with normals that it does not face.

        The factor 1.2 makes up for the length of the normals before they are units.
        """
        doubtful = self[np.flatnonzero(self.doubts < BARELY)]
        owners = np.take_along_axis(doubtful.decals, doubtful.owners(radii)[:, None], axis=1)[:, 0]
        axes = self.centers.points.normals[owners]
        cosines = np.einsum("ni,ni->n", doubtful.points.normals, axes)
        rows = np.flatnonzero((owners >= 0) & (cosines < FACING_LIMIT + BARELY))
        points = doubtful.points[rows]
        return replace(points, normals=unit_rows(points.normals - 1.2 * BARELY * axes[rows]))

    def powers(self, radii: Float64Array) -> Float64Array:
        """Return the powers of points, which decide between cells (`decals.field.radial`); ∞ for no decal."""
        return np.where(self.decals >= 0, self.distances**2 - radii[self.decals] ** 2, np.inf)

    def lowest(self, radii: Float64Array, count: int) -> tuple[Int64Array, Float64Array, Float64Array]:
        """Return the decals of least powers, these powers, and the offsets of the centres.

        The offsets ``[n, count, 3]`` are those of the centres' feet on the tangent planes of the points.
        """
        powers = self.powers(radii)
        columns = np.argsort(powers, axis=1)[:, :count]
        decals = np.take_along_axis(self.decals, columns, axis=1)
        positions = self.points.positions.astype(np.float64)
        normals = self.points.normals.astype(np.float64)
        offsets = self.centers.points.positions[decals] - positions[:, None]
        offsets -= np.einsum("nki,ni->nk", offsets, normals)[..., None] * normals[:, None]
        return decals, np.take_along_axis(powers, columns, axis=1), offsets

    def owners(self, radii: Float64Array) -> Int64Array:
        """Return the columns of the owners, ``[n]``: of least power, or the smallest that is nested above it.

        The image of the smallest must reach the point: the rule of `decals.field.radial.nested_owner`.
        """
        return self._owners(radii, self.powers(radii))

    def _owners(self, radii: Float64Array, powers: Float64Array) -> Int64Array:
        """Return `owners` by the powers of the points."""
        columns: Int64Array = powers.argmin(axis=1)
        own, larger = radii[self.decals], radii[self.decals[np.arange(len(columns)), columns]]
        smaller = (powers <= 0.0) & (own < larger[:, None])
        rows = np.flatnonzero(smaller.any(axis=1))
        own, larger, smaller = own[rows], larger[rows, None], smaller[rows]
        lowest = self.decals[rows, columns[rows]][:, None]
        least = MIN_KEPT_RADIUS * larger
        # nested decals are at most so far apart
        apart = least + np.sqrt(least**2 + larger**2 - np.where(smaller, own, larger) ** 2)
        smaller &= self.centers.gaps[self.decals[rows]] <= apart
        some = np.flatnonzero(smaller.any(axis=1))
        rows, smaller, lowest = rows[some], smaller[some], lowest[some]
        above = smaller & self._nested(self.decals[rows], lowest, radii)
        some = np.flatnonzero(above.any(axis=1))
        rows, above = rows[some], above[some]
        decals, own = self.decals[rows], powers[rows]
        facing = np.einsum("nki,ni->nk", self.centers.points.normals[decals], self.points.normals[rows])
        above &= (facing > FACING_LIMIT + TOP_MARGIN) & (self.lengths[rows] <= radii[decals])
        for column in range(decals.shape[1]):
            lower = own < own[:, column : column + 1]
            parted = lower & ~self._nested(decals, decals[:, column : column + 1], radii)
            above[:, column] &= ~parted.any(axis=1)
        top = np.where(above, radii[decals], np.inf).argmin(axis=1)
        columns[rows] = np.where(above.any(axis=1), top, columns[rows])
        return columns

    def _nested(self, decals: Int64Array, others: Int64Array, radii: Float64Array) -> BoolArray:
        """Return True for pairs of decals that are nested: `decals.record.balls_nested`."""
        positions = self.centers.points.positions
        offsets = positions[decals].astype(np.float64) - positions[others]
        squared = np.einsum("...i,...i->...", offsets, offsets)
        smaller, larger = (choose(radii[decals], radii[others]) for choose in (np.minimum, np.maximum))
        difference = larger**2 - smaller**2
        least = 2.0 * MIN_KEPT_RADIUS * np.sqrt(squared)
        nested: BoolArray = (squared - difference <= least * smaller) | (
            squared + difference <= least * larger
        )
        return nested

    def shares(self, radii: Float64Array) -> Float64Array:
        """Return the distance from the owner in its radii, ``[n]``; above 1 the point is bare.

        On lines of contact, where several decals are as good as owners, it is the largest of theirs.
        """
        powers = self.powers(radii)
        columns = self._owners(radii, powers)[:, None]
        own_radii = radii[self.decals]
        shares = np.where(self.decals >= 0, self.lengths, 0.0) / own_radii
        own = np.take_along_axis(powers, columns, 1)
        tolerance = TIE * np.take_along_axis(own_radii, columns, 1) ** 2
        tied = (powers <= own + tolerance) & (own == powers.min(axis=1, keepdims=True))
        result: Float64Array = np.where(tied, shares, np.take_along_axis(shares, columns, 1)).max(axis=1)
        return result

    def risky(self, radii: Float64Array, share: float, apart: float) -> "OwnedPoints":
        """Return points beyond a share of the radius: those nearest to bare in each cube of side `apart`.

        Points of one cube are compared if the same three decals meet there.
        """
        shares = self.shares(radii)
        outer = self[np.flatnonzero(shares > share)]
        shares = shares[shares > share]
        nearest = np.argsort(outer.powers(radii), axis=1)[:, :3]
        corners = np.take_along_axis(outer.decals, nearest, axis=1)
        cubes = np.floor(outer.points.positions.astype(np.float64) / (apart or 1.0)).astype(np.int64)
        places = np.hstack([corners, cubes])
        order = np.lexsort((-shares, *places.T))
        return outer[order[firsts(places[order])]]

    def joined(self, *others: "OwnedPoints") -> "OwnedPoints":
        """Return the points of all."""
        parts = (self, *others)
        return OwnedPoints(
            OrientedPoints.joined([part.points for part in parts]),
            np.concatenate([part.lengths for part in parts]),
            np.concatenate([part.distances for part in parts]),
            np.concatenate([part.decals for part in parts]),
            np.concatenate([part.doubts for part in parts]),
            self.centers,
        )

    def peaks(self, least: Float64Array) -> "OwnedPoints":
        """Return the farthest point of each corner of a Voronoi cell, at least so far from its owner.

        Points with the same owner and the same next two decals share a corner of the owner's cell. `least`
        holds a distance for each decal.
        """
        owners = self.decals[:, 0]
        outer = np.flatnonzero((owners >= 0) & (self.lengths[:, 0] > least[owners]))
        corners = np.hstack([self.decals[outer, :1], np.sort(self.decals[outer, 1:3], axis=1)])
        order = np.lexsort((-self.lengths[outer, 0], *corners.T))
        return self[outer[order[firsts(corners[order])]]]


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


def firsts(rows: Int64Array) -> BoolArray:
    """Return True for rows that differ from the one before."""
    first = np.ones(len(rows), np.bool_)
    first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return first


def arc_lengths(w: Float64Array, n_p: Float64Array, n_q: Float64Array) -> Float64Array:
    """Return the lengths along the surface at which the corrected mapping draws offsets w, ``float64[n]``.

    `decals.field.mapping.unroll` states the formula.
    """
    a, b = -np.einsum("ni,ni->n", w, n_p), np.einsum("ni,ni->n", w, n_q)
    squared = np.einsum("ni,ni->n", w, w)
    arc = (a * b > 0.0) & (squared > 0.0)
    sine = np.clip(0.5 * np.linalg.norm(n_q - n_p, axis=1), 1e-6, 1.0)
    stretch = np.arcsin(sine) / sine
    y = (b - a) / np.where(arc, a + b, 1.0)
    longer = squared + a * b * (1.0 + 2.0 * y * y) * (stretch**2 - 1.0) / sine**2
    lengths: Float64Array = np.sqrt(np.where(arc, longer, squared))
    return lengths
