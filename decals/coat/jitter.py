"""A little disorder for decals that lie too well."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decals.seeds.population import Sites, World
from decals.surfaces.surface import Flags, Floats, unit_rows
from decals.wishes import number


@dataclass(frozen=True)
class Jitter:
    """How much chance there is in where decals lie, how large they are and which way they point.

    Attributes
    ----------
    position
        Standard deviation of the place, in spacings. Sizes are measured afterwards, so a coat without gaps
        stays one.
    size
        Standard deviation of the radius, as a part of it; factors are never above ``exp(3 size)``.
    angle
        Largest turn from the direction to either side, in degrees.
    """

    position: float = 0.0
    size: float = 0.0
    angle: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "size", "angle"):
            value = getattr(self, name)
            number(f"{name} of a jitter", value, "a number from 0 upward", lambda given: given >= 0)

    def places(self, world: World, sites: Sites, spacings: Floats, movable: Flags, seed: int) -> Sites:
        """Move sites about on their surfaces; who would be hidden or barred stays."""
        if self.position == 0.0 or len(sites) == 0:
            return sites
        steps = np.random.default_rng(seed).normal(0.0, self.position, (len(sites), 3)) * spacings[:, None]
        steps -= np.einsum("ni,ni->n", steps, sites.normals)[:, None] * sites.normals
        wished = Sites((sites.positions + steps).astype(np.float32), sites.normals, sites.surface_ids)
        found, allowed = world.settle(wished)
        goes = (allowed & movable)[:, None]
        return Sites(
            np.where(goes, found.positions, sites.positions),
            np.where(goes, found.normals, sites.normals),
            sites.surface_ids,
        )

    def sizes(self, radii: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
        """Radii, some larger and some smaller than they were."""
        lots = np.random.default_rng(seed).normal(0.0, 1.0, len(radii))
        jittered: NDArray[np.float64] = radii * np.exp(self.size * np.clip(lots, -3.0, 3.0))
        return jittered

    def turns(self, tangents: Floats, normals: Floats, seed: int) -> Floats:
        """Tangents turned about the normals."""
        lots = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(tangents), 1))
        angles = np.radians(self.angle) * lots
        return unit_rows(np.cos(angles) * tangents + np.sin(angles) * np.cross(normals, tangents))
