"""Particles beside wide gaps, and decals that would be outsized, move toward the middle of their cells."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree, NearestFacing, NeighborQuery
from decals.scattering.particle_state import ParticleState

SAMPLES_PER_PARTICLE = 24
"""Samples for each particle among which gaps are looked for."""

WIDE_GAP = 0.74
"""Distance from the nearest particle, in spacings, from which a sample lies in a wide gap. In a hexagonal
tiling no point is farther than 0.577."""

GAP_REACH = 1.5
"""Largest distance of a sample from its nearest particle, in spacings; farther ones lie on scraps."""

EVEN = 1.1
"""Largest ratio of spacings at which the density counts as even."""

MIN_SAMPLES = 2
"""Least number of samples of a wide gap; the corner of a square has fewer."""

ROUNDS = 8
"""Largest number of rounds of moves."""

MOVE = 0.5
"""Length of a move, as a share of the way to the middle."""

ENCLOSING_STEPS = 24
"""Steps toward the centre of the least ball around points (Bădoiu and Clarkson 2003)."""

OUTSIZED = 1.3
"""Ratio of a decal's radius to the median, at samples alone, from which it moves."""

CENTERING_ROUNDS = 6
"""Largest number of rounds in which outsized decals move."""

MIN_DISTANCE = 0.7
"""Least distance of a decal that moved, in spacings."""

NEIGHBORS = 8
"""Nearest decals whose largest radius must fall when a decal moves."""

_SAMPLE_STREAM = 11

Aim: TypeAlias = Callable[[OrientedPoints], OrientedPoints]
"""A function of centres, with the normals of their surfaces, to these with the normals of decals there."""


def fill_gaps(state: ParticleState, least: float) -> None:
    """Move particles beside wide gaps; gaps remain along lips and ragged boundaries.

    A particle beside a wide gap moves toward the centre of the least ball around the samples nearest to it.
    It stays if another particle would be nearer than before, and nearer than `least`. Where the density is
    not even, all stay: wide gaps belong beside its steps.

    Parameters
    ----------
    state
        The particles.
    least
        Least distance of particles, in spacings.
    """
    sizes = state.host_sizes
    if sizes.max() > EVEN * sizes.min():
        return
    counts = np.bincount(state.surface_ids, minlength=len(state.domain.surfaces))
    samples = state.domain.sample(SAMPLES_PER_PARTICLE * counts, stream=_SAMPLE_STREAM)
    query = NeighborQuery(state, GAP_REACH)
    for _ in range(ROUNDS):
        gaps, owners = query.owners(samples.positions, samples.normals)
        in_gap = (owners >= 0) & (gaps > WIDE_GAP) & state.movable[owners]
        found, counts = np.unique(owners[in_gap], return_counts=True)
        rows = found[counts >= MIN_SAMPLES]
        if len(rows) == 0:
            break
        points = state.points()
        moved = _moved(state.domain, points, rows, samples.positions, owners)
        tree = FacingTree(points.positions, points.normals)
        keep = np.flatnonzero(_far_enough(tree, points, moved, rows, sizes, least))
        if len(keep) == 0:
            break
        state.move_to(rows[keep], moved.positions[keep], moved.normals[keep])
        query.refresh()


def center_outsized(
    domain: Domain,
    centers: OrientedPoints,
    movable: BoolArray,
    sizes: Float32Array,
    samples: OrientedPoints,
    aim: Aim,
) -> OrientedPoints:
    """Return the decals at centres, those of outsized decals moved toward the middle of their cells.

    The decals' normals decide which of them face a point, so that beside lips and thin walls some cells are
    larger than those of the particles. A decal stays where its move would make one of its neighbours larger,
    or bring it nearer to one than `MIN_DISTANCE`.

    Parameters
    ----------
    domain
        The surfaces.
    centers
        The centres, with the normals of their surfaces.
    movable
        True for centres that may move, ``bool[n]``.
    sizes
        Spacing at each centre, ``float32[n]``.
    samples
        Points spread evenly over the area to cover.
    aim
        Returns the decals of centres.
    """
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    movable = movable.copy()
    decals = aim(centers)
    nearest = NearestFacing(samples.positions, samples.normals)
    radii, owners = _cells(decals, nearest)
    for _ in range(CENTERING_ROUNDS):
        rows = np.flatnonzero(movable & (radii > OUTSIZED * np.median(radii)))
        if len(rows) == 0:
            break
        moved = _moved(domain, centers, rows, samples.positions, owners)
        tree = FacingTree(centers.positions, centers.normals)
        keep = np.flatnonzero(_far_enough(tree, centers, moved, rows, sizes, MIN_DISTANCE))
        rows, moved = rows[keep], moved[keep]
        if len(rows) == 0:
            break
        trial = _replaced(centers, rows, moved)
        count = min(NEIGHBORS, len(centers))
        around = cKDTree(centers.positions).query(centers.positions[rows], k=np.arange(1, count + 1))[1]
        turned = aim(trial)
        after = _cells(turned, nearest)
        worse = after[0][around].max(axis=1) >= radii[around].max(axis=1)
        if worse.any():
            back = rows[worse]
            movable[back] = False
            trial = _replaced(trial, back, centers[back])
            turned = aim(trial)
            after = _cells(turned, nearest)
        centers, decals, (radii, owners) = trial, turned, after
    return decals


def _replaced(points: OrientedPoints, rows: Int64Array, others: OrientedPoints) -> OrientedPoints:
    """Return points with some of them at others' places."""
    positions, normals = points.positions.copy(), points.normals.copy()
    positions[rows], normals[rows] = others.positions, others.normals
    return OrientedPoints(positions, normals, points.surface_ids)


def _cells(decals: OrientedPoints, nearest: NearestFacing) -> tuple[Float64Array, Int64Array]:
    """Return the distance of each decal's farthest sample, and the decal nearest to each sample."""
    distances, owners = nearest.of(decals.positions, decals.normals)
    radii = np.zeros(len(decals))
    owned = owners >= 0
    np.maximum.at(radii, owners[owned], distances[owned])
    return radii, owners


def _moved(
    domain: Domain, points: OrientedPoints, rows: Int64Array, samples: Float32Array, owners: Int64Array
) -> OrientedPoints:
    """Return some particles after their moves, the others' place where these would be hidden."""
    targets = points.positions[rows].astype(np.float64)
    order = np.argsort(owners, kind="stable")
    starts = np.searchsorted(owners[order], rows)
    ends = np.searchsorted(owners[order], rows, side="right")
    for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
        targets[k] += MOVE * (_center(samples[order[start:end]].astype(np.float64), targets[k]) - targets[k])
    before = points[rows]
    after, allowed = domain.project(
        OrientedPoints(targets.astype(np.float32), before.normals, before.surface_ids)
    )
    positions = np.where(allowed[:, None], after.positions, before.positions)
    normals = np.where(allowed[:, None], after.normals, before.normals)
    return OrientedPoints(positions, normals, before.surface_ids)


def _center(points: Float64Array, start: Float64Array) -> Float64Array:
    """Return about the centre of the least ball around points."""
    center = start.copy()
    for step in range(1, ENCLOSING_STEPS):
        far = points[np.einsum("ni,ni->n", points - center, points - center).argmax()]
        center += (far - center) / (step + 1)
    return center


def _far_enough(
    tree: FacingTree,
    points: OrientedPoints,
    moved: OrientedPoints,
    rows: Int64Array,
    sizes: Float32Array,
    least: float,
) -> BoolArray:
    """Return True for moves after which no particle is too near, also none that moves at the same time."""
    before = points[rows]
    distances, others = tree.nearest(before.positions, before.normals, count=2)
    now = np.where(others[:, 0] == rows, distances[:, 1], distances[:, 0])
    near, which = tree.nearest(moved.positions, moved.normals, count=2)
    fixed = np.where(which == rows[:, None], np.inf, near).min(axis=1)
    apart = np.linalg.norm(moved.positions[:, None].astype(np.float64) - moved.positions, axis=2)
    np.fill_diagonal(apart, np.inf)
    apart[moved.normals @ moved.normals.T < 0] = np.inf
    limit = np.minimum(least * sizes[rows], now)
    enough: BoolArray = (fixed >= limit) & (apart.min(axis=1, initial=np.inf) >= limit)
    return enough
