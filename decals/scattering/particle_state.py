"""The state of the particles on one Warp device, and the step that moves them."""

from typing import Any, NamedTuple

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Int64Array
from blobtree.device import launch
from blobtree.kernels import loaded
from decals.model import FACING_LIMIT
from decals.scattering.domain import LEAST_SHEET, Domain, OrientedPoints
from decals.scattering.projection import spans_of
from decals.scattering.repulsion import CUTOFF, SKIN, Law, Repulsion, no_mirror_planes, particle_struct
from decals.scattering.repulsion_kernels import StepTerms
from decals.scattering.search_kernels import MirrorPlanes, Particles
from decals.scattering.step_kernels import (
    accept_or_backtrack,
    compare_energy,
    project_or_reject,
    propose_moves,
    scatter_rows,
)
from decals.surfaces.surface import Scalars, Vectors, vectors

MAX_AGE = 12
"""Steps after which an epoch ends in any case: the law changes along the schedule."""

MAX_EPOCHS_OF_LISTS = 4
"""Epochs after which neighbours are listed anew in any case, as a few particles may have moved far."""

MAX_DRIFT = 0.5 * SKIN
"""Sum of the lengths of typical moves, in spacings, after which neighbours are listed anew."""

IGNORED_FASTEST = 0.02
"""Share of the particles, the fastest, whose moves do not count."""

MAX_AGE_ON_GPU = 4
"""Steps after which an epoch ends on a GPU, once particles are calm: to list neighbours costs less there than
to measure how far they moved."""

STEPS_UNTIL_CALM = 40
"""Steps during which the age of lists on a GPU grows to its maximum."""


class _State(NamedTuple):
    """Particles, their next moves, and their energies."""

    particles: Particles
    terms: StepTerms


class ParticleState:
    """Particles that repel each other, on one device.

    An epoch lasts as long as the spacings and the law of repulsion stay the same. Lists of neighbours last
    for some epochs. Within one the total energy never rises: a step that would raise it is rejected, and the
    particles whose energy rose halve their next step (backtracking, particle by particle).

    Parameters
    ----------
    domain
        The surfaces, with density and mask.
    points
        The particles, sorted by surface.
    movable
        True for particles that may move, ``bool[n]``.
    sizes
        Spacing around each particle, ``float32[n]``.
    """

    def __init__(
        self, domain: Domain, points: OrientedPoints, movable: BoolArray, sizes: Float32Array
    ) -> None:
        self.domain, self.device = domain, domain.device
        self.count = len(points)
        self.surface_ids = points.surface_ids
        self.movable = movable
        self.spans = spans_of(points.surface_ids)
        self.epoch = 0
        self._current, self._proposed = self._new_state(points), self._new_state(points)
        self.device_movable: Any = wp.array(movable.astype(np.int32), dtype=wp.int32, device=self.device)
        self.device_surface_ids: Any = wp.array(points.surface_ids, dtype=wp.int32, device=self.device)
        self._projected = particle_struct(self._empty(wp.vec3), self._empty(wp.vec3))
        self._targets = self._empty(wp.vec3)
        self._lengths, self._reaches = self._empty(wp.float32), self._empty(wp.float32)
        self._forbidden = self._empty(wp.int32)
        self._step_scales: Any = wp.full(self.count, 1.0, dtype=wp.float32, device=self.device)
        self._proposed_energy, self._accepted_energy = self._single(wp.float64), self._single(wp.float64)
        self._rejected = self._single(wp.int32)
        self._repulsion = Repulsion(self.count, device=self.device)
        self._law = Law(0.0)
        self._steps = self._age = 0
        self._drift, self._epochs_of_lists = 0.0, 0
        self._listed = False
        self.resize(sizes)

    @property
    def particles(self) -> Particles:
        """Positions, normals and spacings, as arrays of the device."""
        return self._current.particles

    @property
    def positions(self) -> Vectors:
        """Positions of the particles, an array of the device."""
        return self._current.particles.positions

    @property
    def normals(self) -> Vectors:
        """Normals of the surfaces at the particles, an array of the device."""
        return self._current.particles.normals

    @property
    def energies(self) -> Float32Array:
        """Energy of each particle, a measure of crowding, ``float32[n]``."""
        energies: Float32Array = self._current.terms.energies.numpy().copy()
        return energies

    @property
    def energy(self) -> float:
        """Energy of all pairs together, by the law and the lists of this epoch; 0 after other moves."""
        return float(self._accepted_energy.numpy()[0]) if self._listed else 0.0

    @property
    def epoch_over(self) -> bool:
        """True if a new epoch must begin before the next step."""
        if not self._listed:
            return True
        if not wp.get_device(self.device).is_cpu:
            max_age = 1 + self._steps * MAX_AGE_ON_GPU // STEPS_UNTIL_CALM
            return self._age >= min(MAX_AGE_ON_GPU, max_age)
        return self._age >= MAX_AGE or self._drift >= MAX_DRIFT

    def points(self) -> OrientedPoints:
        """Copy the particles to the host."""
        return OrientedPoints(self.positions.numpy().copy(), self.normals.numpy().copy(), self.surface_ids)

    def resize(self, sizes: Float32Array) -> None:
        """Set the spacing around each particle; a new epoch begins."""
        self.sizes: Any = wp.array(sizes, dtype=wp.float32, device=self.device)
        self.host_sizes = sizes
        self.spacing = float(np.median(sizes)) if len(sizes) else 1.0
        self.varied = bool(len(sizes) and sizes.min() != sizes.max())
        for state in (self._current, self._proposed):
            state.particles.sizes = self.sizes
        self.end_epoch()

    def end_epoch(self) -> None:
        """Let a new epoch begin before the next step, after positions were changed from outside."""
        self._listed = False

    def number_sheets(self) -> None:
        """Set the sheets of the particles, after they moved."""
        if self.domain.sheeted:
            sheets = self.sheets_of(self.points())
            self._current.particles.sheets = self._proposed.particles.sheets = sheets

    def sheets_of(self, points: OrientedPoints) -> Any:
        """Return the numbers of the sheets of points, an array of the device; None for a single sheet."""
        sheets = self.domain.sheets(points, LEAST_SHEET * self.spacing**2)
        if sheets is None:
            return None
        return wp.array(sheets.astype(np.int32), dtype=wp.int32, device=self.device)

    def move_to(self, rows: Int64Array, positions: Float32Array, normals: Float32Array) -> None:
        """Move some particles elsewhere on their surfaces; a new epoch begins if there are any."""
        if len(rows) == 0:
            return
        indices: Any = wp.array(rows.astype(np.int32), dtype=wp.int32, device=self.device)
        inputs = [indices, vectors(positions, self.device), vectors(normals, self.device)]
        launch(scatter_rows, len(rows), inputs, [self.particles], device=self.device)
        self.end_epoch()

    def hold(self, rows: Int64Array) -> None:
        """Let some particles no longer move."""
        self.movable = self.movable.copy()
        self.movable[rows] = False
        self.device_movable = wp.array(self.movable.astype(np.int32), dtype=wp.int32, device=self.device)

    def mirror_planes(self, points: Particles, surface_ids: Scalars, enabled: Scalars) -> MirrorPlanes:
        """Return the mirror planes of points on the surfaces of the given ids, where enabled (1).

        Particles that may not move need none: they may lie on the boundary itself.
        """
        boundary = self.domain.boundary(self.spacing)
        if boundary is None:
            return no_mirror_planes(self.device)
        return boundary.mirror_planes(points, surface_ids, enabled, reach=CUTOFF)

    def begin_epoch(self, law: Law) -> None:
        """Begin an epoch: list neighbours if they moved far, set the law, and evaluate the energy."""
        drifted = self._drift >= MAX_DRIFT or self._epochs_of_lists >= MAX_EPOCHS_OF_LISTS
        if not self._listed or drifted or not wp.get_device(self.device).is_cpu:
            self.number_sheets()
            self._repulsion.list_neighbors(self.particles, spacing=self.spacing, varied=self.varied)
            self._drift, self._epochs_of_lists = 0.0, 0
        self._epochs_of_lists += 1
        self._repulsion.mirrors = self.mirror_planes(
            self.particles, self.device_surface_ids, self.device_movable
        )
        self._law, self._listed, self._age = law, True, 0
        self.epoch += 1
        if law.ring_weight:
            self._repulsion.set_mean_ring(self.particles)
        self._evaluate(self._current, self._accepted_energy)

    def step(self) -> None:
        """Take one step within the epoch: propose moves, project them, then accept or reject the step."""
        self._propose()
        self._evaluate(self._proposed, self._proposed_energy)
        self._accept_step()
        self._steps += 1
        self._age += 1
        if wp.get_device(self.device).is_cpu:
            self._drift += _typical_length((self._lengths.numpy() / self.host_sizes)[self.movable])

    def _propose(self) -> None:
        """Write the next positions, on the surfaces, to the proposed state."""
        particles, moves = self._current.particles, self._current.terms.moves
        inputs = [particles, moves, self._step_scales, self.device_movable]
        outputs = [self._targets, self._lengths, self._reaches]
        launch(propose_moves, self.count, inputs, outputs, device=self.device)
        projected = self._projected
        self.domain.projection.project(
            self._targets, self._reaches, self.spans, projected.positions, projected.normals, self._forbidden
        )
        inputs = [FACING_LIMIT, particles, self._lengths, projected, self._forbidden]
        launch(project_or_reject, self.count, inputs, [self._proposed.particles], device=self.device)

    def _accept_step(self) -> None:
        """Make the proposed state the current one, unless the total energy rose."""
        energies = [self._proposed_energy, self._accepted_energy]
        kernel = loaded(compare_energy, self.device)
        wp.launch(kernel, dim=1, inputs=[*energies, self._rejected], device=self.device)
        inputs = [self._rejected, *self._proposed]
        outputs = [*self._current, self._step_scales]
        launch(accept_or_backtrack, self.count, inputs, outputs, device=self.device)

    def _evaluate(self, state: _State, total_energy: Any) -> None:
        self._repulsion.evaluate(state.particles, self._law, state.terms)
        wp.utils.array_sum(state.terms.pair_energies, out=total_energy)

    def _new_state(self, points: OrientedPoints) -> _State:
        terms: Any = StepTerms()
        terms.moves = self._empty(wp.vec3)
        terms.energies = self._empty(wp.float32)
        terms.pair_energies = self._empty(wp.float64)
        positions: Any = wp.array(points.positions, dtype=wp.vec3, device=self.device)
        normals: Any = wp.array(points.normals, dtype=wp.vec3, device=self.device)
        return _State(particle_struct(positions, normals), terms)

    def _empty(self, dtype: Any) -> Any:
        return wp.zeros(self.count, dtype=dtype, device=self.device)

    def _single(self, dtype: Any) -> Any:
        return wp.zeros(1, dtype=dtype, device=self.device)


def _typical_length(lengths: Float32Array) -> float:
    """Return the length of the longest move, the few fastest particles aside."""
    if not len(lengths):
        return 0.0
    rank = int((1.0 - IGNORED_FASTEST) * (len(lengths) - 1))
    return float(np.partition(lengths, rank)[rank])
