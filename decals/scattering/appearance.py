"""Decals of oriented points: radii, tangents and images by a set of rules."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from decals.errors import InvalidScattering
from decals.model import Decals
from decals.scattering.covering import covering_radii
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.gap_filling import EVEN, center_outsized
from decals.scattering.mean_normals import mean_normals
from decals.scattering.neighbors import NearestFacing
from decals.scattering.orientation import Direction, as_direction, max_curvatures, tangents
from decals.scattering.sizing import Sizing, delaunay_radii, touching_radii
from decals.scattering.turned_normals import turned_normals
from decals.scattering.variation import ImageChoice, Jitter, image_shares, random_images, ranked_images
from decals.validation import member, real_number

SAMPLES_PER_DECAL = 64
"""Samples for each decal from which its radius is measured."""

MIN_SAMPLES = 4096
"""Least number of samples, so that the radii of few decals are accurate as well."""

LARGEST_ON_THIN_PARTS = 6.0
"""Largest covering radius over the expected one where parts may be thinner than decals lie apart.

On a hair, a decal has its area in a piece that is far longer than its radius.
"""

EXPECTED_RADIUS = 0.6
"""Radius of a decal before it is measured, in spacings: that of a hexagonal tiling without gaps."""

_SAMPLE_STREAM, _TRIAL_STREAM, _ANGLE_STREAM, _IMAGE_STREAM = 3, 4, 5, 6
_POSITION_JITTER_STREAM, _SIZE_JITTER_STREAM, _ANGLE_JITTER_STREAM = 7, 8, 9


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
    images: int = 1
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
            images: int = 1,
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
        real_number(
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
        """
        jitter = self.jitter or Jitter()
        points = jitter.move(domain, points, spacings, movable, _stream(seed, _POSITION_JITTER_STREAM))
        images_at = points
        points, radii = self._with_radii(domain, points, spacings, movable, seed)
        radii = jitter.scale(self.factor * radii, _stream(seed, _SIZE_JITTER_STREAM))
        directions = tangents(points.positions, points.normals, self.direction, _stream(seed, _ANGLE_STREAM))
        if jitter.angle:
            directions = jitter.turn(directions, points.normals, _stream(seed, _ANGLE_JITTER_STREAM))
        return Decals(
            positions=points.positions,
            normals=points.normals,
            tangents=directions,
            radii=radii.astype(np.float32),
            images=self._chosen_images(images_at, radii, seed),
            spill=domain.one_sided(points),
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

        For covering radii at even density, some are moved by `center_outsized` and turned by
        `turned_normals`.

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

        def project(trials: OrientedPoints) -> tuple[OrientedPoints, Int64Array]:
            projected, allowed = domain.project(trials)
            rows = np.flatnonzero(allowed)
            return projected[rows], rows

        expected = EXPECTED_RADIUS * spacings.astype(np.float64)
        bent = self._with_mean_normals(domain, centers, spacings)
        bent_at = centers.positions
        nearest = NearestFacing(samples.positions, samples.normals)

        def aim(centers: OrientedPoints) -> OrientedPoints:
            nonlocal bent, bent_at
            moved = np.flatnonzero((centers.positions != bent_at).any(axis=1))
            normals = bent.normals.copy()
            normals[moved] = self._with_mean_normals(domain, centers[moved], spacings[moved]).normals
            bent = OrientedPoints(centers.positions, normals, centers.surface_ids)
            bent_at = centers.positions
            normals = turned_normals(bent, centers.normals, samples, nearest, expected)
            return OrientedPoints(centers.positions, normals, centers.surface_ids)

        even = bool(spacings.max() <= EVEN * spacings.min())
        decals = center_outsized(domain, centers, movable, spacings, samples, aim) if even else aim(centers)
        trials = _stream(seed, _TRIAL_STREAM)
        radii = covering_radii(
            decals,
            samples,
            project,
            trials,
            shade=domain.shaded,
            even=even,
            nearest=nearest,
            bounds=LARGEST_ON_THIN_PARTS * expected if domain.has_thin_parts else None,
        )
        return decals, radii

    def _chosen_images(self, points: OrientedPoints, radii: Float64Array, seed: int) -> Int32Array:
        if self.choice is ImageChoice.SIZE:
            return ranked_images(self._shares, radii)
        if self.choice is ImageChoice.CURVATURE:
            return ranked_images(self._shares, max_curvatures(points.positions, points.normals))
        return random_images(self._shares, len(points), _stream(seed, _IMAGE_STREAM))


def _stream(seed: int, purpose: int) -> int:
    """Derive a seed for one purpose, so that a change of one option does not affect the others."""
    return int(np.random.SeedSequence([seed, purpose]).generate_state(1, np.uint64)[0])
