"""Who lives where: visible areas, the share of each surface, and the first positions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decals.errors import InvalidSeeding
from decals.surface import Flags, Floats, Surface

SCOUTS = 4096
"""Samples that estimate which part of a surface is visible."""

LIFT = 1e-4
"""A point is hidden if it lies inside another surface after a lift along its own normal, by this share of its
surface's diagonal: so coincident surfaces do not hide each other, and touching faces do."""

ROUNDS = 12
"""How often the number of samples doubles before a surface counts as hidden after all."""


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
    """Surfaces together: what of them is visible, and samples of that.

    A point inside another, closed surface is hidden. Every surface draws from its own stream of random
    numbers, derived from the seed and its place in the list.
    """

    def __init__(self, surfaces: Sequence[Surface], seed: int) -> None:
        self.surfaces = tuple(surfaces)
        self._seed = seed
        self._boxes = np.array([surface.bounds for surface in self.surfaces]).reshape(-1, 2, 3)
        self._lifts = LIFT * np.linalg.norm(self._boxes[:, 1] - self._boxes[:, 0], axis=1)
        self.areas = np.array([self._visible_area(number) for number in range(len(self.surfaces))])

    @property
    def area(self) -> float:
        """Visible area of all surfaces together."""
        return float(self.areas.sum())

    def hidden(self, number: int, positions: Floats, normals: Floats) -> Flags:
        """Whether points of the surface of that number lie inside another surface."""
        result = np.zeros(len(positions), np.bool_)
        lifted = positions + np.float32(self._lifts[number]) * normals
        for other in self._overlapping(number):
            visible = np.flatnonzero(~result)
            result[visible] = self.surfaces[other].contains(lifted[visible])
        return result

    def sample(self, counts: NDArray[np.int64], stream: int) -> Sites:
        """Exactly so many visible random points of each surface, stratified by area."""
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
        if not self._overlapping(number):
            return surface.sample(count, seed)
        tries = int(np.ceil(1.1 * count * surface.area / self.areas[number])) + 16
        for _ in range(ROUNDS):
            positions, normals = surface.sample(tries, seed)
            visible = np.flatnonzero(~self.hidden(number, positions, normals))
            if len(visible) >= count:
                chosen = visible[(np.arange(count) * len(visible)) // count]
                return positions[chosen], normals[chosen]
            tries *= 2
        raise InvalidSeeding(
            f"expected visible area on surface {number}, got none in {tries} samples; move it"
        )

    def _visible_area(self, number: int) -> float:
        surface = self.surfaces[number]
        if not self._overlapping(number):
            return surface.area
        hidden = self.hidden(number, *surface.sample(SCOUTS, self._stream(number, 0)))
        return surface.area * float(1.0 - hidden.mean())

    def _overlapping(self, number: int) -> list[int]:
        """Other surfaces whose boxes meet the box of this one."""
        low, high = self._boxes[number]
        meets = ((self._boxes[:, 0] <= high) & (self._boxes[:, 1] >= low)).all(axis=1)
        return [int(other) for other in np.flatnonzero(meets) if other != number]

    def _stream(self, number: int, stream: int) -> int:
        words = np.random.SeedSequence([self._seed, stream, number]).generate_state(2, np.uint64)
        return int(words[0])


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
