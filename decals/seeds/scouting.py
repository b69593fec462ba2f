"""Random places that look for gaps between particles."""

from collections.abc import Callable

import numpy as np

from decals.seeds.population import Sites, World, shares
from decals.surfaces.surface import Floats

PER_MOVER, PER_PARTICLE = 200, 4
"""Scouts that look for gaps: so many for each particle that must move, at most so many for each."""

_STREAM = 1000


class Scouts:
    """Places all over the surfaces, drawn once; each look takes the next of them."""

    def __init__(self, world: World, sizes_at: Callable[[Floats], Floats]) -> None:
        self._world, self._sizes_at = world, sizes_at
        self._sites: Sites | None = None
        self._sizes: Floats | None = None
        self._next = 0

    def some(self, movers: int, count: int) -> tuple[Sites, Floats]:
        """Places enough for so many of the `count` particles that must move, and the spacings there."""
        sites, sizes = self._drawn(PER_PARTICLE * count)
        taken = min(len(sites), PER_MOVER * movers + 1000)
        rows = (self._next + np.arange(taken)) % len(sites)
        self._next = (self._next + taken) % len(sites)
        return sites[rows], sizes[rows]

    def _drawn(self, most: int) -> tuple[Sites, Floats]:
        if self._sites is None or self._sizes is None:
            sites = self._world.sample(shares(self._world.masses, most), stream=_STREAM)
            self._sites = sites[np.random.default_rng(_STREAM).permutation(most)]
            self._sizes = self._sizes_at(self._sites.positions)
        return self._sites, self._sizes
