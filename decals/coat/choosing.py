"""Which image each decal shows."""

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidSeeding
from decals.model import MOST_IMAGES
from decals.wishes import numbers, whole

Wide = NDArray[np.float64]


class ImageChoice(Enum):
    """What decides which image a decal shows; how many show each follows from the weights."""

    RANDOM = "random"
    """Chance."""
    SIZE = "size"
    """The decals' size: the first image for the smallest, the last for the largest."""
    CURVATURE = "curvature"
    """How much the surface bends: the first image where it is flattest, the last where it bends most."""


def odds(images: int, weights: ArrayLike | None) -> Wide:
    """Share of each image, ``float64[images]``; `InvalidSeeding` for numbers that are no shares."""
    whole("images", images, 1, most=MOST_IMAGES)
    if weights is None:
        return np.full(images, 1.0 / images)
    given = numbers("weights", weights)
    if given.shape != (images,):
        raise InvalidSeeding(f"weights: expected shape [{images}], got {list(given.shape)}")
    if not (np.isfinite(given).all() and (given >= 0).all() and given.sum() > 0):
        raise InvalidSeeding("weights: expected finite numbers from 0 upward, one of them above 0")
    shares: Wide = given / given.sum()
    return shares


def at_random(shares: Wide, count: int, seed: int) -> NDArray[np.int32]:
    """Draw images by their shares, ``int32[count]``."""
    return np.random.default_rng(seed).choice(len(shares), size=count, p=shares).astype(np.int32)


def by_rank(shares: Wide, values: Wide) -> NDArray[np.int32]:
    """Images in the order of values, the first for the smallest, each as often as its share says."""
    count = len(values)
    ranks = np.empty(count, np.int64)
    ranks[np.argsort(values, kind="stable")] = np.arange(count)
    levels = (ranks + 0.5) / max(count, 1)
    chosen = np.searchsorted(np.cumsum(shares)[:-1], levels, side="right")
    return chosen.astype(np.int32)
