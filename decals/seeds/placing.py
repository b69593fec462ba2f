"""How many particles there are, and where those lie that are given."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidSeeding
from decals.seeds.population import Sites, World
from decals.surfaces.surface import as_points
from decals.wishes import number, whole

MOST_SEEDS = 100_000_000
"""Seeds in one population; some hundred bytes are needed for each."""


def nobody() -> Sites:
    """No sites at all."""
    none = np.zeros((0, 3), np.float32)
    return Sites(none, none, np.zeros(0, np.int32))


def count_of(count: int | None, spacing: float | None, mass: float) -> int:
    """Count that was wished for, or follows from the spacing."""
    if (count is None) == (spacing is None):
        raise InvalidSeeding("expected either a count or a spacing, got both or none; give one of them")
    if count is not None:
        return whole("count", count, most=MOST_SEEDS)
    length = number("spacing", spacing, "a length above 0", lambda value: value > 0)
    if length < np.sqrt(2.0 * mass / (np.sqrt(3.0) * MOST_SEEDS)):
        raise InvalidSeeding(
            f"spacing: {length:g} makes more than {MOST_SEEDS:,} seeds; take a larger one, or a count"
        )
    return int(round(2.0 * mass / (np.sqrt(3.0) * length**2)))


def placed(world: World, fixed: ArrayLike | None) -> Sites:
    """Put fixed particles onto the surfaces that they are closest to, in the surfaces' order."""
    if fixed is None or np.size(fixed) == 0:
        return nobody()
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


def remaining(counts: NDArray[np.int64], given: Sites) -> NDArray[np.int64]:
    """What is left of each surface's share after the fixed particles; the sum stays exact."""
    left = counts - np.bincount(given.surface_ids, minlength=len(counts))
    while (left < 0).any():
        left[int(left.argmax())] -= 1
        left[int(left.argmin())] += 1
    return left
