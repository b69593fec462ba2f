"""Polish: part the last close pairs by trial."""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Int64Array
from blobtree.device import launch
from decals.scattering.domain import OrientedPoints, crosses_density_step
from decals.scattering.neighbors import CLOSE_DISTANCE, NeighborQuery, index_array, local_maxima
from decals.scattering.particle_state import ParticleState
from decals.scattering.projection import spans_of
from decals.scattering.repulsion import particle_struct
from decals.scattering.search_kernels import Candidates, ChoiceRule, move_to_best, sample_around

MIN_TRIALS, TRIALS_PER_ROUND = 60, 1000
"""Candidates of each moving particle at least, and of all moving particles of a round together."""

TRIAL_DISTANCES = (0.03, 0.9)
"""Shortest and longest distance of a candidate from its particle, in spacings."""

MOVER_SEPARATION = 2.5
"""Least distance between particles that move in the same round, in spacings, so that they stay apart."""

SELECTION_NOISE = 0.05
"""Random part of the order in which close particles move, in spacings: the closest may be unable to move."""

CANDIDATE_REACH = 2.0
"""Distance from all particles, in spacings, from which candidates count as equal."""

IDEAL_RING = 1.0
"""Mean distance to six neighbours in a perfect tiling, in spacings."""

MIN_GAIN = 1.001
"""Least factor by which a move must increase the distance to the nearest neighbour."""

FULL_SEARCH_INTERVAL = 5
"""Rounds after which all particles are searched for close pairs, not only those that were close before."""

MAX_IDLE_ROUNDS = 30
"""Rounds without any move after which the search ends."""


def polish(
    state: ParticleState,
    *,
    rounds: int,
    seed: int,
    sizes_at: Callable[[Float32Array], Float32Array],
    close: float = CLOSE_DISTANCE,
) -> None:
    """Move particles that are too close to a neighbour to better candidates around them.

    After farthest-point optimisation (Schlömer, Heck and Deussen 2011), by trial because normals, and with
    them the neighbourhoods, jump at sharp edges. The least distance, in spacings, never falls. Particles do
    not cross a step of the density.

    Parameters
    ----------
    state
        The particles.
    rounds
        Largest number of rounds.
    seed
        Seed of the candidates.
    sizes_at
        Spacing at positions, a function of ``points[n, 3]`` to ``[n]``.
    close
        Distance below which two particles are too close, in spacings.
    """
    rng = np.random.default_rng(seed)
    query = NeighborQuery(state, CANDIDATE_REACH)
    all_rows = np.arange(state.count)
    rows, idle_rounds = all_rows, 0
    for turn in range(rounds):
        if turn % FULL_SEARCH_INTERVAL == 0:  # particles that moved may have come close to others
            rows = all_rows
        nearest = query.nearest_of(rows)
        rows, nearest = rows[nearest < close], nearest[nearest < close]
        movers, nearest = _choose_movers(state, rows, nearest, rng)
        if len(movers) == 0 or idle_rounds == MAX_IDLE_ROUNDS:
            break
        trial_seed = int(rng.integers(2**31))
        moved = _try_candidates(
            state, query, movers, nearest, seed=trial_seed, close=close, sizes_at=sizes_at
        )
        idle_rounds = 0 if moved.any() else idle_rounds + 1
        if moved.any():
            query.refresh()
    state.end_epoch()


def _choose_movers(
    state: ParticleState, rows: Int64Array, nearest: Float32Array, rng: np.random.Generator
) -> tuple[Int64Array, Float32Array]:
    """Choose the movable particles that are the closest within a neighbourhood, and their distances."""
    nearest, rows = nearest[state.movable[rows]], rows[state.movable[rows]]
    noise = (SELECTION_NOISE * rng.random(len(rows))).astype(np.float32)
    points = state.positions.numpy()[rows]
    separations = MOVER_SEPARATION * state.host_sizes[rows]
    maxima = local_maxima(points, -nearest - noise, separations, device=state.device)
    return rows[maxima], nearest[maxima]


def _try_candidates(
    state: ParticleState,
    query: NeighborQuery,
    movers: Int64Array,
    nearest: Float32Array,
    *,
    seed: int,
    close: float,
    sizes_at: Callable[[Float32Array], Float32Array],
) -> BoolArray:
    """Move particles to the best of random candidates around them; return True for those that moved."""
    device, count = state.device, len(movers)
    per_mover = max(MIN_TRIALS, TRIALS_PER_ROUND // count)
    total = count * per_mover
    rows, own = index_array(movers, device), index_array(np.repeat(movers, per_mover), device)

    # random points around the movers, projected onto their surfaces
    targets, reaches = _zeros(wp.vec3, total, device), _zeros(wp.float32, total, device)
    positions, normals = _zeros(wp.vec3, total, device), _zeros(wp.vec3, total, device)
    forbidden = _zeros(wp.int32, total, device)
    centers, center_sizes = state.positions[rows].contiguous(), state.sizes[rows].contiguous()
    log_shortest, log_longest = np.log(TRIAL_DISTANCES)
    inputs = [seed, per_mover, float(log_shortest), float(log_longest), centers, center_sizes]
    launch(sample_around, total, inputs, [targets, reaches], device=device)
    spans = [
        (surface, per_mover * first, per_mover * last)
        for surface, first, last in spans_of(state.surface_ids[movers])
    ]
    state.domain.projection.project(targets, reaches, spans, positions, normals, forbidden)

    # where density varies, candidates across a step of it are forbidden
    sizes = state.sizes[own].contiguous()
    if state.varied:
        candidate_sizes = sizes_at(positions.numpy())
        flags = crosses_density_step(sizes.numpy(), candidate_sizes) | (forbidden.numpy() == 1)
        forbidden.assign(flags.astype(np.int32))
        sizes.assign(candidate_sizes)

    trials = OrientedPoints(
        positions.numpy(), normals.numpy(), np.repeat(state.surface_ids[movers], per_mover)
    )
    points = particle_struct(positions, normals, sizes, state.sheets_of(trials))
    surface_ids = state.device_surface_ids[own].contiguous()
    mirrors = state.mirror_planes(points, surface_ids, state.device_movable[own].contiguous())
    candidates: Any = Candidates()
    candidates.per_particle = per_mover
    candidates.positions, candidates.normals, candidates.forbidden = positions, normals, forbidden
    candidates.nearest, candidates.rings = query.rings(points, own, mirrors)
    rule: Any = ChoiceRule()
    rule.min_gain, rule.close, rule.ideal_ring = MIN_GAIN, close, IDEAL_RING
    current_nearest: Any = wp.array(nearest, dtype=wp.float32, device=device)
    moved = _zeros(wp.int32, count, device)
    inputs = [rule, rows, current_nearest, candidates]
    launch(move_to_best, count, inputs, [state.particles, moved], device=device)
    flags_moved: BoolArray = moved.numpy() == 1
    return flags_moved


def _zeros(dtype: Any, count: int, device: str) -> Any:
    return wp.zeros(count, dtype=dtype, device=device)
