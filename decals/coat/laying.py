"""From particles to decals: sizes, directions and images."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.checks import instance
from decals.coat.choosing import ImageChoice, at_random, by_rank, odds
from decals.coat.fields import bends
from decals.coat.jitter import Jitter
from decals.coat.orientation import Direction, check_direction, tangents
from decals.coat.sizing import Sizing, covering_radii, delaunay_radii, touching_radii
from decals.errors import InvalidSeeding
from decals.model import Decals
from decals.seeds.population import Sites, World
from decals.seeds.relaxation import Relaxation
from decals.wishes import number, whole

SAMPLES = 64
"""Samples for each decal from which its size is measured."""

FEWEST_SAMPLES = 4096
"""Samples at least, so that the few decals of a small population are measured as well."""

_SAMPLE_STREAM, _TRIAL_STREAM, _ANGLE_STREAM, _IMAGE_STREAM = 3, 4, 5, 6
_PLACE_STREAM, _SIZE_STREAM, _TURN_STREAM = 7, 8, 9


def lay(
    relaxation: Relaxation,
    *,
    seed: int = 0,
    sizing: Sizing = Sizing.COVERING,
    factor: float = 1.0,
    direction: Direction = None,
    images: int = 1,
    weights: ArrayLike | None = None,
    choice: ImageChoice = ImageChoice.RANDOM,
    jitter: Jitter | None = None,
) -> Decals:
    """Lay a decal on every particle; see `decals.seed` for what is wished for.

    Raises
    ------
    InvalidSeeding
        For a factor, direction, number of images or weights that make no sense.
    """
    instance(
        "relaxation", relaxation, Relaxation, InvalidSeeding, "seed(surfaces, ...) does both in one call"
    )
    whole("seed", seed)
    shares, disorder = wishes(factor, direction, images, weights, sizing, choice, jitter), jitter or Jitter()
    if relaxation.count == 0:
        return Decals.empty()
    spacings = relaxation.sizes_at(relaxation.positions)
    sites = disorder.places(
        relaxation.world, relaxation.sites, spacings, ~relaxation.fixed, _stream(seed, _PLACE_STREAM)
    )
    radii = disorder.sizes(
        factor * _radii(relaxation.world, sites, sizing, seed), _stream(seed, _SIZE_STREAM)
    )
    ways = tangents(sites.positions, sites.normals, direction, _stream(seed, _ANGLE_STREAM))
    if disorder.angle:
        ways = disorder.turns(ways, sites.normals, _stream(seed, _TURN_STREAM))
    return Decals(
        positions=sites.positions,
        normals=sites.normals,
        tangents=ways,
        radii=radii.astype(np.float32),
        images=_images(choice, shares, sites, radii, _stream(seed, _IMAGE_STREAM)),
    )


def wishes(
    factor: float,
    direction: Direction,
    images: int,
    weights: ArrayLike | None,
    sizing: Sizing,
    choice: ImageChoice,
    jitter: Jitter | None,
) -> NDArray[np.float64]:
    """Share of each image; `InvalidSeeding` if the wishes make no sense."""
    for name, value, kind in (("sizing", sizing, Sizing), ("choice", choice, ImageChoice)):
        if not isinstance(value, kind):
            known = ", ".join(str(member) for member in kind)
            raise InvalidSeeding(f"{name}: expected one of {known}, got {value!r}")
    if not isinstance(jitter, Jitter | None):
        raise InvalidSeeding(f"jitter: expected a Jitter, got {jitter!r}")
    number("factor", factor, "a number above 0", lambda value: value > 0)
    check_direction(direction)
    return odds(images, weights)


def _images(
    choice: ImageChoice,
    shares: NDArray[np.float64],
    sites: Sites,
    radii: NDArray[np.float64],
    stream: int,
) -> NDArray[np.int32]:
    if choice is ImageChoice.SIZE:
        return by_rank(shares, radii)
    if choice is ImageChoice.CURVATURE:
        return by_rank(shares, bends(sites.positions, sites.normals))
    return at_random(shares, len(sites), stream)


def _radii(world: World, sites: Sites, sizing: Sizing, seed: int) -> NDArray[np.float64]:
    """Radii by one of the rules; a surface too small for a share of the particles counts for nothing."""
    if sizing is Sizing.TOUCHING:
        return touching_radii(sites)
    counts = np.bincount(sites.surface_ids, minlength=len(world.surfaces))
    each = max(SAMPLES, FEWEST_SAMPLES // max(len(sites), 1))
    samples = world.sample(counts * each, stream=_SAMPLE_STREAM)
    if sizing is Sizing.DELAUNAY:
        return delaunay_radii(sites, samples)
    return covering_radii(
        sites, samples, lambda trials: _visible(world, trials), _stream(seed, _TRIAL_STREAM)
    )


def _visible(world: World, sites: Sites) -> Sites:
    """Put points back onto their own surfaces and drop those that may not lie there."""
    settled, allowed = world.settle(sites)
    return settled[np.flatnonzero(allowed)]


def _stream(seed: int, purpose: int) -> int:
    """Derive a seed for one purpose, so that a new wish for it leaves the others as they were."""
    return int(np.random.SeedSequence([seed, purpose]).generate_state(1, np.uint64)[0])
