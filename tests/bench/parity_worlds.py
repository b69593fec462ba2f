"""Worlds of decals for the parity check: small sets, hostile in six ways, that do not reach each other."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.model import Decals

SETS = 512
MEMBERS = 9
SPACING = 8.0
KINDS = 6
"""Space or plane, sizes to 20:1; sizes to 1,000:1; concentric; nearly a hexagonal tiling; one in another."""


@dataclass(frozen=True)
class World:
    """Decals, `members` of them a set; which sets lie in a plane."""

    decals: Decals
    members: int
    flat: NDArray[np.bool_]


def make_world(seed: int, *, layered: bool = False) -> World:
    """Make a world; with `layered`, decals of all interactions in three layers."""
    rng = np.random.default_rng(seed)
    kind = np.arange(SETS) % KINDS
    radii = _radii(rng, kind)
    flat = np.isin(kind, (1, 4))
    offsets = _offsets(rng, kind, radii, flat)
    unused = np.arange(MEMBERS) > rng.integers(1, MEMBERS, (SETS, 1))
    away = np.zeros((SETS, MEMBERS, 3)) + [0, 0, 3] + 0.1 * np.arange(MEMBERS)[:, None] * [1, 0, 0]
    radii[unused], offsets[unused] = 1e-3, away[unused]
    corners = np.stack(np.unravel_index(np.arange(SETS), (8, 8, 8)), -1) * SPACING
    count = SETS * MEMBERS
    normals = [0, 0, 1] + 0.3 * rng.normal(size=(count, 3)) * ~np.repeat(flat, MEMBERS)[:, None]
    more: dict[str, Any] = {"spill": rng.random(count) < 0.1}
    if layered:
        more |= {"interactions": rng.integers(0, 3, count), "layers": rng.integers(-1, 2, count)}
    positions = (offsets + corners[:, None]).reshape(-1, 3)
    decals = Decals(positions, normals, rng.normal(size=(count, 3)), radii.reshape(-1), **more)
    return World(decals, MEMBERS, flat)


def _radii(rng: np.random.Generator, kind: NDArray[np.intp]) -> NDArray[np.float64]:
    ratio = np.where(kind == 2, 1000.0, 20.0)[:, None]
    radii = ratio ** rng.uniform(-1, 0, (len(kind), MEMBERS))
    hexagonal = 0.4 * (1 + 10.0 ** rng.uniform(-7, -1, radii.shape))
    radii = np.where((kind == 4)[:, None], hexagonal, radii)
    same = (kind == 3)[:, None] & (rng.random(radii.shape) < 0.5)
    return np.where(same, radii[:, :1], radii)


def _offsets(
    rng: np.random.Generator, kind: NDArray[np.intp], radii: NDArray[np.float64], flat: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Members about the first of each set, which lies in its corner."""
    away = rng.normal(size=(*radii.shape, 3)) * np.where(flat, 0, 1)[:, None, None] ** [0, 0, 1]
    away /= np.linalg.norm(away, axis=2, keepdims=True)
    distance = (radii + radii[:, :1]) * rng.uniform(0, 1, radii.shape)
    deep = np.abs(radii - radii[:, :1]) * rng.uniform(0.8, 1.2, radii.shape)
    distance = np.where((kind == 5)[:, None], deep, distance)
    concentric = (kind == 3)[:, None] & (rng.random(radii.shape) < 0.7)
    distance = np.where(concentric, 0.0, distance)
    offsets = away * distance[..., None]
    angle = np.arange(MEMBERS) * np.pi / 3
    ring = 0.7 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(MEMBERS)])
    tiling = ring * (1 + 10.0 ** rng.uniform(-7, -1, (len(kind), MEMBERS, 1)))
    offsets = np.where((kind == 4)[:, None, None], tiling, offsets)
    offsets[:, 0] = 0
    return offsets
