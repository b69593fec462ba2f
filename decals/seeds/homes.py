"""Particles stay at home: at the density at which they began."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from decals.seeds.crowd import Crowd
from decals.seeds.population import Sites, crosses_edge
from decals.surfaces.surface import Floats


class Homes:
    """The spacing at which each particle began, and where it was last seen there.

    The start is drawn from the density in proportion. Afterwards nothing holds the counts at an edge of it:
    pressures are the same on both sides, and the gap between the last two rows belongs to neither, so that
    the coarse side gains about half a row. Hence who comes to an other density than its own goes back.

    Parameters
    ----------
    sizes_at
        Spacing wished for at each position, ``points[n, 3]`` to ``[n]``.
    """

    def __init__(self, sizes_at: Callable[[Floats], Floats]) -> None:
        self._sizes_at = sizes_at
        self._sizes: Floats | None = None
        self._last: Sites | None = None

    def call(self, crowd: Crowd) -> None:
        """Put those who left back to where they were at the last call, and take the spacings anew."""
        sizes = self._sizes_at(crowd.positions.numpy())
        if self._sizes is None or self._last is None:
            self._sizes = sizes
        else:
            gone = np.flatnonzero(crosses_edge(self._sizes, sizes))
            crowd.place(gone, self._last.positions[gone], self._last.normals[gone])
            sizes[gone] = self._sizes_at(self._last.positions[gone])
        crowd.resize(sizes)
        self._last = crowd.sites()

    def change(self, crowd: Crowd, rows: NDArray[np.int64]) -> None:
        """Some particles have been given other homes."""
        if self._sizes is not None:
            self._last = crowd.sites()
            self._sizes[rows] = self._sizes_at(self._last.positions[rows])
