"""Particles that repel each other on surfaces until they lie evenly."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.progress import Progress
from decals.errors import InvalidSeeding
from decals.evenness import Spacing, evenness, ideal_spacing
from decals.local_relaxation import relax_near
from decals.moving import moved
from decals.neighbours import FacingTree
from decals.polishing import CLOSE, polish
from decals.population import Density, Mask, Sites, World, shares
from decals.refilling import crowded, refill
from decals.repulsion import Repulsion
from decals.surface import Flags, Floats, Surface, as_points

EXPONENTS = (2.0, 3.0)
"""Power law of the repulsion at the first and the last step."""

STIFFNESS = 300.0
"""Of the spring between particles that are too close, at the end."""

HARDENING = (0.5, 0.8)
"""Parts of the schedule between which the spring stiffens: soft to even out, hard to pack."""

REFILLS = (0.1, 0.8, 0.05)
"""First and last part of the schedule at which crowded particles move to bare places, and the step."""

RARELY = 6
"""Steps at least between two such times, for the moved to find their rest."""

SCOUTS_PER_MOVER, SCOUTS_PER_PARTICLE = 200, 4
"""Samples among which bare places are found: so many for each that must move, at most so many for each."""

POLISHING = 60
"""Rounds at most that part the last close pairs."""

CHECKS = 10
"""Steps after which it is measured whether the particles lie evenly enough."""


class Relaxation:
    """One population of particles on any set of surfaces, relaxed step by step.

    Energy minimisation after Witkin and Heckbert (1994): particles repel each other within their tangent
    planes and are projected back onto their own surface. Particles of different surfaces repel each other
    too; those on two sides of a wall do not (their normals part). None lies or moves inside another
    closed surface. Each surface keeps its share of the count, by visible area and density. Now and then
    crowded particles move to bare places, and the last step parts what is still too close (`polish`).

    Parameters
    ----------
    surfaces
        Where the particles live.
    count
        How many there are, exactly, the fixed ones included.
    spacing
        In place of the count: distance of neighbours; as many as fit follow.
    seed
        From 0 upward; the same one gives the same bytes on the same kind of machine.
    iterations
        Steps of the whole schedule. More may be taken; they go on with its last energy.
    density
        How densely particles lie, relative to elsewhere: a function of ``points[n, 3]`` to ``[n]`` above
        zero. It should change by less than a factor of four between neighbours.
    mask
        Where particles may lie: a function of ``points[n, 3]`` to ``bool[n]``.
    fixed
        Particles that stay where they are, ``float[k, 3]``, on the surfaces that they are closest to.
    device
        Warp device on which repulsion is computed.

    Raises
    ------
    InvalidSeeding
        For a negative count or seed, no steps, a spacing that is not above zero, more fixed particles than
        the count, a density or mask that answers nonsense, or a count without visible area.
    """

    def __init__(
        self,
        surfaces: Sequence[Surface],
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
        _check("seed", seed, 0)
        _check("iterations", iterations, 1)
        self.iterations = iterations
        self.steps = 0
        self._seed = seed
        self._device = device
        self.world = World(surfaces, seed, density=density, mask=mask)
        count = _count(count, spacing, self.world.mass)
        self.spacing = ideal_spacing(self.world.mass, count)
        placed = _placed(self.world, fixed)
        if len(placed) > count:
            raise InvalidSeeding(
                f"fixed: expected at most the count of {count}, got {len(placed)}; raise the count"
            )
        counts = _remaining(shares(self.world.masses, count), placed)
        others = self.world.sample(counts, stream=1) if count else _nobody()
        joined = Sites.joined([placed, others])
        order = np.argsort(joined.surface_ids, kind="stable")
        self._fixed: Flags = (np.arange(count) < len(placed))[order]
        self._sites = joined[order]
        first, last, step = (int(part * iterations) for part in REFILLS)
        self._refills = set(range(max(first, 1), last + 1, max(step, RARELY)))
        self._repulsion: Repulsion | None = None
        self._sizes = self.sizes_at(self.positions)

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self._sites)

    @property
    def sites(self) -> Sites:
        """Where the particles are, on which surface, and the normals there."""
        return self._sites

    @property
    def positions(self) -> Floats:
        """Where the particles are, ``float32[n, 3]``."""
        return self._sites.positions

    @property
    def normals(self) -> Floats:
        """Unit normals of the surfaces there, ``float32[n, 3]``."""
        return self._sites.normals

    @property
    def surface_ids(self) -> NDArray[np.int32]:
        """Number of the surface that each particle lies on, ``int32[n]``, ascending."""
        return self._sites.surface_ids

    @property
    def fixed(self) -> Flags:
        """Which particles stay where they are, ``bool[n]``."""
        return self._fixed.copy()

    @property
    def energies(self) -> Floats:
        """How crowded each particle was at the last step: its energy there, ``float32[n]``."""
        return np.zeros(self.count, np.float32) if self._repulsion is None else self._repulsion.energies

    @property
    def finished(self) -> bool:
        """Whether the schedule has been run."""
        return self.steps >= self.iterations

    def sizes_at(self, positions: Floats) -> Floats:
        """Spacing wished for at each position, ``float32[n]``."""
        sizes: Floats = (self.spacing / np.sqrt(self.world.density(positions))).astype(np.float32)
        return sizes

    def run(
        self,
        progress: Progress | None = None,
        *,
        until: float | None = None,
        cancel: Callable[[], bool] | None = None,
    ) -> None:
        """Take the steps that are left of the schedule.

        Parameters
        ----------
        progress
            Called with a stage in plain words and the fraction done.
        until
            The rho that is enough: measured at every tenth step, and nothing is polished beyond it.
        cancel
            Asked before every step whether to stop; the particles stay as they are then.
        """
        while not self.finished and not (cancel is not None and cancel()):
            self._advance()
            if self.finished:
                self.polish(close=CLOSE if until is None else min(CLOSE, until))
            if progress is not None:
                progress("spreading seeds", self.steps / self.iterations)
            if until is not None and self.steps % CHECKS == 0 and self.statistics().rho >= until:
                break

    def step(self) -> None:
        """Move every particle once against its neighbours, and now and then some to bare places."""
        self._advance()
        if self.steps == self.iterations:
            self.polish()

    def _advance(self) -> None:
        self.steps += 1
        if self.count < 2:
            return
        if self.steps in self._refills:
            self._refill()
        self._push()

    def polish(self, rounds: int = POLISHING, *, close: float = CLOSE) -> None:
        """Part the pairs that are still closer than so many spacings by trial, as long as that helps."""
        if self.count < 2:
            return
        self._sites = polish(
            self._sites,
            self.sizes_at(self.positions),
            ~self._fixed,
            self.world.settle,
            rounds=rounds,
            seed=self._seed,
            close=close,
        )
        self._repulsion = None

    def insert(self, point: ArrayLike, *, fixed: bool = False) -> int:
        """Add a particle near the point and relax those around it; its number comes back.

        The spacing stays as it was, and so do all particles farther away.

        Raises
        ------
        InvalidSeeding
            If the surface closest to the point is barred there.
        """
        site = _placed(self.world, np.reshape(np.asarray(point, dtype=np.float32), (1, -1)))
        if not self.world.settle(site)[1].all():
            raise InvalidSeeding(f"expected a place that is neither hidden nor masked, got {point!r:.60}")
        row = int(np.searchsorted(self.surface_ids, site.surface_ids[0], side="right"))
        self._sites = Sites.joined([self._sites[:row], site, self._sites[row:]])
        self._fixed = np.insert(self._fixed, row, fixed)
        self._relax_near(self.positions[row])
        return row

    def remove(self, number: int) -> None:
        """Take a particle away and let those around it close the gap.

        Raises
        ------
        InvalidSeeding
            If there is no particle of that number.
        """
        if not 0 <= number < self.count:
            raise InvalidSeeding(f"number: expected a particle from 0 to {self.count - 1}, got {number}")
        place = self.positions[number]
        self._sites = Sites.joined([self._sites[:number], self._sites[number + 1 :]])
        self._fixed = np.delete(self._fixed, number)
        self._relax_near(place)

    def _relax_near(self, place: Floats) -> None:
        self._repulsion = None
        self._sizes = self.sizes_at(self.positions)
        if self.count > 1:
            self._sites = relax_near(
                self.world,
                self._sites,
                ~self._fixed,
                self._sizes,
                place,
                exponent=EXPONENTS[1],
                stiffness=STIFFNESS,
                device=self._device,
            )

    def statistics(self) -> Spacing:
        """How evenly the particles lie now."""
        distances, indices = FacingTree(self.positions, self.normals).nearest(
            self.positions, self.normals, count=6, skip_self=True
        )
        sizes = self.sizes_at(self.positions).astype(np.float64)
        distances /= 0.5 * (sizes[:, None] + np.where(indices >= 0, sizes[indices], 1.0))
        return evenness(self.spacing * distances, self.spacing)

    def _refill(self) -> None:
        """Move crowded particles to bare places."""
        if self.steps == 1:
            return
        movers = crowded(self._sites, self.energies, ~self._fixed)
        if len(movers) == 0:
            return
        most = min(SCOUTS_PER_PARTICLE * self.count, SCOUTS_PER_MOVER * len(movers) + 1000)
        scouts = self.world.sample(shares(self.world.masses, most), stream=1000 + self.steps)
        self._sites, which = refill(self._sites, movers, scouts, self.sizes_at(scouts.positions))
        if len(which) and self._repulsion is not None:
            self._repulsion.forget()

    def _push(self) -> None:
        """Move every particle; those that would leave their side or get hidden stay."""
        part = min(self.steps / self.iterations, 1.0)
        exponent = EXPONENTS[0] + (EXPONENTS[1] - EXPONENTS[0]) * part
        stiffness = STIFFNESS * float(np.interp(part, HARDENING, (0.0, 1.0)))
        repulsion = self._repulsion or Repulsion(self.count, device=self._device)
        if repulsion.stale:
            self._sizes = self.sizes_at(self.positions)
            repulsion.relist(self.positions, self.normals, self._sizes)
        moves = repulsion.moves(
            self.positions, self.normals, self._sizes, exponent=exponent, stiffness=stiffness
        )
        self._repulsion = repulsion
        moves[self._fixed] = 0.0
        self._sites = moved(self.world, self._sites, moves, self._sizes)


def _nobody() -> Sites:
    none = np.zeros((0, 3), np.float32)
    return Sites(none, none, np.zeros(0, np.int32))


def _check(name: str, value: int, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InvalidSeeding(f"{name}: expected a whole number, got {value!r}")
    if value < least:
        raise InvalidSeeding(f"{name}: expected at least {least}, got {value}")


def _count(count: int | None, spacing: float | None, mass: float) -> int:
    """Count that was wished for, or follows from the spacing."""
    if (count is None) == (spacing is None):
        raise InvalidSeeding("expected either a count or a spacing, got both or none; give one of them")
    if count is not None:
        _check("count", count, 0)
        return int(count)
    assert spacing is not None
    if not (np.isfinite(spacing) and spacing > 0):
        raise InvalidSeeding(f"spacing: expected a length above 0, got {spacing!r}")
    return int(round(2.0 * mass / (np.sqrt(3.0) * spacing**2)))


def _placed(world: World, fixed: ArrayLike | None) -> Sites:
    """Put fixed particles onto the surfaces that they are closest to, in the surfaces' order."""
    if fixed is None or np.size(fixed) == 0:
        return _nobody()
    if not world.surfaces:
        raise InvalidSeeding("fixed: expected a surface for them to lie on, got none")
    points = as_points(fixed, "fixed")
    found = [surface.project(points) for surface in world.surfaces]
    gaps = np.stack([np.linalg.norm(positions - points, axis=1) for positions, _ in found])
    nearest = gaps.argmin(axis=0)
    rows = np.arange(len(points))
    return Sites(
        np.stack([positions for positions, _ in found])[nearest, rows],
        np.stack([normals for _, normals in found])[nearest, rows],
        nearest.astype(np.int32),
    )


def _remaining(counts: NDArray[np.int64], placed: Sites) -> NDArray[np.int64]:
    """What is left of each surface's share after the fixed particles; the sum stays exact."""
    left = counts - np.bincount(placed.surface_ids, minlength=len(counts))
    while (left < 0).any():
        left[int(left.argmax())] -= 1
        left[int(left.argmin())] += 1
    return left
