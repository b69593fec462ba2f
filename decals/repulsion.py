"""The repulsion of one population: who is whose neighbour, and where everybody wants to go."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from decals.model import FACING_LIMIT
from decals.particles import list_neighbours, repel
from decals.surface import Floats

CUTOFF = 2.0
"""Reach of the repulsion, in spacings."""

SKIN = 0.4
"""How much farther neighbours are listed, in spacings, so that a list serves for several steps."""

OLDEST = 12
"""Steps after which neighbours are listed anew in any case."""

DRIFTERS = 0.02
"""Part of the particles, the fastest, for whose sake alone no new list is made."""

ROOM = 40
"""Most neighbours of a particle."""

CORE = 0.93
"""Distance below which the spring pushes, in spacings."""

DAMPING = 0.6
"""Share of a Newton step taken, since neighbours move at the same time."""

LONGEST = 0.3
"""Longest move of a step, in spacings."""

WIDENING = 1.5
"""How far beyond its own reach a particle looks where spacings vary: up to neighbours of twice its size."""

GRID_CELLS = (16, 128)
"""Fewest and most cells of the hash grid along each axis."""


class Repulsion:
    """Newton steps of particles that repel each other, with neighbour lists that last for several steps.

    Parameters
    ----------
    count
        Number of particles.
    device
        Warp device that computes.
    """

    def __init__(self, count: int, *, device: str = "cpu") -> None:
        self._count, self._device = count, device
        side = int(np.clip(2 * np.sqrt(max(count, 1)) / CUTOFF, *GRID_CELLS))
        self._lists: tuple[Any, ...] = (
            wp.zeros(count, dtype=wp.int32, device=device),
            wp.zeros(ROOM * count, dtype=wp.int32, device=device),
            wp.zeros(ROOM * count, dtype=wp.float32, device=device),
        )
        self._grid: Any = wp.HashGrid(side, side, side, device=device)
        self._sizes: Any = None
        self._moves: Any = wp.zeros(count, dtype=wp.vec3, device=device)
        self._energies: Any = wp.zeros(count, dtype=wp.float32, device=device)
        self._drift, self._age = 0.0, 0

    @property
    def stale(self) -> bool:
        """Whether neighbours must be listed anew before the next step."""
        return self._sizes is None or self._age >= OLDEST or self._drift >= 0.5 * SKIN

    @property
    def energies(self) -> Floats:
        """Energy of each particle before the last step, ``float32[n]``."""
        energies: Floats = self._energies.numpy().copy()
        return energies

    def forget(self) -> None:
        """Neighbours have changed: list them anew before the next step."""
        self._sizes = None

    def relist(self, positions: Floats, normals: Floats, sizes: Floats) -> None:
        """List the neighbours of all particles, whose spacings are `sizes`, ``float32[n]``."""
        reach = CUTOFF + SKIN
        widening = 1.0 if sizes.min() == sizes.max() else WIDENING
        points, directions = self._vectors(positions), self._vectors(normals)
        self._sizes = wp.array(sizes, dtype=wp.float32, device=self._device)
        self._grid.build(points, reach * float(np.median(sizes)))
        inputs = [self._grid.id, points, directions, self._sizes, reach, widening, FACING_LIMIT, ROOM]
        launch(list_neighbours, self._count, inputs, self._lists, device=self._device)
        self._drift, self._age = 0.0, 0

    def moves(
        self, positions: Floats, normals: Floats, sizes: Floats, *, exponent: float, stiffness: float
    ) -> Floats:
        """Where each particle wants to go from where it is, ``float32[n, 3]``, within its tangent plane."""
        inputs = [self._vectors(positions), self._vectors(normals), self._sizes, ROOM, *self._lists]
        inputs += [CUTOFF, exponent, CORE, stiffness, DAMPING, LONGEST]
        launch(repel, self._count, inputs, [self._moves, self._energies], device=self._device)
        moves: Floats = self._moves.numpy().copy()
        self._age += 1
        self._drift += _speed(moves, sizes)
        return moves

    def _vectors(self, rows: Floats) -> Any:
        return wp.array(rows, dtype=wp.vec3, device=self._device, copy=False)


def _speed(moves: Floats, sizes: Floats) -> float:
    """Length of the longest move but for the few fastest, in spacings."""
    lengths: NDArray[np.float32] = np.sqrt(np.einsum("ni,ni->n", moves, moves)) / sizes
    rank = int((1.0 - DRIFTERS) * (len(lengths) - 1))
    return float(np.partition(lengths, rank)[rank])
