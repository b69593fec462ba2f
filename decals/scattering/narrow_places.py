"""Particles for narrow places, such as the inner side of a rim, which no particle elsewhere faces."""

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from decals.model import FACING_LIMIT
from decals.scattering.bare_places import spread_apart
from decals.scattering.domain import OrientedPoints, apportion
from decals.scattering.gap_filling import EVEN
from decals.scattering.neighbors import NeighborQuery
from decals.scattering.particle_state import ParticleState
from decals.scattering.relocation import most_crowded

FIRST_SAMPLES, SAMPLES = 16, 64
"""Samples for each particle: in the first search for narrow places, and in a second one if that finds any."""

MOST_FIRST_SAMPLES, MOST_SAMPLES = 100_000, 200_000
"""Largest numbers of these samples."""

UNREACHED = 1.0
"""Distance from all facing particles, in spacings, beyond which a sample lies in a narrow place. In a
hexagonal tiling no point is farther than 0.577."""

NARROW = 1.8
"""Distance, in spacings, beyond which at least one sample must lie: smaller gaps move no particle."""

APART = 0.9
"""Least distance of particles that move to narrow places, in spacings."""

REACH = 2.0
"""Distance from all particles, in spacings, from which samples count as equal."""

MAX_SHARE = 0.12
"""Largest share of the particles that move to narrow places."""

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
    movers = most_crowded(state, np.flatnonzero(state.movable), int(MAX_SHARE * state.count))
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
