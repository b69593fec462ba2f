"""Viewpoints of pictures: the matrix to clip space, and the rays of the pixels.

Matrices act on columns, ``M @ (x, y, z, 1)``, as in OpenGL, and are float64.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from decals.errors import InvalidScene

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
        """Return the matrix from world to clip space, ``float64[4, 4]``, for a picture of a box."""
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
