"""Handles of the selected node, and the arithmetic of their drags: rays in, maps and points out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node
from blobtree._typing import Float64Array
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import Path, node_at, primitive_path
from blobtree.nodes.places import Place

AXES = "x", "y", "z"
TURN_PLACE, SCALE_PLACE = 0.75, 1.2
"""Distances of the handles that turn and scale from the middle, in lengths of the axes."""

SNAP_ANGLE = 15.0
"""Step of a snapped turn, in degrees."""

SNAP_FACTOR = 0.1
"""Step of a snapped scale."""

SNAPS_PER_LENGTH = 4.0
"""Least number of snapped steps along an axis of the gizmo, if no distance is given."""

PARALLEL = 1e-3
"""Sine of an angle below which a ray counts as parallel to a plane, or to a line."""

Ray = tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True, eq=False)
class Handle:
    """A handle of a node.

    Attributes
    ----------
    name
        "move", "move x", "turn x", "scale", or a parameter and the row of its point, such as "start 0".
    position
        Where it lies in the world, float64, shape (3,).
    """

    name: str
    position: Float64Array


def handles_of(tree: Node, path: Path, length: float) -> list[Handle]:
    """Return the handles of the node at a path, the middle first; none for one that its warps do not show.

    Parameters
    ----------
    tree
        The tree.
    path
        Path of the node.
    length
        Length of the gizmo's axes, in model units.
    """
    try:
        middle = Place(tree, path).middle
        points = control_points(tree, path)
    except InvalidNode:
        return []
    handles = [Handle("move", middle)]
    for axis, name in enumerate(AXES):
        across = np.ones(3) - np.eye(3)[axis]
        handles.append(Handle(f"move {name}", middle + length * np.eye(3)[axis]))
        handles.append(Handle(f"turn {name}", middle + TURN_PLACE * length * across / math.sqrt(2.0)))
    handles.append(Handle("scale", middle + SCALE_PLACE * length / math.sqrt(3.0)))
    alone = len(points) == 1 and math.dist(points[0].position, middle) <= 1e-3 * length
    return handles if alone else handles + points


def control_points(tree: Node, path: Path) -> list[Handle]:
    """Return a handle for each point that the primitive at a path declares: ends, corners, control points."""
    try:
        path = primitive_path(tree, path)
    except InvalidNode:
        return []
    node, place = node_at(tree, path), Place(tree, path)
    handles = []
    for name, parameter in parameters_of(type(node)).items():
        if parameter.quantity in (Quantity.POINT, Quantity.POINTS):
            rows = np.atleast_2d(np.asarray(getattr(node, name), np.float64))
            handles += [Handle(f"{name} {row}", place.world(point)) for row, point in enumerate(rows)]
    return handles


def moved_point(tree: Node, path: Path, handle: str, target: ArrayLike) -> tuple[Path, str, Any]:
    """Return path, parameter and value that put a control point at a point of the world, shape (3,)."""
    path = primitive_path(tree, path)
    name, row = handle.rsplit(" ", 1)
    node, place = node_at(tree, path), tuple(Place(tree, path).local(target).tolist())
    value = getattr(node, name)
    if parameters_of(type(node))[name].quantity is Quantity.POINT:
        return path, name, place
    return path, name, (*value[: int(row)], place, *value[int(row) + 1 :])


# -- rays ---------------------------------------------------------------------------------------------------


def _unit(vector: ArrayLike) -> Float64Array:
    array = np.asarray(vector, np.float64).reshape(3)
    return array / np.linalg.norm(array)


def along_line(origin: ArrayLike, axis: ArrayLike, ray: Ray) -> float | None:
    """Return how far along a line, from its origin, it comes closest to a ray; None if they are parallel."""
    start, direction, line = np.asarray(ray[0], np.float64).reshape(3), _unit(ray[1]), _unit(axis)
    across = direction - (direction @ line) * line
    squared = float(across @ across)
    if squared < PARALLEL**2:
        return None
    offset = start - np.asarray(origin, np.float64)
    return float(offset @ line - (offset @ across) / squared * (direction @ line))


def on_plane(point: ArrayLike, normal: ArrayLike, ray: Ray) -> Float64Array | None:
    """Return where a ray meets a plane, shape (3,); None if they are parallel."""
    start, direction, up = np.asarray(ray[0], np.float64).reshape(3), _unit(ray[1]), _unit(normal)
    slope = float(direction @ up)
    if abs(slope) < PARALLEL:
        return None
    met: Float64Array = start + direction * float((np.asarray(point, np.float64) - start) @ up) / slope
    return met


def nearest_on_sphere(center: ArrayLike, radius: float, near: ArrayLike, ray: Ray) -> Float64Array:
    """Return the unit direction from a centre to a ray: where it meets a sphere, the nearer to a point.

    A ray that misses the sphere gives the direction to its point closest to the centre.
    """
    middle, along = np.asarray(center, np.float64), _unit(ray[1])
    start = np.asarray(ray[0], np.float64).reshape(3) - middle
    closest = start - (start @ along) * along
    half_chord = math.sqrt(max(radius**2 - float(closest @ closest), 0.0))
    ends = closest - half_chord * along, closest + half_chord * along
    offset = np.asarray(near, np.float64) - middle
    return _unit(min(ends, key=lambda end: float(np.linalg.norm(end - offset))))


def angle_about(axis: ArrayLike, first: ArrayLike, second: ArrayLike) -> float:
    """Return the angle in degrees from one offset to another, counter-clockwise about an axis."""
    line, a, b = _unit(axis), np.asarray(first, np.float64), np.asarray(second, np.float64)
    a, b = a - (a @ line) * line, b - (b @ line) * line
    return math.degrees(math.atan2(float(line @ np.cross(a, b)), float(a @ b)))


def turn_about(center: Float64Array, axis: int, degrees: float) -> Float64Array:
    """Return the turn about a line through a centre along an axis of the world, float64[4, 4]."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = np.eye(4)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix[[first, second], [first, second]] = cosine
    matrix[second, first], matrix[first, second] = sine, -sine
    matrix[:3, 3] = center - matrix[:3, :3] @ center
    return matrix


def scale_about(center: Float64Array, factor: float) -> Float64Array:
    """Return the scale by a factor about a centre, float64[4, 4]."""
    matrix = np.diag([factor, factor, factor, 1.0])
    matrix[:3, 3] = (1.0 - factor) * center
    return matrix


def snapped(value: Any, step: float) -> Any:
    """Return a number, or numbers, rounded to multiples of a step."""
    return np.round(np.asarray(value, np.float64) / step) * step


def snap_distance(length: float) -> float:
    """Return a round distance, 1, 2 or 5 times a power of ten, for steps of a gizmo of a length."""
    most = length / SNAPS_PER_LENGTH
    power = 10.0 ** math.floor(math.log10(most))
    return max(power * factor for factor in (1.0, 2.0, 5.0) if power * factor <= most * 1.0001)


@dataclass(frozen=True, eq=False)
class HandleDrag:
    """A drag of one handle, from the state in which it began.

    Parameters
    ----------
    handles
        Handles of the node at the beginning, the middle first.
    name
        Name of the dragged one.
    start
        Ray through the pointer at the beginning.
    length
        Length of the gizmo's axes, in model units.
    """

    handles: Sequence[Handle]
    name: str
    start: Ray
    length: float

    @property
    def _middle(self) -> Float64Array:
        return self.handles[0].position

    def _in_view(self, point: Float64Array, ray: Ray) -> Float64Array | None:
        """Return where a ray meets the plane through a point that faced the viewer at the beginning."""
        return on_plane(point, self.start[1], ray)

    def offset(self, ray: Ray, step: float) -> Float64Array | None:
        """Return the displacement of a drag that moves, in multiples of a step unless it is 0."""
        if self.name == "move":
            first, now = self._in_view(self._middle, self.start), self._in_view(self._middle, ray)
            shift = None if first is None or now is None else now - first
        else:
            axis = np.eye(3)[AXES.index(self.name[-1])]
            first_at, now_at = (along_line(self._middle, axis, one) for one in (self.start, ray))
            shift = None if first_at is None or now_at is None else (now_at - first_at) * axis
        return snapped(shift, step) if step and shift is not None else shift

    def matrix(self, ray: Ray, *, snap: bool) -> Float64Array | None:
        """Return the map of a drag that turns or scales, float64[4, 4]."""
        if self.name == "scale":
            first, now = (self._in_view(self._middle, one) for one in (self.start, ray))
            if first is None or now is None:
                return None
            reach = float(np.linalg.norm(first - self._middle))
            factor = float(np.linalg.norm(now - self._middle)) / max(reach, 1e-9 * self.length)
            factor = max(float(snapped(factor, SNAP_FACTOR)) if snap else factor, SNAP_FACTOR)
            return scale_about(self._middle, factor)
        axis = AXES.index(self.name[-1])
        first, now = (on_plane(self._middle, np.eye(3)[axis], one) for one in (self.start, ray))
        if first is None or now is None:
            return None
        degrees = angle_about(np.eye(3)[axis], first - self._middle, now - self._middle)
        return turn_about(self._middle, axis, float(snapped(degrees, SNAP_ANGLE)) if snap else degrees)

    def point(self, ray: Ray, step: float) -> Float64Array | None:
        """Return where a drag puts a control point, on multiples of a step unless it is 0."""
        place = next(handle.position for handle in self.handles if handle.name == self.name)
        first, now = self._in_view(place, self.start), self._in_view(place, ray)
        if first is None or now is None:
            return None
        return snapped(place + now - first, step) if step else place + now - first
