"""Projections of a flat image onto a surface: from points in space to positions in the image.

A projection is any function of ``points[n, 3]`` to ``uv[n, 2]``: u runs from 0 at the left edge of the image
to 1 at the right, v from 0 at the bottom to 1 at the top.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Box, Float32Array, Float64Array
from blobtree.validation import describe, finite_vector
from decals.errors import InvalidScattering
from decals.surfaces.convert import Model, as_mesh_surface, as_surfaces
from decals.surfaces.surface import Surface
from decals.validation import real_array

Projection: TypeAlias = Callable[[Float32Array], Float64Array]
"""``points[n, 3]`` to ``uv[n, 2]``."""

Vector: TypeAlias = Sequence[float]

_VIEW_AXES = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}
"""Axes to the right, up and toward a viewer at the far end of each axis."""


def box_of(surfaces: Surface | Sequence[Surface]) -> Box:
    """Return the corners of the box around surfaces."""
    several = as_surfaces(surfaces)
    if not several:
        raise InvalidScattering("surfaces: expected at least one to project an image onto, got none")
    boxes = np.array([surface.bounds for surface in several], dtype=np.float64)
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _axis(name: str) -> tuple[int, int, int]:
    if not isinstance(name, str) or name not in _VIEW_AXES:
        raise InvalidScattering(f"axis: expected 'x', 'y' or 'z', got {describe(name)}")
    return _VIEW_AXES[name]


@dataclass(frozen=True)
class Planar:
    """Parallel projection of an image, as from a slide projector; the far side gets it, too.

    Parameters
    ----------
    origin : sequence of float
        Position of the image's lower left corner.
    right, up : sequence of float
        Vectors from the origin to the lower right and to the upper left corner.

    Raises
    ------
    InvalidScattering
        If a value is not three finite numbers, or `right` and `up` are parallel or zero.

    Examples
    --------
    >>> import decals
    >>> import numpy as np
    >>> square = decals.scattering.Planar(origin=(0, 0, 0), right=(2, 0, 0), up=(0, 2, 0))
    >>> square(np.float32([[1, 0.5, 7]])).round(2)
    array([[0.5 , 0.25]])
    """

    origin: Vector
    right: Vector
    up: Vector

    def __post_init__(self) -> None:
        finite_vector("origin", self.origin, InvalidScattering)
        sides = np.stack(
            [finite_vector(name, getattr(self, name), InvalidScattering) for name in ("right", "up")]
        )
        if np.linalg.matrix_rank(sides) < 2:
            raise InvalidScattering(
                "right, up: expected sides of a parallelogram, got parallel or zero vectors"
            )

    def __call__(self, points: Float32Array) -> Float64Array:
        """Return the position of each point in the image, ``float64[n, 2]``."""
        sides = np.stack([self.right, self.up], axis=1).astype(np.float64)
        offsets = points.astype(np.float64) - np.asarray(self.origin, np.float64)
        uv: Float64Array = offsets @ np.linalg.pinv(sides).T
        return uv

    @classmethod
    def over(cls, surfaces: Surface | Sequence[Surface], axis: str = "z") -> "Planar":
        """Return a projection over the box of surfaces, as seen from the far end of an axis: x, y or z."""
        (right, up, toward), (low, high) = _axis(axis), box_of(surfaces)
        sides = np.diag(np.maximum(high - low, 1e-12 * (high - low).max()))
        origin = low.copy()
        origin[toward] = high[toward]
        return cls(tuple(origin), tuple(sides[right]), tuple(sides[up]))


@dataclass(frozen=True)
class Cylindrical:
    """Projection of an image around an axis, like a label around a bottle; its seam is opposite to `front`.

    Parameters
    ----------
    base, top : sequence of float
        Ends of the axis, at the image's lower and upper edge.
    front : sequence of float, default: (1, 0, 0)
        Direction from the axis to the middle of the image.

    Raises
    ------
    InvalidScattering
        If a value is not three finite numbers, the axis has no length, or `front` is parallel to it.

    Examples
    --------
    >>> import decals
    >>> import numpy as np
    >>> label = decals.scattering.Cylindrical(base=(0, 0, 0), top=(0, 0, 2))
    >>> label(np.float32([[1, 0, 1], [0, 1, 2]])).round(2)
    array([[0.5 , 0.5 ],
           [0.75, 1.  ]])
    """

    base: Vector
    top: Vector
    front: Vector = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("base", "top", "front"):
            finite_vector(name, getattr(self, name), InvalidScattering)
        axis = np.subtract(self.top, self.base)
        if not np.linalg.norm(np.cross(axis, self.front)) > 1e-9 * np.linalg.norm(axis) > 0:
            raise InvalidScattering("expected an axis with length, and a front that is not along it")

    def __call__(self, points: Float32Array) -> Float64Array:
        """Return the position of each point in the image, ``float64[n, 2]``."""
        axis = np.subtract(self.top, self.base).astype(np.float64)
        offsets = points.astype(np.float64) - np.asarray(self.base, np.float64)
        return np.stack([_angles(offsets, axis, self.front), offsets @ axis / (axis @ axis)], axis=1)

    @classmethod
    def over(cls, surfaces: Surface | Sequence[Surface], axis: str = "z") -> "Cylindrical":
        """Return a projection around the axis x, y or z through the middle of the surfaces' box."""
        (right, _, along), (low, high) = _axis(axis), box_of(surfaces)
        base = 0.5 * (low + high)
        top = base.copy()
        base[along], top[along] = low[along], high[along]
        return cls(tuple(base), tuple(top), tuple(np.eye(3)[right]))


@dataclass(frozen=True)
class Spherical:
    """Projection of an image around a ball, like a map of the world: u is longitude, v latitude.

    Parameters
    ----------
    center : sequence of float, default: (0, 0, 0)
        Centre of the ball.
    up : sequence of float, default: (0, 0, 1)
        Direction from the centre to the upper edge of the image.
    front : sequence of float, default: (1, 0, 0)
        Direction from the centre to the middle of the image.

    Raises
    ------
    InvalidScattering
        If a value is not three finite numbers, or `up` and `front` are parallel.

    Examples
    --------
    >>> import decals
    >>> import numpy as np
    >>> decals.scattering.Spherical()(np.float32([[1, 0, 0], [0, 0, 1]])).round(2)[:, 1]
    array([0.5, 1. ])
    """

    center: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 0.0, 1.0)
    front: Vector = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("center", "up", "front"):
            finite_vector(name, getattr(self, name), InvalidScattering)
        if not np.linalg.norm(np.cross(self.up, self.front)) > 1e-9:
            raise InvalidScattering("up, front: expected two directions that differ")

    def __call__(self, points: Float32Array) -> Float64Array:
        """Return the position of each point in the image, ``float64[n, 2]``."""
        up = np.asarray(self.up, np.float64) / np.linalg.norm(self.up)
        offsets = points.astype(np.float64) - np.asarray(self.center, np.float64)
        lengths = np.maximum(np.linalg.norm(offsets, axis=1), 1e-300)
        latitude = np.arcsin(np.clip(offsets @ up / lengths, -1.0, 1.0))
        return np.stack([_angles(offsets, up, self.front), 0.5 + latitude / np.pi], axis=1)


def _angles(offsets: Float64Array, axis: Float64Array, front: Vector) -> Float64Array:
    """Return angles about an axis, in turns: 1/2 in front, counter-clockwise as seen from the axis' end."""
    unit = axis / np.linalg.norm(axis)
    ahead = np.asarray(front, np.float64)
    ahead = ahead - (ahead @ unit) * unit
    turns: Float64Array = 0.5 + np.arctan2(offsets @ np.cross(unit, ahead), offsets @ ahead) / (2.0 * np.pi)
    return turns


class TextureCoordinates:
    """Projection of an image by the texture coordinates of a mesh.

    Parameters
    ----------
    surface : Model
        A mesh of any kind that `scatter` takes.
    uv : array_like
        Positions in the image: for each vertex, ``float[n, 2]``, or for each corner of each face,
        ``float[m, 3, 2]``, for textures with seams.

    Raises
    ------
    InvalidScattering
        If the surface is no mesh, or `uv` has a wrong shape or is not finite.

    Examples
    --------
    >>> import decals
    >>> import numpy as np
    >>> square = decals.surfaces.MeshSurface(
    ...     [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], [[0, 1, 2], [0, 2, 3]]
    ... )
    >>> texture = decals.scattering.TextureCoordinates(square, [[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> texture(np.float32([[1, 0.5, 0]])).round(2)
    array([[0.5 , 0.25]])
    """

    def __init__(self, surface: Model | Surface, uv: ArrayLike) -> None:
        advice = "only meshes have texture coordinates"
        mesh = as_mesh_surface(surface, advice, name="surface", error=InvalidScattering)
        coordinates = real_array("uv", uv, InvalidScattering)
        vertices, faces = len(mesh.vertices), len(mesh.faces)
        if coordinates.shape not in ((vertices, 2), (faces, 3, 2)) or not np.isfinite(coordinates).all():
            raise InvalidScattering(
                f"uv: expected finite numbers of shape [{vertices}, 2] or [{faces}, 3, 2], "
                f"got {list(coordinates.shape)}"
            )
        self._surface = mesh
        self._corners = coordinates[mesh.faces] if coordinates.ndim == 2 else coordinates

    def __call__(self, points: Float32Array) -> Float64Array:
        """Return the position in the image of the closest point of the mesh, ``float64[n, 2]``."""
        faces, weights = self._surface.locate(points)
        positions: Float64Array = np.einsum("nk,nki->ni", weights, self._corners[faces])
        return positions
