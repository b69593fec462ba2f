"""How a flat image lies on a surface: from points in space to places in the image.

A projection is a function of ``points[n, 3]`` to ``uv[n, 2]``: u runs from 0 at the left edge of the image to
1 at the right, v from 0 at the bottom to 1 at the top. Any such function of the user's own will do.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.checks import instance, shown
from decals.errors import InvalidSeeding
from decals.seeds.population import surfaces_of
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Floats, Surface
from decals.wishes import numbers

Wide = NDArray[np.float64]
Projection = Callable[[Floats], Wide]
"""``points[n, 3]`` to ``uv[n, 2]``."""

Vector = Sequence[float]

_SEEN = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}
"""Axes to the right, up and toward the viewer of who looks at a model along each axis, from its far end."""


def box_of(surfaces: Surface | Sequence[Surface]) -> tuple[Wide, Wide]:
    """Corners of the box around surfaces."""
    given = surfaces_of(surfaces)
    if not given:
        raise InvalidSeeding("surfaces: expected at least one to lay an image over, got none")
    boxes = np.array([surface.bounds for surface in given], dtype=np.float64)
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _vector(name: str, value: ArrayLike) -> Wide:
    vector = numbers(name, value)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InvalidSeeding(f"{name}: expected three finite numbers, got {shown(value)}")
    return vector


def _axis(name: str) -> tuple[int, int, int]:
    if not isinstance(name, str) or name not in _SEEN:
        raise InvalidSeeding(f"axis: expected 'x', 'y' or 'z', got {shown(name)}")
    return _SEEN[name]


@dataclass(frozen=True)
class Planar:
    """An image thrown straight onto the model, as from a slide projector; it shows on the far side, too.

    Parameters
    ----------
    origin
        Where the image's lower left corner lies.
    right, up
        From there to the lower right and to the upper left corner.
    """

    origin: Vector
    right: Vector
    up: Vector

    def __post_init__(self) -> None:
        _vector("origin", self.origin)
        sides = np.stack([_vector("right", self.right), _vector("up", self.up)])
        if np.linalg.matrix_rank(sides) < 2:
            raise InvalidSeeding("right, up: expected sides of a parallelogram, got parallel or zero vectors")

    def __call__(self, points: Floats) -> Wide:
        """Place of each point in the image."""
        sides = np.stack([self.right, self.up], axis=1).astype(np.float64)
        offsets = points.astype(np.float64) - np.asarray(self.origin, np.float64)
        found: Wide = offsets @ np.linalg.pinv(sides).T
        return found

    @classmethod
    def over(cls, surfaces: Surface | Sequence[Surface], axis: str = "z") -> "Planar":
        """Stretch an image over the box around surfaces, as seen from the far end of an axis: x, y or z."""
        (right, up, toward), (low, high) = _axis(axis), box_of(surfaces)
        sides = np.diag(np.maximum(high - low, 1e-12 * (high - low).max()))
        origin = low.copy()
        origin[toward] = high[toward]
        return cls(tuple(origin), tuple(sides[right]), tuple(sides[up]))


@dataclass(frozen=True)
class Cylindrical:
    """An image wrapped around an axis like a label around a bottle; its seam lies opposite of `front`.

    Parameters
    ----------
    base, top
        The axis, from the image's lower edge to its upper one.
    front
        Where the image's middle points to.
    """

    base: Vector
    top: Vector
    front: Vector = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("base", "top", "front"):
            _vector(name, getattr(self, name))
        axis = np.subtract(self.top, self.base)
        if not np.linalg.norm(np.cross(axis, self.front)) > 1e-9 * np.linalg.norm(axis) > 0:
            raise InvalidSeeding("expected an axis with length, and a front that is not along it")

    def __call__(self, points: Floats) -> Wide:
        """Place of each point in the image."""
        axis = np.subtract(self.top, self.base).astype(np.float64)
        offsets = points.astype(np.float64) - np.asarray(self.base, np.float64)
        return np.stack([_turns(offsets, axis, self.front), offsets @ axis / (axis @ axis)], axis=1)

    @classmethod
    def over(cls, surfaces: Surface | Sequence[Surface], axis: str = "z") -> "Cylindrical":
        """Wrap an image around the box of surfaces, about the axis x, y or z through its middle."""
        (right, _, along), (low, high) = _axis(axis), box_of(surfaces)
        base = 0.5 * (low + high)
        top = base.copy()
        base[along], top[along] = low[along], high[along]
        return cls(tuple(base), tuple(top), tuple(np.eye(3)[right]))


@dataclass(frozen=True)
class Spherical:
    """An image wrapped around a ball like a map of the world: u is longitude, v latitude.

    Parameters
    ----------
    center
        Of the ball.
    up
        Toward the upper edge of the image.
    front
        Where the image's middle points to.
    """

    center: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 0.0, 1.0)
    front: Vector = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("center", "up", "front"):
            _vector(name, getattr(self, name))
        if not np.linalg.norm(np.cross(self.up, self.front)) > 1e-9:
            raise InvalidSeeding("up, front: expected two directions that differ")

    def __call__(self, points: Floats) -> Wide:
        """Place of each point in the image."""
        up = np.asarray(self.up, np.float64) / np.linalg.norm(self.up)
        offsets = points.astype(np.float64) - np.asarray(self.center, np.float64)
        lengths = np.maximum(np.linalg.norm(offsets, axis=1), 1e-300)
        latitude = np.arcsin(np.clip(offsets @ up / lengths, -1.0, 1.0))
        return np.stack([_turns(offsets, up, self.front), 0.5 + latitude / np.pi], axis=1)


def _turns(offsets: Wide, axis: Wide, front: Vector) -> Wide:
    """Angle of each offset about an axis, in turns: 1/2 in front, counter-clockwise seen from its end."""
    unit = axis / np.linalg.norm(axis)
    ahead = np.asarray(front, np.float64)
    ahead = ahead - (ahead @ unit) * unit
    turns: Wide = 0.5 + np.arctan2(offsets @ np.cross(unit, ahead), offsets @ ahead) / (2.0 * np.pi)
    return turns


class TextureCoordinates:
    """An image painted on a mesh that brings texture coordinates along.

    Parameters
    ----------
    surface
        The mesh.
    uv
        For each vertex, ``float[n, 2]``, or for each corner of each face, ``float[m, 3, 2]``, where
        the texture has seams.
    """

    def __init__(self, surface: MeshSurface, uv: ArrayLike) -> None:
        instance("surface", surface, MeshSurface, InvalidSeeding, "only meshes have texture coordinates")
        given = numbers("uv", uv)
        vertices, faces = len(surface.vertices), len(surface.faces)
        if given.shape not in ((vertices, 2), (faces, 3, 2)) or not np.isfinite(given).all():
            raise InvalidSeeding(
                f"uv: expected finite numbers of shape [{vertices}, 2] or [{faces}, 3, 2], "
                f"got {list(given.shape)}"
            )
        self._surface = surface
        self._corners = given[surface.faces] if given.ndim == 2 else given

    def __call__(self, points: Floats) -> Wide:
        """Place in the image of the closest point of the mesh."""
        faces, weights = self._surface.locate(points)
        found: Wide = np.einsum("nk,nki->ni", weights, self._corners[faces])
        return found
