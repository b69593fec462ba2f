"""Variation of decals: jitter of positions, radii and tangents, and the choice of images."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array
from blobtree.validation import items
from decals.errors import InvalidScattering
from decals.model import MAX_IMAGES
from decals.options import Values
from decals.scattering.domain import Domain, OrientedPoints
from decals.surfaces.surface import unit_rows
from decals.validation import allowed_number, count_number, real_array, whole_number


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


class ImageChoice(Enum):
    """Rules by which decals choose among several images; the weights set the share of each image.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> ball = decals.surfaces.ImplicitSurface(Point((0, 0, 0), radius=1.0))
    >>> chosen = decals.scatter(ball, count=40, images=2, choice=decals.scattering.ImageChoice.SIZE)
    >>> bool(chosen.radii[chosen.images == 0].max() <= chosen.radii[chosen.images == 1].min())
    True
    """

    RANDOM = "random"
    """At random."""
    SIZE = "size"
    """By radius: the first image for the smallest decals, the last for the largest."""
    CURVATURE = "curvature"
    """By curvature: the first image where the surface is flattest, the last where it bends most."""


def image_shares(images: int | Sequence[int], weights: ArrayLike | None) -> Float64Array:
    """Return the share of each image up to the last that has one, or raise `InvalidScattering`.

    `images` is a number of images, or the numbers of some; `weights` has one for each of them.
    """
    numbers = items(images)
    if numbers is None:
        count = count_number("images", images, 1, MAX_IMAGES, InvalidScattering)
    else:
        numbers = tuple(
            whole_number("images", number, 0, MAX_IMAGES - 1, InvalidScattering) for number in numbers
        )
        count = len(numbers)
        if count == 0 or len(set(numbers)) < count:
            raise InvalidScattering(f"images: expected different numbers of images, got {list(numbers)}")
    if weights is None:
        shares = np.full(count, 1.0 / count)
    else:
        values = real_array("weights", weights, InvalidScattering)
        if values.shape != (count,):
            raise InvalidScattering(f"weights: expected shape [{count}], got {list(values.shape)}")
        if not (np.isfinite(values).all() and (values >= 0).all() and values.sum() > 0):
            raise InvalidScattering("weights: expected finite numbers from 0 upward, one of them above 0")
        shares = values / values.sum()
    if numbers is None:
        return shares
    of_all = np.zeros(max(numbers) + 1)
    of_all[list(numbers)] = shares
    return of_all


def random_images(shares: Float64Array, count: int, seed: int) -> Int32Array:
    """Draw images at random by their shares, ``int32[count]``."""
    return np.random.default_rng(seed).choice(len(shares), size=count, p=shares).astype(np.int32)


def ranked_images(shares: Float64Array, values: Float64Array) -> Int32Array:
    """Assign images in the order of values, the first to the smallest, each by its share."""
    count = len(values)
    ranks = np.empty(count, np.int64)
    ranks[np.argsort(values, kind="stable")] = np.arange(count)
    levels = (ranks + 0.5) / max(count, 1)
    images = np.searchsorted(np.cumsum(shares)[:-1], levels, side="right")
    return images.astype(np.int32)
