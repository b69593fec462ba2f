"""The plane that cuts the model open: its place, its handles in the view, and their drags."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.validation import finite_vector
from decals.editing.gizmo import AXES, Handle, Ray, along_line, nearest_on_sphere, snap_distance, snapped
from decals.errors import InvalidEdit
from decals.scenes.camera import Camera, Vector
from decals.scenes.objects import Box, SceneObject, bounds_of

MOVE, TILT = "slice", "tilt slice"
"""Names of the handles: one in the plane moves it along its normal, one at the end of that tilts it."""

STEEP = 0.9
"""Cosine between the normal and an axis from which on that axis is not upward in a picture of the plane."""

NONE, TILTED = "none", "tilted"
CHOICES = NONE, *AXES, TILTED
"""What cuts the model: no plane, one across an axis, or one that is tilted."""


@dataclass(frozen=True)
class SlicePlane:
    """A plane through a point; what lies on the side of the normal is cut away.

    Attributes
    ----------
    point, normal
        A point of the plane, and the unit normal.
    """

    point: Vector
    normal: Vector

    @classmethod
    def across(cls, point: ArrayLike, normal: ArrayLike) -> "SlicePlane":
        """Return the plane through a point with a normal of any length, shape (3,) each."""
        along = np.array(finite_vector("slice normal", normal, InvalidEdit), np.float64)
        length = float(np.linalg.norm(along))
        if not 0.0 < length < np.inf:
            raise InvalidEdit("slice normal: expected a direction other than 0, 0, 0")
        return cls(_vector(np.asarray(point, np.float64)), _vector(along / length))

    @property
    def choice(self) -> str:
        """The entry of `CHOICES` for this plane."""
        across = [axis for axis, unit in zip(AXES, np.eye(3), strict=True) if self.normal == _vector(unit)]
        return across[0] if across else TILTED

    @property
    def position(self) -> float:
        """Distance of the plane from the origin of the model, along the normal."""
        return float(np.dot(self.point, self.normal))

    def at(self, position: float) -> "SlicePlane":
        """Return the plane moved along its normal to a position."""
        shift = (position - self.position) * np.array(self.normal)
        return replace(self, point=_vector(np.array(self.point) + shift))

    def nearest(self, place: ArrayLike) -> Vector:
        """Return the point of the plane that is nearest to a place, shape (3,)."""
        position = np.asarray(place, np.float64)
        return _vector(position - (position @ self.normal - self.position) * np.array(self.normal))

    def facing(self, camera: Camera, *, above: bool) -> Camera:
        """Return a camera that looks straight at the plane, near the target of another one.

        What is upward for the other camera stays upward, save along the normal, or with ``above`` what
        is toward it becomes upward. What is to the right for it stays there.
        """
        target, normal = self.nearest(camera.target), np.array(self.normal)
        right, upward, back = camera.axes
        first, second = (back, upward) if above else (upward, -back)
        up = first if abs(normal @ first) < STEEP else second
        way = -normal if np.cross(up, normal) @ right < 0.0 else normal
        return replace(camera, position=_vector(target + way), target=target, up=_vector(up))

    def reach(self, low: ArrayLike, high: ArrayLike) -> tuple[float, float]:
        """Return the least and the largest position at which the plane meets a box."""
        sides = np.sort(np.stack([low, high]) * np.array(self.normal, np.float64), axis=0)
        return float(sides[0].sum()), float(sides[1].sum())

    def handles(self, length: float) -> list[Handle]:
        """Return the handles of the plane, for a normal of a length."""
        point = np.array(self.point)
        return [Handle(MOVE, point), Handle(TILT, point + length * np.array(self.normal))]


def _vector(array: Float64Array) -> Vector:
    x, y, z = (array + 0.0).tolist()
    return x, y, z


def slice_box(objects: Iterable[SceneObject]) -> Box:
    """Return the box in which a slice of objects lies; a flat one gets half its width on both sides."""
    low, high = bounds_of(objects)
    beside = np.where(high > low, 0.0, (high - low).max() / 2)
    return low - beside, high + beside


@dataclass(frozen=True)
class SliceDrag:
    """A drag of a handle of the plane, from the state in which it began.

    Attributes
    ----------
    name
        `MOVE` or `TILT`.
    plane
        The plane at the beginning.
    start
        Ray through the pointer at the beginning.
    length
        Length of the drawn normal, in model units.
    """

    name: str
    plane: SlicePlane
    start: Ray
    length: float

    def dragged(self, ray: Ray, box: tuple[ArrayLike, ArrayLike], *, snap: bool) -> SlicePlane:
        """Return the plane with the pointer at a ray; it does not leave a box.

        With ``snap``, it moves in round steps, and tilts to the nearest of the 26 directions along axes and
        diagonals.
        """
        plane = self.plane
        if self.name == TILT:
            toward = nearest_on_sphere(plane.point, self.length, plane.handles(self.length)[1].position, ray)
            if snap:
                toward = np.round(toward / np.abs(toward).max())
            return SlicePlane.across(plane.point, toward)
        first, now = (along_line(plane.point, plane.normal, one) for one in (self.start, ray))
        if first is None or now is None:  # the normal points at the viewer
            return plane
        position = plane.position + now - first
        if snap:
            position = float(snapped(position, snap_distance(self.length)))
        return plane.at(min(max(position, (ends := plane.reach(*box))[0]), ends[1]))
