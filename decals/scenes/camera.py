"""Cameras: view and projection matrices, rays of the pixels, and framing of a model.

Matrices act on columns, ``M @ (x, y, z, 1)``, as in OpenGL; they are float64, and the renderer rounds the
product, not the factors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.validation import describe, finite_number, finite_vector, real
from decals.errors import InvalidScene
from decals.rendering.viewpoint import Bounds, Rays
from decals.validation import allowed_number, real_array

Vector = tuple[float, float, float]

MIN_NEAR_OVER_FAR = 1e-4
"""Least distance of the near plane as a fraction of the far one: it bounds the depth buffer's rounding."""
REFERENCE_ASPECT = 4 / 3
"""Aspect ratio of the picture that a camera for all aspect ratios is placed for."""
FILLED = 0.8, 0.98
"""Least and largest share of a picture's width or height that points take before a fitted camera moves."""
NEAREST, NEAREST_FITTED = 0.05, 0.005
"""Least distances of the eye from points, in half diagonals: of one picture, and of all aspect ratios."""
FITTED_ASPECTS, SLOPES = (0.01, 100.0), 48
"""Range and number of aspect ratios whose outermost points a fitted camera remembers."""
MAX_RATIO = 1e6
"""Largest aspect ratio and margin; the least ones are its reciprocal."""
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
class Fit:
    """What pictures of all aspect ratios show of a camera that `Camera.fitting` placed.

    Attributes
    ----------
    pose : (position, target, up, fov)
        The camera that it belongs to; another one is no longer fitted.
    points : tuple of (x, y, z)
        Outermost points of the model as seen from the camera's direction. Without points, narrow pictures
        show as much from left to right as one of the aspect ratio 4:3.
    margin : float
        Size of the picture relative to the points.
    """

    pose: tuple[Vector, Vector, Vector, float]
    points: tuple[Vector, ...] = ()
    margin: float = 1.05


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
    fit : Fit, optional
        What pictures of all aspect ratios show; `fitting` and `decals.cover` make it. A camera that is
        placed in another way has none.

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
    fit: Fit | None = field(default=None, repr=False)

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
        if self.fit is not None and not isinstance(self.fit, Fit):
            raise InvalidScene(
                f"a camera's fit: expected a Fit or None, got {describe(self.fit)}; use Camera.fitting"
            )
        if self.fit is not None and self.fit.pose != self._pose:
            object.__setattr__(self, "fit", None)

    @property
    def _pose(self) -> tuple[Vector, Vector, Vector, float]:
        return self.position, self.target, self.up, self.fov

    def at(self, aspect: float) -> "Camera":
        """Return the camera of a picture whose width over its height is ``aspect``.

        A camera that `fitting` placed for all aspect ratios moves if the points would be cut, or take less
        than 80 % of the width and of the height. They then fill the picture. All other cameras stay.

        Examples
        --------
        >>> import decals
        >>> camera = decals.Camera.fitting([[-1, 0, 0], [1, 0, 0]], direction=(0, 0, 1), aspect=None)
        >>> camera.at(0.5).distance > 2 * camera.at(1.4).distance
        True
        """
        if self.fit is None:
            return self
        if self.fit.points:
            if self.shows(self.fit.points, aspect):
                return self
            position, target = self.filling(self.fit.points, self.fit.margin).pose(_ratio("aspect", aspect))
            return Camera(_triple(position), _triple(target), self.up, self.fov)
        if aspect >= REFERENCE_ASPECT:
            return self
        widened = math.tan(math.radians(self.fov) / 2) * REFERENCE_ASPECT / aspect
        return replace(self, fov=math.degrees(2.0 * math.atan(widened)))

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

    def fitted_to(self, points: ArrayLike, *, margin: float) -> "Camera":
        """Return the camera with points that pictures of all aspect ratios show; see `at`."""
        positions = _points(points)
        x, y, z = (positions @ self.axes.T).T
        half = math.tan(math.radians(self.fov) / 2) / _ratio("margin", margin)
        slopes = half * np.geomspace(*FITTED_ASPECTS, SLOPES)
        planes = [z, -z, y + half * z, half * z - y]
        planes += [side * x + slope * z for slope in slopes for side in (1.0, -1.0)]
        outermost = sorted({int(np.argmax(plane)) for plane in planes})
        return replace(self, fit=Fit(self._pose, tuple(map(_triple, positions[outermost])), margin))

    def shows(self, points: ArrayLike, aspect: float, *, least: float = FILLED[0]) -> bool:
        """Return True if points take at least the share ``least`` of a picture, and none is near its rim.

        The larger one of the shares of the width and of the height counts.
        """
        lowest, highest = self.aspects_of(points, least=least)
        return lowest <= aspect <= highest

    def aspects_of(self, points: ArrayLike, *, least: float = FILLED[0]) -> tuple[float, float]:
        """Return the least and the greatest aspect ratio whose pictures show the points; (1, 0) for none."""
        x, y, z = self.axes @ (_points(points) - self.position).T
        if z.max() >= 0.0:  # behind the eye
            return 1.0, 0.0
        half = math.tan(math.radians(self.fov) / 2)
        across, upward = x / (half * z), y / (half * z)
        if np.abs(upward).max() > FILLED[1]:
            return 1.0, 0.0
        fills_height = np.ptp(upward) >= 2.0 * least
        highest = MAX_RATIO if fills_height else float(np.ptp(across)) / (2.0 * least)
        return float(np.abs(across).max()) / FILLED[1], highest

    def filling(self, points: ArrayLike, margin: float) -> "Filling":
        """Return the poses in this direction whose pictures points fill, but for a margin."""
        toward, up = _orientation(self._back.tolist(), self.up)
        return Filling.of(_points(points), _looking(toward, up, self.fov), margin, NEAREST_FITTED)

    def clip_range(self, bounds: Bounds) -> tuple[float, float]:
        """Return the distances, along the view, of a near and a far plane that enclose a box."""
        depth = (np.array(self.position) - _corners(bounds)) @ self.axes[2]
        far = float(depth.max()) * 1.01
        if far <= 0.0:  # the box lies behind the eye: any range is right
            far = self.distance
        return max(float(depth.min()) * 0.99, far * MIN_NEAR_OVER_FAR), far

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Float64Array:
        """Return the matrix from world to clip space, ``float64[4, 4]``; see `Viewpoint.clip_matrix`."""
        camera = self.at(size[0] / size[1])
        return camera.projection(size[0] / size[1], *camera.clip_range(bounds)) @ camera.view()

    def rays(self, width: int, height: int) -> Rays:
        """Return the rays through the pixels of a picture of this size."""
        camera = self.at(width / height)
        right, up, back = camera.axes
        half = math.tan(math.radians(camera.fov) / 2)
        pixel = 2 * half / height
        corner = -back - half * up - (pixel * width / 2) * right
        return Rays(np.array(camera.position), corner, pixel * right, pixel * up)

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
        camera = replace(self, position=_triple(turned + np.array(self.target)))
        return camera if self.fit is None else replace(camera, fit=Fit(camera._pose))

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
        aspect: float | None = 4 / 3,
        margin: float = 1.05,
    ) -> "Camera":
        """Return a camera that looks at points, ``[n, 3]``, from a direction, with all of them in the middle.

        It stands closer than that of `framing` if the points do not fill their box. The four edges of the
        picture are planes through the eye: each pair of opposite planes fixes one coordinate of the eye and a
        least distance. Other arguments and errors are those of `framing`. Without ``aspect``, the points fill
        pictures of all aspect ratios: the camera remembers the outermost points, see `at`.
        """
        positions = _points(points)
        if aspect is None:
            shape = direction, up, fov, REFERENCE_ASPECT, margin
            return cls._fitting(positions, *shape, NEAREST_FITTED).fitted_to(positions, margin=margin)
        return cls._fitting(positions, direction, up, fov, aspect, margin, NEAREST)

    @classmethod
    def _fitting(
        cls,
        positions: Float64Array,
        direction: Sequence[float],
        up: Sequence[float],
        fov: float,
        aspect: float,
        margin: float,
        nearest: float,
    ) -> "Camera":
        """Return a camera whose picture points fill, at least ``nearest`` half diagonals in front of them."""
        toward, upward = _orientation(direction, up)
        filling = Filling.of(positions, _looking(toward, upward, fov), _ratio("margin", margin), nearest)
        position, centre = filling.pose(_ratio("aspect", aspect))
        return cls(_triple(position), _triple(centre), _triple(upward), fov)


@dataclass(frozen=True, eq=False)
class Filling:
    """Poses from one direction whose pictures some points fill.

    Attributes
    ----------
    axes
        Unit vectors to the right, up and toward the eye, as rows.
    across, depths
        Coordinates of the points along the first and the last axis, ``float64[n]``.
    slope
        Half the height of a picture at distance 1 that points may fill.
    along, middle
        Coordinates of the target along the other two axes.
    nearest
        Least coordinate of the eye along the last axis.
    """

    axes: Float64Array
    across: Float64Array
    depths: Float64Array
    slope: float
    along: float
    middle: float
    nearest: float

    @classmethod
    def of(cls, positions: Float64Array, camera: Camera, margin: float, nearest: float) -> "Filling":
        """Return the poses in the direction of a camera; see `Camera.fitting` for the other arguments."""
        slope, axes = math.tan(math.radians(camera.fov) / 2) / margin, camera.axes
        # Without BLAS, which rounds otherwise on other processors: content hashes would differ.
        x, y, z = ((positions * axis).sum(axis=1) for axis in axes)
        along, depth_of_height = _fit_axis(y, z, slope)
        middle = float(z.max() + z.min()) / 2
        least = max(depth_of_height, float(z.max()) + nearest * _half_diagonal(positions))
        return cls(axes, x, z, slope, along, middle, least)

    def pose(self, aspect: float) -> tuple[Float64Array, Float64Array]:
        """Return the eye and the target for pictures of an aspect ratio."""
        right, up, back = self.axes
        across, depth_of_width = _fit_axis(self.across, self.depths, self.slope * aspect)
        target = across * right + self.along * up + self.middle * back
        return target + (max(depth_of_width, self.nearest) - self.middle) * back, target


def _ratio(name: str, value: float) -> float:
    """Return a ratio that float64 can divide by and multiply with."""
    least, most = 1 / MAX_RATIO, MAX_RATIO
    return allowed_number(
        name, value, "a number from 1e-6 to 1e6", lambda ratio: least <= ratio <= most, InvalidScene
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


def _looking(toward: Float64Array, up: Float64Array, fov: float) -> Camera:
    """Return a camera that looks at the origin from a unit direction."""
    return Camera(_triple(toward), (0.0, 0.0, 0.0), _triple(up), fov)


def _half_diagonal(points: Float64Array) -> float:
    """Return half the diagonal of the points' box; for a box without size a small positive length."""
    low, high = points.min(axis=0), points.max(axis=0)
    half, size = math.hypot(*(high - low)) / 2, float(np.abs(points).max())
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
    return finite_vector(f"a camera's {name}", value, InvalidScene)


def _triple(array: Float64Array) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])


def _unit(vector: Float64Array) -> Float64Array:
    return np.asarray(vector / math.hypot(*vector))


def _parallel(a: Float64Array, unit: Float64Array) -> bool:
    return math.hypot(*np.cross(_unit(a), unit)) < PARALLEL_SINE
