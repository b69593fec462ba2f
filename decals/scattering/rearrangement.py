"""Decals that are outsized, or too near to others, move together with their neighbours."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.progress import check_cancelled
from decals.scattering.decal_normals import DecalNormals
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.gap_filling import cell_middles
from decals.scattering.neighbors import FacingTree, NearestFacing
from decals.surfaces.surface import unit_rows

LEAST_DISTANCE = 0.865
"""Distance of two decals, in spacings, below which they are too near."""

MIN_DISTANCE = 0.7
"""Distance of two decals, in spacings, below which no radius makes up for them: the fault counts 1."""

PUSHED_TO = 0.88
"""Distance, in spacings, to which two decals push each other."""

UNEVEN_SHARE = 0.2
"""Share of decals that are too near to others, above which their density is uneven by intent."""

OUTSIZED = 1.37
"""Ratio of a decal's radius to the median, at samples alone, above which it is outsized."""

MOVES = 1.3
"""The same ratio, above which a decal moves toward the middle of its cell."""

MAX_EXCESS = 0.35
"""Largest excess that counts, as a share of the largest good radius: no arrangement reaches some points."""

PHASES = ((1.0, 18, False), (0.7, 12, True), (0.4, 8, True))
"""Share of each move that is made in the rounds of each phase, number of these rounds, and True if moves that
bring two decals nearer than `GUARD` are undone. Without that, decals may pass through such arrangements."""

GUARD = 0.75
"""Distance of two decals, in spacings, below which guarded moves do not bring them."""

MAX_MOVE, LEAST_MOVE = 0.2, 1e-3
"""Longest and shortest move of a round, in spacings."""

ACTIVE, LOOKED_AT = 5.0, 8.0
"""Distances of a faulty decal, in spacings, up to which decals move, and up to which they are looked at."""

LINK = 1.5
"""Distance up to which two decals belong to one group, in spacings."""

LARGEST = 1.65
"""Largest radius of most decals, in expected ones. Heights of sheets grow with the radius."""

NEIGHBORS = 6
"""Nearest decals of each that are looked at."""

WithSheets: TypeAlias = Callable[[OrientedPoints], OrientedPoints]
"""A function of decals to these with the heights of those that keep to their sheets."""


@dataclass(frozen=True)
class _Arrangement:
    """Decals at some places, and their faults.

    Attributes
    ----------
    centers
        The centres, with the normals of their surfaces.
    decals
        The decals there.
    radii
        Distance of the farthest sample that is nearest to each decal, ``float64[n]``.
    owners
        The decal nearest to each sample.
    pairs, distances
        Decals too near to each other, ``int64[k, 2]``, and their distances.
    faults
        Sum of the squared faults of each decal, ``float64[n]``.
    """

    centers: OrientedPoints
    decals: OrientedPoints
    radii: Float64Array
    owners: Int64Array
    pairs: Int64Array
    distances: Float64Array
    faults: Float64Array


def rearranged(
    domain: Domain,
    centers: OrientedPoints,
    movable: BoolArray,
    spacing: float,
    samples: OrientedPoints,
    nearest: NearestFacing,
    normals: DecalNormals,
    with_sheets: WithSheets,
) -> OrientedPoints:
    """Return decals at centres of which some moved, so that fewer are outsized or too near to others.

    The decals' normals decide which of them face a point, so that beside lips and thin walls some cells are
    larger than those of the particles. In each round, outsized decals move toward the middle of their cells,
    and near ones push each other away. A round may make faults worse for a while. In the end each group of
    decals that changed goes back to its round of the least squared faults.

    Where many decals are near to others from the start, their density is uneven by intent. None is pushed.

    Parameters
    ----------
    domain
        The surfaces.
    centers
        The centres, with the normals of their surfaces.
    movable
        True for centres that may move, ``bool[n]``.
    spacing
        Spacing of the decals.
    samples
        Points spread evenly over the area to cover.
    nearest
        Finds the decals nearest to the samples.
    normals
        Finds the normals of decals.
    with_sheets
        Lets some decals keep to their sheets.
    """
    decals = with_sheets(normals.of(centers))
    near = np.unique(_near_pairs(centers, decals.heights, LEAST_DISTANCE * spacing)[0])
    task = _Task(
        domain,
        movable,
        spacing,
        PUSHED_TO if len(near) <= UNEVEN_SHARE * len(centers) else 0.0,
        float(np.median(_cells(decals, nearest)[0])),
        samples,
        nearest,
        normals,
    )
    best = task.arrangement(centers, decals)
    for phase in PHASES:
        if not best.faults.any():
            break
        moved = task.moved(best, *phase)
        found = task.arrangement(moved, with_sheets(normals.of(moved)))
        best = found if found.faults.sum() < best.faults.sum() else best
    return best.decals


@dataclass(frozen=True)
class _Task:
    """What all arrangements share: parameters of `rearranged`, and the two that follow.

    Attributes
    ----------
    pushed_to
        Distance, in spacings, to which near decals push each other.
    usual
        Median radius of the decals at samples.
    """

    domain: Domain
    movable: BoolArray
    spacing: float
    pushed_to: float
    usual: float
    samples: OrientedPoints
    nearest: NearestFacing
    normals: DecalNormals

    def arrangement(self, centers: OrientedPoints, decals: OrientedPoints) -> _Arrangement:
        """Return the arrangement of decals at centres."""
        radii, owners = _cells(decals, self.nearest)
        faults = np.clip(radii / max(OUTSIZED * self.usual, 1e-30) - 1.0, 0.0, MAX_EXCESS) ** 2
        pairs, distances = _near_pairs(centers, decals.heights, self.pushed_to * self.spacing)
        lacks = np.maximum(1.0 - distances / (LEAST_DISTANCE * self.spacing), 0.0)
        overlap = distances < MIN_DISTANCE * self.spacing
        np.add.at(faults, pairs, (0.5 * lacks**2 + overlap)[:, None])
        return _Arrangement(centers, decals, radii, owners, pairs, distances, faults)

    def moved(self, start: _Arrangement, share: float, rounds: int, guarded: bool) -> OrientedPoints:
        """Return the centres after the rounds of a phase near faulty decals; see `PHASES`."""
        rows = np.flatnonzero(_near(start.centers.positions, start.faults > 0.0, LOOKED_AT * self.spacing))
        active = _near(start.centers.positions, start.faults > 0.0, ACTIVE * self.spacing)[rows]
        part, centers = self._part(start, rows), start.centers[rows]
        heights = None if start.decals.heights is None else start.decals.heights[rows]
        found = list[_Arrangement]()
        for _ in range(rounds):
            check_cancelled("moving decals apart")
            found.append(part.arrangement(centers, replace(part.normals.of(centers), heights=heights)))
            if not found[-1].faults.any():
                break
            after = part._after_moves(found[-1], active, share)
            centers = _kept_apart(centers, after, heights, GUARD * self.spacing) if guarded else after
        return start.centers.replaced(rows, _best_of_groups(found, LINK * self.spacing))

    def _part(self, start: _Arrangement, rows: Int64Array) -> "_Task":
        """Return the task for some decals and the samples nearest to them."""
        among = np.zeros(len(start.centers), np.bool_)
        among[rows] = True
        samples = self.samples[np.flatnonzero((start.owners >= 0) & among[start.owners])]
        return replace(
            self,
            movable=self.movable[rows],
            samples=samples,
            nearest=NearestFacing(samples.positions, samples.normals),
            normals=self.normals.part(rows, samples),
        )

    def _after_moves(self, last: _Arrangement, active: BoolArray, share: float) -> OrientedPoints:
        """Return the centres after one round of moves."""
        centers, movable = last.centers, self.movable & active
        first, second = last.pairs.T
        offsets = centers.positions[first].astype(np.float64) - centers.positions[second]
        both = movable[first] & movable[second]
        lengths = np.where(both, 0.5, 1.0) * (self.pushed_to * self.spacing - last.distances)
        pushes = lengths[:, None] * unit_rows(offsets)
        moves = np.zeros((len(centers), 3))
        np.add.at(moves, first, pushes)
        np.add.at(moves, second, -pushes)
        wide = np.flatnonzero(last.radii > MOVES * self.usual)
        moves[wide] += cell_middles(centers, wide, self.samples.positions, last.owners)
        moves[wide] -= centers.positions[wide]
        lengths = np.linalg.norm(moves, axis=1)
        moves *= share * np.minimum(MAX_MOVE * self.spacing / np.maximum(lengths, 1e-30), 1.0)[:, None]
        rows = np.flatnonzero(movable & (lengths > LEAST_MOVE * self.spacing))
        targets = (centers.positions[rows] + moves[rows]).astype(np.float32)
        after, allowed = self.domain.project(replace(centers[rows], positions=targets))
        kept = np.flatnonzero(allowed)
        return centers.replaced(rows[kept], after[kept])


def _kept_apart(
    before: OrientedPoints, after: OrientedPoints, heights: Float64Array | None, least: float
) -> OrientedPoints:
    """Return centres after moves, but undo moves that bring two nearer than before and than the least."""
    while True:
        pairs, distances = _near_pairs(after, heights, least)
        first, second = (before.positions[rows].astype(np.float64) for rows in pairs.T)
        back = np.unique(pairs[distances < np.linalg.norm(first - second, axis=1)])
        back = back[(after.positions[back] != before.positions[back]).any(axis=1)]
        if len(back) == 0:
            return after
        after = after.replaced(back, before[back])


def _best_of_groups(rounds: list[_Arrangement], reach: float) -> OrientedPoints:
    """Return the centres that each group of decals has in its round of the least squared faults.

    A group is a set of decals that moved, or are near to such, within a reach of each other.
    """
    centers = rounds[0].centers
    changed = np.zeros(len(centers), np.bool_)
    for one in rounds[1:]:
        changed |= (one.centers.positions != centers.positions).any(axis=1)
    rows = np.flatnonzero(_near(centers.positions, changed, reach))
    groups = _groups(centers.positions[rows], reach)
    chosen = np.argmin([np.bincount(groups, one.faults[rows]) for one in rounds], axis=0)[groups]
    for number, one in enumerate(rounds):
        own = rows[chosen == number]
        centers = centers.replaced(own, one.centers[own])
    return centers


def _cells(decals: OrientedPoints, nearest: NearestFacing) -> tuple[Float64Array, Int64Array]:
    """Return the distance of each decal's farthest sample, and the decal nearest to each sample."""
    distances, owners = nearest.of(decals.positions, decals.normals)
    radii = np.zeros(len(decals))
    owned = owners >= 0
    np.maximum.at(radii, owners[owned], distances[owned])
    return radii, owners


def _near_pairs(
    centers: OrientedPoints, heights: Float64Array | None, reach: float
) -> tuple[Int64Array, Float64Array]:
    """Return the pairs of centres on surfaces that face each other, ``int64[k, 2]``, and their distances."""
    heights = None if heights is None else LARGEST * heights
    tree = FacingTree(centers.positions, centers.normals, heights)
    found, others = tree.nearest(
        centers.positions, centers.normals, count=NEIGHBORS, skip_self=True, reach=reach
    )
    rows, columns = np.nonzero(others >= 0)
    pairs = np.stack([rows, others[rows, columns]], axis=1)
    # both keep to their sheets if one does: each is then a neighbour of the other
    keys, which, counts = np.unique(np.sort(pairs, axis=1), axis=0, return_index=True, return_counts=True)
    return keys[counts == 2], found[rows, columns][which[counts == 2]]


def _near(positions: Float32Array, chosen: BoolArray, reach: float) -> BoolArray:
    """Return True for positions within a reach of any of the chosen ones."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    distances, _ = cKDTree(positions[chosen]).query(positions, distance_upper_bound=reach)
    near: BoolArray = np.isfinite(distances)
    return near


def _groups(positions: Float32Array, reach: float) -> Int64Array:
    """Return the number of the group of each position: those within a reach of each other are in one."""
    from scipy.sparse import coo_array  # imported where they are used: they take a quarter of a second
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(positions).query_pairs(reach, output_type="ndarray")
    shape = (len(positions), len(positions))
    links = coo_array((np.ones(len(pairs), np.bool_), tuple(pairs.T)), shape=shape)
    groups: Int64Array = connected_components(links, directed=False)[1]
    return groups
