"""The state of a lesson as immutable values, and the points at which its formulas are evaluated."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float64Array
from decals.apps.lab.errors import InvalidLesson
from decals.editing.queries import nearest_points
from decals.editing.slicing import SlicePlane
from decals.field.rules import PictureRules
from decals.model import Decals
from decals.scenes.camera import Camera
from decals.scenes.objects import SceneObject, bounds_of

MAP_PIXELS = 120
"""Width and height of a map in samples."""

NORMAL_STEP = 1e-3
"""Step along the surface for derivatives of its normals, over the diagonal of the box of the objects."""

EYE_DISTANCE = 10.0
"""Distance from which the rays of a map start, in widths of the map."""


def as_index(part: str, number: Any, count: int) -> int:
    """Return the index of one of so many parts of a scene, which a formula computed.

    Raises
    ------
    InvalidLesson
        The scene has no such part, perhaps any more.
    """
    if np.ndim(number) or number not in range(count):
        raise InvalidLesson(f"the scene has no {part} {number!s}; undo, or start the lesson again")
    return int(number)


@dataclass(frozen=True, eq=False)
class Points:
    """Points of the scene.

    Attributes
    ----------
    positions, normals
        float64[n, 3]. Normals are 0 in space.
    exists
        False for points that no surface has, such as pixels beside an object, bool[n].
    variables
        Names that formulas have at these points, such as "x" along a line, float64[n] each.
    """

    positions: Float64Array
    normals: Float64Array
    exists: BoolArray
    variables: Mapping[str, Float64Array] = field(default_factory=dict)

    @classmethod
    def in_space(cls, positions: Float64Array, **variables: Float64Array) -> Self:
        """Return points without normals."""
        return cls(positions, np.zeros_like(positions), np.ones(len(positions), np.bool_), variables)


@dataclass(frozen=True)
class Relaxed:
    """Measures of particles after each step of a relaxation so far; the first ones are those of the start.

    Attributes
    ----------
    step
        The step whose particles are the decals of the scene.
    energies, rhos, variations
        Energy, least distance over the ideal one, and variation of the distances to the nearest neighbours.
    """

    step: int
    energies: tuple[float, ...]
    rhos: tuple[float, ...]
    variations: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Experiment:
    """A scene under study: what the formulas of a lesson are about.

    Attributes
    ----------
    objects, decals, rules
        The scene, and the rules by which it is drawn. Decal 0 is the first one of the lesson.
    probe
        The point at which values are shown.
    camera
        The camera of the lesson: maps show what it sees.
    size
        Width of maps in model units; by default what the camera sees.
    in_space
        Formulas are evaluated in space, not on surfaces.
    line
        Ends of the lesson's line, or the numbers of two decals.
    relaxed
        The relaxation of a lesson on scattering, else None.
    plane
        The slice, or None. The probe lies on the slice, and maps show the slice in place of the surface.
    cache
        Values that several formulas share, with the points they hold at.
    """

    objects: tuple[SceneObject, ...]
    decals: Decals
    rules: PictureRules
    probe: tuple[float, float, float]
    camera: Camera
    size: float
    in_space: bool = False
    line: tuple[Any, Any] = (0, 1)
    relaxed: Relaxed | None = None
    plane: SlicePlane | None = None
    cache: dict[Any, Any] = field(default_factory=dict)

    def decal(self, number: Any) -> int:
        """Return the row of a decal; raise `InvalidLesson` if the scene has lost it."""
        return as_index("decal", number, len(self.decals))

    # -- points -----------------------------------------------------------------------------------------

    @property
    def _off_surfaces(self) -> bool:
        return self.in_space or self.plane is not None or not self.objects

    @property
    def _map_camera(self) -> Camera:
        """The camera of maps: that of the lesson sees surfaces from above."""
        return self.camera if self.plane is None else self.plane.facing(self.camera, above=not self.in_space)

    def points_near(self, positions: ArrayLike, **variables: Float64Array) -> Points:
        """Return the points of the surfaces that are nearest to positions; the positions in space."""
        places = np.asarray(positions, np.float64).reshape(-1, 3)
        if self._off_surfaces:
            return Points.in_space(places, **variables)
        near = nearest_points(self.objects, places)
        exists = np.ones(len(places), np.bool_)
        return Points(near.positions.astype(np.float64), near.normals.astype(np.float64), exists, variables)

    def line_points(self, count: int) -> Points:
        """Return points on the lesson's line, with "x", the distance from its first end.

        A line through two decals begins and ends where their fields do.
        """
        first, last = (self._end(end) for end in self.line)
        distance = float(np.linalg.norm(last - first))
        direction = (last - first) / distance if distance else self.camera.axes[0]
        low, high = 0.0, distance
        if isinstance(self.line[0], int):
            reach = self.decals.influence[[self.decal(end) for end in self.line]]
            low, high = min(-reach[0], distance - reach[1]), max(distance + reach[1], reach[0])
        x = np.linspace(low, high, count)
        return self.points_near(first + x[:, None] * direction, x=x)

    def along_line(self, position: ArrayLike) -> float:
        """Return "x" of the point of the line that is nearest to a position."""
        first, last = (self._end(end) for end in self.line)
        length = float(np.linalg.norm(last - first))
        return float((np.asarray(position) - first) @ (last - first)) / length if length else 0.0

    def _end(self, end: Any) -> Float64Array:
        place = self.decals.positions[self.decal(end)] if isinstance(end, int) else end
        return np.asarray(place, np.float64)

    def map_points(self) -> Points:
        """Return the points that pixels of a map show, row by row from the top."""
        return _map_points(self.objects, self._map_camera, self.size, self._off_surfaces)

    def normal_derivatives(self, points: Points) -> Float64Array | None:
        """Return derivatives of the surfaces' normals by the points, float64[n, 3, 3]; None in space."""
        return None if self._off_surfaces else _normal_derivatives(self.objects, points)

    def on_map(self, position: ArrayLike) -> tuple[float, float]:
        """Return where a position is on a map, to the right and up in model units from the middle."""
        right, up, _ = self._map_camera.axes
        offset = np.asarray(position, np.float64) - self._map_camera.target
        return float(offset @ right), float(offset @ up)


@lru_cache(maxsize=4)
def _map_points(objects: tuple[SceneObject, ...], camera: Camera, size: float, in_space: bool) -> Points:
    right, up, back = camera.axes
    steps = (np.arange(MAP_PIXELS) + 0.5) / MAP_PIXELS * size - size / 2
    x, y = (grid.ravel() for grid in np.meshgrid(steps, -steps))
    places = np.asarray(camera.target) + x[:, None] * right + y[:, None] * up
    if in_space:
        return Points.in_space(places)
    eyes = (places + EYE_DISTANCE * size * back).astype(np.float32)
    rays = np.tile(-back.astype(np.float32), (len(eyes), 1))
    distances = np.min([item.surface.raycast(eyes, rays) for item in objects], axis=0)
    exists = np.isfinite(distances)
    near = nearest_points(objects, eyes + np.where(exists, distances, 0.0)[:, None] * rays)
    return Points(near.positions.astype(np.float64), near.normals.astype(np.float64), exists)


@lru_cache(maxsize=4)
def _normal_derivatives(objects: tuple[SceneObject, ...], points: Points) -> Float64Array:
    """Return derivatives of normals by differences along the surface."""
    low, high = bounds_of(objects)
    step = NORMAL_STEP * float(np.linalg.norm(np.subtract(high, low)))
    least = np.eye(3)[np.abs(points.normals).argmin(axis=1)]
    first = np.cross(points.normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    derivatives = np.zeros((len(first), 3, 3))
    for tangent in (first, np.cross(points.normals, first)):
        ahead, behind = (
            nearest_points(objects, points.positions + way * tangent).normals.astype(np.float64)
            for way in (step, -step)
        )
        derivatives += (ahead - behind)[:, :, None] * tangent[:, None, :] / (2.0 * step)
    return derivatives


@dataclass(frozen=True, eq=False)
class Scope:
    """What a formula is evaluated in: an experiment, and points of it.

    Attributes
    ----------
    experiment
        The experiment.
    points
        The points; formulas give a value for each.
    """

    experiment: Experiment
    points: Points

    @classmethod
    def at_probe(cls, experiment: Experiment) -> Self:
        """Return the scope of live values: the probe."""
        return cls(experiment, experiment.points_near(experiment.probe))

    def at(self, points: Points) -> "Scope":
        """Return the scope at other points."""
        return replace(self, points=points)

    def __getitem__(self, name: str) -> Float64Array:
        return self.points.variables[name]

    def shared(self, name: str, compute: Callable[[], Any]) -> Any:
        """Return a value that several formulas need at the same points, computed once."""
        cache, key = self.experiment.cache, (name, id(self.points))
        if key not in cache:
            cache[key] = self.points, compute()  # the points stay alive, and so their id theirs
        return cache[key][1]
