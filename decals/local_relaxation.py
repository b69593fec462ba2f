"""Relax the neighbourhood of one place, for edits while somebody looks on."""

import numpy as np

from decals.moving import moved
from decals.population import Sites, World
from decals.repulsion import Repulsion
from decals.surface import Flags, Floats

INNER, OUTER = 4.0, 6.5
"""Particles nearer than the first move, up to the second they push, in spacings."""

STEPS = 16
"""Steps that a neighbourhood takes."""


def relax_near(
    world: World,
    sites: Sites,
    movable: Flags,
    sizes: Floats,
    center: Floats,
    *,
    exponent: float,
    stiffness: float,
    device: str,
) -> Sites:
    """Let the particles around a place find their rest, all others where they are."""
    distances = np.linalg.norm(sites.positions - center, axis=1)
    spacing = float(sizes[distances.argmin()])
    near = np.flatnonzero(distances < OUTER * spacing)
    resting = (distances[near] > INNER * spacing) | ~movable[near]
    crowd, own_sizes = sites[near], sizes[near]
    repulsion = Repulsion(len(near), device=device)
    for _ in range(STEPS):
        if repulsion.stale:
            repulsion.relist(crowd.positions, crowd.normals, own_sizes)
        moves = repulsion.moves(
            crowd.positions, crowd.normals, own_sizes, exponent=exponent, stiffness=stiffness
        )
        moves[resting] = 0.0
        crowd = moved(world, crowd, moves, own_sizes)
    positions, normals = sites.positions.copy(), sites.normals.copy()
    positions[near], normals[near] = crowd.positions, crowd.normals
    return Sites(positions, normals, sites.surface_ids)
