"""Particles for narrow places, such as the inner side of a rim, which no particle elsewhere faces."""

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from decals.model import FACING_LIMIT
from decals.scattering.bare_places import spread_apart
from decals.scattering.domain import OrientedPoints, apportion
from decals.scattering.neighbors import NeighborQuery, local_maxima
from decals.scattering.particle_state import ParticleState
from decals.scattering.relocation import MIN_SEPARATION

FIRST_SAMPLES, SAMPLES = 16, 64
"""Points for each particle, at which narrow places are looked for first, and once there are any."""

MOST_FIRST_SAMPLES, MOST_SAMPLES = 100_000, 200_000
"""Largest numbers of these points."""

UNREACHED = 1.0
"""Distance from all facing particles, in spacings, beyond which a sample lies in a narrow place. In a
hexagonal tiling no point is farther than 0.577."""

NARROW = 1.8
"""The same for at least one of the samples: particles do not move for smaller gaps."""

APART = 0.9
"""Least distance of particles that move to narrow places, in spacings."""

REACH = 2.0
"""Distance from all particles, in spacings, from which samples count as equal."""

MAX_SHARE = 0.12
"""Largest share of the particles that move to narrow places."""

EVEN = 1.1
"""Largest ratio of spacings at which the density counts as even."""

_SAMPLE_STREAM = 1002


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
    if not len(_unreached(state, min(FIRST_SAMPLES * state.count, MOST_FIRST_SAMPLES))[1]):
        return np.zeros(0, np.int64)
    samples, gaps = _unreached(state, min(SAMPLES * state.count, MOST_SAMPLES))
    if gaps.max(initial=0.0) <= NARROW:
        return np.zeros(0, np.int64)
    distances = np.full(len(samples), APART * state.spacing)
    targets = samples[spread_apart(samples, gaps, distances, FACING_LIMIT)]
    movers = _crowded(state)
    rows, chosen = [], []
    for surface in np.unique(targets.surface_ids):
        own_movers = movers[state.surface_ids[movers] == surface]
        own_targets = np.flatnonzero(targets.surface_ids == surface)
        pairs = min(len(own_movers), len(own_targets))
        rows.append(own_movers[:pairs])
        chosen.append(own_targets[:pairs])
    moved, filled = np.concatenate(rows), targets[np.concatenate(chosen)]
    state.move_to(moved, filled.positions, filled.normals)
    state.hold(moved)
    return moved


def _unreached(state: ParticleState, count: int) -> tuple[OrientedPoints, Float64Array]:
    """Return those of so many samples that lie in narrow places, and their distances in spacings."""
    domain = state.domain
    samples = domain.sample(apportion(domain.masses, count), stream=_SAMPLE_STREAM)
    gaps = NeighborQuery(state, REACH).owners(samples.positions, samples.normals)[0]
    rows = np.flatnonzero(gaps > UNREACHED)
    return samples[rows], gaps[rows].astype(np.float64)


def _crowded(state: ParticleState) -> Int64Array:
    """Return particles that may move, the most crowded first; of neighbours only one."""
    rows = np.flatnonzero(state.movable)
    rows = rows[np.argsort(-state.energies[rows], kind="stable")]
    separations = MIN_SEPARATION * state.host_sizes[rows]
    points = state.positions.numpy()[rows]
    maxima = local_maxima(points, state.energies[rows], separations, device=state.device)
    return rows[maxima][: int(MAX_SHARE * state.count)]
