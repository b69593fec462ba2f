"""Move crowded particles to bare places, where repulsion alone cannot bring them."""

import numpy as np
from numpy.typing import NDArray

from decals.neighbours import FacingTree
from decals.population import Sites
from decals.surface import Floats

EXCESS = 1.8
"""A particle moves if its energy is this many times that of the median one."""

BARE = 0.55
"""Least distance of a filled place from all particles, in spacings; a hole of a perfect tiling has 0.577."""

APART = 1.2
"""Least distance between places that are filled at the same time, in spacings."""

MOST = 0.02
"""Largest part of the population that moves at once, besides one."""


def crowded(particles: Sites, energies: Floats, movable: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Particles that should move elsewhere, the most crowded first; of neighbours one only."""
    most = 1 + int(MOST * len(particles))
    rows = np.flatnonzero(movable & (energies > EXCESS * np.median(energies)))
    rows = rows[np.argsort(-energies[rows], kind="stable")][: 4 * most]
    if len(rows) == 0:
        return rows
    tree = FacingTree(particles.positions, particles.normals)
    near = tree.nearest(particles.positions[rows], particles.normals[rows], count=7)[1]
    kept: set[int] = set()
    chosen: list[int] = []
    for particle, others in zip(rows.tolist(), near.tolist(), strict=True):
        if len(chosen) < most and particle not in kept:
            chosen.append(particle)
            kept.update(others)
    return np.array(chosen, np.int64)


def refill(
    particles: Sites, movers: NDArray[np.int64], scouts: Sites, scout_sizes: Floats
) -> tuple[Sites, NDArray[np.int64]]:
    """Move particles to the barest scouts, each within its own surface; which of them moved comes along.

    Repulsion only acts nearby: it carries no particle to another component, round a sharp tip, or past
    its neighbours. Counts per surface stay as they are. `scout_sizes` are the spacings wished for there.
    """
    tree = FacingTree(particles.positions, particles.normals)
    bareness = tree.nearest(scouts.positions, scouts.normals)[0][:, 0] / scout_sizes
    moved: list[int] = []
    filled: list[int] = []
    for surface in np.unique(particles.surface_ids[movers]):
        own = movers[particles.surface_ids[movers] == surface].tolist()
        places = _places(
            np.flatnonzero(scouts.surface_ids == surface), scouts, bareness, scout_sizes, len(own)
        )
        moved += own[: len(places)]
        filled += places
    positions, normals = particles.positions.copy(), particles.normals.copy()
    positions[moved], normals[moved] = scouts.positions[filled], scouts.normals[filled]
    return Sites(positions, normals, particles.surface_ids), np.array(moved, np.int64)


def _places(
    members: NDArray[np.int64],
    scouts: Sites,
    bareness: NDArray[np.float64],
    sizes: Floats,
    most: int,
) -> list[int]:
    """Choose the barest members that keep apart from each other."""
    places: list[int] = []
    taken = np.empty((0, 3))
    for scout in members[np.argsort(-bareness[members], kind="stable")][: 64 * most].tolist():
        if len(places) == most or bareness[scout] < BARE:
            break
        position = scouts.positions[scout].astype(np.float64)
        if (((taken - position) ** 2).sum(axis=1) > (APART * sizes[scout]) ** 2).all():
            places.append(scout)
            taken = np.vstack([taken, position])
    return places
