"""Particles that repel each other on surfaces until they lie evenly."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.progress import Progress
from decals.errors import InvalidSeeding
from decals.seeds.carrying import carried, freed
from decals.seeds.crowd import Crowd
from decals.seeds.evenness import Spacing, evenness_of, ideal_spacing
from decals.seeds.homes import Homes
from decals.seeds.local_relaxation import relax_near
from decals.seeds.looking import Lookout
from decals.seeds.placing import count_of, nobody, placed, remaining
from decals.seeds.polishing import CLOSE, polish
from decals.seeds.population import Density, Mask, Sites, World, shares
from decals.seeds.refilling import crowded, refill
from decals.seeds.repulsion import CUTOFF
from decals.seeds.schedule import law_at
from decals.seeds.scouting import Scouts
from decals.surfaces.surface import Flags, Floats, Surface, as_points
from decals.wishes import function_or_none, number, numbers, whole

REFILLS = (0.1, 0.8, 0.05)
"""First and last part of the schedule at which crowded particles move to bare places, and the step."""

RARELY = 6
"""Steps at least between two such times, for the moved to find their rest."""

SETTLING = 60
"""Steps after a deformation within which crowded particles still move to bare places."""

POLISHING = 150
"""Rounds at most that part the last close pairs."""

CHECKS = 2
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
        Where the particles live: one or several.
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
        Warp device on which particles are pushed and put back onto their surfaces.

    Raises
    ------
    InvalidSeeding
        For a negative count or seed, no steps, a spacing that is not above zero, more fixed particles than
        the count, a density or mask that answers nonsense, or a count without visible area.
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
        self.iterations = whole("iterations", iterations, 1)
        self.steps = self._deformed = 0
        self._seed = whole("seed", seed)
        self.world = World(surfaces, seed, density=density, mask=mask, device=device)
        count = count_of(count, spacing, self.world.mass)
        self.spacing = ideal_spacing(self.world.mass, count)
        given = placed(self.world, fixed)
        if len(given) > count:
            raise InvalidSeeding(
                f"fixed: expected at most the count of {count}, got {len(given)}; raise the count"
            )
        counts = remaining(shares(self.world.masses, count), given)
        others = self.world.sample(counts, stream=1) if count else nobody()
        joined = Sites.joined([given, others])
        order = np.argsort(joined.surface_ids, kind="stable")
        self._fixed: Flags = (np.arange(count) < len(given))[order]
        self._sites: Sites | None = joined[order]
        first, last, step = (int(part * iterations) for part in REFILLS)
        self._refills = set(range(max(first, 1), last + 1, max(step, RARELY)))
        self._crowd: Crowd | None = None
        self._homes = Homes(self.sizes_at)
        self._scouts = Scouts(self.world, self.sizes_at)

    def __repr__(self) -> str:
        return f"Relaxation({self.count} particles, step {self.steps} of {self.iterations})"

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self._fixed)

    @property
    def sites(self) -> Sites:
        """Where the particles are, on which surface, and the normals there."""
        if self._sites is None:
            self._sites = self._on_device().sites()
        return self._sites

    @property
    def positions(self) -> Floats:
        """Where the particles are, ``float32[n, 3]``."""
        return self.sites.positions

    @property
    def normals(self) -> Floats:
        """Unit normals of the surfaces there, ``float32[n, 3]``."""
        return self.sites.normals

    @property
    def surface_ids(self) -> NDArray[np.int32]:
        """Number of the surface that each particle lies on, ``int32[n]``, ascending."""
        return self.sites.surface_ids

    @property
    def fixed(self) -> Flags:
        """Which particles stay where they are, ``bool[n]``."""
        return self._fixed.copy()

    @property
    def energies(self) -> Floats:
        """How crowded each particle is: its energy where it is, ``float32[n]``; 0 before any step."""
        return np.zeros(self.count, np.float32) if self._crowd is None else self._crowd.energies

    @property
    def energy(self) -> float:
        """Energy of all pairs together, in square spacings; it never rises within an `epoch`."""
        return 0.0 if self._crowd is None else self._crowd.energy / self.spacing**2

    @property
    def epoch(self) -> int:
        """How often neighbours, spacings and the law of repulsion have been taken anew."""
        return 0 if self._crowd is None else self._crowd.epoch

    @property
    def finished(self) -> bool:
        """Whether the schedule has been run."""
        return self.steps >= self.iterations

    def sizes_at(self, positions: Floats) -> Floats:
        """Spacing wished for at each position, ``float32[n]``."""
        densities = self.world.density(as_points(positions, "positions"))
        sizes: Floats = (self.spacing / np.sqrt(densities)).astype(np.float32)
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
            The rho that is enough: measured at every other step, and nothing is polished beyond it.
        cancel
            Asked before every step whether to stop; the particles stay as they are then.

        Raises
        ------
        InvalidSeeding
            If `until` is no number, or `progress` or `cancel` cannot be called.
        """
        if until is not None:
            until = number("until", until, "the rho that is enough, a number above 0", lambda rho: rho > 0)
        function_or_none("progress", progress)
        function_or_none("cancel", cancel)
        while not self.finished and not (cancel is not None and cancel()):
            self._advance()
            if self.finished:
                self.polish(close=CLOSE if until is None else min(CLOSE, until))
            if progress is not None:
                progress("spreading seeds", self.steps / self.iterations)
            if until is not None and self.steps % CHECKS == 0 and self._least() >= until:
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
        whole("rounds", rounds)
        number("close", close, "a number of spacings from 0 upward", lambda value: value >= 0)
        if self.count > 1:
            crowd = self._on_device()
            self._call_home(crowd)
            polish(crowd, rounds=rounds, seed=self._seed, close=close, sizes_at=self.sizes_at)
            self._homes.change(crowd, np.arange(self.count))
            self._sites = None

    def insert(self, point: ArrayLike, *, fixed: bool = False) -> int:
        """Add a particle near the point and relax those around it; its number comes back.

        The spacing stays as it was, and so do all particles farther away.

        Raises
        ------
        InvalidSeeding
            If the surface closest to the point is barred there.
        """
        place = numbers("point", point)
        if place.shape != (3,):
            raise InvalidSeeding(f"point: expected three numbers, got shape {list(place.shape)}")
        site = placed(self.world, place[None])
        if not self.world.settle(site)[1].all():
            raise InvalidSeeding(f"expected a place that is neither hidden nor masked, got {point!r:.60}")
        row = int(np.searchsorted(self.surface_ids, site.surface_ids[0], side="right"))
        sites = Sites.joined([self.sites[:row], site, self.sites[row:]])
        self._fixed = np.insert(self._fixed, row, fixed)
        self._relax_near(sites, site.positions[0])
        return row

    def remove(self, number: int) -> None:
        """Take a particle away and let those around it close the gap.

        Raises
        ------
        InvalidSeeding
            If there is no particle of that number.
        """
        if whole("number", number) >= self.count:
            raise InvalidSeeding(
                f"number: expected a particle among the {self.count} there are, counted from 0, got {number}"
            )
        place = self.positions[number]
        sites = Sites.joined([self.sites[:number], self.sites[number + 1 :]])
        self._fixed = np.delete(self._fixed, number)
        self._relax_near(sites, place)

    def deform(self, surfaces: Surface | Sequence[Surface]) -> None:
        """Take other surfaces in place of those there are, one for one, and carry the particles along.

        On a mesh with the same faces each stays at its place in its face; elsewhere it is put onto the new
        surface where that is closest, on a tree along the field. Where that would heap them up, the surface
        having gone too far, they first move as the box around it. Who ends up hidden or barred starts again
        at random. Counts stay, of each surface too; the spacing follows the area. A few calls of `step` even
        out what was stretched; nothing else changes, so a viewer may show every one.

        Raises
        ------
        InvalidSeeding
            If there are not as many surfaces as before, particles have no visible area to lie on, or they
            would end up in a heap all the same; nothing has changed then.
        """
        world = self.world.deformed(surfaces)
        sites = carried(self.world, world, self.sites, self.spacing)
        sites = freed(world, sites, self._fixed, stream=self.steps)
        self.world = world
        self.spacing = ideal_spacing(world.mass, self.count)
        self._scouts = Scouts(world, self.sizes_at)
        self._deformed = self.steps
        self._refills |= {self.steps + k for k in range(RARELY, SETTLING + 1, RARELY)}
        self._sites, self._crowd, self._homes = sites, None, Homes(self.sizes_at)

    def _relax_near(self, sites: Sites, place: Floats) -> None:
        """Take other particles, and let those around the place find their rest."""
        if len(sites) > 1:
            sizes = self.sizes_at(sites.positions)
            sites = relax_near(self.world, sites, ~self._fixed, sizes, place)
        self._sites, self._crowd, self._homes = sites, None, Homes(self.sizes_at)

    def statistics(self) -> Spacing:
        """How evenly the particles lie now."""
        return evenness_of(self.positions, self.normals, self.sizes_at(self.positions), self.spacing)

    def _least(self) -> float:
        """Least distance between particles, in spacings."""
        if self.count < 2:
            return np.inf
        return float(Lookout(self._on_device(), CUTOFF).nearness_of(np.arange(self.count)).min())

    def _refill(self) -> None:
        """Move crowded particles to bare places."""
        if self.steps == 1:
            return
        crowd = self._on_device()
        movers = crowded(crowd)
        if len(movers):
            self._call_home(crowd)
            moved = refill(crowd, movers, *self._scouts.some(len(movers), self.count))
            self._homes.change(crowd, moved)

    def _push(self) -> None:
        """Move every particle; those that would leave their side or get hidden stay."""
        crowd = self._on_device()
        if crowd.stale:
            self._call_home(crowd)
            part, rest = ((self.steps - since) / self.iterations for since in (0, self._deformed))
            crowd.begin(law_at(part, rest))
        crowd.step()
        self._sites = None

    def _call_home(self, crowd: Crowd) -> None:
        """Where density varies: nobody stays at another one, and spacings are taken anew."""
        if not self.world.uniform:
            self._homes.call(crowd)

    def _on_device(self) -> Crowd:
        """The particles in the device's memory."""
        if self._crowd is None:
            sites = self.sites
            self._crowd = Crowd(self.world, sites, ~self._fixed, self.sizes_at(sites.positions))
        return self._crowd
