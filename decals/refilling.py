"""Move crowded particles to bare places, where repulsion alone cannot bring them."""

import numpy as np
from numpy.typing import NDArray

from decals.neighbours import FacingTree
from decals.population import Sites

GAIN = 1.3
"""A particle moves if it will be this many times farther from its neighbours than it was."""

APART = 0.8
"""Least distance between places that are filled at the same time, in spacings."""

MOST = 0.05
"""Largest part of the population that moves at once, besides one."""


def refill(particles: Sites, scouts: Sites, spacing: float) -> Sites:
    """Move the most crowded particles to the barest scouts, each within its own surface.

    Repulsion only acts nearby: it carries no particle to another component, round a sharp tip, or past
    its neighbours. Counts per surface stay as they are.
    """
    tree = FacingTree(particles.positions, particles.normals)
    crowding, partner = tree.nearest(particles.positions, particles.normals, skip_self=True)
    bareness, _ = tree.nearest(scouts.positions, scouts.normals)
    pairs = _matches(particles, scouts, crowding[:, 0], partner[:, 0], bareness[:, 0], spacing)
    if not pairs:
        return particles
    movers, places = np.array(pairs).T
    positions, normals = particles.positions.copy(), particles.normals.copy()
    positions[movers], normals[movers] = scouts.positions[places], scouts.normals[places]
    return Sites(positions, normals, particles.surface_ids)


def _matches(
    particles: Sites,
    scouts: Sites,
    crowding: NDArray[np.float64],
    partner: NDArray[np.int64],
    bareness: NDArray[np.float64],
    spacing: float,
) -> list[tuple[int, int]]:
    """Pairs (particle, scout) from the most crowded and the barest on."""
    pairs: list[tuple[int, int]] = []
    for surface in np.unique(particles.surface_ids):
        members = np.flatnonzero(particles.surface_ids == surface)
        most = 1 + int(MOST * len(members))
        donors = _donors(members, crowding, partner, most)
        places = _places(np.flatnonzero(scouts.surface_ids == surface), scouts, bareness, spacing, most)
        for mover, place in zip(donors, places, strict=False):
            if bareness[place] <= GAIN * crowding[mover]:
                break
            pairs.append((mover, place))
    return pairs


def _donors(
    members: NDArray[np.int64], crowding: NDArray[np.float64], partner: NDArray[np.int64], most: int
) -> list[int]:
    """Choose the most crowded members; of a close pair one only."""
    kept: set[int] = set()
    donors: list[int] = []
    for particle in members[np.argsort(crowding[members], kind="stable")].tolist():
        if len(donors) == most:
            break
        if particle not in kept:
            donors.append(particle)
            kept.add(int(partner[particle]))
    return donors


def _places(
    members: NDArray[np.int64], scouts: Sites, bareness: NDArray[np.float64], spacing: float, most: int
) -> list[int]:
    """Choose the barest members that keep apart from each other."""
    places: list[int] = []
    taken = np.empty((0, 3))
    for scout in members[np.argsort(-bareness[members], kind="stable")][: 64 * most].tolist():
        if len(places) == most:
            break
        position = scouts.positions[scout].astype(np.float64)
        if (((taken - position) ** 2).sum(axis=1) > (APART * spacing) ** 2).all():
            places.append(scout)
            taken = np.vstack([taken, position])
    return places
