"""Cameras: view and projection matrices, rays of the pixels, and framing of a model.

Matrices act on columns, ``M @ (x, y, z, 1)``, as in OpenGL; they are float64, and the renderer rounds the
product, not the factors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.validation import real
from decals.errors import InvalidScene
from decals.rendering.viewpoint import Bounds, Rays
from decals.validation import describe, finite_number, finite_vector, real_array, real_number

Vector = tuple[float, float, float]

MIN_NEAR_OVER_FAR = 1e-4
"""Least distance of the near plane as a fraction of the far one: it bounds the depth buffer's rounding."""
DEFAULT_DIRECTION: Vector = (0.35, 0.25, 1.0)
"""Default direction from a model toward the camera."""
THREE_QUARTER: Vector = (0.55, 0.35, 1.0)
"""Direction from a model toward the camera: from the right, a little above."""
PARALLEL_SINE = 1e-9
"""Sine below which two directions count as parallel."""

PRESETS: dict[str, Vector] = {
    "three-quarter": THREE_QUARTER,
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}
"""Directions toward the camera by name, as parts to the right, upward, and toward the front."""


@dataclass(frozen=True)
class Axes:
    """Which way a model stands: unit vectors upward and toward its front."""

    up: Vector
    front: Vector

    @property
    def matrix(self) -> Float64Array:
        """Unit vectors to the right, upward and toward the front, as rows, float64[3, 3]."""
        return np.array([np.cross(self.up, self.front), self.up, self.front], np.float64)

    def preset(self, name: str) -> Vector:
        """Return the direction of a preset in the model's own coordinates."""
        x, y, z = (np.asarray(PRESETS[name]) @ self.matrix).tolist()
        return x, y, z


UPRIGHT = {
    "x": Axes((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "y": Axes((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "z": Axes((0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
}
"""Axes by the name of the one that points upward."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A perspective camera.

    Parameters
    ----------
    position, target : (x, y, z)
        The eye, and the point in the middle of the picture, in the scene's units.
    up : (x, y, z)
        Upward direction of the picture; any vector that is not along the view.
    fov : float
        Vertical angle of view in degrees, between 0 and 180.

    Raises
    ------
    InvalidScene
        If a number is not finite, position and target coincide, or ``up`` is zero or along the view.

    Examples
    --------
    >>> import decals
    >>> camera = decals.Camera((0, 0, 5), fov=40)
    >>> camera.distance
    5.0
    >>> decals.Camera.fitting([[-1, 0, 0], [1, 0, 0]], direction=(0, 0, 1), margin=1).target
    (0.0, 0.0, 0.0)
    """

    position: Vector
    target: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 30.0

    def __post_init__(self) -> None:
        for name in ("position", "target", "up"):
            object.__setattr__(self, name, _vector(name, getattr(self, name)))
        object.__setattr__(self, "fov", finite_number("a camera's fov", self.fov, InvalidScene))
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
        """Distance from the eye to the target."""
        return math.dist(self.position, self.target)

    @property
    def _back(self) -> Float64Array:
        return _unit(np.subtract(self.position, self.target))

    @property
    def axes(self) -> Float64Array:
        """Unit vectors to the right, up, and toward the viewer, as rows."""
        back = self._back
        right = _unit(np.cross(_unit(np.array(self.up)), back))
        return np.stack([right, np.cross(back, right), back])

    def view(self) -> Float64Array:
        """Return the matrix from world to eye space, ``float64[4, 4]``; the eye looks along −z."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes
        matrix[:3, 3] = -self.axes @ np.array(self.position)
        return matrix

    def projection(self, aspect: float, near: float, far: float) -> Float64Array:
        """Return the matrix from eye to clip space, ``float64[4, 4]``.

        ``aspect`` is width over height of the picture. ``near`` and ``far`` are distances of planes from the
        eye along the view, in model units.
        """
        focal = 1.0 / math.tan(math.radians(self.fov) / 2)
        matrix = np.zeros((4, 4))
        matrix[0, 0] = focal / aspect
        matrix[1, 1] = focal
        matrix[2, 2] = (far + near) / (near - far)
        matrix[2, 3] = 2 * far * near / (near - far)
        matrix[3, 2] = -1.0
        return matrix

    def clip_range(self, bounds: Bounds) -> tuple[float, float]:
        """Return the distances, along the view, of a near and a far plane that enclose a box."""
        depth = (np.array(self.position) - _corners(bounds)) @ self.axes[2]
        far = float(depth.max()) * 1.01
        if far <= 0.0:  # the box lies behind the eye: any range is right
            far = self.distance
        return max(float(depth.min()) * 0.99, far * MIN_NEAR_OVER_FAR), far

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Float64Array:
        """Return the matrix from world to clip space, ``float64[4, 4]``; see `Viewpoint.clip_matrix`."""
        return self.projection(size[0] / size[1], *self.clip_range(bounds)) @ self.view()

    def rays(self, width: int, height: int) -> Rays:
        """Return the rays through the pixels of a picture of this size."""
        right, up, back = self.axes
        half = math.tan(math.radians(self.fov) / 2)
        pixel = 2 * half / height
        corner = -back - half * up - (pixel * width / 2) * right
        return Rays(np.array(self.position), corner, pixel * right, pixel * up)

    def turned(self, degrees: float) -> "Camera":
        """Return a camera turned about the upward axis through the target, counter-clockwise from above.

        Examples
        --------
        >>> import decals
        >>> position = decals.Camera((0, 1, 5)).turned(90).position
        >>> tuple(round(x, 6) + 0.0 for x in position)
        (5.0, 1.0, 0.0)
        """
        angle = math.radians(finite_number("degrees", degrees, InvalidScene))
        axis, offset = _unit(np.array(self.up)), np.subtract(self.position, self.target)
        along = axis * (axis @ offset)
        across = offset - along
        turned = along + math.cos(angle) * across + math.sin(angle) * np.cross(axis, across)
        return replace(self, position=_triple(turned + np.array(self.target)))

    @classmethod
    def framing(
        cls,
        bounds: Bounds,
        *,
        direction: Sequence[float] = DEFAULT_DIRECTION,
        up: Sequence[float] = (0.0, 1.0, 0.0),
        fov: float = 30.0,
        aspect: float = 4 / 3,
        margin: float = 1.05,
    ) -> "Camera":
        """Return a camera that looks at a box from a direction, just far enough to show all of it.

        Parameters
        ----------
        bounds : (float[3], float[3])
            Lower and upper corner.
        direction : (x, y, z)
            Direction from the box toward the eye; any length.
        up : (x, y, z)
            Upward direction; if it is along the view, another axis replaces it.
        fov : float
            Vertical angle of view in degrees.
        aspect : float
            Width over height of the picture, from 1e-6 to 1e6.
        margin : float
            Size of the picture relative to the box, from 1e-6 to 1e6; 1 leaves no space.

        Raises
        ------
        InvalidScene
            If a number is not finite or out of its range, or the direction is zero.
        """
        return cls.fitting(
            _corners(bounds), direction=direction, up=up, fov=fov, aspect=aspect, margin=margin
        )

    @classmethod
    def fitting(
        cls,
        points: ArrayLike,
        *,
        direction: Sequence[float] = DEFAULT_DIRECTION,
        up: Sequence[float] = (0.0, 1.0, 0.0),
        fov: float = 30.0,
        aspect: float = 4 / 3,
        margin: float = 1.05,
    ) -> "Camera":
        """Return a camera that looks at points, ``[n, 3]``, from a direction, with all of them in the middle.

        It stands closer than that of `framing` if the points do not fill their box. The four edges of the
        picture are planes through the eye: each pair of opposite planes fixes one coordinate of the eye and a
        least distance. Other arguments and errors are those of `framing`.
        """
        positions = _points(points)
        aspect = _ratio("aspect", aspect)
        margin = _ratio("margin", margin)
        toward, upward = _orientation(direction, up)
        axes_camera = cls(_triple(toward), (0.0, 0.0, 0.0), _triple(upward), fov)
        half = math.tan(math.radians(axes_camera.fov) / 2) / margin
        x, y, z = (positions @ axes_camera.axes.T).T
        across, depth_of_width = _fit_axis(x, z, half * aspect)
        along, depth_of_height = _fit_axis(y, z, half)
        middle = (z.max() + z.min()) / 2
        eye = max(depth_of_width, depth_of_height, float(z.max()) + 0.05 * _half_diagonal(positions))
        centre = np.array([across, along, middle]) @ axes_camera.axes
        position = _triple(centre + (eye - middle) * axes_camera.axes[2])
        return cls(position, _triple(centre), _triple(upward), fov)


def _ratio(name: str, value: float) -> float:
    """Return a ratio that float64 can divide by and multiply with."""
    return real_number(
        name, value, "a number from 1e-6 to 1e6", lambda ratio: 1e-6 <= ratio <= 1e6, InvalidScene
    )


def _fit_axis(x: Float64Array, z: Float64Array, slope: float) -> tuple[float, float]:
    """Return x and z of the eye for which both planes |x| = slope · depth touch the points."""
    right, left = float(np.max(x + slope * z)), float(np.max(slope * z - x))
    return (right - left) / 2, (right + left) / (2 * slope)


def _orientation(direction: Sequence[float], up: Sequence[float]) -> tuple[Float64Array, Float64Array]:
    """Return the unit direction toward the eye, and an upward direction that is not along it."""
    toward, upward = np.array(_vector("direction", direction)), np.array(_vector("up", up))
    if not toward.any():
        raise InvalidScene("a camera's direction must not be zero")
    toward = _unit(toward)
    if not upward.any() or _parallel(upward, toward):
        upward = np.eye(3)[int(np.argmin(np.abs(toward)))]
    return toward, upward


def _half_diagonal(points: Float64Array) -> float:
    """Return half the diagonal of the points' box; for a box without size a small positive length."""
    low, high = points.min(axis=0), points.max(axis=0)
    half, size = float(np.linalg.norm(high - low)) / 2, float(np.abs(points).max())
    return half if half > 1e-6 * size else max(1e-3 * size, 1e-3)


def _points(points: ArrayLike) -> Float64Array:
    positions = real_array("points", points, InvalidScene)
    if (
        positions.ndim != 2
        or positions.shape[1] != 3
        or not len(positions)
        or not np.isfinite(positions).all()
    ):
        raise InvalidScene(
            f"points must be finite, of shape [n, 3] with n > 0, got shape {list(positions.shape)}"
        )
    return positions


def _corners(bounds: Bounds) -> Float64Array:
    try:
        box = np.asarray([real(bounds[0]), real(bounds[1])], np.float64)
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        box = np.zeros(0)
    if box.shape != (2, 3) or not np.isfinite(box).all() or (box[0] > box[1]).any():
        raise InvalidScene(
            f"bounds must be two finite corners (lower, upper) of three numbers, got {describe(bounds)}"
        )
    choice = np.indices((2, 2, 2)).reshape(3, 8).T
    return np.take_along_axis(box, choice, axis=0)


def _vector(name: str, value: ArrayLike) -> Vector:
    return _triple(finite_vector(f"a camera's {name}", value, InvalidScene))


def _triple(array: Float64Array) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])


def _unit(vector: Float64Array) -> Float64Array:
    return np.asarray(vector / math.hypot(*vector))


def _parallel(a: Float64Array, unit: Float64Array) -> bool:
    return math.hypot(*np.cross(_unit(a), unit)) < PARALLEL_SINE
