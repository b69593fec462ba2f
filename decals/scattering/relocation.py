"""Relocation: crowded particles move to gaps, to narrow places, and to parts of trees that lack some."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.model import FACING_LIMIT
from decals.scattering.bare_places import spread_apart
from decals.scattering.domain import AREA_SAMPLES, Domain, OrientedPoints, apportion
from decals.scattering.gap_filling import EVEN
from decals.scattering.neighbors import NeighborQuery, index_array, local_maxima
from decals.scattering.particle_state import ParticleState
from decals.scattering.repulsion import particle_struct
from decals.surfaces.surface import vectors

MIN_ENERGY_RATIO = 1.8
"""Energy of a crowded particle, as a multiple of the median energy."""

MIN_GAP = 0.55
"""Least distance of a filled point from all particles, in spacings; a hole of a perfect tiling has 0.577."""

MIN_SEPARATION = 1.2
"""Least distance between points that are filled, or particles that leave, at the same time, in spacings."""

MAX_RELOCATED_SHARE = 0.02
"""Largest share of the particles that is relocated at once, besides one."""

GAP_REACH = 1.5
"""Distance from all particles, in spacings, from which gaps count as equal."""

CANDIDATES_PER_MOVER, CANDIDATES_PER_PARTICLE = 200, 4
"""Candidate points for each particle that moves, and at most for each particle."""

MAX_CANDIDATES = 500_000
"""Largest number of candidates: more take longer to draw than all steps of a million particles on a GPU."""

THIN_REACH, THIN_SHARE = 4.0, 0.45
"""Distance in spacings within which a thin part has less than this share of the area of a disc."""

SHARE_ERROR = 0.003
"""Allowed error of a part's number of particles, over its share; one particle always is."""

FIRST_NARROW_SAMPLES, NARROW_SAMPLES = 16, 64
"""Samples for each particle: in the first search for narrow places, and in a second one if that finds any."""

MOST_FIRST_NARROW_SAMPLES, MOST_NARROW_SAMPLES = 100_000, 200_000
"""Largest numbers of these samples."""

UNREACHED = 1.0
"""Distance from all facing particles, in spacings, beyond which a sample lies in a narrow place. In a
hexagonal tiling no point is farther than 0.577."""

NARROW = 1.8
"""Distance, in spacings, beyond which at least one sample must lie: smaller gaps move no particle."""

NARROW_APART = 0.9
"""Least distance of particles that move to narrow places, in spacings."""

NARROW_REACH = 2.0
"""Distance from all particles, in spacings, from which samples count as equal."""

MAX_NARROW_SHARE = 0.12
"""Largest share of the particles that move to narrow places."""

_CANDIDATE_STREAM, _SAMPLE_STREAM, _NARROW_STREAM = 1000, 1001, 1002


class Relocation:
    """Moves crowded particles to gaps, looked for at points all over the domain, drawn once and used in turn.

    Parameters
    ----------
    domain
        The surfaces, with density and mask.
    sizes_at
        Spacing at positions, a function of ``points[n, 3]`` to ``[n]``.
    """

    def __init__(self, domain: Domain, sizes_at: Callable[[Float32Array], Float32Array]) -> None:
        self._domain, self._sizes_at = domain, sizes_at
        self._points: OrientedPoints | None = None
        self._sizes: Float32Array | None = None
        self._thin: tuple[Any, BoolArray] | None = None
        self._next = 0

    def __call__(self, state: ParticleState, restore: Callable[[ParticleState], None]) -> Int64Array:
        """Move the crowded particles, before which `restore` is called; return those that moved."""
        movers = crowded_particles(state)
        if len(movers) == 0:
            return movers
        restore(state)
        points, sizes = self._drawn(state.count)
        rows = self._next_batch(len(movers), len(points))
        if self._domain.has_thin_parts:
            tree, thin = self._thin_points(state.count)
            rows = rows[~thin[rows]]
            movers = movers[~thin[tree.query(state.positions.numpy()[movers])[1]]]
        return relocate(state, movers, points[rows], sizes[rows])

    def _next_batch(self, mover_count: int, count: int) -> Int64Array:
        """Return the rows, of `count` points, of enough candidates for some movers."""
        batch_size = min(count, CANDIDATES_PER_MOVER * mover_count + 1000)
        rows = (self._next + np.arange(batch_size)) % count
        self._next = (self._next + batch_size) % count
        return rows

    def _drawn(self, particles: int) -> tuple[OrientedPoints, Float32Array]:
        """Return the candidates for so many particles, and the spacings there."""
        if self._points is None or self._sizes is None:
            count = min(CANDIDATES_PER_PARTICLE * particles, MAX_CANDIDATES)
            points = self._domain.sample(apportion(self._domain.masses, count), stream=_CANDIDATE_STREAM)
            self._points = points[np.random.default_rng(_CANDIDATE_STREAM).permutation(count)]
            self._sizes = self._sizes_at(self._points.positions)
        return self._points, self._sizes

    def _thin_points(self, count: int) -> tuple[Any, BoolArray]:
        """Return a tree of all candidates, and True for those on parts thinner than particles lie apart.

        Particles neither come nor leave there. Their distances say nothing: those of the right number of
        particles on a hair are far larger than a spacing.
        """
        if self._thin is None:
            from scipy.spatial import cKDTree  # most domains have no thin parts

            points, sizes = self._drawn(count)
            tree, radii = cKDTree(points.positions), THIN_REACH * sizes
            nearby = tree.query_ball_point(points.positions, radii, return_length=True, workers=-1)
            flat = len(points) / count * np.pi * THIN_REACH**2 / (0.5 * np.sqrt(3.0))
            self._thin = tree, np.asarray(nearby < THIN_SHARE * flat, np.bool_)
        return self._thin


def crowded_particles(state: ParticleState) -> Int64Array:
    """Return the particles to relocate, the most crowded first; of neighbours only one."""
    energies = state.energies
    max_count = 1 + int(MAX_RELOCATED_SHARE * state.count)
    rows = np.flatnonzero(state.movable & (energies > MIN_ENERGY_RATIO * np.median(energies)))
    if len(rows) == 0:
        return rows
    return most_crowded(state, rows, max_count)


def most_crowded(state: ParticleState, rows: Int64Array, most: int) -> Int64Array:
    """Return at most so many of some particles, the most crowded first; of neighbours only one."""
    energies = state.energies
    rows = rows[np.argsort(-energies[rows], kind="stable")]
    points = state.positions.numpy()[rows]
    separations = MIN_SEPARATION * state.host_sizes[rows]
    maxima = local_maxima(points, energies[rows], separations, device=state.device)
    return rows[maxima][:most]


def relocate(
    state: ParticleState, movers: Int64Array, candidates: OrientedPoints, candidate_sizes: Float32Array
) -> Int64Array:
    """Move particles to the candidates in the largest gaps of their own parts; return those that moved.

    Repulsion acts only nearby: it carries no particle to another component, round a sharp tip, or past
    its neighbours. Counts of the parts stay the same. `candidate_sizes` are spacings at the candidates.
    """
    gaps = gap_sizes(state, candidates, candidate_sizes, enough=MIN_GAP)
    bare = np.flatnonzero(gaps > MIN_GAP)
    separations = MIN_SEPARATION * candidate_sizes[bare]
    maxima = local_maxima(candidates.positions[bare], gaps[bare], separations, device=state.device)
    targets = bare[maxima]
    targets = targets[np.argsort(-gaps[targets], kind="stable")]
    parts = state.domain.parts(state.points()[movers])
    parts_of_targets = state.domain.parts(candidates[targets])
    moved, filled = _paired(movers, parts, targets, parts_of_targets)
    state.move_to(moved, candidates.positions[filled], candidates.normals[filled])
    return moved


def _paired(
    movers: Int64Array, groups: NDArray[Any], targets: Int64Array, groups_of_targets: NDArray[Any]
) -> tuple[Int64Array, Int64Array]:
    """Return, of each group, as many movers as it has targets and these targets, the first of both."""
    moved, filled = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for group in np.unique(groups):
        own_movers, own_targets = movers[groups == group], targets[groups_of_targets == group]
        pairs = min(len(own_movers), len(own_targets))
        moved.append(own_movers[:pairs])
        filled.append(own_targets[:pairs])
    return np.concatenate(moved), np.concatenate(filled)


def gap_sizes(
    state: ParticleState, candidates: OrientedPoints, sizes: Float32Array, *, enough: float
) -> Float32Array:
    """Return the distance of each candidate to the nearest facing particle, in spacings, up to a limit.

    Distances below `enough` need not be the least.
    """
    device, count = state.device, len(candidates)
    points = particle_struct(
        vectors(candidates.positions, device),
        vectors(candidates.normals, device),
        wp.array(sizes, dtype=wp.float32, device=device),
        state.sheets_of(candidates),
    )
    own: Any = index_array(np.full(count, -1), device)
    surface_ids = index_array(candidates.surface_ids, device)
    enabled = index_array(np.ones(count, np.int32), device)
    mirrors = state.mirror_planes(points, surface_ids, enabled)
    gaps: Float32Array = NeighborQuery(state, GAP_REACH).nearest(points, own, mirrors, enough=enough).numpy()
    return gaps


@dataclass(frozen=True)
class _Samples:
    """Points all over the domain, the spacings there, and the numbers of their parts."""

    points: OrientedPoints
    sizes: Float32Array
    parts: Int64Array


class PartShares:
    """Keeps the particles of each part of a tree near its share of the area, where parts are thin.

    Pressures at rest are not equal at equal densities: particles at a rim, or on both sides of a plate, have
    fewer or nearer neighbours than those on a ball. So particles drift across the joints between parts, some
    per cent of a part. Those in excess, the most crowded ones, move to the largest gaps of parts that lack
    some.

    Parameters
    ----------
    domain
        The surfaces, with density and mask.
    sizes_at
        Spacing at positions, a function of ``points[n, 3]`` to ``[n]``.
    """

    def __init__(self, domain: Domain, sizes_at: Callable[[Float32Array], Float32Array]) -> None:
        self._domain, self._sizes_at = domain, sizes_at
        self._samples: _Samples | None = None

    def __call__(self, state: ParticleState, restore: Callable[[ParticleState], None]) -> Int64Array:
        """Move particles between parts, before which `restore` is called; return those that moved."""
        if not self._domain.has_thin_parts:
            return np.zeros(0, np.int64)
        restore(state)
        points, samples = state.points(), self._drawn()
        parts = self._domain.parts(points)
        excess = self._excess(parts, samples.parts)
        movable = state.movable & (excess[parts] > 0)
        leaving = _largest(
            state.energies, points.positions, state.host_sizes, parts, excess, movable, state.device
        )
        lacking = np.flatnonzero(excess[samples.parts] < 0)
        candidates, sizes = samples.points[lacking], samples.sizes[lacking]
        gaps = gap_sizes(state, candidates, sizes, enough=0.0)
        filled = _largest(
            gaps, candidates.positions, sizes, samples.parts[lacking], -excess, gaps > 0.0, state.device
        )
        moved, filled = _paired(leaving, points.surface_ids[leaving], filled, candidates.surface_ids[filled])
        state.move_to(moved, candidates.positions[filled], candidates.normals[filled])
        return moved

    def _drawn(self) -> _Samples:
        if self._samples is None:
            domain = self._domain
            points = domain.sample(apportion(domain.masses, AREA_SAMPLES), stream=_SAMPLE_STREAM)
            self._samples = _Samples(points, self._sizes_at(points.positions), domain.parts(points))
        return self._samples

    def _excess(self, parts: Int64Array, sampled: Int64Array) -> Int64Array:
        """Return by how many particles each part exceeds its share of those of its surface."""
        numbers = int(max(parts.max(), sampled.max())) + 1
        found, shares = np.bincount(parts, minlength=numbers), np.bincount(sampled, minlength=numbers)
        excess = np.zeros(numbers, np.int64)
        surfaces = len(self._domain.surfaces)
        for index in range(surfaces):
            own = slice(index, None, surfaces)
            if shares[own].any():
                excess[own] = found[own] - apportion(shares[own].astype(np.float64), int(found[own].sum()))
        return np.where(np.abs(excess) > np.maximum(1.0, SHARE_ERROR * (found - excess)), excess, 0)


def _largest(
    values: Float32Array,
    positions: Float32Array,
    sizes: Float32Array,
    parts: Int64Array,
    counts: Int64Array,
    allowed: BoolArray,
    device: str,
) -> Int64Array:
    """Return the rows with the largest values, so many of each part, none near another of its part."""
    chosen = [np.zeros(0, np.int64)]
    for part in np.flatnonzero(counts > 0):
        rows = np.flatnonzero(allowed & (parts == part))
        maxima = local_maxima(positions[rows], values[rows], MIN_SEPARATION * sizes[rows], device=device)
        rows = rows[maxima]
        chosen.append(rows[np.argsort(-values[rows], kind="stable")][: counts[part]])
    return np.concatenate(chosen)


def reach_narrow_places(state: ParticleState) -> Int64Array:
    """Move crowded particles to narrow places and hold them there; return those that moved.

    A narrow place has too little area for a particle of its own, and its normals differ so much from those
    around it that no particle there faces it: the inner side of a rim, the edge of a plate. Repulsion would
    push its particles out, so they no longer move. Where the density is not even, all stay.

    Parameters
    ----------
    state
        The particles, about at rest.
    """
    sizes = state.host_sizes
    if state.domain.has_thin_parts or sizes.max() > EVEN * sizes.min():
        return np.zeros(0, np.int64)
    if not len(_unreached(state, min(FIRST_NARROW_SAMPLES * state.count, MOST_FIRST_NARROW_SAMPLES))[1]):
        return np.zeros(0, np.int64)
    samples, gaps = _unreached(state, min(NARROW_SAMPLES * state.count, MOST_NARROW_SAMPLES))
    if gaps.max(initial=0.0) <= NARROW:
        return np.zeros(0, np.int64)
    distances = np.full(len(samples), NARROW_APART * state.spacing)
    targets = samples[spread_apart(samples, gaps, distances, FACING_LIMIT)]
    movers = most_crowded(state, np.flatnonzero(state.movable), int(MAX_NARROW_SHARE * state.count))
    moved, filled = _paired(movers, state.surface_ids[movers], np.arange(len(targets)), targets.surface_ids)
    state.move_to(moved, targets.positions[filled], targets.normals[filled])
    state.hold(moved)
    return moved


def _unreached(state: ParticleState, count: int) -> tuple[OrientedPoints, Float64Array]:
    """Return those of so many samples that lie in narrow places, and their distances in spacings."""
    domain = state.domain
    samples = domain.sample(apportion(domain.masses, count), stream=_NARROW_STREAM)
    gaps = NeighborQuery(state, NARROW_REACH).owners(samples.positions, samples.normals)[0]
    rows = np.flatnonzero(gaps > UNREACHED)
    return samples[rows], gaps[rows].astype(np.float64)
