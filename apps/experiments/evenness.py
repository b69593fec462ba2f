"""How even scattered decals are against schedule, curvature and thickness, beside dart throwing and Lloyd.

Published for the plane: rho of dart throwing 0.750, of centroidal Voronoi tessellations 0.795.
"""

import numpy as np
from scipy.spatial import cKDTree

from blobtree._typing import Float32Array, Float64Array
from decals import Decals, MeshObject, Relaxation, Scene, measure
from decals.apps.gallery.helpers import camera_at
from decals.errors import InvalidInput
from decals.experiments import Grid, Seeds
from decals.scattering.neighbors import ideal_spacing
from decals.scattering.orientation import tangents
from decals.surfaces import MeshSurface
from decals.validation import count_number

DIVISIONS = 5
"""Divisions of an icosahedron: 20,480 faces."""

WAVES = 4.0
"""Waves of the bumps in a radian."""

DARTS = 400
"""Darts for each point that stays."""

DART_RHO = 0.75
"""Least distance of darts over the ideal spacing of `count` points."""

CANDIDATES, ROUNDS = 150, 60
"""Samples of the surface for each point, and rounds of Lloyd's method."""


def evenness(
    method: str,
    count: int = 1000,
    steps: int = 150,
    bumps: float = 0.0,
    thickness: float = 1.0,
    seed: int = 0,
) -> dict[str, float]:
    """Distribute points over a closed body.

    Parameters
    ----------
    method
        ``"scatter"``, the relaxation of this package; ``"darts"``, dart throwing; ``"lloyd"``, Lloyd's method
        on samples of the surface. The last two are plain re-implementations.
    count
        Number of points; of darts about that number.
    steps
        Steps of the relaxation.
    bumps
        Height of the bumps, over the radius of 1.
    thickness
        Thickness of the body, over its width.
    seed
        Seed of the points.

    Returns
    -------
    dict
        ``points``; ``rho`` and ``mean``, the least and the mean distance of neighbours over the ideal one;
        ``cv``, ``cv6`` and ``bond_order`` of `decals.measure`; ``spacing``, the ideal distance over the
        thickness.
    """
    count = count_number("count", count, 1, None, InvalidInput)
    steps = count_number("steps", steps, 0, None, InvalidInput)
    surface = body(bumps, thickness)
    positions = METHODS[method](surface, count, steps, seed)
    positions, normals = surface.project(positions)
    spacing = ideal_spacing(surface.area, len(positions))
    decals = Decals(
        positions=positions,
        normals=normals,
        tangents=tangents(positions, normals, None, seed),
        radii=np.full(len(positions), 0.5 * spacing, np.float32),
        images=np.full(len(positions), -1, np.int32),
    )
    scene = Scene(
        objects=(MeshObject("body", surface.vertices, surface.faces),),
        camera=camera_at((0.0, -6.0, 0.0)),
        decals=decals,
    )
    found = measure(scene, samples=1)
    return {
        "points": len(positions),
        "rho": found.rho,
        "mean": found.mean_distance / spacing,
        "cv": found.cv,
        "cv6": found.cv6,
        "bond_order": found.bond_order,
        "spacing": float(spacing / (2.0 * thickness)),
    }


def body(bumps: float, thickness: float) -> MeshSurface:
    """Return a ball with bumps, flattened along z."""
    import pyvista as pv

    ball = pv.Icosphere(radius=1.0, nsub=DIVISIONS)
    directions = np.asarray(ball.points, np.float64)
    waves = np.prod(np.sin(WAVES * np.pi / 2 * directions + 0.3), axis=1)
    vertices = directions * (1.0 + bumps * waves[:, None]) * [1.0, 1.0, thickness]
    return MeshSurface(vertices, np.asarray(ball.regular_faces))


def _scattered(surface: MeshSurface, count: int, steps: int, seed: int) -> Float32Array:
    relaxation = Relaxation(surface, count=count, iterations=steps, seed=seed)
    relaxation.run()
    return relaxation.positions


def _darts(surface: MeshSurface, count: int, _steps: int, seed: int) -> Float32Array:
    """Return the darts of a random sequence that keep their distance from the earlier ones."""
    radius = DART_RHO * ideal_spacing(surface.area, count)
    darts, normals = surface.sample(DARTS * count, seed)
    order = np.random.default_rng(seed).permutation(len(darts))
    darts, normals = darts[order], normals[order]
    near = cKDTree(darts)
    free, kept = np.ones(len(darts), np.bool_), []
    for dart in range(len(darts)):
        if free[dart]:
            kept.append(dart)
            close = np.asarray(near.query_ball_point(darts[dart], radius))
            free[close[normals[close] @ normals[dart] > 0.0]] = False
    return darts[kept]


def _lloyd(surface: MeshSurface, count: int, _steps: int, seed: int) -> Float32Array:
    """Move each point to the mean of the samples that are nearest to it, again and again."""
    samples, facings = (values.astype(np.float64) for values in surface.sample(CANDIDATES * count, seed))
    spacing = ideal_spacing(surface.area, count)
    points, normals = surface.sample(count, seed + 1)
    for _ in range(ROUNDS):
        # Normals as further coordinates keep the sides of thin bodies apart.
        tree = cKDTree(np.hstack([points, 2.0 * spacing * normals]))
        _, owner = tree.query(np.hstack([samples, 2.0 * spacing * facings]))
        sizes = np.maximum(np.bincount(owner, minlength=count), 1)
        sums = [np.bincount(owner, samples[:, axis], minlength=count) for axis in range(3)]
        means: Float64Array = np.stack(sums, axis=1) / sizes[:, None]
        points, normals = surface.project(means)
    return points


METHODS = {"scatter": _scattered, "darts": _darts, "lloyd": _lloyd}
"""Methods by name."""

PLAIN = Grid(count=[1000], bumps=[0.0], thickness=[1.0])

experiment = evenness
design = (
    PLAIN * (Grid(method=["scatter"], steps=[10, 30, 60, 150]) + Grid(method=["darts", "lloyd"], steps=[0]))
    + Grid(method=["scatter"], count=[1000], steps=[150])
    * (Grid(bumps=[0.1, 0.2, 0.3], thickness=[1.0]) + Grid(bumps=[0.0], thickness=[0.3, 0.1, 0.03]))
) * Seeds(3)
full = (
    (
        Grid(method=["scatter"], count=[1_000, 4_096, 20_000], steps=[5, 10, 20, 30, 60, 100, 150, 300])
        + Grid(method=["darts", "lloyd"], count=[1_000, 4_096], steps=[0])
    )
    * Grid(bumps=[0.0, 0.1, 0.2, 0.3], thickness=[1.0, 0.3, 0.1, 0.03, 0.01])
    * Seeds(10)
)
