"""The law of repulsion, its schedule, and the launches that evaluate it for all particles."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree.device import launch
from decals.model import FACING_LIMIT
from decals.scattering.repulsion_kernels import (
    EnergyLaw,
    NeighborLists,
    Rings,
    StepTerms,
    list_neighbors,
    measure_rings,
    repel,
)
from decals.scattering.search_kernels import MirrorPlanes, NeighborSearch, Particles

CUTOFF = 2.0
"""Distance beyond which particles do not repel each other, in spacings."""

SKIN = 0.4
"""Additional reach of the neighbour lists, in spacings, so that a list serves for several steps."""

MAX_NEIGHBORS = 40
"""Largest number of listed neighbours of a particle."""

CORE = 0.93
"""Distance below which the spring pushes, in spacings."""

DAMPING = 0.6
"""Share of a Newton step that is taken, since neighbours move at the same time."""

MAX_MOVE = 0.3
"""Longest move of a step, in spacings."""

SEARCH_WIDENING = 1.5
"""Factor of a particle's search radius where spacings vary: finds neighbours of up to twice its spacing."""

GRID_CELLS = (16, 128)
"""Fewest and most cells of the hash grid along each axis."""

STIFFNESS = 1000.0
"""Stiffness of the spring at the last step."""

RING_WEIGHT = 600.0
"""Weight of the ring term at the last step."""

HARDENING = (0.6, 1.0)
"""Parts of the schedule between which stiffness and ring weight rise from 0 to their final values."""


def no_mirror_planes(device: str) -> MirrorPlanes:
    """Return mirror planes of surfaces without boundary."""
    return mirror_planes(0, 0, device)


def mirror_planes(per_point: int, count: int, device: str) -> MirrorPlanes:
    """Return room for the mirror planes of so many points."""
    mirrors: Any = MirrorPlanes()
    mirrors.per_point = per_point
    mirrors.points = wp.zeros(per_point * count, dtype=wp.vec3, device=device)
    mirrors.normals = wp.zeros(per_point * count, dtype=wp.vec3, device=device)
    planes: MirrorPlanes = mirrors
    return planes


@dataclass(frozen=True)
class Law:
    """Parameters of the repulsion that change along the schedule.

    Attributes
    ----------
    stiffness
        Stiffness of the spring between particles that are too close.
    ring_weight
        Weight of the ring term, which penalises deviations of the mean distance to six neighbours.
    """

    stiffness: float
    ring_weight: float = 0.0


LOCAL_LAW = Law(STIFFNESS)
"""Law for a few particles among others at rest, without ring term, since rings are cut off there."""


def law_at(progress: float, progress_since_deformation: float) -> Law:
    """Return the law at a part of the schedule, from 0 to 1 and beyond.

    `progress_since_deformation` controls the ring term: before particles are nearly at rest it would fix
    the defects of their arrangement.
    """
    hardness, ring_share = np.interp((progress, progress_since_deformation), HARDENING, (0.0, 1.0))
    return Law(STIFFNESS * float(hardness), RING_WEIGHT * float(ring_share))


class Repulsion:
    """Newton steps of particles that repel each other, with neighbour lists that last for several steps.

    Parameters
    ----------
    count
        Number of particles.
    device
        Warp device of all arrays.
    """

    def __init__(self, count: int, *, device: str = "cpu") -> None:
        self._count, self._device = count, device
        self.lists: Any = NeighborLists()
        """Neighbours of each particle, a `NeighborLists` struct."""
        self.lists.capacity = wp.int32(MAX_NEIGHBORS)
        self.lists.counts = wp.zeros(count, dtype=wp.int32, device=device)
        self.lists.indices = wp.zeros(MAX_NEIGHBORS * count, dtype=wp.int32, device=device)
        self.lists.weights = wp.zeros(MAX_NEIGHBORS * count, dtype=wp.float32, device=device)
        self._rings: Any = Rings()
        self._rings.means = wp.zeros(count, dtype=wp.float32, device=device)
        self._rings.sixth_distances = wp.zeros(count, dtype=wp.float32, device=device)
        self._rings.total = wp.zeros(1, dtype=wp.float32, device=device)
        self._grid = make_grid(count, device)
        self.mirrors = no_mirror_planes(device)
        """Planes behind which particles have images."""

    def list_neighbors(self, particles: Particles, *, spacing: float, varied: bool) -> None:
        """List the neighbours of all particles.

        Parameters
        ----------
        particles
            The particles, on the device.
        spacing
            A typical spacing, in model units.
        varied
            True unless all spacings are the same.
        """
        self._grid.build(particles.positions, (CUTOFF + SKIN) * spacing)
        search = neighbor_search(self._grid, CUTOFF + SKIN, varied=varied)
        launch(list_neighbors, self._count, [search, particles], [self.lists], device=self._device)

    def set_mean_ring(self, particles: Particles) -> None:
        """Make the present mean of all rings the one that the ring term compares with."""
        self._measure_rings(particles)
        wp.utils.array_sum(self._rings.means, out=self._rings.total)

    def evaluate(self, particles: Particles, law: Law, out: StepTerms) -> None:
        """Write the move of each particle within its tangent plane, and its energies."""
        if law.ring_weight:
            self._measure_rings(particles)
        inputs = [particles, self.lists, self._rings, _energy_law(law), self.mirrors]
        launch(repel, self._count, inputs, [out], device=self._device)

    def _measure_rings(self, particles: Particles) -> None:
        inputs = [particles, self.lists, CUTOFF, self.mirrors]
        launch(measure_rings, self._count, inputs, [self._rings], device=self._device)


def _energy_law(law: Law) -> EnergyLaw:
    parameters: Any = EnergyLaw()
    parameters.cutoff, parameters.core = CUTOFF, CORE
    parameters.stiffness, parameters.ring_weight = law.stiffness, law.ring_weight
    parameters.damping, parameters.max_move = DAMPING, MAX_MOVE
    struct: EnergyLaw = parameters
    return struct


def make_grid(count: int, device: str) -> Any:
    """Return a hash grid for a number of points."""
    side = int(np.clip(2 * np.sqrt(max(count, 1)) / CUTOFF, *GRID_CELLS))
    return wp.HashGrid(side, side, side, device=device)


def neighbor_search(grid: Any, reach: float, *, varied: bool) -> NeighborSearch:
    """Return the rule of a search in a grid; `varied` unless all spacings are the same."""
    search: Any = NeighborSearch()
    search.grid, search.reach = grid.id, reach
    search.widening = SEARCH_WIDENING if varied else 1.0
    search.facing_limit = FACING_LIMIT
    rule: NeighborSearch = search
    return rule


def particle_struct(positions: Any, normals: Any, sizes: Any = None, sheets: Any = None) -> Any:
    """Return a `Particles` struct of arrays on a device; `sizes` may be left out where they are not read."""
    particles: Any = Particles()
    particles.positions, particles.normals = positions, normals
    if sizes is not None:
        particles.sizes = sizes
    if sheets is not None:
        particles.sheets = sheets
    return particles
