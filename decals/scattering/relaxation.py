"""The solver: particles repel each other on surfaces until they lie evenly."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Int32Array, Int64Array
from blobtree.progress import Progress, reporting
from blobtree.validation import point_array, truth
from decals.errors import InvalidScattering
from decals.model import Decals
from decals.scattering.appearance import Appearance, ImageChoice, PlacedZones
from decals.scattering.domain import (
    Density,
    Domain,
    Mask,
    OrientedPoints,
    apportion,
    crosses_density_step,
    particle_count,
    remaining_counts,
)
from decals.scattering.extras import CARRIERS, FILLINGS, PLACEMENTS, RELOCATIONS, SEPARATIONS
from decals.scattering.jitter import Jitter
from decals.scattering.local_relaxation import relax_near
from decals.scattering.neighbors import (
    CLOSE_DISTANCE,
    NeighborQuery,
    Spacing,
    ideal_spacing,
    spacing_of_points,
)
from decals.scattering.orientation import Direction
from decals.scattering.particle_state import ParticleState
from decals.scattering.repulsion import CUTOFF, law_at
from decals.scattering.sizing import Sizing
from decals.surfaces.surface import Surface
from decals.validation import allowed_number, count_number, function_or_none, real_array, whole_number

RELOCATION_SCHEDULE = (0.1, 0.8, 0.05)
"""First and last part of the schedule at which crowded particles are relocated, and the interval."""

PLACEMENT_SCHEDULE = (0.5, 0.7, 1.0)
"""Parts of the schedule at which particles move to places that repulsion leaves bare.

Some particles leave such places between two of these times; hardly any do after the last one.
"""

STEPS_TO_REST = 40
"""Least number of steps before such a move: particles come nearly to rest in them."""

MIN_RELOCATION_INTERVAL = 6
"""Least number of steps between two relocations, in which relocated particles come to rest."""

MAX_ITERATIONS = 1_000_000_000

RELOCATION_STEPS_AFTER_DEFORMATION = 60
"""Steps after a deformation within which crowded particles are relocated as well."""

POLISHING_ROUNDS = 150
"""Default number of rounds of `Relaxation.polish`."""

CHECK_INTERVAL = 2
"""Steps between two tests whether the particles lie evenly enough."""


class _DensityAnchors:
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


class Relaxation:
    """Particles on any set of surfaces, relaxed step by step.

    The particles minimise an energy after Witkin and Heckbert (1994): they repel each other within their
    tangent planes and are projected back onto their own surfaces. Particles of different surfaces repel each
    other too; those on two sides of a wall do not, as their normals differ. Particles never lie or move
    inside another, closed surface. Each surface keeps its share of the count, by visible area and density. At
    intervals crowded particles are relocated to gaps, some move to places that no particle faces, such as the
    inner side of a rim, and after the last step `polish` parts close pairs.

    Parameters
    ----------
    surfaces : Surface or sequence of Surface
        The surfaces of the particles.
    count : int, optional
        Exact number of particles, the fixed ones included. Give either `count` or `spacing`.
    spacing : float, optional
        Distance of neighbours, in model units; the count follows from it.
    seed : int, default: 0
        Seed of all random choices, from 0 upward. The same seed gives the same bytes on the same kind of
        machine.
    iterations : int, default: 150
        Steps of the whole schedule, at most 1,000,000,000. Further steps continue with the last law of
        repulsion.
    density : callable, optional
        Relative density of particles: a function of ``points[n, 3]`` to numbers above zero, ``[n]``. It
        should change by less than a factor of four between neighbours.
    mask : callable, optional
        Where particles may lie: a function of ``points[n, 3]`` to ``bool[n]``.
    fixed : array_like, optional
        Particles that never move, ``float[k, 3]``. Each is projected onto the surface closest to it.
    device : str, default: "cpu"
        Warp device of all computations, such as ``"cuda:0"``.

    Raises
    ------
    InvalidScattering
        For a negative count or seed, no iterations, a spacing that is not above zero, more fixed particles
        than the count, invalid values of the density or mask, or a count without visible area.

    See Also
    --------
    decals.scatter : Relax particles and return decals, in one call.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> ball = decals.surfaces.ImplicitSurface(Point((0, 0, 0), radius=1.0))
    >>> relaxation = decals.Relaxation(ball, count=60, seed=1)
    >>> relaxation.run()
    >>> relaxation
    Relaxation(60 particles, step 150 of 150)
    >>> relaxation.statistics().rho > 0.8
    True
    >>> len(relaxation.to_decals())
    60
    """

    def __init__(
        self,
        surfaces: Surface | Sequence[Surface],
        *,
        count: int | None = None,
        spacing: float | None = None,
        seed: int = 0,
        iterations: int = 150,
        density: Density | None = None,
        mask: Mask | None = None,
        fixed: ArrayLike | None = None,
        device: str = "cpu",
    ) -> None:
        self.iterations = count_number("iterations", iterations, 1, MAX_ITERATIONS, InvalidScattering)
        self.steps = self._deformed_at = 0
        self._seed = whole_number("seed", seed, 0, None, InvalidScattering)
        self.domain = Domain(surfaces, seed, density=density, mask=mask, device=device)
        count = particle_count(count, spacing, self.domain.mass)
        self.spacing = ideal_spacing(self.domain.mass, count)
        fixed_points = self.domain.project_fixed(fixed)
        if len(fixed_points) > count:
            raise InvalidScattering(
                f"fixed: expected at most the count of {count}, got {len(fixed_points)}; raise the count"
            )
        counts = remaining_counts(apportion(self.domain.masses, count), fixed_points)
        sampled = self.domain.sample(counts, stream=1) if count else OrientedPoints.empty()
        joined = OrientedPoints.joined([fixed_points, sampled])
        order = np.argsort(joined.surface_ids, kind="stable")
        self._fixed: BoolArray = (np.arange(count) < len(fixed_points))[order]
        first, last, interval = (int(part * self.iterations) for part in RELOCATION_SCHEDULE)
        self._relocation_steps = set(range(max(first, 1), last + 1, max(interval, MIN_RELOCATION_INTERVAL)))
        self._relocations = [make(self.domain, self.sizes_at) for make in RELOCATIONS]
        placements = (int(part * self.iterations) for part in PLACEMENT_SCHEDULE)
        self._placement_steps = {step for step in placements if step >= STEPS_TO_REST}
        self._anchors = _DensityAnchors(self.sizes_at)
        self._points: OrientedPoints | None = joined[order]
        self._state: ParticleState | None = None

    def __repr__(self) -> str:
        return f"Relaxation({self.count} particles, step {self.steps} of {self.iterations})"

    # -- the particles ------------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self._fixed)

    @property
    def points(self) -> OrientedPoints:
        """Positions, normals and surfaces of the particles."""
        if self._points is None:
            self._points = self._device_state().points()
        return self._points

    @property
    def positions(self) -> Float32Array:
        """Positions of the particles, ``float32[n, 3]``."""
        return self.points.positions

    @property
    def normals(self) -> Float32Array:
        """Unit normals of the surfaces at the particles, ``float32[n, 3]``."""
        return self.points.normals

    @property
    def surface_ids(self) -> Int32Array:
        """Index of the surface of each particle, ``int32[n]``, ascending."""
        return self.points.surface_ids

    @property
    def fixed(self) -> BoolArray:
        """True for particles that never move, ``bool[n]``."""
        return self._fixed.copy()

    @property
    def energies(self) -> Float32Array:
        """Energy of each particle, a measure of crowding, ``float32[n]``; 0 before the first step."""
        return np.zeros(self.count, np.float32) if self._state is None else self._state.energies

    @property
    def energy(self) -> float:
        """Energy of all pairs together, in square spacings; it never rises within an `epoch`.

        0 where it is not known: before the first step, and after particles were polished or moved.
        """
        return 0.0 if self._state is None else self._state.energy / self.spacing**2

    @property
    def epoch(self) -> int:
        """Number of times that spacings and the law of repulsion were updated."""
        return 0 if self._state is None else self._state.epoch

    @property
    def finished(self) -> bool:
        """True if all steps of the schedule were taken."""
        return self.steps >= self.iterations

    def sizes_at(self, positions: Float32Array) -> Float32Array:
        """Return the spacing that the density asks for at positions, ``float32[n]``."""
        densities = self.domain.density(point_array(positions, "positions"))
        sizes: Float32Array = (self.spacing / np.sqrt(densities)).astype(np.float32)
        return sizes

    def statistics(self) -> Spacing:
        """Measure how evenly the particles lie."""
        return spacing_of_points(self.positions, self.normals, self.sizes_at(self.positions), self.spacing)

    # -- the schedule -------------------------------------------------------------------------------------

    def run(
        self,
        progress: Progress | None = None,
        *,
        until: float | None = None,
        cancel: Callable[[], bool] | None = None,
    ) -> None:
        """Take the remaining steps of the schedule.

        Parameters
        ----------
        progress : callable, optional
            Called with the name of the stage and the fraction done.
        until : float, optional
            The rho at which to stop: it is measured at every other step, and polishing stops there too.
        cancel : callable, optional
            Called before every step; return True to stop. The particles stay as they are then.

        Raises
        ------
        InvalidScattering
            If `until` is no number, or `progress` or `cancel` cannot be called.
        """
        if until is not None:
            until = allowed_number(
                "until",
                until,
                "the rho that is enough, a number above 0",
                lambda rho: rho > 0,
                InvalidScattering,
            )
        function_or_none("progress", progress, InvalidScattering)
        function_or_none("cancel", cancel, InvalidScattering)
        with reporting(progress) as report:
            while not self.finished and not (cancel is not None and cancel()):
                self._advance()
                if self.finished:
                    self.polish(close=CLOSE_DISTANCE if until is None else min(CLOSE_DISTANCE, until))
                report("spreading particles", self.steps / self.iterations)
                if until is not None and self.steps % CHECK_INTERVAL == 0 and self._least_distance() >= until:
                    break

    def step(self) -> None:
        """Take one step: move every particle, relocate crowded ones at intervals, polish after the last."""
        self._advance()
        if self.steps == self.iterations:
            self.polish()

    def polish(self, rounds: int = POLISHING_ROUNDS, *, close: float = CLOSE_DISTANCE) -> None:
        """Part the pairs that are closer than `close` spacings by trial, in at most so many rounds."""
        rounds = count_number("rounds", rounds, 0, None, InvalidScattering)
        allowed_number(
            "close",
            close,
            "a number of spacings from 0 to 100",
            lambda value: 0 <= value <= 100,
            InvalidScattering,
        )
        if self.count > 1:
            state = self._device_state()
            self._restore_density(state)
            for separate in SEPARATIONS:
                separate(state, rounds=rounds, seed=self._seed, close=close, sizes_at=self.sizes_at)
            for fill in FILLINGS if rounds else ():
                fill(state, CLOSE_DISTANCE)
            self._anchors.set(state, np.arange(self.count))
            self._points = None

    def _advance(self) -> None:
        self.steps += 1
        if self.count < 2:
            return
        if self.steps in self._relocation_steps:
            self._relocate()
        if self.steps in self._placement_steps:
            self._place()
        self._repel()

    def _relocate(self) -> None:
        """Move crowded particles to gaps."""
        if self.steps == 1:
            return
        state = self._device_state()
        for relocate in self._relocations:
            moved = relocate(state, self._restore_density)
            if len(moved):
                self._anchors.set(state, moved)

    def _place(self) -> None:
        """Move crowded particles to places that repulsion leaves bare."""
        state = self._device_state()
        for place in PLACEMENTS:
            moved = place(state)
            if len(moved):
                self._anchors.set(state, moved)

    def _repel(self) -> None:
        """Move every particle against its neighbours, in a new epoch if the last epoch is over."""
        state = self._device_state()
        if state.epoch_over:
            self._restore_density(state)
            progress, since_deformation = (
                (self.steps - start) / self.iterations for start in (0, self._deformed_at)
            )
            state.begin_epoch(law_at(progress, since_deformation))
        state.step()
        self._points = None

    def _restore_density(self, state: ParticleState) -> None:
        """Where density varies, return drifted particles and update all spacings."""
        if not self.domain.uniform:
            self._anchors.restore(state)

    def _least_distance(self) -> float:
        """Return the least distance between particles, in spacings."""
        if self.count < 2:
            return np.inf
        query = NeighborQuery(self._device_state(), CUTOFF)
        return float(query.nearest_of(np.arange(self.count)).min())

    def _device_state(self) -> ParticleState:
        if self._state is None:
            points = self.points
            self._state = ParticleState(self.domain, points, ~self._fixed, self.sizes_at(points.positions))
        return self._state

    # -- edits --------------------------------------------------------------------------------------------

    def insert(self, point: ArrayLike, *, fixed: bool = False) -> int:
        """Insert a particle near a point and relax its neighbourhood.

        The spacing and all particles farther away stay as they are.

        Parameters
        ----------
        point : array_like
            Three coordinates; the particle lies on the surface closest to them.
        fixed : bool, default: False
            True for a particle that never moves.

        Returns
        -------
        int
            Index of the new particle.

        Raises
        ------
        InvalidScattering
            If the closest point of the surfaces is hidden or masked, or an argument is of another type.
        """
        coordinates = real_array("point", point, InvalidScattering)
        if coordinates.shape != (3,):
            raise InvalidScattering(f"point: expected three numbers, got shape {list(coordinates.shape)}")
        held = truth("fixed", fixed, InvalidScattering)
        inserted = self.domain.project_fixed(coordinates[None])
        if not self.domain.project(inserted)[1].all():
            raise InvalidScattering(f"expected a point that is neither hidden nor masked, got {point!r:.60}")
        row = int(np.searchsorted(self.surface_ids, inserted.surface_ids[0], side="right"))
        points = OrientedPoints.joined([self.points[:row], inserted, self.points[row:]])
        self._fixed = np.insert(self._fixed, row, held)
        self._relax_near(points, inserted.positions[0])
        return row

    def remove(self, number: int) -> None:
        """Remove a particle and relax its neighbourhood.

        Parameters
        ----------
        number : int
            Index of the particle.

        Raises
        ------
        InvalidScattering
            If `number` is not the index of a particle.
        """
        if whole_number("number", number, 0, None, InvalidScattering) >= self.count:
            raise InvalidScattering(
                f"number: expected a particle among the {self.count} there are, counted from 0, got {number}"
            )
        center = self.positions[number]
        points = OrientedPoints.joined([self.points[:number], self.points[number + 1 :]])
        self._fixed = np.delete(self._fixed, number)
        self._relax_near(points, center)

    def deform(self, surfaces: Surface | Sequence[Surface]) -> None:
        """Replace the surfaces, one for one, and carry the particles along.

        On a mesh with the same faces each particle stays at the same point of its face. On other surfaces it
        moves to the closest point, on a tree along the field. If the particles would collapse to a heap, they
        first move with the box around the surface. Particles that become hidden or masked start again at
        random points. Counts of all surfaces stay the same, and the spacing follows the area. A few calls of
        `step` make the particles even again.

        Parameters
        ----------
        surfaces : Surface or sequence of Surface
            As many surfaces as before.

        Raises
        ------
        InvalidScattering
            For another number of surfaces, particles without visible area, or a deformation that particles
            cannot follow. Nothing has changed then.
        """
        domain = self.domain.deformed(surfaces)
        points = self.points
        for carry in CARRIERS:
            points = carry(self.domain, domain, points, self.spacing, self._fixed, stream=self.steps)
        self.domain = domain
        self.spacing = ideal_spacing(domain.mass, self.count)
        self._relocations = [make(domain, self.sizes_at) for make in RELOCATIONS]
        self._deformed_at = self.steps
        intervals = range(
            MIN_RELOCATION_INTERVAL, RELOCATION_STEPS_AFTER_DEFORMATION + 1, MIN_RELOCATION_INTERVAL
        )
        self._relocation_steps |= {self.steps + interval for interval in intervals}
        self._restart(points)

    def _relax_near(self, points: OrientedPoints, center: Float32Array) -> None:
        """Replace the particles, and relax those around a point."""
        if len(points) > 1:
            sizes = self.sizes_at(points.positions)
            points = relax_near(self.domain, points, ~self._fixed, sizes, center)
        self._restart(points)

    def _restart(self, points: OrientedPoints) -> None:
        """Replace the particles, and forget their state on the device."""
        self._points, self._state = points, None
        self._anchors = _DensityAnchors(self.sizes_at)

    # -- decals -------------------------------------------------------------------------------------------

    def to_decals(
        self,
        *,
        seed: int = 0,
        sizing: Sizing | str = Sizing.COVERING,
        factor: float = 1.0,
        direction: Direction = None,
        images: int | Sequence[int] = 1,
        weights: ArrayLike | None = None,
        choice: ImageChoice | str = ImageChoice.RANDOM,
        jitter: Jitter | None = None,
        zones: PlacedZones | None = None,
    ) -> Decals:
        """Return a decal for each particle.

        Parameters
        ----------
        seed : int, default: 0
            Seed of the random choices in this call; `decals.scatter` passes its own.
        sizing, factor, direction, images, weights, choice, jitter
            Radii, tangents and images, as for `decals.scatter`.
        zones : optional
            Zones as `decals.scattering.Zones.placed_on` returns them.

        Returns
        -------
        Decals

        Raises
        ------
        InvalidScattering
            For a seed or an option of the wrong kind.
        """
        whole_number("seed", seed, 0, None, InvalidScattering)
        appearance = Appearance(sizing, factor, direction, images, weights, choice, jitter)
        return self.decals_of(appearance, seed=seed, zones=zones)

    def decals_of(self, appearance: Appearance, *, seed: int, zones: PlacedZones | None) -> Decals:
        """Return a decal for each particle, with radii, tangents and images by these rules."""
        if self.count == 0:
            return Decals.empty()
        spacings = self.sizes_at(self.positions)
        return appearance.decals_of(self.points, self.domain, spacings, ~self._fixed, seed=seed, zones=zones)
