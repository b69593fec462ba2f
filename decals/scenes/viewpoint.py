"""What the renderer asks of a camera: clip space, and the rays of the pixels.

Matrices act on columns, ``M @ (x, y, z, 1)``, as in OpenGL, and are float64.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidScene

Bounds = tuple[ArrayLike, ArrayLike]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rays:
    """The rays through an image's pixels.

    ``(x, y)`` is the place in pixels from the image's lower left corner, so a pixel's centre lies at half
    integers, as in ``gl_FragCoord``. In perspective a ray is ``origin + t·(corner + x·right + y·up)``; its
    direction is not unit, but its component along the view is 1. In a parallel projection it is
    ``(origin + x·right + y·up) + t·corner``, with a unit direction.
    """

    origin: Floats
    corner: Floats
    right: Floats
    up: Floats
    parallel: bool = False

    def origins(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Give where the rays at places in pixels begin, shape ``[..., 3]``."""
        return self.origin + self._step(x, y) * self.parallel

    def directions(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Give the directions at places in pixels, shape ``[..., 3]``."""
        return self.corner + self._step(x, y) * (not self.parallel)

    def _step(self, x: ArrayLike, y: ArrayLike) -> Floats:
        px, py = np.asarray(x, np.float64)[..., None], np.asarray(y, np.float64)[..., None]
        return np.asarray(px * self.right + py * self.up)


class Viewpoint(Protocol):
    """Where a picture is taken from."""

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Floats:
        """World to clip space, ``float64[4, 4]``, for a picture of this size of what is in a box."""
        ...

    def rays(self, width: int, height: int) -> Rays:
        """Give the rays through the pixels of a picture of this size."""
        ...


@dataclass(frozen=True, eq=False, slots=True)
class Projection:
    """A viewpoint known by its matrix alone: another program's camera, perspective, parallel or sheared.

    Parameters
    ----------
    matrix
        World to clip space, ``float64[4, 4]``, near and far planes included.

    Raises
    ------
    InvalidScene
        The matrix is not finite, or flattens the world.
    """

    matrix: Floats

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
        """Whether all rays have one direction."""
        return not self.matrix[3, :3].any()

    def clip_matrix(self, size: tuple[int, int], bounds: Bounds) -> Floats:
        """Give the matrix, whatever the size and the box."""
        return self.matrix

    def rays(self, width: int, height: int) -> Rays:
        """Give the rays through the pixels of a picture of this size."""
        return _rays_of(self, width, height)

    def _perspective_rays(self, pixels: Floats) -> Rays:
        """Solve for the point that is projected nowhere, and for directions of clip coordinate w = 1."""
        rows = self.matrix[[0, 1, 3]]
        eye = _solve(rows[:, :3], -rows[:, 3])
        right, up, corner = _solve(rows[:, :3], np.vstack([pixels, [0.0, 0.0, 1.0]])).T
        return Rays(eye, corner, right, up)

    def _parallel_rays(self, pixels: Floats) -> Rays:
        """Rays begin on the near plane, where clip coordinate z = −w."""
        scale = self.matrix[3, 3]
        rows, shift = self.matrix[:3, :3] / scale, self.matrix[:3, 3] / scale
        right, up, corner = _solve(rows, np.vstack([pixels, [0.0, 0.0, -1.0]])).T
        away = _solve(rows, np.array([0.0, 0.0, 1.0]))
        direction = away / float(np.linalg.norm(away))
        return Rays(corner - _solve(rows, shift), direction, right, up, parallel=True)


@lru_cache(maxsize=16)
def _rays_of(projection: Projection, width: int, height: int) -> Rays:
    """Solve for rays; one step of a hand asks several times."""
    pixels = np.array([[2.0 / width, 0.0, -1.0], [0.0, 2.0 / height, -1.0]])
    return projection._parallel_rays(pixels) if projection.parallel else projection._perspective_rays(pixels)


def _solve(matrix: Floats, values: Floats) -> Floats:
    return np.asarray(np.linalg.solve(matrix, values), np.float64)
