"""A relaxation whose steps are kept, so that a slider goes back and forth in it."""

import time

import numpy as np

from blobtree._typing import Float32Array
from decals.apps.lab.experiment import Relaxed
from decals.editing.queries import SurfacePoints
from decals.scattering.neighbors import spacing_of_points
from decals.scattering.relaxation import Relaxation
from decals.scenes.objects import SceneObject


class Recording:
    """The steps of a relaxation so far.

    Parameters
    ----------
    objects
        The surfaces.
    count
        Number of particles.
    seed
        Seed of the random numbers.
    iterations
        Steps of the schedule.
    """

    def __init__(self, objects: tuple[SceneObject, ...], count: int, seed: int, iterations: int) -> None:
        surfaces = [item.surface for item in objects]
        self._relaxation = Relaxation(surfaces, count=count, seed=seed, iterations=iterations)
        self.seed, self.iterations = seed, iterations
        self._points: list[SurfacePoints] = []
        self._measures: list[tuple[float, float, float]] = []
        self._keep()

    def _keep(self) -> None:
        points, solver = self._relaxation.points, self._relaxation
        sizes = solver.sizes_at(points.positions)
        spacing = spacing_of_points(points.positions, points.normals, sizes, solver.spacing)
        energy = solver.energy or float("nan")  # 0: it is not known at the start and at the end
        self._points.append(SurfacePoints(points.positions, points.normals, points.surface_ids))
        self._measures.append((energy, spacing.rho, spacing.cv))

    def advance(self, step: int, seconds: float) -> int:
        """Take steps until a step is known, or for so long; return the last one that is known."""
        end = time.monotonic() + seconds
        while len(self._points) <= step and time.monotonic() < end:
            self._relaxation.step()
            self._keep()
        return min(step, len(self._points) - 1)

    def points(self, step: int) -> SurfacePoints:
        """Return the particles after a step."""
        return self._points[step]

    def step_of(self, positions: Float32Array) -> int | None:
        """Return the step after which the particles were here, or None."""
        steps = range(len(self._points))
        return next((s for s in steps if np.array_equal(self._points[s].positions, positions)), None)

    def relaxed(self, step: int) -> Relaxed:
        """Return the measures so far."""
        return Relaxed(step, *(tuple(column) for column in zip(*self._measures, strict=True)))
