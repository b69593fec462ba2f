"""Where a picture is taken from: view and projection matrices, and the rays of the pixels.

Matrices act on columns, ``M @ (x, y, z, 1)``, as in OpenGL; they are float64, and the renderer rounds the
product, not the factors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from decals.checks import finite, triple
from decals.errors import InvalidScene
from decals.scenes.viewpoint import Bounds, Floats, Rays

Vector = tuple[float, float, float]

NEAR_OVER_FAR = 1e-4
"""The near plane comes no closer than this fraction of the far one, for the depth buffer's sake."""
DIRECTION = (0.35, 0.25, 1.0)
"""Where pictures are taken from, unless somebody says otherwise: from the model toward the eye."""
PARALLEL = 1e-9
"""Sine below which two directions count as parallel."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A perspective camera.

    Parameters
    ----------
    position, target
        The eye, and the point in the middle of the picture, in the scene's units.
    up
        Any direction that is not along the view; the picture's upward one.
    fov
        Vertical angle of view in degrees, between 0 and 180.

    Raises
    ------
    InvalidScene
        Something is not finite, position and target coincide, or ``up`` is zero or along the view.
    """

    position: Vector
    target: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 30.0

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            object.__setattr__(self, name, _vector(name, getattr(self, name)))
        object.__setattr__(self, "fov", finite("a camera's fov", self.fov, InvalidScene))
        if not 0.0 < self.fov < 180.0:
            raise InvalidScene(f"a camera's fov must lie between 0 and 180 degrees, got {self.fov}")
        scale = max(abs(x) for x in (*self.position, *self.target))
        if not self.distance > 1e-12 * scale:
            raise InvalidScene(
                f"a camera's position and target coincide at {self.position}; move one of them"
            )
        if math.hypot(*self.up) == 0.0 or _parallel(np.array(self.up), self._back):
            raise InvalidScene(f"a camera's up must not be zero or along the view, got {self.up}")

    @property
    def distance(self) -> float:
        """How far the target is from the eye."""
        return math.dist(self.position, self.target)

    @property
    def _back(self) -> Floats:
        return _unit(np.subtract(self.position, self.target))

    @property
    def axes(self) -> Floats:
        """Unit vectors to the right, up, and toward the viewer, as rows."""
        back = self._back
        right = _unit(np.cross(_unit(np.array(self.up)), back))
        return np.stack([right, np.cross(back, right), back])

    def view(self) -> Floats:
        """World to eye space, ``float64[4, 4]``; the eye looks along −z."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes
        matrix[:3, 3] = -self.axes @ np.array(self.position)
        return matrix

    def projection(self, aspect: float, near: float, far: float) -> Floats:
        """Eye to clip space, ``float64[4, 4]``, for an image of this width over height."""
        focal = 1.0 / math.tan(math.radians(self.fov) / 2)
        matrix = np.zeros((4, 4))
        matrix[0, 0] = focal / aspect
        matrix[1, 1] = focal
        matrix[2, 2] = (far + near) / (near - far)
        matrix[2, 3] = 2 * far * near / (near - far)
        matrix[3, 2] = -1.0
        return matrix

    def clip_range(self, bounds: Bounds) -> tuple[float, float]:
        """Give near and far distances, along the view, that hold everything in a box before the eye."""
        depth = (np.array(self.position) - _corners(bounds)) @ self.axes[2]
        far = float(depth.max()) * 1.01
        if far <= 0.0:  # all of it lies behind: any range is right
            far = self.distance
        return max(float(depth.min()) * 0.99, far * NEAR_OVER_FAR), far

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Floats:
        """World to clip space, ``float64[4, 4]``, for a picture of this size of what is in a box."""
        return self.projection(size[0] / size[1], *self.clip_range(bounds)) @ self.view()

    def rays(self, width: int, height: int) -> Rays:
        """Give the rays through the pixels of an image of this size."""
        right, up, back = self.axes
        half = math.tan(math.radians(self.fov) / 2)
        pixel = 2 * half / height
        corner = -back - half * up - (pixel * width / 2) * right
        return Rays(np.array(self.position), corner, pixel * right, pixel * up)

    @classmethod
    def framing(
        cls,
        bounds: Bounds,
        *,
        direction: Sequence[float] = DIRECTION,
        up: Sequence[float] = (0.0, 1.0, 0.0),
        fov: float = 30.0,
        aspect: float = 4 / 3,
        margin: float = 1.05,
    ) -> "Camera":
        """Look at a box from a direction, just far enough to see all of it.

        Parameters
        ----------
        bounds
            Lower and upper corner, each ``[3]``.
        direction
            From the box toward the eye; any length.
        up
            Upward direction; where it is along the view, another axis takes its place.
        fov
            Vertical angle of view, degrees.
        aspect
            Width over height of the picture.
        margin
            Room around the box, 1 for none.
        """
        return cls.fitting(
            _corners(bounds), direction=direction, up=up, fov=fov, aspect=aspect, margin=margin
        )

    @classmethod
    def fitting(
        cls,
        points: ArrayLike,
        *,
        direction: Sequence[float] = DIRECTION,
        up: Sequence[float] = (0.0, 1.0, 0.0),
        fov: float = 30.0,
        aspect: float = 4 / 3,
        margin: float = 1.05,
    ) -> "Camera":
        """Look at points, ``[n, 3]``, as `framing` does at a box: close, with all of them in the middle.

        Tighter than the box around them, for shapes that do not fill it.
        """
        places = _points(points)
        toward, upward = _orientation(direction, up)
        frame = cls(_triple(toward), (0.0, 0.0, 0.0), _triple(upward), fov)
        half = math.tan(math.radians(frame.fov) / 2) / margin
        x, y, z = (places @ frame.axes.T).T
        across, wide = _squeeze(x, z, half * aspect)
        along, high = _squeeze(y, z, half)
        middle = (z.max() + z.min()) / 2
        eye = max(wide, high, float(z.max()) + 0.05 * _reach(places))
        centre = np.array([across, along, middle]) @ frame.axes
        return cls(_triple(centre + (eye - middle) * frame.axes[2]), _triple(centre), _triple(upward), fov)


def _squeeze(x: Floats, z: Floats, slope: float) -> tuple[float, float]:
    """Place an eye that looks along −z so that |x| ≤ slope · depth touches the points on both sides."""
    right, left = float(np.max(x + slope * z)), float(np.max(slope * z - x))
    return (right - left) / 2, (right + left) / (2 * slope)


def _orientation(direction: Sequence[float], up: Sequence[float]) -> tuple[Floats, Floats]:
    """Unit direction toward the eye, and an upward one that is not along it."""
    toward, upward = np.array(_vector("direction", direction)), np.array(_vector("up", up))
    if not toward.any():
        raise InvalidScene("a camera's direction must not be zero")
    toward = _unit(toward)
    if not upward.any() or _parallel(upward, toward):
        upward = np.eye(3)[int(np.argmin(np.abs(toward)))]
    return toward, upward


def _reach(points: Floats) -> float:
    """Give half the diagonal of the points' box, or something usable where that is a point."""
    low, high = points.min(axis=0), points.max(axis=0)
    reach, size = float(np.linalg.norm(high - low)) / 2, float(np.abs(points).max())
    return reach if reach > 1e-6 * size else max(1e-3 * size, 1e-3)


def _points(points: ArrayLike) -> Floats:
    places = np.asarray(points, np.float64)
    if places.ndim != 2 or places.shape[1] != 3 or not len(places) or not np.isfinite(places).all():
        raise InvalidScene(
            f"points must be finite, of shape [n, 3] with n > 0, got shape {list(places.shape)}"
        )
    return places


def _corners(bounds: Bounds) -> Floats:
    box = np.asarray([bounds[0], bounds[1]], np.float64)
    if box.shape != (2, 3) or not np.isfinite(box).all() or (box[0] > box[1]).any():
        raise InvalidScene(f"bounds must be two finite corners (lower, upper) of three numbers, got {bounds}")
    choice = np.indices((2, 2, 2)).reshape(3, 8).T
    return np.take_along_axis(box, choice, axis=0)


def _vector(name: str, value: ArrayLike) -> Vector:
    return _triple(triple(f"a camera's {name}", value, InvalidScene))


def _triple(array: Floats) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / math.hypot(*vector))


def _parallel(a: Floats, unit: Floats) -> bool:
    return math.hypot(*np.cross(_unit(a), unit)) < PARALLEL
