"""Where pictures are taken from: presets and directions, and a camera that fits the objects closely."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decals.errors import DecalsError
from decals.scenes.camera import Camera
from decals.scenes.scene import MeshObject, SceneObject, bounds_of

from .errors import UsageError

Vector = tuple[float, float, float]
Size = tuple[int, int]
Floats = NDArray[np.float64]

THREE_QUARTER = "three-quarter"
PRESETS: dict[str, Vector] = {
    THREE_QUARTER: (0.55, 0.35, 1.0),
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}
"""Directions toward the camera by name, as parts to the right, upward, and toward the front."""

_MARGIN = 1.08
_SAMPLES = 4000


@dataclass(frozen=True)
class Axes:
    """Which way a model stands: unit vectors upward and toward its front."""

    up: Vector
    front: Vector

    def preset(self, name: str) -> Vector:
        """Direction of a preset in the model's own coordinates."""
        right = np.cross(self.up, self.front)
        x, y, z = (np.asarray(PRESETS[name]) @ np.array([right, self.up, self.front])).tolist()
        return x, y, z


UPRIGHT = {
    "x": Axes((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "y": Axes((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "z": Axes((0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
}
"""Axes by the name of the one that points upward."""


@dataclass(frozen=True)
class View:
    """A direction toward the camera, and the one that is up in the picture."""

    direction: Vector
    up: Vector


def parse_view(camera: str | None, axes: Axes) -> View:
    """Read ``--camera``: a preset of `PRESETS`, or a direction ``"x,y,z"`` toward the camera.

    Raises
    ------
    UsageError
        If it is neither.
    """
    name = camera or THREE_QUARTER
    if name in PRESETS:
        return View(axes.preset(name), axes.up)
    try:
        x, y, z = (float(part) for part in name.split(","))
    except ValueError:
        presets = ", ".join(PRESETS)
        raise UsageError(
            f"--camera: expected {presets}, or a direction such as 1,0.5,2; got {camera!r}"
        ) from None
    if not 0.0 < math.hypot(x, y, z) < math.inf:
        raise UsageError(f"--camera: expected a finite direction other than 0,0,0; got {camera!r}")
    return View((x, y, z), axes.up)


def frame(objects: Sequence[SceneObject], view: View, size: Size) -> Camera:
    """Look at objects so that they just fill a picture of this size.

    Of all eyes that look in the view's direction, the nearest one that sees every point of the surfaces. Each
    edge of the picture is a plane through the eye; two opposite ones fix its place across and its distance.

    Raises
    ------
    UsageError
        If the objects are too large or too small for a camera.
    """
    aspect = size[0] / size[1]
    try:
        base = Camera.framing(bounds_of(objects), direction=view.direction, up=view.up, aspect=aspect)
    except DecalsError as error:
        raise UsageError(f"no camera sees the model: {error}") from error
    half = math.tan(math.radians(base.fov) / 2) / _MARGIN
    x, y, z = base.axes @ (_points(objects) - np.asarray(base.target)).T
    across, far_x = _between(x, z, half * aspect)
    above, far_y = _between(y, z, half)
    distance = max(far_x, far_y)
    middle = float(z.mean())
    if not distance > middle:  # all points in one place
        return base
    eye, target = (
        np.asarray(base.target) + np.array([across, above, depth]) @ base.axes for depth in (distance, middle)
    )
    return Camera(_triple(eye), _triple(target), base.up, base.fov)


def _between(x: Floats, z: Floats, slope: float) -> tuple[float, float]:
    """Place and distance of the nearest eye, looking along -z, that sees (x, z) between two planes."""
    right, left = float((x + slope * z).max()), float((-x + slope * z).max())
    return 0.5 * (right - left), 0.5 * (right + left) / slope


def _points(objects: Sequence[SceneObject]) -> Floats:
    """All vertices of meshes, and many points of other surfaces."""
    parts = [
        item.vertices if isinstance(item, MeshObject) else item.surface.sample(_SAMPLES, seed=0)[0]
        for item in objects
    ]
    return np.concatenate(parts).astype(np.float64)


def _triple(vector: Floats) -> Vector:
    x, y, z = vector.tolist()
    return x, y, z
