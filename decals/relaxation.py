"""Particles that repel each other on surfaces until they lie evenly."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.progress import Progress
from decals.errors import InvalidSeeding
from decals.model import FACING_LIMIT
from decals.neighbours import FacingTree
from decals.particles import repel
from decals.population import Sites, World, shares
from decals.refilling import refill
from decals.surface import Flags, Floats, Surface, unit_rows

EXPONENTS = (4.0, 12.0)
"""Power law of the repulsion at the first and the last step: soft to even out, hard to pack."""

CUTOFF = 2.5
"""Reach of the repulsion, in spacings."""

DAMPING = 0.6
"""Share of a Newton step taken, since neighbours move at the same time."""

LONGEST = 0.3
"""Longest move of a step, in spacings."""

REFILLS = (0.3, 0.6, 0.9)
"""Parts of the schedule after which crowded particles move to bare places."""

MEMORY = 0.7
"""Share of the past in the normal that guides a particle. At a sharp tip the surface's normal jumps from one
side to the other with every small move; its mean over some steps tells neighbours from far sides better."""

VOID_SAMPLES = 32
"""Samples for each particle among which bare places are found."""

GRID_CELLS = (16, 128)
"""Fewest and most cells of the hash grid along each axis."""


@dataclass(frozen=True)
class Spacing:
    """How evenly particles lie; distances count between particles that face the same way.

    Attributes
    ----------
    ideal
        Distance of neighbours if the visible area were one hexagonal tiling, sqrt(2 A / (sqrt(3) N)).
    mean
        Mean distance to the nearest neighbour.
    rho
        Least distance over the ideal one; 1 is the unreachable best (Lagae and Dutré 2008).
    cv
        Coefficient of variation of the distance to the nearest neighbour.
    cv6
        Coefficient of variation of the mean distance to six neighbours.
    """

    ideal: float
    mean: float
    rho: float
    cv: float
    cv6: float


class Relaxation:
    """One population of particles on any set of surfaces, relaxed step by step.

    Energy minimisation after Witkin and Heckbert (1994): particles repel each other within their tangent
    planes and are projected back onto their own surface. Particles of different surfaces repel each other
    too; those on two sides of a wall do not (their normals part). None lies or moves inside another
    closed surface. Each surface keeps its share of the count, by visible area.

    Parameters
    ----------
    surfaces
        Where the particles live.
    count
        How many there are, exactly.
    seed
        From 0 upward; the same one gives the same bytes on the same kind of machine.
    iterations
        Steps of the whole schedule. More may be taken; they go on with its last energy.

    Raises
    ------
    InvalidSeeding
        For a negative count or seed, no steps, or a count without visible area.
    """

    def __init__(
        self, surfaces: Sequence[Surface], *, count: int, seed: int = 0, iterations: int = 200
    ) -> None:
        _check("count", count, 0)
        _check("seed", seed, 0)
        _check("iterations", iterations, 1)
        self.iterations = iterations
        self.steps = 0
        self.world = World(surfaces, seed)
        counts = shares(self.world.areas, count)
        self.spacing = ideal_spacing(self.world.area, count)
        self._ends = np.concatenate([[0], np.cumsum(counts)])
        self._sites = self.world.sample(counts, stream=1) if count else _nobody()
        self._scouts = self.world.sample(counts * VOID_SAMPLES, stream=2) if count else _nobody()
        self._refills = {int(part * iterations) for part in REFILLS} - {0}
        side = int(np.clip(2 * np.sqrt(max(count, 1)) / CUTOFF, *GRID_CELLS))
        self._grid: Any = wp.HashGrid(side, side, side, device="cpu")
        self._guides = self.normals.copy()
        self._moves = np.zeros((count, 3), np.float32)
        self._energies = wp.zeros(count, dtype=wp.float32, device="cpu")

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
    def energies(self) -> Floats:
        """How crowded each particle was at the last step: its energy there, ``float32[n]``."""
        energies: Floats = self._energies.numpy().copy()
        return energies

    @property
    def finished(self) -> bool:
        """Whether the schedule has been run."""
        return self.steps >= self.iterations

    def run(self, progress: Progress | None = None) -> None:
        """Take the steps that are left of the schedule."""
        while not self.finished:
            self.step()
            if progress is not None:
                progress("spreading seeds", self.steps / self.iterations)

    def step(self) -> None:
        """Move every particle once against its neighbours, and now and then some to bare places."""
        self.steps += 1
        if self.count < 2:
            return
        if self.steps in self._refills:
            self._refill()
        self._push()
        self._settle()

    def statistics(self) -> Spacing:
        """How evenly the particles lie now."""
        distances, _ = FacingTree(self.positions, self.normals).nearest(
            self.positions, self.normals, count=6, skip_self=True
        )
        nearest, six = distances[:, 0], distances.mean(axis=1)
        nearest, six = nearest[np.isfinite(nearest)], six[np.isfinite(six)]
        if len(nearest) == 0:
            return Spacing(self.spacing, np.inf, np.inf, 0.0, 0.0)
        rho = float(nearest.min()) / self.spacing
        return Spacing(self.spacing, float(nearest.mean()), rho, _variation(nearest), _variation(six))

    def _refill(self) -> None:
        """Move crowded particles to bare places, where they forget their past."""
        before = self._sites
        self._sites = refill(before, self._scouts, self.spacing)
        moved = (before.positions != self.positions).any(axis=1)
        self._guides[moved] = self.normals[moved]

    def _push(self) -> None:
        """Compute the move of every particle."""
        part = min(self.steps / self.iterations, 1.0)
        exponent = EXPONENTS[0] + (EXPONENTS[1] - EXPONENTS[0]) * part
        positions, guides, moves = (_vectors(rows) for rows in (self.positions, self._guides, self._moves))
        self._grid.build(positions, CUTOFF * self.spacing)
        inputs = [self._grid.id, positions, guides, self.spacing, CUTOFF, exponent]
        inputs += [FACING_LIMIT, DAMPING, LONGEST]
        wp.launch(repel, dim=self.count, inputs=inputs, outputs=[moves, self._energies], device="cpu")

    def _settle(self) -> None:
        """Project the moved particles; those that would leave their side or get hidden stay."""
        positions, normals = np.empty_like(self.positions), np.empty_like(self.normals)
        stays: Flags = np.zeros(self.count, np.bool_)
        for number, surface in enumerate(self.world.surfaces):
            own = slice(self._ends[number], self._ends[number + 1])
            positions[own], normals[own] = surface.project(self.positions[own] + self._moves[own])
            stays[own] = self.world.hidden(number, positions[own], normals[own])
        stays |= np.einsum("ni,ni->n", normals, self.normals) <= FACING_LIMIT
        positions[stays], normals[stays] = self.positions[stays], self.normals[stays]
        self._sites = Sites(positions, normals, self.surface_ids)
        self._guides = unit_rows(MEMORY * self._guides + (1.0 - MEMORY) * normals)


def ideal_spacing(area: float, count: int) -> float:
    """Distance of neighbours in the hexagonal tiling of an area by so many points."""
    return float(np.sqrt(2.0 * area / (np.sqrt(3.0) * max(count, 1))))


def _vectors(rows: Floats) -> wp.array[wp.vec3]:
    """Show rows to a kernel without a copy."""
    return wp.array(rows, dtype=wp.vec3, device="cpu", copy=False)


def _variation(values: NDArray[np.float64]) -> float:
    return float(values.std() / values.mean()) if len(values) and values.mean() > 0 else 0.0


def _nobody() -> Sites:
    none = np.zeros((0, 3), np.float32)
    return Sites(none, none, np.zeros(0, np.int32))


def _check(name: str, value: int, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InvalidSeeding(f"{name}: expected a whole number, got {value!r}")
    if value < least:
        raise InvalidSeeding(f"{name}: expected at least {least}, got {value}")
