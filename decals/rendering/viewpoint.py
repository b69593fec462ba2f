"""Viewpoints of pictures: matrices to clip space and rays, and the rectangles and tiles of a picture.

Matrices act on columns, ``M @ (x, y, z, 1)``, as in OpenGL, and are float64.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from decals.errors import InvalidScene


@dataclass(frozen=True, slots=True)
class Part:
    """A range of rows or faces of a drawing step, as fractions from 0 to 1."""

    begin: float = 0.0
    end: float = 1.0

    def of(self, count: int) -> tuple[int, int]:
        """Return the index of the first of ``count`` rows, and that after the last."""
        return round(self.begin * count), round(self.end * count)


WHOLE = Part()

Step = Callable[[Part], None]
"""A drawing step. Its parts, drawn in order, give the same as the whole."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle by its lower left corner and size, in samples."""

    x: int
    y: int
    width: int
    height: int

    @property
    def area(self) -> int:
        """Number of samples."""
        return self.width * self.height

    def rows(self, part: Part) -> "Rectangle":
        """Return a part of the rows."""
        first, last = part.of(self.height)
        return Rectangle(self.x, self.y + first, self.width, last - first)

    def around(self, other: "Rectangle") -> "Rectangle":
        """Return the smallest rectangle that encloses both."""
        x, y = min(self.x, other.x), min(self.y, other.y)
        right = max(self.x + self.width, other.x + other.width)
        top = max(self.y + self.height, other.y + other.height)
        return Rectangle(x, y, right - x, top - y)


Bounds = tuple[ArrayLike, ArrayLike]
"""Lower and upper corner of a box, ``[3]`` each."""


@dataclass(frozen=True, slots=True)
class Rays:
    """The rays through an image's pixels.

    ``(x, y)`` is the position in pixels from the image's lower left corner, so a pixel's centre lies at half
    integers, as in ``gl_FragCoord``. In perspective a ray is ``origin + t·(corner + x·right + y·up)``; its
    direction is not unit, but its component along the view is 1. In a parallel projection it is
    ``(origin + x·right + y·up) + t·corner``, with a unit direction.
    """

    origin: Float64Array
    corner: Float64Array
    right: Float64Array
    up: Float64Array
    parallel: bool = False

    def origins(self, x: ArrayLike, y: ArrayLike) -> Float64Array:
        """Return the origins of the rays at positions in pixels, shape ``[..., 3]``."""
        return self.origin + self._step(x, y) * self.parallel

    def directions(self, x: ArrayLike, y: ArrayLike) -> Float64Array:
        """Return the directions of the rays at positions in pixels, shape ``[..., 3]``."""
        return self.corner + self._step(x, y) * (not self.parallel)

    def _step(self, x: ArrayLike, y: ArrayLike) -> Float64Array:
        px, py = np.asarray(x, np.float64)[..., None], np.asarray(y, np.float64)[..., None]
        return np.asarray(px * self.right + py * self.up)


class Viewpoint(Protocol):
    """The viewpoint of a picture: a `decals.Camera`, a `Projection` or a class of your own.

    Examples
    --------
    >>> import decals
    >>> from decals.rendering import Viewpoint
    >>> viewpoint: Viewpoint = decals.Camera((0, 0, 5))
    >>> viewpoint.clip_matrix((640, 480), ([-1, -1, -1], [1, 1, 1])).shape
    (4, 4)
    >>> viewpoint.rays(640, 480).directions(320, 240)
    array([ 0.,  0., -1.])
    """

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Float64Array:
        """Return the matrix from world to clip space, ``float64[4, 4]``.

        Parameters
        ----------
        size
            Width and height of the picture in pixels.
        bounds
            Lower and upper corner of a box in model units, shape (3,) each. The near and the far plane
            enclose it.
        """
        ...

    def rays(self, width: int, height: int) -> Rays:
        """Return the rays through the pixels of a picture of this size."""
        ...


@dataclass(frozen=True, eq=False, slots=True)
class Projection:
    """A viewpoint given by a matrix: the camera of another program, perspective, parallel or sheared.

    Parameters
    ----------
    matrix : float64[4, 4]
        World to clip space, near and far planes included; it acts on columns.

    Raises
    ------
    InvalidScene
        If the matrix is not finite, or not invertible.

    Examples
    --------
    >>> import numpy
    >>> from decals.rendering import Projection
    >>> Projection(numpy.diag([1, 1, -0.1, 1])).parallel
    True
    """

    matrix: Float64Array

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise InvalidScene(f"a projection must be 4 × 4 finite numbers, got {self.matrix!r}")
        if np.linalg.matrix_rank(matrix / np.abs(matrix).max(axis=1, keepdims=True).clip(1e-300)) < 4:
            raise InvalidScene(
                "a projection must not flatten the world; its near and far planes may coincide"
            )
        matrix.flags.writeable = False
        object.__setattr__(self, "matrix", matrix)

    @property
    def parallel(self) -> bool:
        """True if all rays have one direction."""
        return not self.matrix[3, :3].any()

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Float64Array:
        """Return the matrix, for every size and box."""
        return self.matrix

    def rays(self, width: int, height: int) -> Rays:
        """Return the rays through the pixels of a picture of this size."""
        return _rays_of(self, width, height)

    def _perspective_rays(self, pixels: Float64Array) -> Rays:
        """Solve for the eye, which has no projection, and for directions of clip coordinate w = 1."""
        rows = self.matrix[[0, 1, 3]]
        eye = _solve(rows[:, :3], -rows[:, 3])
        right, up, corner = _solve(rows[:, :3], np.vstack([pixels, [0.0, 0.0, 1.0]])).T
        return Rays(eye, corner, right, up)

    def _parallel_rays(self, pixels: Float64Array) -> Rays:
        """Return rays that begin on the near plane, where clip coordinate z = −w."""
        scale = self.matrix[3, 3]
        rows, shift = self.matrix[:3, :3] / scale, self.matrix[:3, 3] / scale
        right, up, corner = _solve(rows, np.vstack([pixels, [0.0, 0.0, -1.0]])).T
        away = _solve(rows, np.array([0.0, 0.0, 1.0]))
        direction = away / float(np.linalg.norm(away))
        return Rays(corner - _solve(rows, shift), direction, right, up, parallel=True)


@lru_cache(maxsize=16)
def _rays_of(projection: Projection, width: int, height: int) -> Rays:
    """Return the rays of a projection; one move of the pointer needs them several times."""
    pixels = np.array([[2.0 / width, 0.0, -1.0], [0.0, 2.0 / height, -1.0]])
    return projection._parallel_rays(pixels) if projection.parallel else projection._perspective_rays(pixels)


def _solve(matrix: Float64Array, values: Float64Array) -> Float64Array:
    return np.asarray(np.linalg.solve(matrix, values), np.float64)


MAX_TILE = 2560
"""Samples along each side of a tile without its margin, at most; it bounds the memory."""
TILE_MARGIN = 320
"""Samples around a tile that are drawn too, so that passes which read neighbouring pixels show no seam."""


@dataclass(frozen=True, slots=True)
class PictureView:
    """View of a whole picture: its size in samples, the matrix to clip space, and the rays of the samples."""

    size: tuple[int, int]
    matrix: Float64Array
    rays: Rays

    @classmethod
    def of(cls, viewpoint: Viewpoint, size: tuple[int, int], bounds: Bounds) -> Self:
        """Return the view of a viewpoint in a picture of this size, in samples, of objects in a box."""
        return cls(size, viewpoint.clip_matrix(size, bounds), viewpoint.rays(*size))

    def whole(self) -> "Tile":
        """Return the picture as a single tile."""
        return self.part(Rectangle(0, 0, *self.size))

    def part(self, inner: Rectangle) -> "Tile":
        """Return a rectangle as a tile without margin."""
        return Tile(self, inner.x, inner.y, inner.width, inner.height, inner)


@dataclass(frozen=True, slots=True)
class Tile:
    """A rectangle of a picture's samples, counted from the picture's lower left corner.

    All of it is drawn; its inner rectangle (in the same coordinates) becomes pixels.
    """

    view: PictureView
    x: int
    y: int
    width: int
    height: int
    inner: Rectangle

    def matrix(self) -> Float64Array:
        """Return the matrix from the world to this tile's clip space, acting on columns."""
        width, height = self.view.size
        crop = np.eye(4)
        crop[0, 0], crop[1, 1] = width / self.width, height / self.height
        crop[0, 3] = (width - 2 * self.x) / self.width - 1
        crop[1, 3] = (height - 2 * self.y) / self.height - 1
        return np.asarray(crop @ self.view.matrix)

    def block(self) -> bytes:
        """Return the contents of ``CameraBlock`` in ``shaders/camera.glsl`` (std140)."""
        rays = self.view.rays
        rows = np.zeros((8, 4), np.float32)
        rows[:4] = self.matrix().T
        rows[4:, :3] = rays.origins(self.x, self.y), rays.directions(self.x, self.y), rays.right, rays.up
        rows[4, 3] = not rays.parallel
        return rows.tobytes()


def covered_rectangle(bounds: Bounds, tile: Tile) -> Rectangle:
    """Return the samples of a tile, counted from its own corner, that a box may cover."""
    size = np.array([tile.width, tile.height])
    choices = np.indices((2, 2, 2)).reshape(3, 8).T == 1
    corners = np.where(choices, *np.asarray(bounds, np.float64)[::-1])
    clip = np.column_stack([corners, np.ones(8)]) @ tile.matrix().T
    low, high = np.zeros(2), size.astype(np.float64)
    if (clip[:, 3] > 0.0).all():  # a box that reaches behind the eye may cover any sample
        positions: Float64Array = (0.5 * clip[:, :2] / clip[:, 3:] + 0.5) * size
        low = np.clip(np.floor(positions.min(axis=0)) - 1.0, 0.0, size)
        high = np.clip(np.ceil(positions.max(axis=0)) + 1.0, 0.0, size)
    x, y = (int(corner) for corner in low)
    width, height = (int(length) for length in high - low)
    return Rectangle(x, y, width, height)


def tiles(view: PictureView, samples: int, *, limit: int = MAX_TILE) -> Iterator[Tile]:
    """Divide a picture with ``samples`` along each axis of a pixel; no tile divides a pixel."""
    width, height = view.size
    step = _step(samples, limit)
    for y in range(0, height, step):
        for x in range(0, width, step):
            inner = Rectangle(x, y, min(step, width - x), min(step, height - y))
            left, right = max(x - TILE_MARGIN, 0), min(x + inner.width + TILE_MARGIN, width)
            low, high = max(y - TILE_MARGIN, 0), min(y + inner.height + TILE_MARGIN, height)
            yield Tile(view, left, low, right - left, high - low, inner)


def largest_tile(size: tuple[int, int], samples: int, *, limit: int = MAX_TILE) -> tuple[int, int]:
    """Return the size, in samples, of the largest tile of a picture with its margin."""
    longest = _step(samples, limit) + 2 * TILE_MARGIN
    return min(size[0] * samples, longest), min(size[1] * samples, longest)


def _step(samples: int, limit: int) -> int:
    return max(limit // samples, 1) * samples
