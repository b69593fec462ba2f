"""Radii of decals: gap-free, touching, or by the paper's rule."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from itertools import combinations
from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.formulas.falloff import RIM
from blobtree.progress import reporting
from decals.field.radial import TOP_MARGIN
from decals.model import FACING_LIMIT
from decals.record import MIN_KEPT_RADIUS
from decals.scattering.domain import OrientedPoints
from decals.scattering.neighbors import FacingTree, NearestFacing
from decals.surfaces.surface import unit_rows

RADIUS_MARGIN = 0.03
"""Margin of covering radii, as a share: an allowance for farthest points that the search missed."""

PEAK_FRACTION = 0.75
"""Distance of a point from its decal, as a share of the decal's radius so far, from which it is a peak."""

TRIAL_RANGE = 2.5
"""Distance that a round of trials may gain, in its own spreads; nearer peaks drop out."""

MAX_BARE_SHARE = 0.05
"""Largest share of a decal's mean area that may stay bare to spare the decal an outsized radius."""

MAX_RADIUS_RATIO = 1.5
"""Ratio of an outsized radius to the larger of the radius without bare points and the median of those."""

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

MAX_TURN = 20.0
"""Largest angle in degrees by which a decal turns away from surface behind a wall."""

CORNER_TOLERANCE = 1.02
"""Ratio of the distances from two decals up to which a point is a corner of both Voronoi cells."""

DOUBTFUL = 0.3
"""Difference of the cosine between a decal's and a point's normal from the facing limit, below which the
surface's smooth normals may decide whether the decal faces the point."""

NEARLY_BARE = 0.975
"""Distance of a point from its owner, in the owner's radii, from which smooth normals may make it bare."""

CANDIDATES = 6
"""Nearest decals that face a point and may own it, whatever their radii."""

ARC_REACH = 2.0
"""Ratio of the distances of two decals from a point up to which the length to the farther one is measured."""

SPARE = 0.015
"""Share of its radius by which a decal grows beyond a bare point."""

SEARCHES = ((0.5, 0.9, 1), (0.3, 0.93, 1), (0.15, 0.96, 2), (0.08, 0.97, 2), (0.04, 0.98, 2))
"""Rounds that look for bare points: spread of random points in mean distances of the samples, distance of the
points around which they lie from their owners, in the owners' radii, and number of random points around each.
Another point lies a spread farther out. The last round is repeated."""

LEAST_BEND = 0.05
"""Least sine between the normals of two faces whose edge is searched along."""

ON_PLANE = 0.01
"""Largest distance of a projected point from the plane of a face, in spreads, at which it lies there."""

CUBE = 1.0
"""Side of the cubes of which one point each is searched around, in mean distances of the samples."""

TIE = 0.004
"""Difference of two powers at a point, in squared radii of its owner, up to which either decal may own it."""

MAX_CORNER = 0.5
"""Largest distance of a corner of a cell from the point by which it is found, in radii."""

CORNER_SLACK = 0.1
"""Power of a fourth decal at such a corner below that of its three, in squared radii, up to which it counts:
the surface bends."""

MAX_SEARCHES, CLEAN_SEARCHES, MAX_REPEATS = 12, 2, 4
"""Largest number of rounds, number of those without a bare point after which they end, and largest number of
repeats of all rounds around decals that grew."""

EVEN_RADIUS_RATIO = 1.495
"""Ratio of a radius to the median at even density, beyond which other decals grow first."""

CLEARANCE = 0.005
"""Share of its radius by which an image should end beyond every point that the searches find."""

SPECK = 0.01
"""Share of its radius by which an image may end before a point that only such a decal could cover."""

TRIALS_PER_PEAK = 2
"""Random points around each peak in each round."""

TRIAL_SPREADS = (1.0, 0.4)
"""Standard deviation of the random points of each round, in mean distances of the samples."""


class Sizing(Enum):
    """Rules for the radii of decals.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> ball = decals.surfaces.ImplicitSurface(Point((0, 0, 0), radius=1.0))
    >>> covering = decals.scatter(ball, count=40)
    >>> touching = decals.scatter(ball, count=40, sizing=decals.Sizing.TOUCHING)
    >>> bool(touching.radii.max() < covering.radii.min())
    True
    """

    COVERING = "covering"
    """Least radii that leave no gap."""
    TOUCHING = "touching"
    """Half the distance to the nearest neighbour: decals do not overlap."""
    DELAUNAY = "delaunay"
    """The paper's rule: the field ends at the farthest Delaunay neighbour. It leaves small gaps."""


Project: TypeAlias = Callable[[OrientedPoints], tuple[OrientedPoints, Int64Array]]
"""Project points onto their own surfaces, drop those hidden there, and return the rows of the rest."""

Shade: TypeAlias = Callable[[OrientedPoints], OrientedPoints]
"""Return points on surfaces with the smooth normals of the picture; drop those whose normals are the same."""


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


def covering_radii(
    decals: OrientedPoints,
    samples: OrientedPoints,
    project: Project,
    seed: int,
    *,
    shade: Shade | None = None,
    even: bool = False,
    nearest: NearestFacing | None = None,
) -> Float64Array:
    """Return the least radii, up to a small margin, at which decals cover the surfaces they lie on.

    A decal reaches to the farthest point of the surface that is nearer to it than to any other decal that
    faces the point: a corner of its Voronoi cell. Dense samples find the neighbourhood of each corner. The
    centre of the circle through its three decals and random trials approach it. The paper's rule, influence
    radius = distance D of the farthest Delaunay neighbour, leaves gaps: a perfect hexagonal tiling already
    needs s = D / (sqrt(3) 0.4542) = 1.271 D.

    Where radii are unlike or the surface bends, contact by cells (`decals.field.radial`) gives a point to
    another decal than the nearest, and its image may end before the point. The decal grows that must grow
    least.

    Two kinds of points stay bare. No decal among the last of `NEIGHBOR_COUNTS` nearest faces the first kind.
    The second would make a decal outsized (`MAX_BARE_SHARE`, `MAX_RADIUS_RATIO`), such as a lone folded face
    or a distant scrap. A decal that owns no sample gets half the distance to its nearest neighbour, else the
    median radius.

    Parameters
    ----------
    decals
        Centres, with the normals of their surfaces.
    samples
        Points spread evenly over the area to cover, 32 or more for each decal.
    project
        Projects trial points onto their surfaces.
    seed
        Seed of the trials.
    shade
        Returns points with the smooth normals of the picture, which decide there which decals face a point.
        Points that are nearly bare, or that a decal faces barely or barely not, are covered with both.
    even
        True if the decals should be of about equal size: before one becomes outsized, others grow.
    nearest
        Finds the decals nearest to the samples; a new one if None.

    Returns
    -------
    float64[n], above zero.
    """
    centers = _Centers.of(decals)
    if nearest is None:
        nearest = NearestFacing(samples.positions, samples.normals)
    distances, owners = nearest.of(decals.positions, decals.normals)
    limits = _max_radii(distances, owners, len(decals))
    if even:  # no other decal is so large that it may own points near the middle of a cell
        farthest = np.zeros(len(decals))
        np.maximum.at(farthest, owners[owners >= 0], distances[owners >= 0])
        outer = distances > PEAK_FRACTION * np.minimum(farthest, limits)[owners]
        samples = samples[np.flatnonzero((owners < 0) | outer)]
    sample_distance = np.sqrt(np.pi * len(decals) / max(len(distances), 1))

    first = centers.find(samples)
    radii = np.zeros(len(decals))
    _grow(radii, first, limits)
    sample_distance *= float(np.median(radii))
    sparse = first.risky(_without_zeros(radii, centers.tree, decals), PEAK_FRACTION, 2.0 * sample_distance)
    outward = _outward(sparse, radii, sample_distance)  # into spikes between the samples
    first = first.joined(centers.find(_projected([outward], sample_distance, project)))
    _grow(radii, first, limits)
    rng = np.random.default_rng(seed)
    owned = first.peaks(PEAK_FRACTION * radii)
    owned = owned.joined(centers.find(project(_circumcenters(owned, decals))[0]))
    _grow(radii, owned, limits)
    with reporting() as report:
        for done, spread in enumerate(TRIAL_SPREADS, start=2):
            report("measuring radii", done / (len(TRIAL_SPREADS) + 3))
            least = np.maximum(PEAK_FRACTION * radii, radii - TRIAL_RANGE * spread * sample_distance)
            owned = owned.peaks(least)
            reach = spread * sample_distance
            trials = [
                _outward(owned, radii, reach),
                _random_points_around(owned.points, TRIALS_PER_PEAK, reach, rng),
            ]
            owned = owned.joined(centers.find(_projected(trials, reach, project)))
            _grow(radii, owned, limits)

        def project_reporting(trials: OrientedPoints) -> tuple[OrientedPoints, Int64Array]:
            report("measuring radii", (len(TRIAL_SPREADS) + 2) / (len(TRIAL_SPREADS) + 3))
            return project(trials)

        stages = [(limits, -CLEARANCE)]
        if even:
            largest = EVEN_RADIUS_RATIO * float(np.median(radii))
            radii = np.minimum(radii, largest)
            stages = [(np.full(len(radii), largest), -CLEARANCE), (limits, SPECK)]
        radii = (1.0 + RADIUS_MARGIN) * _without_zeros(radii, centers.tree, decals)
        owned = owned.joined(first.with_shading(shade, radii))
        for limits, speck in stages:
            if speck > 0.0 and not (owned.shares(radii) > 1.0 + speck).any():
                break
            largest_radii = (1.0 + RADIUS_MARGIN) * limits
            growth = _Growth(largest_radii, speck, project_reporting, shade, sample_distance, rng)
            owned = growth.close_gaps(radii, owned)
    return radii


def touching_radii(decals: OrientedPoints) -> Float64Array:
    """Return half the distance to the nearest facing decal; the median radius without such a decal."""
    tree = FacingTree(decals.positions, decals.normals)
    nearest = tree.nearest(decals.positions, decals.normals, skip_self=True)[0][:, 0]
    return _with_median(0.5 * nearest)


def delaunay_radii(decals: OrientedPoints, samples: OrientedPoints) -> Float64Array:
    """Return radii by the paper's rule (section 3.3): influence up to the farthest Delaunay neighbour.

    Two decals are neighbours in the surface's own Delaunay triangulation if their Voronoi cells meet: if a
    sample is nearest to the one and next nearest to the other.
    """
    owned = _Centers.of(decals).find(samples)
    pairs = owned.decals[(owned.decals[:, :2] >= 0).all(axis=1), :2]
    starts, ends = decals.positions[pairs[:, 0]], decals.positions[pairs[:, 1]]
    lengths = np.linalg.norm(starts.astype(np.float64) - ends, axis=1)
    farthest = np.full(len(decals), -np.inf)
    for side in (0, 1):
        np.maximum.at(farthest, pairs[:, side], lengths)
    return float(RIM) * _with_median(farthest)


def _with_median(radii: Float64Array) -> Float64Array:
    """Replace values that are not finite or not above zero by the median of the others, or 1."""
    valid = np.isfinite(radii) & (radii > 0)
    return np.where(valid, radii, float(np.median(radii[valid])) if valid.any() else 1.0)


@dataclass(frozen=True)
class _Centers:
    """All decals, in a search tree; `gaps` are the distances to the nearest other decals, ``[n]``."""

    points: OrientedPoints
    tree: FacingTree
    gaps: Float64Array

    @staticmethod
    def of(decals: OrientedPoints) -> "_Centers":
        """Return decals with their search tree."""
        tree = FacingTree(decals.positions, decals.normals)
        distances, _ = tree.around(2)
        gaps = distances[:, 1] if distances.shape[1] > 1 else np.full(len(decals), np.inf)
        return _Centers(decals, tree, gaps)

    def find(self, points: OrientedPoints) -> "_OwnedPoints":
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
        lengths[close] = _arc_lengths(offsets, n_p, n_q)
        return _OwnedPoints(points, lengths, distances, indices, doubts, self)


@dataclass(frozen=True)
class _OwnedPoints:
    """Points, and the nearest `CANDIDATES` decals that face each: distances and indices, -1 for none.

    `lengths` are the distances along the surface, at which images end; straight ones for decals beyond
    `ARC_REACH`. All three are ``[n, k]``. `doubts` say how little decides which decals face it, ``[n]``.
    """

    points: OrientedPoints
    lengths: Float64Array
    distances: Float64Array
    decals: Int64Array
    doubts: Float32Array
    centers: _Centers

    def __getitem__(self, rows: Int64Array) -> "_OwnedPoints":
        return replace(
            self,
            points=self.points[rows],
            lengths=self.lengths[rows],
            distances=self.distances[rows],
            decals=self.decals[rows],
            doubts=self.doubts[rows],
        )

    def with_shading(self, shade: Shade | None, radii: Float64Array) -> "_OwnedPoints":
        """Return the points, doubtful and nearly bare ones with the normals of `shade` as well."""
        if shade is None:
            return self
        rows = np.flatnonzero((self.doubts < DOUBTFUL) | (self.shares(radii) > NEARLY_BARE))
        return self.joined(self.centers.find(shade(self.points[rows])))

    def powers(self, radii: Float64Array) -> Float64Array:
        """Return the powers of points, which decide between cells (`decals.field.radial`); ∞ for no decal."""
        return np.where(self.decals >= 0, self.distances**2 - radii[self.decals] ** 2, np.inf)

    def owners(self, radii: Float64Array) -> Int64Array:
        """Return the columns of the owners, ``[n]``: of least power, or the smallest that is nested above it.

        The image of the smallest must reach the point.

        `decals.field.radial.nested_owner` is the rule.
        """
        powers = self.powers(radii)
        columns: Int64Array = powers.argmin(axis=1)
        lowest = np.take_along_axis(self.decals, columns[:, None], axis=1)
        own, larger = radii[self.decals], radii[lowest]
        smaller = (powers <= 0.0) & (own < larger)
        least = MIN_KEPT_RADIUS * larger
        apart = least + np.sqrt(
            least**2 + larger**2 - np.where(smaller, own, larger) ** 2
        )  # or less if nested
        smaller &= self.centers.gaps[self.decals] <= apart
        rows = np.flatnonzero(smaller.any(axis=1))
        rows = rows[(smaller[rows] & self._nested(self.decals[rows], lowest[rows], radii)).any(axis=1)]
        decals, own = self.decals[rows], powers[rows]
        facing = np.einsum("nki,ni->nk", self.centers.points.normals[decals], self.points.normals[rows])
        above = smaller[rows] & self._nested(decals, lowest[rows], radii)
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
        columns = self.owners(radii)[:, None]
        powers, shares = (
            self.powers(radii),
            np.where(self.decals >= 0, self.lengths, 0.0) / radii[self.decals],
        )
        own = (
            np.take_along_axis(powers, columns, 1)
            + TIE * radii[np.take_along_axis(self.decals, columns, 1)] ** 2
        )
        lowest = powers.min(axis=1, keepdims=True)
        tied = (powers <= own) & (np.take_along_axis(powers, columns, 1) == lowest)
        result: Float64Array = np.where(tied, shares, np.take_along_axis(shares, columns, 1)).max(axis=1)
        return result

    def risky(self, radii: Float64Array, share: float, apart: float) -> "_OwnedPoints":
        """Return points beyond a share of the radius: the ones nearest to bare in each cube of side `apart`.

        Points of one cube are compared if the same three decals meet there.
        """
        shares = self.shares(radii)
        rows = np.flatnonzero(shares > share)
        nearest = np.argsort(self.powers(radii)[rows], axis=1)[:, :3]
        corners = np.take_along_axis(self.decals[rows], nearest, axis=1)
        cubes = np.floor(self.points.positions[rows].astype(np.float64) / (apart or 1.0)).astype(np.int64)
        places = np.hstack([corners, cubes])
        order = np.lexsort((-shares[rows], *places.T))
        return self[rows[order[_firsts(places[order])]]]

    def joined(self, *others: "_OwnedPoints") -> "_OwnedPoints":
        """Return the points of all."""
        parts = (self, *others)
        return _OwnedPoints(
            OrientedPoints.joined([part.points for part in parts]),
            np.concatenate([part.lengths for part in parts]),
            np.concatenate([part.distances for part in parts]),
            np.concatenate([part.decals for part in parts]),
            np.concatenate([part.doubts for part in parts]),
            self.centers,
        )

    def peaks(self, least: Float64Array) -> "_OwnedPoints":
        """Return the farthest point of each corner of a Voronoi cell, at least so far from its owner.

        Points with the same owner and the same next two decals share a corner of the owner's cell. `least`
        holds a distance for each decal.
        """
        owners = self.decals[:, 0]
        outer = np.flatnonzero((owners >= 0) & (self.lengths[:, 0] > least[owners]))
        corners = np.hstack([self.decals[outer, :1], np.sort(self.decals[outer, 1:3], axis=1)])
        order = np.lexsort((-self.lengths[outer, 0], *corners.T))
        return self[outer[order[_firsts(corners[order])]]]


def _firsts(rows: Int64Array) -> BoolArray:
    """Return True for rows that differ from the one before."""
    first = np.ones(len(rows), np.bool_)
    first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    return first


def _arc_lengths(w: Float64Array, n_p: Float64Array, n_q: Float64Array) -> Float64Array:
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


def _circumcenters(peaks: _OwnedPoints, decals: OrientedPoints) -> OrientedPoints:
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
    normals, surface_ids = peaks.points.normals[whole][sound], peaks.points.surface_ids[whole][sound]
    return OrientedPoints(centers, normals, surface_ids)


def _max_radii(distances: Float64Array, owners: Int64Array, count: int) -> Float64Array:
    """Return the radius beyond which each decal is outsized, from the samples' nearest decals."""
    bare_samples = max(1, round(MAX_BARE_SHARE * len(owners) / count))
    order = np.lexsort((-distances, owners))
    order = order[owners[order] >= 0]
    if len(order) == 0:
        return np.zeros(count)
    starts = np.searchsorted(owners[order], np.arange(count + 1))
    next_largest = starts[:-1] + bare_samples
    enough = next_largest < starts[1:]
    trimmed = np.where(enough, distances[order[np.minimum(next_largest, len(order) - 1)]], 0.0)
    median = float(np.median(trimmed[enough])) if enough.any() else np.inf
    return MAX_RADIUS_RATIO * np.maximum(trimmed, median)


def _grow(radii: Float64Array, owned: _OwnedPoints, limits: Float64Array) -> None:
    """Grow the radius of every decal, up to its limit, to all points that it owns or nearly owns.

    Images end at their radius along the surface, so the length of the arc counts, not that of the chord.
    """
    close = (owned.decals >= 0) & (owned.distances <= CORNER_TOLERANCE * owned.distances[:, :1])
    close &= owned.distances <= limits[owned.decals]
    np.maximum.at(radii, owned.decals[close], owned.lengths[close])


@dataclass(frozen=True)
class _Growth:
    """Rules by which radii grow until no point is bare.

    Attributes
    ----------
    limits
        Largest radius of each decal, ``float64[n]``.
    speck
        Share of its radius by which an image may end before a point; below zero, it must end beyond.
    project, shade
        Those of `covering_radii`.
    sample_distance
        Mean distance of the samples.
    rng
        Draws the random points.
    """

    limits: Float64Array
    speck: float
    project: Project
    shade: Shade | None
    sample_distance: float
    rng: np.random.Generator

    def close_gaps(self, radii: Float64Array, owned: _OwnedPoints) -> _OwnedPoints:
        """Grow radii until searches find no bare point; return all searched points.

        Growth moves the cells of other decals, so all points near decals that grew are searched around again.
        """
        every, grown = owned, np.ones(len(radii), np.bool_)
        if self.speck > 0.0:  # all other points were searched with less tolerance
            grown[:] = False
            grown[owned.decals[owned.shares(radii) > 1.0 + self.speck]] = True
        for _ in range(MAX_REPEATS):
            before = radii.copy()
            near = grown[every.decals].any(axis=1)
            found = self._search(radii, every[np.flatnonzero(near)])
            grown = radii > before
            every = every.joined(found)
            if not grown.any():
                break
        return every

    def _search(self, radii: Float64Array, owned: _OwnedPoints) -> _OwnedPoints:
        """Grow radii until searches around points find no bare one; return the searched points.

        Points whose nearest decals have not grown for `CLEAN_SEARCHES` of the last rounds are not searched
        again. Around doubtful points, rounds search along edges, every other with the first spread: where a
        decal faces one face of a mesh and not the next, its farthest point is a corner of that face.
        """
        finest = len(SEARCHES) - 1
        changed = np.full(len(radii), finest)  # first round after each decal's last growth
        done: list[_OwnedPoints] = []
        for turn in range(MAX_SEARCHES):
            spread, share, count = SEARCHES[min(turn, finest)]
            reach = spread * self.sample_distance
            owned = owned.risky(radii, share, CUBE * self.sample_distance)
            latest = np.where(owned.decals >= 0, changed[owned.decals], 0).max(axis=1, initial=0)
            settled = turn - latest >= CLEAN_SEARCHES
            done.append(owned[np.flatnonzero(settled)])
            owned = owned[np.flatnonzero(~settled)]
            if len(owned.points) == 0:
                break
            trials = [
                _outward(owned, radii, reach),
                _random_points_around(owned.points, count, reach, self.rng),
                _power_corners(owned, radii),
            ]
            doubtful = owned[np.flatnonzero(owned.doubts < DOUBTFUL)]
            step = SEARCHES[0][0] * self.sample_distance if turn % 2 else reach
            edges = _along_edges(_outward(doubtful, radii, step), step, self.project)
            found = owned.centers.find(
                OrientedPoints.joined([_projected(trials, reach, self.project), edges])
            )
            owned = owned.joined(found.with_shading(self.shade, radii))
            before = radii.copy()
            self._cover(radii, owned)
            changed[radii > before] = max(turn + 1, finest)
        return owned.joined(*done)

    def _cover(self, radii: Float64Array, owned: _OwnedPoints) -> None:
        """Grow, for every bare point, the decal that must grow least to own and reach it.

        Growth counts more where the length along the surface exceeds the distance: a decal that bends over an
        edge gains more such points with every growth.
        """
        bare = owned[np.flatnonzero(owned.shares(radii) > 1.0 + self.speck)]
        powers = bare.powers(radii)
        lowest = np.sort(powers, axis=1)
        others = np.minimum(np.where(powers == lowest[:, :1], lowest[:, 1:2], lowest[:, :1]), 0.0)
        needed = np.maximum(bare.lengths, np.sqrt(np.maximum(bare.distances**2 - others, 0.0)))
        columns, owners = np.arange(CANDIDATES), bare.owners(radii)[:, None]
        on_top = owners != powers.argmin(axis=1)[:, None]
        needed = np.where(on_top, bare.lengths, needed)
        largest = self.limits[bare.decals]
        possible = (bare.decals >= 0) & (needed <= largest) & (~on_top | (columns == owners))
        needed = np.minimum((1.0 + SPARE) * needed, largest)
        factors = np.full(needed.shape, np.inf)
        bends = bare.lengths[possible] / np.maximum(bare.distances[possible], 1e-30)
        factors[possible] = bends * (needed / radii[bare.decals])[possible]
        best = factors.argmin(axis=1)
        rows = np.flatnonzero(possible.any(axis=1))
        np.maximum.at(radii, bare.decals[rows, best[rows]], needed[rows, best[rows]])


def _outward(owned: _OwnedPoints, radii: Float64Array, reach: float) -> OrientedPoints:
    """Return points so far from given ones, away from their owners or along the border of the cells.

    On an edge or an open border of the surface, the point of a cell that is farthest from its decal is a
    vertex, or lies where the edge meets the border of the cell. These trials approach both: they lie as high
    above the surface, so that beyond an edge they are projected onto it, and so along it.
    """
    powers = owned.powers(radii)
    columns = np.argsort(powers, axis=1)[:, :2]
    decals = np.take_along_axis(owned.decals, columns, axis=1)
    powers = np.take_along_axis(powers, columns, axis=1)
    positions = owned.points.positions.astype(np.float64)
    normals = owned.points.normals.astype(np.float64)
    w = owned.centers.points.positions[decals] - positions[:, None]
    w -= np.einsum("nki,ni->nk", w, normals)[..., None] * normals[:, None]
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
    lifted = (positions + step + reach * normals).astype(np.float32)
    return OrientedPoints(lifted, owned.points.normals, owned.points.surface_ids)


def _projected(trials: list[OrientedPoints], height: float, project: Project) -> OrientedPoints:
    """Return projected points; those of the first trials come from a height over planes, to which they keep.

    One that falls onto the edge of its plane gets the normal of the plane, not that of the other face.
    """
    lifted, joined = len(trials[0]), OrientedPoints.joined(trials)
    points, rows = project(joined)
    normals = joined.normals[rows]
    risen = np.einsum("ni,ni->n", points.positions - joined.positions[rows], normals) + height
    on_plane = (rows < lifted) & (np.abs(risen) < ON_PLANE * height)
    return replace(points, normals=np.where(on_plane[:, None], normals, points.normals))


def _along_edges(trials: OrientedPoints, height: float, project: Project) -> OrientedPoints:
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
    rows = rows[bent]
    edges = OrientedPoints(meets.astype(np.float32), trials.normals[rows], trials.surface_ids[rows])
    points, rows = project(edges)
    moved = np.linalg.norm(points.positions - edges.positions[rows], axis=1)
    return edges[rows[moved < ON_PLANE * height]]


def _power_corners(owned: _OwnedPoints, radii: Float64Array) -> OrientedPoints:
    """Return the corners of cells near points: where three of the four least powers are equal.

    With the offsets w of the centres and the powers c at a point q, the powers at q + a are c − 2 a·w + |a|².
    So the corners in the tangent plane at q solve two linear equations. On a flat face without bends, the
    point of a cell that is farthest from its decal is one of its corners, or lies on an edge of the surface.
    """
    powers = owned.powers(radii)
    columns = np.argsort(powers, axis=1)[:, :4]
    powers = np.take_along_axis(powers, columns, axis=1)
    decals = np.take_along_axis(owned.decals, columns, axis=1)
    places = owned.points.positions.astype(np.float64)
    normals = owned.points.normals.astype(np.float64)
    offsets = owned.centers.points.positions[decals] - places[:, None]
    offsets -= np.einsum("nki,ni->nk", offsets, normals)[..., None] * normals[:, None]
    reach = MAX_CORNER * radii[decals[:, 0]]
    found: list[OrientedPoints] = []
    for triple in combinations(range(columns.shape[1]), 3):
        ids = np.sort(decals[:, triple], axis=1)
        order = np.lexsort((powers[:, 0], *ids.T))
        first = order[_firsts(ids[order])]
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
        corners = (places[rows] + step[near]).astype(np.float32)
        found.append(OrientedPoints(corners, owned.points.normals[rows], owned.points.surface_ids[rows]))
    return OrientedPoints.joined(found)


def _random_points_around(
    points: OrientedPoints, count: int, spread: float, rng: np.random.Generator
) -> OrientedPoints:
    """Return so many normally distributed points around each point."""
    repeated = points[np.repeat(np.arange(len(points)), count)]
    offsets = rng.normal(0.0, spread, repeated.positions.shape).astype(np.float32)
    return OrientedPoints(repeated.positions + offsets, repeated.normals, repeated.surface_ids)


def _without_zeros(radii: Float64Array, tree: FacingTree, decals: OrientedPoints) -> Float64Array:
    """Replace the zero radii of decals that own no sample."""
    zero = ~(radii > 0)
    if not zero.any():
        return radii
    nearest, _ = tree.nearest(decals.positions, decals.normals, skip_self=True)
    others = radii[~zero]
    fallback = float(np.median(others)) if len(others) else 1.0
    usable = np.isfinite(nearest[:, 0]) & (nearest[:, 0] > 0)
    return np.where(zero, np.where(usable, 0.5 * nearest[:, 0], fallback), radii)
