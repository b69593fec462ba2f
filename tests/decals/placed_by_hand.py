"""Decals as people place them, and their pinholes: points that an image reaches, and where none shows."""

from typing import Any

import numpy as np

import decals
from decals import Decals
from tests.decals.distortion import random_points
from tests.decals.fault_models import Arrays, ears, gear
from tests.decals.meshes import icosphere
from tests.decals.shapes import torus
from tests.oracles.decals import reached

WHITE = np.full((2, 2, 4), 255, np.uint8)
SURE = 1e-4
"""Radii by which an image must reach beyond a point, and cosine by which its decal must face it."""


def ellipsoid() -> Arrays:
    vertices, faces = icosphere(5)
    return vertices * (1.6, 1.0, 0.6), faces


def ring() -> Arrays:
    shape = torus()
    return shape.vertices, shape.faces


MODELS = {"ball": lambda: icosphere(5), "ellipsoid": ellipsoid, "ring": ring, "ears": ears, "gear": gear}
FAMILIES: dict[str, dict[str, Any]] = {
    "few": {"count": 10, "radii": (0.5, 1.0)},
    "many": {"count": 60, "radii": (0.15, 0.6)},
    "crowded": {"count": 100, "radii": (0.05, 1.0)},
    "tilted": {"count": 40, "radii": (0.2, 0.7), "tilt": 0.25},
    "pairs": {"count": 60, "radii": (0.05, 0.7), "near": 0.3},
    "layers": {"count": 40, "radii": (0.3, 0.6), "layers": 3},
}
"""Arguments of `placed`."""


def placed(
    mesh: Arrays,
    seed: int,
    *,
    count: int,
    radii: tuple[float, float],
    tilt: float = 0.0,
    near: float = 0.0,
    layers: int = 1,
) -> Decals:
    """Decals at random points, with normals tilted by `tilt`; with `near`, half of them beside others."""
    rng = np.random.default_rng(seed)
    points, normals = random_points(mesh, 20_000, seed)
    rows = np.arange(count)
    if near:
        wanted = points[: count // 2] + near * rng.normal(size=(count // 2, 3))
        rows[count // 2 :] = ((points[:, None] - wanted) ** 2).sum(axis=2).argmin(axis=0)
    options: dict[str, Any] = {}
    if layers > 1:
        options = {"layers": rng.integers(0, layers, count), "interactions": rng.integers(0, 3, count)}
    return Decals(
        points[rows],
        normals[rows] + tilt * rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3)),
        radii[0] * (radii[1] / radii[0]) ** rng.random(count),
        **options,
    )


def pinholes(layout: Decals, mesh: Arrays, count: int, contact: str = "elastic") -> float:
    """Share of pinholes of the points that images reach."""
    points, normals = (rows.astype(np.float32) for rows in random_points(mesh, count, 7))
    shown = decals.evaluate(layout, points, normals, contact=contact, images=[WHITE]).color
    assert shown is not None
    union = reached(layout, points, normals, SURE)
    return float((union & (shown[:, 3] == 0)).sum() / union.sum())
