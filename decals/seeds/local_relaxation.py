"""Relax the neighbourhood of one place, for edits while somebody looks on."""

import numpy as np

from decals.seeds.crowd import Crowd
from decals.seeds.population import Sites, World
from decals.seeds.schedule import NEARBY
from decals.surfaces.surface import Flags, Floats

INNER, OUTER = 4.0, 6.5
"""Particles nearer than the first move, up to the second they push, in spacings."""

STEPS = 16
"""Steps that a neighbourhood takes."""


def relax_near(world: World, sites: Sites, movable: Flags, sizes: Floats, center: Floats) -> Sites:
    """Let the particles around a place find their rest, all others where they are."""
    distances = np.linalg.norm(sites.positions - center, axis=1)
    spacing = float(sizes[distances.argmin()])
    near = np.flatnonzero(distances < OUTER * spacing)
    moving = (distances[near] < INNER * spacing) & movable[near]
    if not moving.any():
        return sites
    crowd = Crowd(world, sites[near], moving, sizes[near])
    for _ in range(STEPS):
        if crowd.stale:
            crowd.begin(NEARBY)
        crowd.step()
    found = crowd.sites()
    positions, normals = sites.positions.copy(), sites.normals.copy()
    positions[near], normals[near] = found.positions, found.normals
    return Sites(positions, normals, sites.surface_ids)
