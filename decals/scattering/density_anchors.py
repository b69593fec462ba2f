"""Particles that drift across a step of the density return."""

from collections.abc import Callable

import numpy as np

from blobtree._typing import Float32Array, Int64Array
from decals.scattering.domain import OrientedPoints, crosses_density_step
from decals.scattering.particle_state import ParticleState


class DensityAnchors:
    """Spacing at which each particle began, and the last position where it had about that spacing.

    The initial sample follows the density. Afterwards no force keeps the counts at a step of the density:
    pressures are equal on both sides, and the gap between the last two rows belongs to neither, so the coarse
    side gains about half a row. Hence particles that drift across a step of the density return.

    Parameters
    ----------
    sizes_at
        Spacing at positions, a function of ``points[n, 3]`` to ``[n]``.
    """

    def __init__(self, sizes_at: Callable[[Float32Array], Float32Array]) -> None:
        self._sizes_at = sizes_at
        self._sizes: Float32Array | None = None
        self._points: OrientedPoints | None = None

    def restore(self, state: ParticleState) -> None:
        """Return drifted particles to their last anchors, and update the spacings of all particles."""
        sizes = self._sizes_at(state.positions.numpy())
        if self._sizes is None or self._points is None:
            self._sizes = sizes
        else:
            drifted = np.flatnonzero(crosses_density_step(self._sizes, sizes))
            state.move_to(drifted, self._points.positions[drifted], self._points.normals[drifted])
            sizes[drifted] = self._sizes_at(self._points.positions[drifted])
        state.resize(sizes)
        self._points = state.points()

    def set(self, state: ParticleState, rows: Int64Array) -> None:
        """Anchor some particles where they are now."""
        if self._sizes is not None:
            self._points = state.points()
            self._sizes[rows] = self._sizes_at(self._points.positions[rows])
