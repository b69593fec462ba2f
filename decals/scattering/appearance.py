"""Decals of oriented points: radii, tangents and images by a set of rules."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.validation import items
from decals.errors import InvalidScattering
from decals.model import MAX_IMAGES, Decals
from decals.scattering.decal_normals import mean_normals
from decals.scattering.domain import Density, Domain, Mask, OrientedPoints
from decals.scattering.extras import RULES
from decals.scattering.jitter import Jitter
from decals.scattering.orientation import Direction, as_direction, max_curvatures, tangents
from decals.scattering.sizing import EXPECTED_RADIUS, Sizing, delaunay_radii, touching_radii
from decals.validation import allowed_number, count_number, member, real_array, whole_number

SAMPLES_PER_DECAL = 64
"""Samples for each decal from which its radius is measured."""

MIN_SAMPLES = 4096
"""Least number of samples, so that the radii of few decals are accurate as well."""

_SAMPLE_STREAM, _TRIAL_STREAM, _ANGLE_STREAM, _IMAGE_STREAM = 3, 4, 5, 6
_POSITION_JITTER_STREAM, _SIZE_JITTER_STREAM, _ANGLE_JITTER_STREAM, _ZONE_STREAM = 7, 8, 9, 10


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


class PlacedZones(Protocol):
    """Zones on surfaces: what `Zones.placed_on` returns."""

    @property
    def density(self) -> Density | None:
        """Relative density of decals; None if it is the same everywhere."""
        ...

    @property
    def spacing(self) -> float | None:
        """Distance of neighbours where the density is 1; None if the zones do not state it."""
        ...

    def mask(self, points: Float32Array) -> BoolArray:
        """Return True where a zone is."""
        ...

    def styles(
        self, base: "Appearance", positions: Float32Array, seed: int
    ) -> "list[tuple[Appearance, Int64Array]]":
        """Return appearances, and the rows of the decals (n, 3) that each is for; together all rows."""
        ...


class ZonesOfModels(Protocol):
    """Zones for `scatter`: `decals.scattering.Zones`."""

    def placed_on(
        self, models: object, *, density: Density | None, mask: Mask | None, seed: int, device: str
    ) -> PlacedZones:
        """Return the zones on models."""
        ...


@dataclass(frozen=True, eq=False)
class Appearance:
    """Rules for the radii, tangents and images of decals; `decals.scatter` documents the attributes.

    Raises
    ------
    InvalidScattering
        For a sizing, factor, direction, number of images, weights, choice or jitter of the wrong kind.
    """

    sizing: Sizing = Sizing.COVERING
    factor: float = 1.0
    direction: Direction = None
    images: int | Sequence[int] = 1
    weights: ArrayLike | None = None
    choice: ImageChoice = ImageChoice.RANDOM
    jitter: Jitter | None = None
    _shares: Float64Array = field(init=False)

    if TYPE_CHECKING:  # names of rules are converted

        def __init__(
            self,
            sizing: Sizing | str = Sizing.COVERING,
            factor: float = 1.0,
            direction: Direction = None,
            images: int | Sequence[int] = 1,
            weights: ArrayLike | None = None,
            choice: ImageChoice | str = ImageChoice.RANDOM,
            jitter: Jitter | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        checked = {
            "sizing": member("sizing", self.sizing, Sizing, InvalidScattering),
            "choice": member("choice", self.choice, ImageChoice, InvalidScattering),
            "direction": as_direction(self.direction),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if not isinstance(self.jitter, Jitter | None):
            raise InvalidScattering(f"jitter: expected a Jitter, got {self.jitter!r}")
        allowed_number(
            "factor",
            self.factor,
            "a number above 0, at most 1e6",
            lambda value: 0 < value <= 1e6,
            InvalidScattering,
        )
        object.__setattr__(self, "_shares", image_shares(self.images, self.weights))

    def decals_of(
        self,
        points: OrientedPoints,
        domain: Domain,
        spacings: Float32Array,
        movable: BoolArray,
        *,
        seed: int,
        zones: "PlacedZones | None" = None,
    ) -> Decals:
        """Return a decal for each point.

        Parameters
        ----------
        points
            Centres of the decals before jitter, sorted by surface.
        domain
            The surfaces of the points.
        spacings
            Spacing at each point, ``float32[n]``.
        movable
            True for points that jitter may move, ``bool[n]``.
        seed
            Seed of all random choices.
        zones
            Zones with factors, directions and images of their own; this appearance is that of points outside.
        """
        if self.jitter is not None:
            stream = _stream(seed, _POSITION_JITTER_STREAM)
            points = self.jitter.move(domain, points, spacings, movable, stream)
        images_at = points
        points, radii = self._with_radii(domain, points, spacings, movable, seed)
        styles = [(self, np.arange(len(points)))]
        if zones is not None:
            parts = zones.styles(self, points.positions, _stream(seed, _ZONE_STREAM))
            styles = [(style, rows) for style, rows in parts if len(rows)]
        factors, directions = np.ones(len(points)), np.zeros((len(points), 3), np.float32)
        for style, rows in styles:
            factors[rows] = style.factor
            directions[rows] = style._directions(points, rows, _stream(seed, _ANGLE_STREAM))
        radii = factors * radii
        if self.jitter is not None:
            radii = self.jitter.scale(radii, _stream(seed, _SIZE_JITTER_STREAM))
        chosen = np.zeros(len(points), np.int32)
        for style, rows in styles:
            chosen[rows] = style._chosen_images(images_at, radii, rows, seed)
        if self.jitter is not None and self.jitter.angle:
            directions = self.jitter.turn(directions, points.normals, _stream(seed, _ANGLE_JITTER_STREAM))
        return Decals(
            positions=points.positions,
            normals=points.normals,
            tangents=directions,
            radii=radii.astype(np.float32),
            images=chosen,
            spill=domain.one_sided(points),
            single_sheets=None if points.heights is None else np.isfinite(points.heights),
        )

    def _with_mean_normals(
        self, domain: Domain, points: OrientedPoints, spacings: Float32Array
    ) -> OrientedPoints:
        """Return points with the mean normals of the surfaces where these bend sharply."""

        def near(trials: Float32Array, rows: Int64Array) -> tuple[Float32Array, Float32Array, Int64Array]:
            return domain.near(trials, points.surface_ids[rows])

        radii = self.factor * EXPECTED_RADIUS * spacings.astype(np.float64)
        normals = mean_normals(points.positions, points.normals, radii, near)
        return OrientedPoints(points.positions, normals, points.surface_ids)

    def _with_radii(
        self,
        domain: Domain,
        centers: OrientedPoints,
        spacings: Float32Array,
        movable: BoolArray,
        seed: int,
    ) -> tuple[OrientedPoints, Float64Array]:
        """Return the decals at centres, with their own normals, and radii by the sizing.

        A surface without particles is not sampled.
        """
        if self.sizing is Sizing.TOUCHING:
            points = self._with_mean_normals(domain, centers, spacings)
            return points, touching_radii(points)
        counts = np.bincount(centers.surface_ids, minlength=len(domain.surfaces))
        samples_per_decal = max(SAMPLES_PER_DECAL, MIN_SAMPLES // max(len(centers), 1))
        samples = domain.sample(counts * samples_per_decal, stream=_SAMPLE_STREAM)
        if self.sizing is Sizing.DELAUNAY:
            points = self._with_mean_normals(domain, centers, spacings)
            return points, delaunay_radii(points, samples)

        aim = partial(self._with_mean_normals, domain)
        return RULES[self.sizing](
            domain, centers, spacings, movable, samples, aim, _stream(seed, _TRIAL_STREAM)
        )

    def _directions(self, points: OrientedPoints, rows: Int64Array, seed: int) -> Float32Array:
        """Return the tangents of some of the points; those of the others decide on a surface's directions."""
        if callable(self.direction):
            return tangents(points.positions[rows], points.normals[rows], self.direction, seed)
        return tangents(points.positions, points.normals, self.direction, seed)[rows]

    def _chosen_images(
        self, points: OrientedPoints, radii: Float64Array, rows: Int64Array, seed: int
    ) -> Int32Array:
        """Return the images of some of the points."""
        if self.choice is ImageChoice.SIZE:
            return ranked_images(self._shares, radii[rows])
        if self.choice is ImageChoice.CURVATURE:
            return ranked_images(self._shares, max_curvatures(points.positions, points.normals)[rows])
        return random_images(self._shares, len(points), _stream(seed, _IMAGE_STREAM))[rows]


def _stream(seed: int, purpose: int) -> int:
    """Derive a seed for one purpose, so that a change of one option does not affect the others."""
    return int(np.random.SeedSequence([seed, purpose]).generate_state(1, np.uint64)[0])


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
