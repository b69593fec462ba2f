"""The ``--camera`` option: presets and directions of view."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from decals import Camera, ImplicitDecalsError, MeshObject
from decals.errors import InvalidInput
from decals.scenes.camera import PRESETS, Axes, Vector
from decals.scenes.cover import vertices_of
from decals.scenes.objects import SceneObject

Size = tuple[int, int]

THREE_QUARTER = "three-quarter"
_MARGIN = 1.08
_SAMPLES = 4000


@dataclass(frozen=True)
class View:
    """A direction toward the camera, and the one that is up in the picture."""

    direction: Vector
    up: Vector


def parse_view(camera: str | None, axes: Axes) -> View:
    """Read ``--camera``: a preset of `PRESETS`, or a direction ``"x,y,z"`` toward the camera.

    Raises
    ------
    InvalidInput
        If it is neither.
    """
    name = camera or THREE_QUARTER
    if name in PRESETS:
        return View(axes.preset(name), axes.up)
    try:
        x, y, z = (float(part) for part in name.split(","))
    except ValueError:
        presets = ", ".join(PRESETS)
        raise InvalidInput(
            f"--camera: expected {presets}, or a direction such as 1,0.5,2; got {camera!r}"
        ) from None
    if not 0.0 < math.hypot(x, y, z) < math.inf:
        raise InvalidInput(f"--camera: expected a finite direction other than 0,0,0; got {camera!r}")
    return View((x, y, z), axes.up)


def frame(objects: Sequence[SceneObject], view: View, size: Size) -> Camera:
    """Return a camera that looks at objects so that they fill a picture of this size.

    The camera moves for pictures of other aspect ratios; see `Camera.at`.

    Raises
    ------
    InvalidInput
        If the objects are too large or too small for a camera.
    """
    outermost = np.concatenate([vertices_of(item) for item in objects])
    points = np.concatenate(
        [
            vertices_of(item) if isinstance(item, MeshObject) else item.surface.sample(_SAMPLES, seed=0)[0]
            for item in objects
        ]
    )
    aspect = size[0] / size[1]
    options: dict[str, Any] = {"direction": view.direction, "up": view.up, "margin": _MARGIN}
    try:
        camera = Camera.fitting(points, aspect=aspect, **options)
        if not camera.shows(outermost, aspect):
            camera = Camera.fitting(outermost, aspect=aspect, **options)
        return camera.fitted_to(outermost, margin=_MARGIN)
    except ImplicitDecalsError as error:
        raise InvalidInput(f"no camera sees the model: {error}") from error
