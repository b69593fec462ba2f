"""Shares of parts: particles that drifted from one part of a tree to another move back."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Int64Array
from decals.scattering.domain import AREA_SAMPLES, Domain, OrientedPoints, apportion
from decals.scattering.neighbors import local_maxima
from decals.scattering.particle_state import ParticleState
from decals.scattering.relocation import MIN_SEPARATION, gap_sizes

SHARE_ERROR = 0.003
"""Allowed error of a part's number of particles, over its share; one particle always is."""

_SAMPLE_STREAM = 1001


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
        moved = np.zeros(0, np.int64)
        for index in range(len(self._domain.surfaces)):
            rows = leaving[points.surface_ids[leaving] == index]
            targets = filled[candidates.surface_ids[filled] == index][: len(rows)]
            rows = rows[: len(targets)]
            state.move_to(rows, candidates.positions[targets], candidates.normals[targets])
            moved = np.concatenate([moved, rows])
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
