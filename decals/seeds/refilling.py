"""Move crowded particles to bare places, where repulsion alone cannot bring them."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from decals.seeds.crowd import Crowd
from decals.seeds.looking import Lookout, outstanding, whole_numbers
from decals.seeds.population import Sites
from decals.surfaces.ground import vectors
from decals.surfaces.surface import Floats

EXCESS = 1.8
"""A particle moves if its energy is this many times that of the median one."""

BARE = 0.55
"""Least distance of a filled place from all particles, in spacings; a hole of a perfect tiling has 0.577."""

APART = 1.2
"""Least distance between places that are filled, or particles that leave, at the same time, in spacings."""

MOST = 0.02
"""Largest part of the population that moves at once, besides one."""

SIGHT = 1.5
"""Places farther than this many spacings from all particles are equally bare."""


def crowded(crowd: Crowd) -> NDArray[np.int64]:
    """Particles that should move elsewhere, the most crowded first; of neighbours one only."""
    energies = crowd.energies
    most = 1 + int(MOST * crowd.count)
    rows = np.flatnonzero(crowd.movable & (energies > EXCESS * np.median(energies)))
    if len(rows) == 0:
        return rows
    rows = rows[np.argsort(-energies[rows], kind="stable")]
    points = crowd.positions.numpy()[rows]
    alone = outstanding(points, energies[rows], APART * crowd.host_sizes[rows], device=crowd.device)
    return rows[alone][:most]


def refill(crowd: Crowd, movers: NDArray[np.int64], scouts: Sites, scout_sizes: Floats) -> NDArray[np.int64]:
    """Move particles to the barest scouts, each within its own surface; who went comes back.

    Repulsion only acts nearby: it carries no particle to another component, round a sharp tip, or past
    its neighbours. Counts per surface stay as they are. `scout_sizes` are the spacings wished for there.
    """
    bareness = _bareness(crowd, scouts, scout_sizes)
    bare = np.flatnonzero(bareness > BARE)
    alone = outstanding(
        scouts.positions[bare], bareness[bare], APART * scout_sizes[bare], device=crowd.device
    )
    places = bare[alone]
    places = places[np.argsort(-bareness[places], kind="stable")]
    moved: list[int] = []
    filled: list[int] = []
    for surface in np.unique(crowd.surface_ids[movers]):
        own = movers[crowd.surface_ids[movers] == surface].tolist()
        free = places[scouts.surface_ids[places] == surface].tolist()
        pairs = min(len(own), len(free))
        moved += own[:pairs]
        filled += free[:pairs]
    rows = np.array(moved, np.int64)
    crowd.place(rows, scouts.positions[filled], scouts.normals[filled])
    return rows


def _bareness(crowd: Crowd, scouts: Sites, sizes: Floats) -> Floats:
    """Distance of each scout to the nearest particle that faces it, in spacings, up to a limit."""
    device = crowd.device
    spacings: Any = wp.array(sizes, dtype=wp.float32, device=device)
    places, ways = vectors(scouts.positions, device), vectors(scouts.normals, device)
    owners, everybody = (
        whole_numbers(rows, device) for rows in (scouts.surface_ids, np.ones(len(scouts), np.int32))
    )
    found = Lookout(crowd, SIGHT).nearness(
        places,
        ways,
        spacings,
        whole_numbers(np.full(len(scouts), -1), device),
        crowd.walls(places, ways, spacings, owners, everybody),
        enough=BARE,
    )
    bareness: Floats = found.numpy()
    return bareness
