"""The coat of decals that ``render`` and ``view`` lay over models."""

from collections.abc import Sequence
from dataclasses import dataclass

from blobtree import Progress
from decals.coat.seeding import seed as seed_decals
from decals.scenes.scene import DecalImage, Scene, SceneObject

from ..views import Size, View, frame
from .options import MAX_DECALS, MAX_SEED, check_count
from .progress_bars import FINDING

DEFAULT_COUNT = 500
DEFAULT_IMAGES = ("scale",)


@dataclass(frozen=True)
class Coat:
    """The decals that somebody asked for."""

    count: int
    images: tuple[DecalImage, ...]
    seed: int

    @classmethod
    def asked(cls, count: int | None, images: Sequence[str] | None, seed: int | None) -> "Coat":
        """Check what was asked, fill in the defaults and read the images."""
        count, seed = DEFAULT_COUNT if count is None else count, seed or 0
        check_count("--decals", count, 0, MAX_DECALS)
        check_count("--seed", seed, 0, MAX_SEED)
        return cls(count, tuple(DecalImage.load(source) for source in images or DEFAULT_IMAGES), seed)

    def scene(self, objects: Sequence[SceneObject], view: View, size: Size, progress: Progress) -> Scene:
        """Cover objects with the decals and look at them."""
        progress(FINDING, 0.0)
        return Scene(
            objects=tuple(objects),
            camera=frame(objects, view, size),
            images=self.images,
            decals=seed_decals(
                [item.surface for item in objects],
                count=self.count,
                seed=self.seed,
                images=len(self.images),
                progress=progress,
            ),
        )
