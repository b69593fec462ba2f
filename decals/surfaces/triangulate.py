"""Polygons as triangles: every polygon of n corners gives n - 2 triangles, and they cover its area.

Convex polygons are divided all at once. The others lose one ear after the other: a corner whose triangle
holds nothing of the rest (Meisters 1975). All corners are kept, also those on straight sides: without them,
a neighbour that has them would no longer meet the polygon.
"""

import heapq
import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from decals.errors import InvalidMesh

MeshArrays = tuple[Float32Array, Int32Array]
"""Vertices ``float32[n, 3]`` and triangles ``int32[m, 3]``."""

MIN_PRECISE_RATIO = 500.0
"""Least ratio of coordinates to the extent of a mesh at which float64 is kept."""

_logger = logging.getLogger(__name__)

FLAT = 1e-12
"""Area of a triangle, relative to the square around its polygon, below which it counts as none."""

CROSSING = 1e-6
"""Area that triangles may cover twice, relative to that of their polygon, which else crosses itself."""


@dataclass(frozen=True)
class Polygons:
    """Polygons of any sizes.

    Attributes
    ----------
    corners : int64[k]
        Vertices of all polygons, one polygon after the other.
    sizes : int64[m]
        Number of corners of each polygon.
    """

    corners: Int64Array
    sizes: Int64Array

    @staticmethod
    def of(rows: "NDArray[Any] | Sequence[NDArray[Any]] | Polygons") -> "Polygons":
        """Return polygons from rows of corners, which may differ in length."""
        if isinstance(rows, Polygons):
            return rows
        if isinstance(rows, np.ndarray):
            return Polygons(rows.reshape(-1).astype(np.int64), np.full(len(rows), rows.shape[1], np.int64))
        corners = np.concatenate([*rows, np.zeros(0, np.int64)]).astype(np.int64)
        return Polygons(corners, np.fromiter(map(len, rows), np.int64, len(rows)))

    @staticmethod
    def joined(parts: "Iterable[Polygons]") -> "Polygons":
        """Return the polygons of several values, in turn."""
        parts = [Polygons(np.zeros(0, np.int64), np.zeros(0, np.int64)), *parts]
        return Polygons(
            np.concatenate([part.corners for part in parts]), np.concatenate([part.sizes for part in parts])
        )

    def __len__(self) -> int:
        return len(self.sizes)


@dataclass(frozen=True)
class Triangulation:
    """Triangles of polygons, in the order of the polygons.

    Attributes
    ----------
    places : int64[t, 3]
        Places of the triangles' corners within ``Polygons.corners``.
    polygons : int64[t]
        Polygon of each triangle.
    crossing : int
        Number of polygons that cross themselves, so that some triangles lie on others.
    """

    places: Int64Array
    polygons: Int64Array
    crossing: int


def triangulate(points: NDArray[Any], polygons: Polygons) -> Triangulation:
    """Divide polygons into triangles; those of fewer than three corners give none."""
    sizes = polygons.sizes
    if (sizes == 3).all():
        places = np.arange(3 * len(sizes)).reshape(-1, 3)
        return Triangulation(places, np.arange(len(sizes)), 0)
    counts = np.maximum(sizes - 2, 0)
    starts, firsts = np.cumsum(sizes) - sizes, np.cumsum(counts) - counts
    places = np.empty((counts.sum(), 3), np.int64)
    crossing = 0
    for size in np.unique(sizes[sizes > 2]).tolist():
        rows = np.flatnonzero(sizes == size)
        corners = starts[rows, None] + np.arange(size)
        local, crosses = _divide(np.asarray(points[polygons.corners[corners]], np.float64))
        triangles = np.take_along_axis(corners, local.reshape(len(rows), -1), axis=1)
        places[firsts[rows, None] + np.arange(size - 2)] = triangles.reshape(len(rows), size - 2, 3)
        crossing += int(crosses.sum())
    return Triangulation(places, np.repeat(np.arange(len(sizes)), counts), crossing)


def _divide(loops: Float64Array) -> tuple[Int64Array, BoolArray]:
    """Return the triangles ``int64[m, k - 2, 3]`` of loops ``float64[m, k, 3]``, and which loops cross."""
    count, size = loops.shape[:2]
    if size == 3:
        return np.broadcast_to(np.arange(3), (count, 1, 3)), np.zeros(count, np.bool_)
    flat = _flattened(loops)
    if size == 4:
        triangles = _HALVES[_second_diagonal(loops, flat).astype(np.int64)]
    else:
        triangles = np.tile(_ring(size), (count, 1, 1))
        fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
        following = (np.arange(size)[:, None] + np.arange(3)) % size
        convex = (_areas(flat, following) > FLAT).all(axis=1) & (_areas(flat, fan) > FLAT).all(axis=1)
        for row in np.flatnonzero(~convex).tolist():
            triangles[row] = _EarClipper(flat[row]).triangles()
    areas = np.take_along_axis(flat, triangles.reshape(count, -1, 1), axis=1).reshape(count, -1, 3, 2)
    signed = _doubled(areas[:, :, 0], areas[:, :, 1], areas[:, :, 2])
    wrong: BoolArray = -np.minimum(signed, 0.0).sum(axis=1) > CROSSING * np.abs(signed).sum(axis=1) + FLAT
    return triangles, wrong


_HALVES = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
"""Triangles of a quadrilateral with the first diagonal, and with the second one."""


def _flattened(loops: Float64Array) -> Float64Array:
    """Project each loop on its plane, counter-clockwise, into the unit square."""
    spans = np.ptp(loops, axis=1).max(axis=1)
    local = (loops - loops.mean(axis=1, keepdims=True)) / np.where(spans > 0.0, spans, 1.0)[:, None, None]
    normals = np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > FLAT, normals / np.where(lengths > 0.0, lengths, 1.0), (0.0, 0.0, 1.0))
    across = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(across, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(normals, first)], axis=2)
    flat: Float64Array = local @ axes
    return flat


def _doubled(a: Float64Array, b: Float64Array, c: Float64Array) -> Float64Array:
    """Return twice the areas of triangles in the plane, positive if counter-clockwise."""
    u, v = b - a, c - a
    areas: Float64Array = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return areas


def _areas(flat: Float64Array, triangles: Int64Array) -> Float64Array:
    """Return twice the areas of the same triangles of all loops, ``float64[m, t]``."""
    return _doubled(flat[:, triangles[:, 0]], flat[:, triangles[:, 1]], flat[:, triangles[:, 2]])


def _second_diagonal(loops: Float64Array, flat: Float64Array) -> BoolArray:
    """Return True for quadrilaterals that the second diagonal divides: if it lies inside, and is shorter."""
    smallest = [_areas(flat, half).min(axis=1) for half in _HALVES]
    lengths = [((loops[:, k] - loops[:, k + 2]) ** 2).sum(axis=1) for k in (0, 1)]
    convex = (smallest[0] > FLAT) & (smallest[1] > FLAT)
    second: BoolArray = np.where(convex, lengths[1] <= lengths[0], smallest[1] > smallest[0] + FLAT)
    return second


@cache
def _ring(size: int) -> Int64Array:
    """Return the triangles of a convex polygon: every second corner is cut off, again and again."""
    ring, triangles = list(range(size)), []
    while len(ring) > 3:
        cut = range(1, min(len(ring), 2 * (len(ring) - 3) + 1), 2)
        triangles += [(ring[k - 1], ring[k], ring[(k + 1) % len(ring)]) for k in cut]
        ring = [corner for k, corner in enumerate(ring) if k not in cut]
    return np.array([*triangles, ring], np.int64)


def _corner_tree(flat: Float64Array) -> Any:
    """Return the tree of the corners of a loop, by which those near a place are found."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    return cKDTree(flat)


class _EarClipper:
    """Division of one polygon in the plane that is not strictly convex.

    Ears with the shortest diagonals go first. An ear is blocked by a corner inside its triangle; it is tried
    again once that corner changes.
    """

    def __init__(self, flat: Float64Array) -> None:
        self.points: list[tuple[float, float]] = [(x, y) for x, y in flat.tolist()]
        count = len(self.points)
        self.before = [(k - 1) % count for k in range(count)]
        self.after = [(k + 1) % count for k in range(count)]
        self.left = set(range(count))
        self.turns = [self._turn(k) for k in range(count)]
        self.version = [0] * count
        self.waiting: dict[int, list[int]] = {}
        self.heap: list[tuple[float, int, int]] = []
        self.blocking = np.array(self.turns) <= FLAT
        self.tree = _corner_tree(flat) if count > TREE_CORNERS else None

    def triangles(self) -> list[tuple[int, int, int]]:
        """Return one triangle less than there are corners, less one."""
        for corner in self.left:
            self._offer(corner)
        found = []
        while len(self.left) > 3:
            ear = self._next_ear()
            found.append((self.before[ear], ear, self.after[ear]))
            self._cut(ear)
        corner = min(self.left)
        return [*found, (corner, self.after[corner], self.before[corner])]

    def _turn(self, k: int) -> float:
        return _turn(self.points[self.before[k]], self.points[k], self.points[self.after[k]])

    def _offer(self, k: int) -> None:
        """Put a corner into the heap if it is convex."""
        self.version[k] += 1
        if self.turns[k] > FLAT:
            heapq.heappush(self.heap, (self._diagonal(k), k, self.version[k]))

    def _diagonal(self, k: int) -> float:
        (x, y), (u, v) = self.points[self.before[k]], self.points[self.after[k]]
        return (x - u) ** 2 + (y - v) ** 2

    def _next_ear(self) -> int:
        while self.heap:
            _, corner, version = heapq.heappop(self.heap)
            if corner not in self.left or version != self.version[corner]:
                continue
            blocker = self._blocker(corner)
            if blocker is None:
                return corner
            self.waiting.setdefault(blocker, []).append(corner)
        # No true ear is left: take a spike or a straight side, else any corner of a loop that crosses itself.
        return min(self.left, key=lambda k: (self.turns[k] < -FLAT, self.turns[k] > FLAT, self._diagonal(k)))

    def _cut(self, ear: int) -> None:
        first, last = self.before[ear], self.after[ear]
        self.left.remove(ear)
        self.after[first], self.before[last] = last, first
        self.blocking[ear] = False
        again = {first, last}
        for corner in (first, last):
            self.turns[corner] = self._turn(corner)
            self.blocking[corner] = self.turns[corner] <= FLAT
        for corner in (ear, first, last):
            again.update(self.waiting.pop(corner, ()))
        for corner in again & self.left:
            self._offer(corner)

    def _blocker(self, ear: int) -> int | None:
        """Return a corner that is not convex and lies in the triangle of an ear, or None."""
        before, after = self.before[ear], self.after[ear]
        a, b, c = self.points[before], self.points[ear], self.points[after]
        for corner in self._near(a, b, c):
            if corner in (before, ear, after):
                continue
            p = self.points[corner]
            if p in (a, b, c):
                if self._enters(corner, *{a: (b, c), b: (c, a), c: (a, b)}[p]):
                    return corner
            elif _turn(a, b, p) >= -FLAT and _turn(b, c, p) >= -FLAT and _turn(c, a, p) >= -FLAT:
                return corner
        return None

    def _near(self, *triangle: tuple[float, float]) -> list[int]:
        """Return the corners that are not convex and may lie in a triangle."""
        if self.tree is None:
            near = np.flatnonzero(self.blocking)
        else:
            xs, ys = zip(*triangle, strict=True)
            center = 0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys))
            reach = 0.5 * max(max(xs) - min(xs), max(ys) - min(ys))
            near = np.array(self.tree.query_ball_point(center, reach + FLAT, p=np.inf), np.int64)
            near = near[self.blocking[near]]
        found: list[int] = near.tolist()
        return found

    def _enters(self, corner: int, u: tuple[float, float], v: tuple[float, float]) -> bool:
        """Return True if a side at a corner, which lies on a triangle's corner, goes into the triangle."""
        p = self.points[corner]
        ends = (self.points[self.before[corner]], self.points[self.after[corner]])
        return any(_turn(p, u, end) > FLAT and _turn(p, end, v) > FLAT for end in ends)


TREE_CORNERS = 100
"""Corners from which on a tree finds those in a triangle."""


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the area of a triangle, positive if counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def precise_points(points: ArrayLike) -> Any:
    """Return points as float32; keep float64 of points so far from zero that float32 would round them."""
    given = np.asarray(points)
    with np.errstate(over="ignore", invalid="ignore"):  # surfaces refuse infinity and NaN
        finite = given.dtype == np.float64 and len(given) and np.isfinite(given).all()
        if finite and np.abs(given).max() > MIN_PRECISE_RATIO * np.ptp(given, axis=0).max():
            return given
        return given.astype(np.float32)


def polygon_triangles(
    points: ArrayLike, polygons: Polygons | NDArray[Any] | Sequence[NDArray[Any]], *, name: str
) -> MeshArrays:
    """Divide polygons into triangles, concave ones too, after a check of their indices."""
    return traced_triangles(points, polygons, name=name)[:2]


def traced_triangles(
    points: ArrayLike, polygons: Polygons | NDArray[Any] | Sequence[NDArray[Any]], *, name: str
) -> tuple[Float32Array, Int32Array, Triangulation]:
    """Return vertices and triangles as `polygon_triangles` does, and which corners the triangles have."""
    vertices: Any = precise_points(points)
    polygons = Polygons.of(polygons)
    if len(polygons) == len(vertices) == 0:
        raise InvalidMesh(
            f"{name!r} has no points and no faces; give a surface mesh (a file may be of another format)"
        )
    if len(polygons) == 0:
        raise InvalidMesh(f"{name!r} has {len(vertices)} points but no faces; give a surface mesh")
    check_indices(polygons.corners, len(vertices), name)
    if (polygons.sizes < 3).all():
        raise InvalidMesh(f"{name!r} has no face of three or more corners; give a surface mesh")
    if short := int((polygons.sizes < 3).sum()):
        _logger.warning("%s: left out %d faces of fewer than three corners", name, short)
    wrong = ~np.isfinite(vertices[polygons.corners]).all(axis=1)
    if wrong.any():
        bad = int(polygons.corners[np.argmax(wrong)])
        raise InvalidMesh(
            f"{name!r} has a face at point {bad}, whose coordinates are not finite; correct them"
        )
    triangles = triangulate(vertices, polygons)
    if triangles.crossing:
        _logger.warning(
            "%s: %d faces cross themselves; some of their triangles lie on others", name, triangles.crossing
        )
    return vertices, polygons.corners[triangles.places].astype(np.int32), triangles


def check_indices(corners: Any, count: int, name: str) -> None:
    """Refuse corner indices out of range: VTK's filters trust them and crash."""
    if len(corners) and (corners.min() < 0 or corners.max() >= count):
        bad = corners.min() if corners.min() < 0 else corners.max()
        raise InvalidMesh(f"{name!r} has {count} points but a face asks for number {bad}; export it again")
