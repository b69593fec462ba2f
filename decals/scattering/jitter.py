"""`Jitter`: random deviations of decals from their positions, radii and directions."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array
from decals.errors import InvalidScattering
from decals.options import Values
from decals.scattering.domain import Domain, OrientedPoints
from decals.surfaces.surface import unit_rows
from decals.validation import allowed_number


@dataclass(frozen=True)
class Jitter:
    """Random deviations of decals from their positions, radii and directions.

    Attributes
    ----------
    position
        Standard deviation of the position, in spacings. Radii are measured afterwards, so decals without
        gaps stay without gaps.
    size
        Standard deviation of the radius, as a share of it; factors are at most ``exp(3 size)``.
    angle
        Largest turn from the direction to either side, in degrees.

    Raises
    ------
    InvalidScattering
        If a value is not a number from 0 upward.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> ball = decals.surfaces.ImplicitSurface(Point((0, 0, 0), radius=1.0))
    >>> even = decals.scatter(ball, count=40)
    >>> uneven = decals.scatter(ball, count=40, jitter=decals.scattering.Jitter(size=0.3))
    >>> bool(uneven.radii.std() > even.radii.std())
    True
    """

    position: Annotated[float, Values(0.0, 1.0, "spacings")] = 0.0
    size: Annotated[float, Values(0.0, 1.0)] = 0.0
    angle: Annotated[float, Values(0.0, 180.0, "°")] = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "size", "angle"):
            value = getattr(self, name)
            allowed_number(
                f"{name} of a jitter",
                value,
                "a number from 0 upward",
                lambda given: given >= 0,
                InvalidScattering,
            )

    def move(
        self, domain: Domain, points: OrientedPoints, spacings: Float32Array, movable: BoolArray, seed: int
    ) -> OrientedPoints:
        """Return points moved on their surfaces; points that would be hidden or masked stay.

        Parameters
        ----------
        domain
            The surfaces.
        points
            The points, n of them.
        spacings : float32[n]
            Distances to neighbours in model units, of which `position` is a share.
        movable : bool[n]
            False for points that stay.
        seed
            Seed of the random steps.
        """
        if self.position == 0.0 or len(points) == 0:
            return points
        steps = np.random.default_rng(seed).normal(0.0, self.position, (len(points), 3)) * spacings[:, None]
        steps -= np.einsum("ni,ni->n", steps, points.normals)[:, None] * points.normals
        targets = OrientedPoints(
            (points.positions + steps).astype(np.float32), points.normals, points.surface_ids
        )
        moved, allowed = domain.project(targets)
        accepted = (allowed & movable)[:, None]
        return OrientedPoints(
            np.where(accepted, moved.positions, points.positions),
            np.where(accepted, moved.normals, points.normals),
            points.surface_ids,
        )

    def scale(self, radii: Float64Array, seed: int) -> Float64Array:
        """Return radii, ``float64[n]`` in model units, times random factors."""
        deviations = np.random.default_rng(seed).normal(0.0, 1.0, len(radii))
        scaled: Float64Array = radii * np.exp(self.size * np.clip(deviations, -3.0, 3.0))
        return scaled

    def turn(self, tangents: Float32Array, normals: Float32Array, seed: int) -> Float32Array:
        """Return unit tangents turned about the unit normals, ``float32[n, 3]`` each, by random angles."""
        shares = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(tangents), 1))
        angles = np.radians(self.angle) * shares
        return unit_rows(np.cos(angles) * tangents + np.sin(angles) * np.cross(normals, tangents))
