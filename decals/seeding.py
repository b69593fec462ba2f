"""From surfaces to decals in one call."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.progress import Progress
from decals.errors import InvalidSeeding
from decals.model import Decals
from decals.orientation import Direction, tangents
from decals.population import Density, Mask, Sites, World
from decals.relaxation import Relaxation
from decals.sizing import Sizing, covering_radii, delaunay_radii, touching_radii
from decals.surface import Surface

SAMPLES = 64
"""Samples for each decal from which its size is measured."""

FEWEST_SAMPLES = 4096
"""Samples at least, so that the few decals of a small population are measured as well."""

SPREADING = 0.8
"""Part of the whole work that the relaxation takes, for progress bars."""

_SAMPLE_STREAM, _TRIAL_STREAM, _ANGLE_STREAM, _IMAGE_STREAM = 3, 4, 5, 6


def seed(
    surfaces: Surface | Sequence[Surface],
    *,
    count: int | None = None,
    spacing: float | None = None,
    seed: int = 0,
    density: Density | None = None,
    mask: Mask | None = None,
    fixed: ArrayLike | None = None,
    sizing: Sizing = Sizing.COVERING,
    factor: float = 1.0,
    direction: Direction = None,
    images: int = 1,
    weights: ArrayLike | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Decals:
    """Cover surfaces with decals that lie evenly and leave no gap.

    One call over `Relaxation`, `covering_radii` and `tangents`.

    Parameters
    ----------
    surfaces
        One surface, or several that are covered by one coat.
    count
        How many decals, exactly, those on fixed places included.
    spacing
        In place of the count: distance of neighbours; as many as fit follow.
    seed
        From 0 upward; the same one gives the same decals.
    density, mask, fixed
        How densely decals lie, where they may lie, and places that are given: see `Relaxation`.
    sizing
        What decides how large decals are.
    factor
        Times that.
    direction
        Of the images' u axes: None (random), a vector, a function of ``points[n, 3]`` to vectors, or an
        `Orientation`.
    images
        How many images there are to choose from.
    weights
        How often each image is chosen, ``float[images]``; equally often by default.
    device
        Warp device on which seeds are spread, such as ``"cuda:0"``.
    progress
        Called with a stage in plain words and the fraction done.
    cancel
        Asked before every step whether to stop spreading; what has been reached is kept and covered.

    Raises
    ------
    InvalidSeeding
        For a count, spacing, seed, density, mask, factor, direction, number of images or weights that make no
        sense, or nothing to lie on.
    """
    given = [surfaces] if isinstance(surfaces, Surface) else list(surfaces)
    odds = _odds(images, weights)
    if not (np.isfinite(factor) and factor > 0):
        raise InvalidSeeding(f"factor: expected a number above 0, got {factor!r}")
    tell = progress or (lambda stage, fraction: None)
    relaxation = Relaxation(
        given,
        count=count,
        spacing=spacing,
        seed=seed,
        density=density,
        mask=mask,
        fixed=fixed,
        device=device,
    )
    relaxation.run(lambda stage, fraction: tell(stage, SPREADING * fraction), cancel=cancel)
    if relaxation.count == 0:
        return Decals.empty()
    tell("measuring sizes", SPREADING)
    radii = factor * sizes(relaxation, sizing, seed=seed)
    tell("measuring sizes", 1.0)
    return Decals(
        positions=relaxation.positions,
        normals=relaxation.normals,
        tangents=tangents(relaxation.positions, relaxation.normals, direction, _stream(seed, _ANGLE_STREAM)),
        radii=radii.astype(np.float32),
        images=_choose(odds, relaxation.count, _stream(seed, _IMAGE_STREAM)),
    )


def sizes(relaxation: Relaxation, sizing: Sizing = Sizing.COVERING, *, seed: int = 0) -> NDArray[np.float64]:
    """Radii of decals on the relaxed particles, ``float64[n]``; by default they leave no gap.

    A surface too small for a share of the particles counts for nothing.
    """
    world = relaxation.world
    if sizing is Sizing.TOUCHING:
        return touching_radii(relaxation.sites)
    counts = np.bincount(relaxation.surface_ids, minlength=len(world.surfaces))
    each = max(SAMPLES, FEWEST_SAMPLES // max(relaxation.count, 1))
    samples = world.sample(counts * each, stream=_SAMPLE_STREAM)
    if sizing is Sizing.DELAUNAY:
        return delaunay_radii(relaxation.sites, samples)
    return covering_radii(
        relaxation.sites, samples, lambda sites: visible(world, sites), _stream(seed, _TRIAL_STREAM)
    )


def visible(world: World, sites: Sites) -> Sites:
    """Put points back onto their own surfaces and drop those that may not lie there."""
    settled, allowed = world.settle(sites)
    return settled[np.flatnonzero(allowed)]


def _odds(images: int, weights: ArrayLike | None) -> NDArray[np.float64]:
    """Chance of each image."""
    if isinstance(images, bool) or not isinstance(images, int | np.integer) or images < 1:
        raise InvalidSeeding(f"images: expected a whole number of at least 1, got {images!r}")
    if weights is None:
        return np.full(images, 1.0 / images)
    odds = np.asarray(weights, dtype=np.float64)
    if odds.shape != (images,):
        raise InvalidSeeding(f"weights: expected shape [{images}], got {list(odds.shape)}")
    if not (np.isfinite(odds).all() and (odds >= 0).all() and odds.sum() > 0):
        raise InvalidSeeding("weights: expected finite numbers from 0 upward, one of them above 0")
    chances: NDArray[np.float64] = odds / odds.sum()
    return chances


def _choose(odds: NDArray[np.float64], count: int, stream: int) -> NDArray[np.int32]:
    return np.random.default_rng(stream).choice(len(odds), size=count, p=odds).astype(np.int32)


def _stream(seed: int, purpose: int) -> int:
    """Derive a seed for one purpose, so that a new wish for it leaves the others as they were."""
    return int(np.random.SeedSequence([seed, purpose]).generate_state(1, np.uint64)[0])
