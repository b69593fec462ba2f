"""From surfaces to decals in one call."""

from collections.abc import Callable, Sequence

from numpy.typing import ArrayLike

from blobtree.progress import Progress
from decals.coat.choosing import ImageChoice
from decals.coat.jitter import Jitter
from decals.coat.laying import lay, wishes
from decals.coat.orientation import Direction
from decals.coat.sizing import Sizing
from decals.model import Decals
from decals.seeds.polishing import CLOSE
from decals.seeds.population import Density, Mask, surfaces_of
from decals.seeds.relaxation import Relaxation
from decals.surfaces.surface import Surface
from decals.wishes import function_or_none, number

SPREADING = 0.8
"""Part of the whole work that the relaxation takes, for progress bars."""


def seed(
    surfaces: Surface | Sequence[Surface],
    *,
    count: int | None = None,
    spacing: float | None = None,
    seed: int = 0,
    density: Density | None = None,
    mask: Mask | None = None,
    fixed: ArrayLike | None = None,
    regularity: float = 1.0,
    sizing: Sizing = Sizing.COVERING,
    factor: float = 1.0,
    direction: Direction = None,
    images: int = 1,
    weights: ArrayLike | None = None,
    choice: ImageChoice = ImageChoice.RANDOM,
    jitter: Jitter | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Decals:
    """Cover surfaces with decals that lie evenly and leave no gap.

    One call over `Relaxation` and `lay`.

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
    regularity
        From 0, places as they are drawn, to 1, as even as can be; between, seeds are spread until the least
        distance is that part of what 1 comes to.
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
    choice
        What decides who shows which: chance, the decals' size, or how much the surface bends.
    jitter
        Chance in places, sizes and directions; none by default.
    device
        Warp device on which seeds are spread, such as ``"cuda:0"``.
    progress
        Called with a stage in plain words and the fraction done.
    cancel
        Asked before every step whether to stop spreading; what has been reached is kept and covered.

    Raises
    ------
    InvalidSeeding
        For a count, spacing, seed, density, mask, regularity, factor, direction, number of images or weights
        that make no sense, or nothing to lie on.
    """
    given = surfaces_of(surfaces)
    number("regularity", regularity, "a number from 0 to 1", lambda value: 0.0 <= value <= 1.0)
    function_or_none("progress", progress)
    wishes(factor, direction, images, weights, sizing, choice, jitter)  # before the long work, not after it
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
    if regularity > 0.0:
        relaxation.run(
            lambda stage, fraction: tell(stage, SPREADING * fraction),
            until=None if regularity == 1.0 else regularity * CLOSE,
            cancel=cancel,
        )
    tell("measuring sizes", SPREADING)
    decals = lay(
        relaxation,
        seed=seed,
        sizing=sizing,
        factor=factor,
        direction=direction,
        images=images,
        weights=weights,
        choice=choice,
        jitter=jitter,
    )
    tell("measuring sizes", 1.0)
    return decals
