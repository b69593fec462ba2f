"""Scenes to begin with, and names of new files."""

from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path

import numpy as np

from decals import Camera, DecalImage, Scene
from decals.apps.views import Axes, parse_view


def new_file(folder: Path, name: str) -> Path:
    """Return the first path that does not exist: NAME.json, NAME-2.json, ..."""
    endings = chain([""], (f"-{number}" for number in count(2)))
    paths = (folder / f"{name}{ending}.json" for ending in endings)
    return next(path for path in paths if not path.exists())


def empty_scene(images: Sequence[str], axes: Axes) -> Scene:
    """Return a scene without objects, whose camera looks at the origin."""
    where = parse_view(None, axes)
    corner = np.ones(3, np.float32)
    camera = Camera.framing((-corner, corner), direction=where.direction, up=where.up)
    return Scene(objects=(), camera=camera, images=tuple(DecalImage.load(source) for source in images))
