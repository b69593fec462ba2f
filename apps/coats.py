"""Decals for measurements: spread evenly in seconds, and at any count covering the surface equally often."""

from collections.abc import Sequence

import numpy as np

from decals.model import Decals
from decals.orientation import tangents
from decals.relaxation import Relaxation
from decals.surface import Surface

COVERAGE = 1.6
"""Area of all rims together over the area of the surface: about what gap-free seeding comes to."""

STEPS = 12
"""Steps of relaxation: enough to part neighbours that lie by chance on one spot."""


def even_coat(surfaces: Sequence[Surface], *, count: int, seed: int = 0) -> Decals:
    """Spread equal decals over surfaces.

    `decals.seed` lays them more evenly and without gaps, but takes minutes for 100,000.
    """
    relaxation = Relaxation(surfaces, count=count, seed=seed, iterations=STEPS)
    relaxation.run()
    radius = np.sqrt(COVERAGE * relaxation.world.area / (np.pi * max(count, 1)))
    return Decals(
        positions=relaxation.positions,
        normals=relaxation.normals,
        tangents=tangents(relaxation.positions, relaxation.normals, None, seed),
        radii=np.full(count, radius, np.float32),
    )
