"""Scenes for measurements: a model under even decals, which cover it equally often at any count."""

import numpy as np

from decals.coat.seeding import seed
from decals.model import Decals
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, Scene
from implicit_decals.apps.measuring.coats import even_coat
from implicit_decals.apps.models.samples import axes_of, sample
from implicit_decals.apps.views import frame, parse_view


def bench_scene(
    model: str, count: int, size: tuple[int, int], *, image: str = "scale", seeded: bool = False
) -> Scene:
    """Make a sample under `count` decals, seen so that it fills a picture of this size.

    With `seeded`, the decals are those of `decals.seed`, as people have them.
    """
    item = sample(model)
    camera: Camera = frame([item], parse_view(None, axes_of(model)), size)
    return Scene(
        objects=(item,),
        camera=camera,
        decals=seed(item.surface, count=count) if seeded else even_coat(item.surface, count=count),
        images=(DecalImage.load(image),),
    )


def in_layers(decals: Decals) -> Decals:
    """Give decals any interaction, in three layers."""
    rng = np.random.default_rng(0)
    count = len(decals)
    return decals.replace(interactions=rng.integers(0, 3, count), layers=rng.integers(-1, 2, count))
