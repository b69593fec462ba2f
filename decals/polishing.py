"""Part the last few pairs that repulsion leaves too close, at sharp tips above all."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals.neighbours import FacingTree
from decals.population import Sites
from decals.surface import Flags, Floats

CLOSE = 0.89
"""A particle is too close to its neighbour below this many spacings."""

TRIALS, BUDGET = 24, 1000
"""Places tried in each round: for each particle at least so many, and for all together."""

REACH = (0.03, 0.9)
"""Shortest and longest way to a trial, in spacings."""

ALONE = 2.5
"""Least distance between particles that move in the same round, in spacings, so that they do not meet."""

GAIN = 1.001
"""A move must multiply the distance to the nearest neighbour by this."""

MIXED = 7
"""Nearest particles looked at where spacings vary, itself included: the nearest need not be the closest."""

LOOK_ROUND = 5
"""Rounds after which all particles are looked at, and not those alone that were close before."""

GIVE_UP = 12
"""Rounds without any move after which the search ends."""

Settle = Callable[[Sites], tuple[Sites, Flags]]
"""Puts points back onto their own surfaces and tells which may lie there."""


def polish(
    particles: Sites,
    sizes: Floats,
    movable: Flags,
    settle: Settle,
    *,
    rounds: int,
    seed: int,
    close: float = CLOSE,
) -> Sites:
    """Move particles that are too close to a neighbour to the loneliest of some places around them.

    After farthest-point optimisation (Schlömer, Heck and Deussen 2011), by trial because normals, and with
    them who is whose neighbour, jump at sharp edges. The least distance, in spacings, never falls.
    """
    rng = np.random.default_rng(seed)
    idle = 0
    watched = np.arange(len(particles))
    for turn in range(rounds):
        if turn % LOOK_ROUND == 0:  # who got close to somebody on the move may have to move instead
            watched = np.arange(len(particles))
        tree = FacingTree(particles.positions, particles.normals)
        nearest = _closeness(tree, sizes, particles[watched], watched)
        pairs, nearest = watched[nearest < close], nearest[nearest < close]
        watched = pairs
        movers, nearest = _movers(particles, pairs[movable[pairs]], nearest[movable[pairs]], sizes, rng)
        if len(movers) == 0 or idle == GIVE_UP:
            break
        tries = max(TRIALS, BUDGET // len(movers))
        own = np.repeat(movers, tries)
        trials, allowed = settle(_around(particles, own, sizes, rng))
        distances = np.where(allowed, _closeness(tree, sizes, trials, own), -1.0)
        best = distances.reshape(-1, tries).argmax(axis=1) + tries * np.arange(len(movers))
        better = distances[best] > GAIN * nearest
        idle = 0 if better.any() else idle + 1
        positions, normals = particles.positions.copy(), particles.normals.copy()
        positions[movers[better]] = trials.positions[best[better]]
        normals[movers[better]] = trials.normals[best[better]]
        particles = Sites(positions, normals, particles.surface_ids)
    return particles


def _movers(
    particles: Sites,
    close: NDArray[np.int64],
    nearest: NDArray[np.float64],
    sizes: Floats,
    rng: np.random.Generator,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Choose among the close ones the closest, none near another of them; their closeness comes along."""
    order = np.argsort(nearest + 1e-3 * rng.random(len(close)), kind="stable")
    close, nearest = close[order], nearest[order]
    if len(close) == 0:
        return close, nearest
    positions = particles.positions[close]
    free = np.ones(len(close), np.bool_)
    chosen: list[int] = []
    near = cKDTree(positions).query_ball_point(positions, ALONE * sizes[close])
    for row, others in enumerate(near):
        if free[row]:
            chosen.append(row)
            free[others] = False
    return close[chosen], nearest[chosen]


def _around(particles: Sites, rows: NDArray[np.int64], sizes: Floats, rng: np.random.Generator) -> Sites:
    """One random place near each of the particles, at all scales within reach."""
    ways = rng.normal(size=(len(rows), 3))
    low, high = np.log(REACH)
    lengths = sizes[rows, None] * np.exp(rng.uniform(low, high, (len(rows), 1)))
    ways *= lengths / np.linalg.norm(ways, axis=1, keepdims=True)
    places = (particles.positions[rows] + ways).astype(np.float32)
    return Sites(places, particles.normals[rows], particles.surface_ids[rows])


def _closeness(tree: FacingTree, sizes: Floats, places: Sites, own: NDArray[np.int64]) -> NDArray[np.float64]:
    """Distance of each place from the nearest facing particle other than its own, in their spacing."""
    count = 2 if sizes.min() == sizes.max() else MIXED
    distances, indices = tree.nearest(places.positions, places.normals, count=count)
    distances[indices == own[:, None]] = np.inf
    closeness: NDArray[np.float64] = (distances / (0.5 * (sizes[own, None] + sizes[indices]))).min(axis=1)
    return closeness
