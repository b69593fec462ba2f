"""Random trees with thin parts, and the exact areas of their parts, in float64.

Each part is a surface of revolution as dense triangles. A deformation acts on the triangles as on the tree.
The *own region* of a part is where no other part has any field: there its surface is known, however the parts
are combined.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import blobtree
from blobtree import Disc, Node, Point, Segment, Torus
from blobtree._typing import BoolArray, Float64Array, IndexArray, Int32Array

KINDS = ("ball", "hair", "rod", "ring", "plate")
AROUND = 48
"""Steps around the axis of a part."""


@dataclass(frozen=True)
class Part:
    """A part of a tree: its kind, its radius, its node, and its own region."""

    kind: str
    radius: float
    node: Node
    """The part under the deformation of the tree."""
    centers: Float64Array
    """Middles of the triangles in the own region (n, 3)."""
    areas: Float64Array
    """Their areas (n,)."""
    others: Node | None
    """All other parts."""

    @property
    def area(self) -> float:
        """Area of the own region."""
        return float(self.areas.sum())

    def owns(self, points: Float64Array) -> BoolArray:
        """Return True for surface points (n, 3) in the own region."""
        if not len(points):
            return np.zeros(0, bool)
        near = self.node(points) > 0.25
        return near if self.others is None else near & (self.others(points) == 0.0)


@dataclass(frozen=True)
class ThinTree:
    """A tree and its parts."""

    tree: Node
    parts: tuple[Part, ...]


Triangles = tuple[Float64Array, IndexArray]
"""Vertices and faces."""
_Part = tuple[str, float, Node, Triangles]
"""Kind, radius, node and surface."""
Deformation = Callable[[Node], Node]
PointMap = Callable[[Float64Array], Float64Array]


def random_tree(seed: int) -> ThinTree:
    """Return a random tree with one to four thin parts, attached or apart, mostly beside a large one."""
    rng = np.random.default_rng([33, seed])
    blend = str(rng.choice(["union", "sum"]))
    nodes: list[_Part] = []
    if rng.random() < 0.7:
        nodes.append(("ball", 1.0, Point((0, 0, 0), radius=1.0), _ball(np.zeros(3), 1.0)))
    for number in range(rng.integers(1, 5)):
        size = 10.0 ** rng.uniform(np.log10(2e-4), np.log10(0.4))
        apart = rng.random() < 0.5 or not nodes
        away = 0.0 if not apart else 4.0 + 4.0 * number
        nodes.append(_random_part(rng, str(rng.choice(KINDS)), size, away))
    deform, move = _random_deformation(rng)
    deformed = [deform(node) for _, _, node, _ in nodes]
    tree = deformed[0]
    for node in deformed[1:]:
        tree = tree | node if blend == "union" else tree + node
    parts = []
    for number, (kind, radius, _, (vertices, faces)) in enumerate(nodes):
        rest = deformed[:number] + deformed[number + 1 :]
        others = None
        for node in rest:
            others = node if others is None else others | node
        centers, areas = _triangles(move(vertices), faces)
        own = np.ones(len(areas), bool) if others is None else others(centers) == 0.0
        parts.append(Part(kind, radius, deformed[number], centers[own], areas[own], others))
    return ThinTree(tree, tuple(parts))


def _random_part(rng: np.random.Generator, kind: str, size: float, away: float) -> _Part:
    """Return kind, radius, node and triangles of a part whose radius is `size`, or less for long ones."""
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    start = direction * (0.8 if away == 0.0 else away)
    aside = rng.normal(size=3)
    aside /= np.linalg.norm(aside)
    if kind == "ball":
        center = start if away else direction
        return kind, size, Point(_vector(center), radius=size), _ball(center, size)
    if kind in ("hair", "rod"):
        end = start + (direction + 0.3 * aside) * rng.uniform(1.0, 2.5)
        radius = size if kind == "rod" else 0.1 * size
        tube = Segment(_vector(start), _vector(end), radius=radius)
        return kind, radius, tube, _capsule(start, end, radius)
    extent = rng.uniform(0.4, 1.2)
    radius = min(size, 0.3 * extent)
    if kind == "ring":
        center = start if away else np.zeros(3)
        extent = extent if away else 1.0 + 0.5 * extent
        ring = Torus(_vector(center), _vector(aside), extent, radius=radius)
        return kind, radius, ring, _torus(center, aside, extent, radius)
    radius = min(max(radius, 2e-3), 0.3 * extent)  # plates that memory allows
    center = start if away else direction * (0.9 + extent)
    axis = aside if away else np.cross(direction, aside) / np.linalg.norm(np.cross(direction, aside))
    plate = Disc(_vector(center), _vector(axis), extent, radius=radius)
    return kind, radius, plate, _plate(center, axis, extent, radius)


def _random_deformation(rng: np.random.Generator) -> tuple[Deformation, PointMap]:
    """Return a deformation of nodes, and the same for points."""
    choice = rng.choice(["none", "none", "map", "stretch", "twist"])
    if choice == "none":
        return lambda node: node, lambda points: points
    if choice == "twist":
        rate = float(rng.uniform(5.0, 15.0))
        return lambda node: node.twist(rate), lambda points: _twisted(points, np.radians(rate))
    matrix = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.1, 10.0)
    if choice == "stretch":
        matrix = matrix @ np.diag(rng.uniform(0.6, 1.6, 3))
    columns = np.column_stack([matrix, rng.uniform(-1.0, 1.0, 3)])
    return lambda node: node.transform(columns), lambda points: points @ matrix.T + columns[:, 3]


def _twisted(points: Float64Array, rate: float) -> Float64Array:
    x, y, z = points.T
    cosines, sines = np.cos(rate * z), np.sin(rate * z)
    return np.stack([cosines * x - sines * y, sines * x + cosines * y, z], axis=1)


def _vector(values: Float64Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _arc(first: float, last: float, steps: int) -> Float64Array:
    angles = np.linspace(first, last, steps)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _ball(center: Float64Array, radius: float) -> Triangles:
    profile = radius * _arc(-0.5 * np.pi, 0.5 * np.pi, 60)
    return _revolved(profile, center, np.array([0.0, 0.0, 1.0]), closed=False)


def _capsule(start: Float64Array, end: Float64Array, radius: float) -> Triangles:
    length = float(np.linalg.norm(end - start))
    side = np.stack([np.full(1000, radius), np.linspace(0.0, length, 1000)], axis=1)
    bottom = radius * _arc(-0.5 * np.pi, 0.0, 20)
    top = radius * _arc(0.0, 0.5 * np.pi, 20) + [0.0, length]
    profile = np.concatenate([bottom[:-1], side, top[1:]])
    return _revolved(profile, start, (end - start) / length, closed=False)


def _plate(center: Float64Array, axis: Float64Array, extent: float, radius: float) -> Triangles:
    out = np.linspace(0.0, extent, 60)
    low = np.stack([out, np.full(60, -radius)], axis=1)
    high = np.stack([out[::-1], np.full(60, radius)], axis=1)
    rim = radius * _arc(-0.5 * np.pi, 0.5 * np.pi, 20) + [extent, 0.0]
    return _revolved(np.concatenate([low[:-1], rim, high[1:]]), center, axis, closed=False)


def _torus(center: Float64Array, axis: Float64Array, extent: float, radius: float) -> Triangles:
    profile = radius * _arc(-np.pi, np.pi, 40)[:-1] + [extent, 0.0]
    return _revolved(profile, center, axis, closed=True)


def _revolved(profile: Float64Array, center: Float64Array, axis: Float64Array, *, closed: bool) -> Triangles:
    """Return vertices and faces of a profile (n, 2) of distances and heights, turned about an axis.

    The triangles have the area of the curved surface: the circles are replaced by polygons that are as long.
    """
    around = AROUND if not closed else 400
    axis = axis / np.linalg.norm(axis)
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angles = np.arange(around) * 2.0 * np.pi / around
    radial = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    radial *= (np.pi / around) / np.sin(np.pi / around)
    vertices = center + profile[:, None, :1] * radial + profile[:, None, 1:] * axis
    rows = len(profile) if closed else len(profile) - 1
    i, j = np.divmod(np.arange(rows * around), around)
    k, after = (i + 1) % len(profile), (j + 1) % around
    a, b, c, d = i * around + j, i * around + after, k * around + after, k * around + j
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return vertices.reshape(-1, 3), faces


def _triangles(vertices: Float64Array, faces: IndexArray | Int32Array) -> tuple[Float64Array, Float64Array]:
    """Return middles and areas of triangles."""
    corners = vertices[faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners.mean(axis=1), 0.5 * np.linalg.norm(crosses, axis=1)


def is_closed(faces: Int32Array) -> bool:
    """Return True if each edge has two triangles, on which it runs in opposite directions."""
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    count = int(faces.max(initial=-1)) + 1
    forth, back = np.sort(start * count + end), np.sort(end * count + start)
    return bool((np.diff(forth) > 0).all() and np.array_equal(forth, back))


def mesh_areas(mesh: blobtree.Mesh) -> tuple[Float64Array, Float64Array]:
    """Return middles and areas of the triangles of a mesh."""
    return _triangles(mesh.vertices.astype(np.float64), mesh.faces)
