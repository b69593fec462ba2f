"""Relaxation of the particles around one point."""

import numpy as np

from blobtree._typing import BoolArray, Float32Array
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.particle_state import ParticleState
from decals.scattering.repulsion import LOCAL_LAW

MOVING_RADIUS, PUSHING_RADIUS = 4.0, 6.5
"""Radius of the particles that move in a local relaxation, and of those that repel them, in spacings."""

LOCAL_STEPS = 16
"""Steps of a local relaxation."""


def relax_near(
    domain: Domain,
    points: OrientedPoints,
    movable: BoolArray,
    sizes: Float32Array,
    center: Float32Array,
    reach: float | None = None,
) -> OrientedPoints:
    """Relax the particles around a point, or those within a reach, and leave all others where they are."""
    distances = np.linalg.norm(points.positions - center, axis=1)
    spacing = float(sizes[distances.argmin()])
    pushing, moved = PUSHING_RADIUS * spacing, MOVING_RADIUS * spacing
    if reach is not None:
        pushing, moved = reach + pushing - moved, reach
    near = np.flatnonzero(distances < pushing)
    moving = (distances[near] < moved) & movable[near]
    if not moving.any():
        return points
    state = ParticleState(domain, points[near], moving, sizes[near])
    for _ in range(LOCAL_STEPS):
        if state.epoch_over:
            state.begin_epoch(LOCAL_LAW)
        state.step()
    return points.replaced(near, state.points())
