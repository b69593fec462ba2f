"""The decals that ``render`` and ``edit`` scatter."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from blobtree import Progress
from decals import DecalImage, Scene, scatter
from decals.apps.commands.options import DEFAULT_IMAGES, MAX_DECALS, MAX_SEED, Scattered, check_count
from decals.apps.commands.progress_bars import PREPARING
from decals.apps.views import Size, View, frame
from decals.errors import InvalidInput
from decals.scenes.objects import SceneObject
from decals.scenes.recipe import Recipe

DEFAULT_COUNT = 500


def refuse_scattering(given: Scattered, table: Path | None) -> None:
    """Raise InvalidInput for options of scattered decals, where a scene or a table has its own decals.

    Decals of a table take images.
    """
    if given.decals is not None or given.seed is not None or (given.image and table is None):
        raise InvalidInput(
            "a saved scene or table has its own decals; leave out --decals, --seed, and --image of a scene"
        )


@dataclass(frozen=True)
class ScatterOptions:
    """Number, images and random seed of the decals."""

    count: int
    images: tuple[DecalImage, ...]
    seed: int

    @classmethod
    def of(cls, given: Scattered) -> "ScatterOptions":
        """Check the options of a command, fill in the defaults and read the images."""
        count, seed = DEFAULT_COUNT if given.decals is None else given.decals, given.seed or 0
        check_count("--decals", count, 0, MAX_DECALS)
        check_count("--seed", seed, 0, MAX_SEED)
        return cls(count, tuple(DecalImage.load(source) for source in given.image or DEFAULT_IMAGES), seed)

    def scene(self, objects: Sequence[SceneObject], view: View, size: Size, progress: Progress) -> Scene:
        """Return a scene of the objects covered with decals, and a camera that shows them."""
        progress(PREPARING, 0.0)
        decals = scatter(
            [item.surface for item in objects],
            count=self.count,
            seed=self.seed,
            images=len(self.images),
            progress=progress,
        )
        recipe = Recipe.of(
            "decals.scatter",
            seed=self.seed,
            models=[item.name for item in objects],
            count=self.count,
            images=[image.source for image in self.images],
        )
        return Scene(
            recipe=recipe.giving(decals, objects),
            objects=tuple(objects),
            camera=frame(objects, view, size),
            images=self.images,
            decals=decals,
        )
