"""The rule of covering radii: decals without gaps, of the least radii, some of them moved and turned."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.progress import reporting
from decals.scattering.decal_normals import DecalNormals
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.gap_filling import EVEN
from decals.scattering.neighbors import FacingTree, NearestFacing
from decals.scattering.owned_points import (
    CANDIDATES,
    DOUBTFUL,
    Centers,
    OwnedPoints,
    Shade,
    power_corners,
    surely_covered,
)
from decals.scattering.rearrangement import rearranged
from decals.scattering.sheets import on_single_sheets
from decals.scattering.sizing import EXPECTED_RADIUS, WithNormals
from decals.surfaces.surface import unit_rows

_logger = logging.getLogger(__name__)

LARGEST_ON_THIN_PARTS = 6.0
"""Largest covering radius over the expected one where parts may be thinner than decals lie apart.

On a hair, a decal has its area in a piece that is far longer than its radius.
"""

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

CORNER_TOLERANCE = 1.02
"""Ratio of the distances from two decals up to which a point is a corner of both Voronoi cells."""

SPARE = 0.015
"""Share of its radius by which a decal grows beyond a bare point."""

SEARCHES = ((0.5, 0.9, 1), (0.3, 0.93, 1), (0.15, 0.96, 2), (0.08, 0.97, 2), (0.04, 0.98, 2))
"""Rounds that look for bare points: spread of random points in mean distances of the samples, distance of the
points around which they lie from their owners, in the owners' radii, and number of random points around each.
Another point lies a spread farther out. The last round is repeated."""

CUBE = 1.0
"""Side of the cubes of which one point each is searched around, in mean distances of the samples."""

MAX_SEARCHES, CLEAN_SEARCHES, MAX_REPEATS = 12, 2, 4
"""Largest number of rounds, number of those without a bare point after which they end, and largest number of
repeats of all rounds around decals that grew."""

FAR_POINTS = 4.0
"""Points for each decal that are beyond the largest radii of all decals and searched around: those of a few
folds. More are those of scraps without decals, and searches around them find ever more of these."""

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

TRIALS_BESIDE_SHEETS, SPREAD_BESIDE_SHEETS = 64, 0.6
"""Number and spread, in mean distances of the samples, of random points around each sample that lies beyond
the sheet of a nearer decal. Other decals own small pieces there, far from the rest of their cells."""

LEAST_BEND = 0.05
"""Least sine between the normals of two faces whose edge is searched along."""

MAX_UNFACED = 0.01
"""Share of the surface that no decal faces, above which a warning says so."""

ON_PLANE = 0.01
"""Largest distance of a projected point from the plane of a face, in spreads, at which it lies there."""

Project: TypeAlias = Callable[[OrientedPoints], tuple[OrientedPoints, Int64Array]]
"""Project points onto their own surfaces, drop those hidden there, and return the rows of the rest."""


def covering_decals(
    domain: Domain,
    centers: OrientedPoints,
    spacings: Float32Array,
    movable: BoolArray,
    samples: OrientedPoints,
    with_normals: WithNormals,
    seed: int,
) -> tuple[OrientedPoints, Float64Array]:
    """Return decals at centres, with their own normals, and the least radii without gaps; see `Rule`.

    `DecalNormals` turns some of them. At even density, `rearranged` moves some.
    """

    def project(trials: OrientedPoints) -> tuple[OrientedPoints, Int64Array]:
        projected, allowed = domain.project(trials)
        rows = np.flatnonzero(allowed)
        return projected[rows], rows

    def with_sheets(decals: OrientedPoints) -> OrientedPoints:
        return on_single_sheets(domain, decals, samples, expected)

    expected = EXPECTED_RADIUS * spacings.astype(np.float64)
    nearest = NearestFacing(samples.positions, samples.normals)
    normals = DecalNormals(centers, spacings, samples, with_normals)
    even = bool(spacings.max() <= EVEN * spacings.min())
    if even:
        spacing = float(np.median(spacings))
        decals = rearranged(domain, centers, movable, spacing, samples, nearest, normals, with_sheets)
    else:
        decals = with_sheets(normals.of(centers))
    radii = covering_radii(
        decals,
        samples,
        project,
        seed,
        shade=domain.shaded,
        even=even,
        nearest=nearest,
        bounds=LARGEST_ON_THIN_PARTS * expected if domain.has_thin_parts else None,
    )
    return decals, radii


def covering_radii(
    decals: OrientedPoints,
    samples: OrientedPoints,
    project: Project,
    seed: int,
    *,
    shade: Shade | None = None,
    even: bool = False,
    nearest: NearestFacing | None = None,
    bounds: Float64Array | None = None,
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
        Points that are nearly bare, or that a decal faces barely or barely not, are covered with both. Those
        that their owner barely faces are covered without it as well.
    even
        True if the decals should be of about equal size: before one becomes outsized, others grow.
    nearest
        Finds the decals nearest to the samples; a new one if None.
    bounds
        Radii, ``float64[n]``, beyond which decals do not grow, whatever stays bare.

    Returns
    -------
    float64[n], above zero.
    """
    centers = Centers.of(decals)
    if nearest is None:
        nearest = NearestFacing(samples.positions, samples.normals)
    distances, owners = nearest.of(decals.positions, decals.normals, decals.heights)
    unfaced = float(np.mean(owners < 0)) if len(owners) else 0.0
    if len(decals) and unfaced > MAX_UNFACED:
        _logger.warning(
            "%.0f %% of the surface stays bare: none of the %d decals faces them; take more decals",
            100.0 * unfaced,
            len(decals),
        )
    limits = _max_radii(distances, owners, len(decals))
    if bounds is not None:
        limits = np.minimum(limits, bounds)
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
    spikes = outward(sparse, radii, sample_distance)  # between the samples
    first = first.joined(centers.find(projected([spikes], sample_distance, project)))
    _grow(radii, first, limits)
    rng = np.random.default_rng(seed)
    if decals.heights is not None:
        beyond = first.points[np.flatnonzero(first.doubts == 0.0)]
        beside = random_points_around(
            beyond, TRIALS_BESIDE_SHEETS, SPREAD_BESIDE_SHEETS * sample_distance, rng
        )
        first = first.joined(centers.find(project(beside)[0]))
        _grow(radii, first, limits)
    owned = first.peaks(PEAK_FRACTION * radii)
    owned = owned.joined(centers.find(project(circumcenters(owned, decals))[0]))
    _grow(radii, owned, limits)
    usable = (1.0 + RADIUS_MARGIN) * _without_zeros(radii, centers.tree, decals)
    sure = surely_covered(first, owned, usable)
    with reporting() as report:
        for done, spread in enumerate(TRIAL_SPREADS, start=2):
            report("measuring radii", done / (len(TRIAL_SPREADS) + 3))
            least = np.maximum(PEAK_FRACTION * radii, radii - TRIAL_RANGE * spread * sample_distance)
            owned = owned.peaks(least)
            reach = spread * sample_distance
            unsure = owned[np.flatnonzero(~owned.belongs(sure))]
            trials = [
                outward(unsure, radii, reach),
                random_points_around(unsure.points, TRIALS_PER_PEAK, reach, rng),
            ]
            owned = owned.joined(centers.find(projected(trials, reach, project)))
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
        last = (1.0 + RADIUS_MARGIN) * limits
        for limits, speck in stages:
            if speck > 0.0 and not (owned.shares(radii) > 1.0 + speck).any():
                break
            largest_radii = (1.0 + RADIUS_MARGIN) * limits
            growth = _Growth(
                largest_radii, last, speck, project_reporting, shade, sample_distance, rng, bounds is not None
            )
            owned = growth.close_gaps(radii, owned)
    return radii


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


def _grow(radii: Float64Array, owned: OwnedPoints, limits: Float64Array) -> None:
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
    last_limits
        The same for the last of several growths. Points beyond those of all their decals stay bare.
    speck
        Share of its radius by which an image may end before a point; below zero, it must end beyond.
    project, shade
        Those of `covering_radii`.
    sample_distance
        Mean distance of the samples.
    rng
        Draws the random points.
    drops_far_points
        True if points beyond the limits of all their decals are not searched around, however few.
    """

    limits: Float64Array
    last_limits: Float64Array
    speck: float
    project: Project
    shade: Shade | None
    sample_distance: float
    rng: np.random.Generator
    drops_far_points: bool

    def close_gaps(self, radii: Float64Array, owned: OwnedPoints) -> OwnedPoints:
        """Grow radii until searches find no bare point; return all searched points.

        Growth moves the cells of other decals, so all points near decals that grew are searched around again.
        """
        every = owned
        if self.speck > 0.0:  # all other points were searched with less tolerance
            grown = np.zeros(len(radii), np.bool_)
            grown[owned.decals[owned.shares(radii) > 1.0 + self.speck]] = True
            near = grown[owned.decals].any(axis=1)
        else:
            sure = surely_covered(owned, owned.peaks(PEAK_FRACTION * radii), radii)
            near = ~owned.belongs(sure)
        for _ in range(MAX_REPEATS):
            before = radii.copy()
            every = every.joined(self._search(radii, every[np.flatnonzero(near)]))
            grown = radii > before
            if not grown.any():
                break
            near = grown[every.decals].any(axis=1)
        return every

    def _search(self, radii: Float64Array, owned: OwnedPoints) -> OwnedPoints:
        """Grow radii until searches around points find no bare one; return the searched points.

        Points whose nearest decals have not grown for `CLEAN_SEARCHES` of the last rounds are not searched
        again. Around doubtful points, rounds search along edges, every other with the first spread: where a
        decal faces one face of a mesh and not the next, its farthest point is a corner of that face.
        """
        finest = len(SEARCHES) - 1
        changed = np.full(len(radii), finest)  # first round after each decal's last growth
        done: list[OwnedPoints] = []
        for turn in range(MAX_SEARCHES):
            spread, share, count = SEARCHES[min(turn, finest)]
            reach = spread * self.sample_distance
            owned = owned.risky(radii, share, CUBE * self.sample_distance)
            near = owned.within(self.limits if self.drops_far_points else self.last_limits)
            if self.drops_far_points or np.count_nonzero(~near) > FAR_POINTS * len(radii):
                owned = owned[np.flatnonzero(near)]
            latest = np.where(owned.decals >= 0, changed[owned.decals], 0).max(axis=1, initial=0)
            settled = turn - latest >= CLEAN_SEARCHES
            done.append(owned[np.flatnonzero(settled)])
            owned = owned[np.flatnonzero(~settled)]
            if len(owned.points) == 0:
                break
            trials = [
                outward(owned, radii, reach),
                random_points_around(owned.points, count, reach, self.rng),
                power_corners(owned, radii),
            ]
            doubtful = owned[np.flatnonzero(owned.doubts < DOUBTFUL)]
            step = SEARCHES[0][0] * self.sample_distance if turn % 2 else reach
            edges = along_edges(outward(doubtful, radii, step), step, self.project)
            found = owned.centers.find(OrientedPoints.joined([projected(trials, reach, self.project), edges]))
            owned = owned.joined(found.with_shading(self.shade, radii))
            before = radii.copy()
            self._cover(radii, owned)
            changed[radii > before] = max(turn + 1, finest)
        return owned.joined(*done)

    def _cover(self, radii: Float64Array, owned: OwnedPoints) -> None:
        """Grow, for every bare point, the decal that must grow least to own and reach the point.

        Growth counts more where the length along the surface exceeds the distance: a decal that bends over an
        edge reaches more bare points with every growth.
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


def random_points_around(
    points: OrientedPoints, count: int, spread: float, rng: np.random.Generator
) -> OrientedPoints:
    """Return so many normally distributed points around each point."""
    repeated = points[np.repeat(np.arange(len(points)), count)]
    offsets = rng.normal(0.0, spread, repeated.positions.shape).astype(np.float32)
    return replace(repeated, positions=repeated.positions + offsets)
