"""The repulsion of one population: who is whose neighbour, and where everybody wants to go."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree.launch import launch
from decals.model import FACING_LIMIT
from decals.seeds.particles import list_neighbours, measure_rings, repel
from decals.seeds.rims import Walls
from decals.surfaces.ground import Scalars, Vectors

CUTOFF = 2.0
"""Reach of the repulsion, in spacings."""

SKIN = 0.4
"""How much farther neighbours are listed, in spacings, so that a list serves for several steps."""

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


@dataclass(frozen=True)
class Law:
    """How particles repel each other.

    Attributes
    ----------
    exponent
        Power of their distance.
    stiffness
        Of the spring between those that are too close.
    evening
        Weight of rings that are wider or narrower than the mean one.
    """

    exponent: float
    stiffness: float
    evening: float = 0.0


class Repulsion:
    """Newton steps of particles that repel each other, with neighbour lists that last for several steps.

    Parameters
    ----------
    count
        Number of particles.
    device
        Warp device that computes; all arrays lie there.
    """

    def __init__(self, count: int, *, device: str = "cpu") -> None:
        self._count, self._device = count, device
        self.lists: tuple[Any, ...] = (
            wp.zeros(count, dtype=wp.int32, device=device),
            wp.zeros(ROOM * count, dtype=wp.int32, device=device),
            wp.zeros(ROOM * count, dtype=wp.float32, device=device),
        )
        self._rings: tuple[Any, Any] = (
            wp.zeros(count, dtype=wp.float32, device=device),
            wp.zeros(count, dtype=wp.float32, device=device),
        )
        self._total: Any = wp.zeros(1, dtype=wp.float32, device=device)
        self._grid = make_grid(count, device)
        self._sizes: Any = None
        self._walls = Walls.none(device)

    def relist(
        self,
        positions: Vectors,
        normals: Vectors,
        sizes: Scalars,
        *,
        spacing: float,
        varied: bool,
        walls: Walls | None = None,
    ) -> None:
        """List the neighbours of all particles.

        `sizes` are the spacings around each, `spacing` a typical one; `varied` unless all are the same.
        Beyond walls lie images of particles.
        """
        self._walls = walls or Walls.none(self._device)
        reach = CUTOFF + SKIN
        widening = WIDENING if varied else 1.0
        self._sizes = sizes
        self._grid.build(positions, reach * spacing)
        inputs = [self._grid.id, positions, normals, sizes, reach, widening, FACING_LIMIT, ROOM]
        launch(list_neighbours, self._count, inputs, self.lists, device=self._device)

    def level(self, positions: Vectors) -> None:
        """Let the mean ring, as it is now, be the one that all particles should have."""
        self._measure(positions)
        wp.utils.array_sum(self._rings[0], out=self._total)

    def evaluate(
        self,
        positions: Vectors,
        normals: Vectors,
        law: Law,
        *,
        moves: Vectors,
        energies: Scalars,
        works: Scalars,
    ) -> None:
        """Write where each particle wants to go within its tangent plane, and its energy where it is."""
        if law.evening:
            self._measure(positions)
        inputs = [positions, normals, self._sizes, ROOM, *self.lists, CUTOFF, law.exponent, CORE]
        inputs += [law.stiffness, law.evening, *self._rings, self._total, DAMPING, LONGEST, *self._walls]
        launch(repel, self._count, inputs, [moves, energies, works], device=self._device)

    def _measure(self, positions: Vectors) -> None:
        inputs = [positions, self._sizes, ROOM, *self.lists, CUTOFF, *self._walls]
        launch(measure_rings, self._count, inputs, self._rings, device=self._device)


def make_grid(count: int, device: str) -> Any:
    """Make a hash grid for so many points."""
    side = int(np.clip(2 * np.sqrt(max(count, 1)) / CUTOFF, *GRID_CELLS))
    return wp.HashGrid(side, side, side, device=device)
