"""Who lives where: visible areas, the share of each surface, and the first positions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidSeeding
from decals.surface import Flags, Floats, Surface

SCOUTS = 16384
"""Samples that estimate which part of a surface is visible."""

LIFT = 1e-4
"""A point is hidden if it lies inside another surface after a lift along its own normal, by this share of its
surface's diagonal: so coincident surfaces do not hide each other, and touching faces do."""

ROUNDS = 12
"""How often the number of samples doubles before a surface counts as hidden after all."""


CHOICE = 8
"""Samples from which one is chosen where density varies."""

Density = Callable[[Floats], ArrayLike]
"""How densely particles lie, relative to elsewhere: ``points[n, 3]`` to numbers above zero, ``[n]``."""

Mask = Callable[[Floats], ArrayLike]
"""Where particles may lie: ``points[n, 3]`` to ``bool[n]``."""


@dataclass(frozen=True)
class Sites:
    """Oriented points, each on one of several surfaces."""

    positions: Floats
    normals: Floats
    surface_ids: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, rows: slice | NDArray[np.int64]) -> "Sites":
        return Sites(self.positions[rows], self.normals[rows], self.surface_ids[rows])

    @staticmethod
    def joined(parts: "Sequence[Sites]") -> "Sites":
        """All sites of all parts, in their order."""
        return Sites(
            np.concatenate([part.positions for part in parts]),
            np.concatenate([part.normals for part in parts]),
            np.concatenate([part.surface_ids for part in parts]),
        )


class World:
    """Surfaces together: where on them particles may lie, how densely, and samples of that.

    A point inside another, closed surface is hidden; a point outside the mask is barred. Every surface draws
    from its own stream of random numbers, derived from the seed and its place in the list.
    """

    def __init__(
        self,
        surfaces: Sequence[Surface],
        seed: int,
        *,
        density: Density | None = None,
        mask: Mask | None = None,
    ) -> None:
        self.surfaces = tuple(surfaces)
        self._seed, self._density, self._mask = seed, density, mask
        self._boxes = np.array([surface.bounds for surface in self.surfaces]).reshape(-1, 2, 3)
        self._lifts = LIFT * np.linalg.norm(self._boxes[:, 1] - self._boxes[:, 0], axis=1)
        measures = [self._measure(number) for number in range(len(self.surfaces))]
        self.areas = np.array([area for area, _ in measures])
        self.masses = np.array([mass for _, mass in measures])

    @property
    def area(self) -> float:
        """Visible area of all surfaces together."""
        return float(self.areas.sum())

    @property
    def mass(self) -> float:
        """Integral of the density over the visible area."""
        return float(self.masses.sum())

    @property
    def uniform(self) -> bool:
        """Whether density is the same everywhere."""
        return self._density is None

    def density(self, positions: Floats) -> NDArray[np.float64]:
        """Relative density of particles, ``float64[n]``; `InvalidSeeding` unless finite and above zero."""
        if self._density is None or len(positions) == 0:
            return np.ones(len(positions))
        return _answers("density", self._density, positions)

    def hidden(self, number: int, positions: Floats, normals: Floats) -> Flags:
        """Whether points of the surface of that number lie inside another surface."""
        result = np.zeros(len(positions), np.bool_)
        lifted = positions + np.float32(self._lifts[number]) * normals
        for other in self._overlapping(number):
            visible = np.flatnonzero(~result)
            result[visible] = self.surfaces[other].contains(lifted[visible])
        return result

    def barred(self, number: int, positions: Floats, normals: Floats) -> Flags:
        """Whether points of the surface of that number are hidden or outside the mask."""
        result = self.hidden(number, positions, normals)
        if self._mask is not None and len(positions):
            result |= ~_answers("mask", self._mask, positions).astype(np.bool_)
        return result

    def settle(self, sites: Sites, *, within: Floats | None = None) -> tuple[Sites, Flags]:
        """Put points back onto their own surfaces; which of them may lie there comes along.

        `within`: upper bounds of their distances from their surfaces, if known.
        """
        positions, normals = np.empty_like(sites.positions), np.empty_like(sites.normals)
        allowed = np.ones(len(sites), np.bool_)
        for number, surface in enumerate(self.surfaces):
            own: slice | NDArray[np.int64] = slice(None)
            if len(self.surfaces) > 1:
                own = np.flatnonzero(sites.surface_ids == number)
            bound = None if within is None else within[own]
            positions[own], normals[own] = surface.project(sites.positions[own], within=bound)
            allowed[own] = ~self.barred(number, positions[own], normals[own])
        return Sites(positions, normals, sites.surface_ids), allowed

    def sample(self, counts: NDArray[np.int64], stream: int) -> Sites:
        """Exactly so many visible random points of each surface, stratified by area and density."""
        parts = [self._sample_one(number, int(count), stream) for number, count in enumerate(counts)]
        return Sites(
            np.concatenate([part[0] for part in parts]),
            np.concatenate([part[1] for part in parts]),
            np.repeat(np.arange(len(parts), dtype=np.int32), counts),
        )

    def _sample_one(self, number: int, count: int, stream: int) -> tuple[Floats, Floats]:
        surface, seed = self.surfaces[number], self._stream(number, stream)
        if count == 0:
            return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32)
        if self._is_whole(number):
            return surface.sample(count, seed)
        wanted = count if self.uniform else CHOICE * count
        tries = int(np.ceil(1.1 * wanted * surface.area / self.areas[number])) + 16
        for _ in range(ROUNDS):
            positions, normals = surface.sample(tries, seed)
            visible = np.flatnonzero(~self.barred(number, positions, normals))
            if len(visible) >= wanted:
                chosen = visible[_evenly(self.density(positions[visible]), count)]
                return positions[chosen], normals[chosen]
            tries *= 2
        raise InvalidSeeding(
            f"expected visible area on surface {number}, got none in {tries} samples; move it"
        )

    def _measure(self, number: int) -> tuple[float, float]:
        """Visible area of a surface, and the integral of the density over it."""
        surface = self.surfaces[number]
        if self._is_whole(number):
            return surface.area, surface.area
        positions, normals = surface.sample(SCOUTS, self._stream(number, 0))
        free = np.flatnonzero(~self.barred(number, positions, normals))
        each = surface.area / len(positions)
        return each * len(free), each * float(self.density(positions[free]).sum())

    def _is_whole(self, number: int) -> bool:
        """Whether nothing can hide or bar a part of the surface, or weigh it."""
        return self.uniform and self._mask is None and not self._overlapping(number)

    def _overlapping(self, number: int) -> list[int]:
        """Other surfaces whose boxes meet the box of this one."""
        low, high = self._boxes[number]
        meets = ((self._boxes[:, 0] <= high) & (self._boxes[:, 1] >= low)).all(axis=1)
        return [int(other) for other in np.flatnonzero(meets) if other != number]

    def _stream(self, number: int, stream: int) -> int:
        words = np.random.SeedSequence([self._seed, stream, number]).generate_state(2, np.uint64)
        return int(words[0])


def _evenly(weights: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Choose rows in proportion to their weights, at even steps of the weights' running sum."""
    total = np.cumsum(weights)
    levels = (np.arange(count) + 0.5) * (total[-1] / count)
    rows: NDArray[np.int64] = np.minimum(np.searchsorted(total, levels, side="right"), len(weights) - 1)
    return rows


def _answers(name: str, function: Callable[[Floats], ArrayLike], positions: Floats) -> NDArray[np.float64]:
    """One number for each position, as the user's function has it, checked."""
    try:
        answers = np.asarray(function(positions), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidSeeding(f"{name}: expected numbers from the function, got {error}") from error
    if answers.shape != (len(positions),):
        raise InvalidSeeding(
            f"{name}: expected shape [{len(positions)}], got {list(answers.shape)}; "
            "return one number for each point"
        )
    if not np.isfinite(answers).all() or (name == "density" and not (answers > 0).all()):
        raise InvalidSeeding(
            f"{name}: expected finite numbers, and densities above zero; bar places by a mask"
        )
    return answers


def shares(areas: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Split a count in proportion to areas by largest remainders; the sum is exact.

    Ties go to the first. `InvalidSeeding` if there is something to split and no area.
    """
    total = float(areas.sum())
    if count == 0:
        return np.zeros(len(areas), np.int64)
    if not total > 0:
        raise InvalidSeeding(f"expected visible area for {count} seeds, got none; add a surface or move one")
    ideal = areas * (count / total)
    result: NDArray[np.int64] = np.floor(ideal).astype(np.int64)
    first = np.argsort(-(ideal - result), kind="stable")
    result[first[: count - int(result.sum())]] += 1
    return result
