"""Who lives where: visible areas, the share of each surface, and the first positions."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals.checks import shown
from decals.errors import InvalidSeeding
from decals.seeds.rims import Rims
from decals.seeds.settling import Settling, spans_of
from decals.surfaces.ground import vectors
from decals.surfaces.surface import Flags, Floats, Surface
from decals.wishes import answers, device_or_error, function_or_none

SCOUTS = 16384
"""Samples that estimate which part of a surface is visible."""

ROUNDS = 12
"""How often the number of samples doubles before a surface counts as hidden after all."""


CHOICE = 8
"""Samples from which one is chosen where density varies."""

EDGE = 1.2
"""Particles stay within this factor of the density at which they began."""

CURVE_BITS = 16
"""Bits of each coordinate along the space-filling curve (Morton's)."""

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
        surfaces: Surface | Sequence[Surface],
        seed: int,
        *,
        density: Density | None = None,
        mask: Mask | None = None,
        device: str = "cpu",
    ) -> None:
        self.surfaces = surfaces_of(surfaces)
        self.device = device_or_error(device)
        function_or_none("density", density)
        function_or_none("mask", mask)
        self._seed, self._density, self._mask = seed, density, mask
        self.settling = Settling(self.surfaces, self._outside if mask is not None else None, device)
        measures = [self._measure(number) for number in range(len(self.surfaces))]
        self.areas = np.array([area for area, _ in measures])
        self.masses = np.array([mass for _, mass in measures])
        self._rims: dict[int, Rims] = {}

    def deformed(self, surfaces: Surface | Sequence[Surface]) -> "World":
        """Other surfaces in place of these, one for one, under the same rules."""
        others = surfaces_of(surfaces)
        if len(others) != len(self.surfaces):
            raise InvalidSeeding(f"expected {len(self.surfaces)} surfaces as before, got {len(others)}")
        return World(others, self._seed, density=self._density, mask=self._mask, device=self.device)

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

    def rims(self, spacing: float) -> Rims:
        """Where the surfaces end, for particles about that far apart."""
        octave = int(np.round(np.log2(max(spacing, 1e-30))))
        if octave not in self._rims:
            self._rims[octave] = Rims(self.surfaces, 2.0**octave, self.device)
        return self._rims[octave]

    def barred(self, number: int, positions: Floats, normals: Floats) -> Flags:
        """Whether points of the surface of that number are hidden or outside the mask."""
        count = len(positions)
        flags: Any = wp.zeros(count, dtype=wp.int32, device=self.device)
        places, ways = vectors(positions, self.device), vectors(normals, self.device)
        self.settling.forbid([(number, 0, count)] if count else [], places, ways, flags)
        found: Flags = flags.numpy() == 1
        return found

    def settle(self, sites: Sites) -> tuple[Sites, Flags]:
        """Put points back onto their own surfaces; which of them may lie there comes along."""
        count = len(sites)
        order = np.argsort(sites.surface_ids, kind="stable")
        points = vectors(np.ascontiguousarray(sites.positions[order]), self.device)
        reaches: Any = wp.zeros(count, dtype=wp.float32, device=self.device)
        found: Any = wp.zeros(count, dtype=wp.vec3, device=self.device)
        normals: Any = wp.zeros(count, dtype=wp.vec3, device=self.device)
        flags: Any = wp.zeros(count, dtype=wp.int32, device=self.device)
        spans = spans_of(sites.surface_ids[order])
        self.settling.settle(points, reaches, spans, found, normals, flags)
        back = np.empty_like(order)
        back[order] = np.arange(count)
        settled = Sites(found.numpy()[back], normals.numpy()[back], sites.surface_ids)
        return settled, (flags.numpy() == 0)[back]

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
        tries = (
            int(np.ceil(1.1 * wanted * surface.area / max(self.areas[number], surface.area / SCOUTS))) + 16
        )
        for _ in range(ROUNDS if self.areas[number] > 0 else 0):
            positions, normals = surface.sample(tries, seed)
            visible = np.flatnonzero(~self.barred(number, positions, normals))
            if len(visible) >= wanted:
                if not self.uniform:
                    visible = visible[_in_order(positions[visible], self.density(positions[visible]))]
                chosen = visible[_evenly(self.density(positions[visible]), count)]
                return positions[chosen], normals[chosen]
            tries *= 2
        raise InvalidSeeding(
            f"expected visible area on surface {number}, got none in {max(tries, SCOUTS)} samples; move it"
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
        return self.uniform and self._mask is None and not self.settling.overlapping(number)

    def _outside(self, positions: Floats) -> Flags:
        """Whether the mask bars a place."""
        assert self._mask is not None
        return ~_answers("mask", self._mask, positions).astype(np.bool_)

    def _stream(self, number: int, stream: int) -> int:
        words = np.random.SeedSequence([self._seed, stream, number]).generate_state(2, np.uint64)
        return int(words[0])


def crosses_edge(before: Floats, after: Floats) -> Flags:
    """Whether spacings are too different for a particle to go from the one to the other."""
    crossed: Flags = np.abs(np.log(after / before)) > 0.5 * np.log(EDGE)
    return crossed


def _in_order(positions: Floats, densities: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order places by steps of density, and along a space-filling curve within each.

    Who takes every so much of the running sum then takes from each part of a surface what it is due.
    """
    steps = np.floor(np.log(densities) / np.log(EDGE) + 0.5)
    low = positions.min(axis=0)
    span = max(float((positions.max(axis=0) - low).max()), 1e-30)
    cells = ((positions - low) * ((1 << CURVE_BITS) - 1) / span).astype(np.int64)
    keys = np.zeros(len(positions), np.int64)
    for bit in range(CURVE_BITS):
        for axis in range(3):
            keys |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.lexsort((keys, steps))


def _evenly(weights: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Choose rows in proportion to their weights, at even steps of the weights' running sum."""
    total = np.cumsum(weights)
    levels = (np.arange(count) + 0.5) * (total[-1] / count)
    rows: NDArray[np.int64] = np.minimum(np.searchsorted(total, levels, side="right"), len(weights) - 1)
    return rows


def surfaces_of(given: object) -> tuple[Surface, ...]:
    """One surface or several as a tuple; `InvalidSeeding` for what is none."""
    if _is_surface(given):
        return (given,)
    several = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
    for one in several:
        if not _is_surface(one):
            raise InvalidSeeding(
                f"surfaces: expected a surface or several, got {shown(one)}; "
                "make one by ImplicitSurface(tree) or MeshSurface(vertices, faces)"
            )
    return several


def _is_surface(one: object) -> TypeGuard[Surface]:
    """Whether it is a surface; a class of surfaces has the same names, and is none."""
    return isinstance(one, Surface) and not isinstance(one, type)


def _answers(name: str, function: Callable[[Floats], ArrayLike], positions: Floats) -> NDArray[np.float64]:
    """One number for each position, as the user's function has it, checked."""
    found = answers(name, function, positions)
    if found.shape != (len(positions),):
        raise InvalidSeeding(
            f"{name}: expected shape [{len(positions)}], got {list(found.shape)}; "
            "return one number for each point"
        )
    if not np.isfinite(found).all() or (name == "density" and not (found > 0).all()):
        raise InvalidSeeding(
            f"{name}: expected finite numbers, and densities above zero; bar places by a mask"
        )
    return found


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
