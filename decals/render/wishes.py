"""Checks of what people want a picture of: a scene, a size, a place to look from."""

from typing import Any

from decals.checks import shown, whole
from decals.errors import InvalidScene
from decals.render.scene_like import SceneLike
from decals.scenes.viewpoint import Viewpoint

MOST_PIXELS = 1 << 20
"""Along each side of a picture."""
MOST_SAMPLES = 1024
"""Along each axis of a pixel."""


def check_size(size: Any, samples: Any) -> None:
    """Refuse pictures without pixels, and larger ones than anybody has memory for."""
    try:
        width, height = size
    except (TypeError, ValueError, KeyError):
        raise InvalidScene(f"size: expected width and height in pixels, got {shown(size)}") from None
    for side in (width, height):
        whole("size", side, 1, MOST_PIXELS, InvalidScene)
    whole("samples", samples, 1, MOST_SAMPLES, InvalidScene)


def check_scene(scene: object) -> None:
    """Refuse what has no objects, decals and images to draw."""
    if not all(hasattr(scene, name) for name in ("objects", "decals", "images")):
        raise InvalidScene(f"scene: expected a Scene, got {shown(scene)}; decals.cover makes one")


def viewpoint_of(scene: SceneLike, viewpoint: Viewpoint | None) -> Viewpoint:
    """Where a picture is taken from: by the scene's camera, if nobody says otherwise."""
    found: Any = getattr(scene, "camera", None) if viewpoint is None else viewpoint
    if isinstance(found, type) or not (hasattr(found, "clip_matrix") and hasattr(found, "rays")):
        raise InvalidScene(f"viewpoint: expected a Camera or a Projection, got {shown(found)}")
    looking: Viewpoint = found
    return looking
