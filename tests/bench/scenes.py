"""Scenes for benchmarks: a model under decals whose coverage does not depend on their number."""

from pathlib import Path

import numpy as np

from decals import Camera, DecalImage, Decals, Scene, scatter
from decals.apps.models.figure_14 import even_decals
from decals.apps.models.samples import axes_of, sample
from decals.apps.views import frame, parse_view
from decals.scenes.objects import as_object


def bench_scene(
    model: str, count: int, size: tuple[int, int], *, image: str = "scale", scattered: bool = False
) -> Scene:
    """Return a sample or a mesh file with `count` decals, and a camera from which it fills a picture.

    With `scattered`, `decals.scatter` distributes the decals, otherwise `even_decals`.
    """
    item = as_object(model, "model") if Path(model).is_file() else sample(model)
    camera: Camera = frame([item], parse_view(None, axes_of(model)), size)
    return Scene(
        objects=(item,),
        camera=camera,
        decals=scatter(item.surface, count=count) if scattered else even_decals(item.surface, count=count),
        images=(DecalImage.load(image),),
    )


def in_layers(decals: Decals) -> Decals:
    """Return the decals with random interactions in three layers."""
    rng = np.random.default_rng(0)
    count = len(decals)
    return decals.replace(interactions=rng.integers(0, 3, count), layers=rng.integers(-1, 2, count))
