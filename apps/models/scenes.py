"""Scenes to begin with, and names of new files."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from blobtree.files import exists
from decals import Camera, DecalImage, Scene
from decals.apps.views import parse_view
from decals.editing.recovery import numbered_paths, recovery_path
from decals.scenes.camera import Axes


def new_file(folder: Path, name: str, *, recover: bool = False) -> Path:
    """Return the first path that does not exist: NAME.json, NAME-2.json, ...

    Unless ``recover`` is True, nor do unsaved changes of it exist.
    """
    paths = numbered_paths(folder / f"{name}.json")
    return next(p for p in paths if not exists(p) and (recover or not exists(recovery_path(p))))


def empty_scene(images: Sequence[str], axes: Axes) -> Scene:
    """Return a scene without objects, whose camera looks at the origin."""
    where = parse_view(None, axes)
    corner = np.ones(3, np.float32)
    framed = Camera.framing((-corner, corner), direction=where.direction, up=where.up)
    eye = np.subtract(framed.position, framed.target)
    camera = replace(framed, position=tuple(eye.tolist()), target=(0.0, 0.0, 0.0))
    return Scene(objects=(), camera=camera, images=tuple(DecalImage.load(source) for source in images))
