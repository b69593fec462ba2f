"""Random trees with thin parts, and the exact areas of their parts, in float64.

Each part is a surface of revolution, or a box, as dense triangles. Some parts are as thin as no primitive of
theirs: walls that differences and shells leave, and the lenses of intersections. A deformation acts on the
triangles as on the tree.
The *own region* of a part is where no other part has any field: there its surface is known, however the parts
are combined.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import blobtree
from blobtree import ISO, Box, Disc, Node, Point, Segment, Shell, Torus
from blobtree._typing import BoolArray, Float64Array, IndexArray, Int32Array, Int64Array
from blobtree.tape.model import gradients_at

PRIMITIVES = ("ball", "hair", "rod", "ring", "plate")
WALLS = ("lens", "shell", "pipe", "case")
KINDS = (*PRIMITIVES, *WALLS)
SHARE_ERROR = 0.05
"""Allowed error of a part's number of decals, over its share."""

AROUND = 48
"""Steps around the axis of a part."""

OWN_TRIANGLES = 64
"""Extent of a part's own region over the longest sides of triangles whose area in it is measured."""

THICKER_SHARE = 0.05
"""Share of a part's area that may be thinner than its radius says: ends of tubes, rims of plates."""

DIFFERENCE = 1e-6
STEPS: Float64Array = DIFFERENCE * np.eye(3)
"""Steps of the differences that are the derivatives of deformations."""

SAGITTA = 0.25
"""Distance from a triangle to the surface that it shows, over its longest side, at most."""

NEWTON_STEPS = 4
"""Steps from the middle of a triangle to the surface."""


@dataclass(frozen=True)
class Part:
    """A part of a tree: its kind, its radius, its node, and its own region."""

    kind: str
    radius: float
    """Half its thickness under the deformation, where it is thin but for a twentieth of its area."""
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

    def area_in(self, corners: Float64Array) -> float:
        """Return the area of triangles (n, 3, 3) in the own region.

        A triangle may be as large as the region, and its middle off the surface. So triangles are cut into
        small ones, and each belongs where the surface is nearest, if it is as near as a chord.
        """
        lower, upper = self.centers.min(axis=0), self.centers.max(axis=0)
        extent = float((upper - lower).max())
        near = ((corners >= lower - extent) & (corners <= upper + extent)).all(axis=2).any(axis=1)
        corners, longest = _cut(corners[near], extent / OWN_TRIANGLES)
        centers, doubled = corners.mean(axis=1), _doubled_areas(corners)[1]
        places = _on_surface(self.node, centers, 0.1 * extent)
        own = self.owns(places) & (self.node(centers) > 0.25)
        own &= np.linalg.norm(places - centers, axis=1) < SAGITTA * longest
        return float(doubled[own].sum()) / 2.0


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


def random_tree(seed: int, *, thinnest: float = 2e-4) -> ThinTree:
    """Return a random tree with one to four thin parts, attached or apart, mostly beside a large one.

    Their sizes are `thinnest` or more beside a ball of radius 1.
    """
    rng = np.random.default_rng([33, seed])
    blend = str(rng.choice(["union", "sum"]))
    nodes: list[_Part] = []
    if rng.random() < 0.7:
        nodes.append(("ball", 1.0, Point((0, 0, 0), radius=1.0), _ball(np.zeros(3), 1.0)))
    for number in range(rng.integers(1, 5)):
        size = 10.0 ** rng.uniform(np.log10(thinnest), np.log10(0.4))
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
        thin = radius * _least_scale(move, vertices, faces)
        parts.append(Part(kind, thin, deformed[number], centers[own], areas[own], others))
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
    if kind in WALLS:
        return _random_wall(rng, kind, radius, extent, start if away else 1.5 * direction, aside)
    if kind == "ring":
        center = start if away else np.zeros(3)
        extent = extent if away else 1.0 + 0.5 * extent
        ring = Torus(_vector(center), _vector(aside), extent, radius=radius)
        return kind, radius, ring, _torus(center, aside, extent, radius)
    center = start if away else direction * (0.9 + extent)
    axis = aside if away else np.cross(direction, aside) / np.linalg.norm(np.cross(direction, aside))
    plate = Disc(_vector(center), _vector(axis), extent, radius=radius)
    return kind, radius, plate, _plate(center, axis, extent, radius)


def _random_wall(
    rng: np.random.Generator,
    kind: str,
    radius: float,
    extent: float,
    center: Float64Array,
    axis: Float64Array,
) -> _Part:
    """Return a part that an operator leaves, twice as thick as `radius`."""
    thickness = 2.0 * radius
    if kind == "lens":
        apart = (extent - radius) * axis
        balls = [Point(_vector(center + side * apart), radius=extent) for side in (-1.0, 1.0)]
        return kind, radius, balls[0] & balls[1], _lens(center, axis, extent, radius)
    if kind == "shell":
        shell = Shell(Point(_vector(center), radius=extent), thickness)
        both = _ball(center, extent), _ball(center, extent - thickness)
        return kind, radius, shell, _joined(*both)
    if kind == "pipe":
        end, wide = center + 1.5 * extent * axis, 0.5 * extent
        radius, thickness = min(radius, 0.3 * wide), min(thickness, 0.6 * wide)
        ends = _vector(center), _vector(end)
        pipe = Segment(*ends, radius=wide) - Segment(*ends, radius=wide - thickness)
        both = _capsule(center, end, wide), _capsule(center, end, wide - thickness)
        return kind, radius, pipe, _joined(*both)
    edge = extent * 10.0 ** rng.uniform(-2.0, -1.0)
    sides = extent * rng.uniform(0.5, 1.0, 3)
    radius = min(radius, 0.3 * float(sides.min()))
    case = Box(_vector(center), _vector(sides), radius=edge) - Box(
        _vector(center), _vector(sides - 2.0 * radius), radius=edge
    )
    boxes = [_rounded_box(center, 0.5 * (sides - gap), edge) for gap in (0.0, 2.0 * radius)]
    return kind, 0.5 * radius, case, _joined(*boxes)


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


def _lens(center: Float64Array, axis: Float64Array, extent: float, radius: float) -> Triangles:
    """Return what two balls of radius `extent` have in common, `radius` high on both sides of their rim."""
    half = float(np.arccos(1.0 - radius / extent))
    cap = extent * _arc(0.5 * np.pi - half, 0.5 * np.pi, 200) - [0.0, extent - radius]
    profile = np.concatenate([cap[::-1] * [1.0, -1.0], cap[1:]])
    return _revolved(profile, center, axis, closed=False)


def _rounded_box(center: Float64Array, half: Float64Array, edge: float) -> Triangles:
    """Return everything within `edge` of a box with these half sides.

    A ball is cut open along three planes, and its pieces move apart. Rows go from the middle of the lower
    side to that of the upper one, columns around the box.
    """
    turn, ahead, still = np.linspace(0.0, 0.5 * np.pi, 9), np.linspace(-1.0, 1.0, 25), np.ones(25)
    fill = np.linspace(0.0, 1.0, 15)
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    angles, outlines = [], []
    for quarter in range(4):
        middle, half_way = (
            (corners[quarter] + corners[quarter - 3]) / 2,
            (corners[quarter - 3] - corners[quarter]) / 2,
        )
        angles += [quarter * 0.5 * np.pi + turn, (quarter + 1) * 0.5 * np.pi * still]
        outlines += [np.tile(corners[quarter], (9, 1)), middle + ahead[:, None] * half_way]
    around, outline = np.concatenate(angles), np.concatenate(outlines)
    low, high = np.full(15, -0.5 * np.pi), np.full(15, 0.5 * np.pi)
    up = np.concatenate([low, turn - 0.5 * np.pi, 0.0 * ahead, turn, high])[:, None]
    level = np.concatenate([-np.ones(24), ahead, np.ones(24)])[:, None]
    share = np.concatenate([fill, np.ones(43), fill[::-1]])[:, None]
    x, y = (half[axis] * share * outline[:, axis] for axis in range(2))
    vertices = np.stack(
        [
            x + edge * np.cos(up) * np.cos(around),
            y + edge * np.cos(up) * np.sin(around),
            np.broadcast_to(half[2] * level + edge * np.sin(up), x.shape),
        ],
        axis=2,
    )
    return center + vertices.reshape(-1, 3), _quads(len(up), len(around), closed=False)


def _joined(first: Triangles, second: Triangles) -> Triangles:
    """Return two surfaces as one."""
    return (
        np.concatenate([first[0], second[0]]),
        np.concatenate([first[1], second[1] + len(first[0])]),
    )


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
    return vertices.reshape(-1, 3), _quads(len(profile), around, closed=closed)


def _quads(rows: int, columns: int, *, closed: bool) -> IndexArray:
    """Return the triangles between rows of points, each a loop; `closed` if the last row meets the first."""
    i, j = np.divmod(np.arange((rows if closed else rows - 1) * columns), columns)
    k, after = (i + 1) % rows, (j + 1) % columns
    a, b, c, d = i * columns + j, i * columns + after, k * columns + after, k * columns + j
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _triangles(vertices: Float64Array, faces: IndexArray | Int32Array) -> tuple[Float64Array, Float64Array]:
    """Return middles and areas of triangles."""
    corners = vertices[faces]
    return corners.mean(axis=1), _doubled_areas(corners)[1] / 2.0


def _doubled_areas(corners: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return normals (n, 3) as long as the doubled areas (n,) of triangles (n, 3, 3), and these."""
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return crosses, np.linalg.norm(crosses, axis=1)


def _least_scale(move: PointMap, vertices: Float64Array, faces: IndexArray) -> float:
    """Return the factor by which a deformation makes a part thinner, but for THICKER_SHARE of its area.

    A slab with the normal n between two planes becomes thinner by |J⁻ᵀ n|.
    """
    corners = vertices[faces]
    normals, areas = _doubled_areas(corners)
    corners, normals = corners[areas > 0.0], normals[areas > 0.0] / areas[areas > 0.0, None]
    centers = corners.mean(axis=1)
    columns = [(move(centers + step) - move(centers - step)) / (2.0 * DIFFERENCE) for step in STEPS]
    longer = np.linalg.solve(np.stack(columns, axis=1), normals[:, :, None])[:, :, 0]
    scales = 1.0 / np.linalg.norm(longer, axis=1)
    weights = _doubled_areas(move(corners.reshape(-1, 3)).reshape(corners.shape))[1]
    order = np.argsort(scales)
    share = np.cumsum(weights[order]) / weights.sum()
    return float(scales[order][np.searchsorted(share, THICKER_SHARE)])


def _cut(corners: Float64Array, longest: float) -> tuple[Float64Array, Float64Array]:
    """Return triangles (n, 3, 3) cut into quarters until their sides are at most `longest`.

    Return also the longest side of the triangle that each is cut from.
    """
    done, of_done = [np.empty((0, 3, 3))], [np.empty(0)]
    whole = _longest_sides(corners)
    while len(corners):
        small = _longest_sides(corners) <= longest
        done.append(corners[small])
        of_done.append(whole[small])
        a, b, c = np.moveaxis(corners[~small], 1, 0)
        d, e, f = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        quarters = ((a, d, f), (d, b, e), (f, e, c), (d, e, f))
        corners = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
        whole = np.tile(whole[~small], 4)
    return np.concatenate(done), np.concatenate(of_done)


def _longest_sides(corners: Float64Array) -> Float64Array:
    """Return the longest side of each triangle."""
    lengths: Float64Array = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return lengths


def _on_surface(node: Node, points: Float64Array, longest: float) -> Float64Array:
    """Return points after steps of Newton's method to the surface of a node; those off its field stay."""
    for _step in range(NEWTON_STEPS):
        rows = gradients_at(node.tape, points).astype(np.float64)
        squared = np.maximum((rows[:, 1:] ** 2).sum(axis=1, keepdims=True), 1e-300)
        steps = rows[:, 1:] * (ISO - rows[:, :1]) / squared
        lengths = np.linalg.norm(steps, axis=1, keepdims=True)
        points = points + steps * np.minimum(1.0, longest / np.maximum(lengths, 1e-300))
    return points


def is_closed(faces: Int32Array) -> bool:
    """Return True if each edge has two triangles, on which it runs in opposite directions."""
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    count = int(faces.max(initial=-1)) + 1
    forth, back = np.sort(start * count + end), np.sort(end * count + start)
    return bool((np.diff(forth) > 0).all() and np.array_equal(forth, back))


def pieces(mesh: blobtree.Mesh) -> IndexArray:
    """Return for each vertex the number of its connected piece."""
    start, end = mesh.faces[:, :2].ravel(), mesh.faces[:, 1:].ravel()
    edges = coo_matrix((np.ones(len(start), np.int8), (start, end)), (len(mesh.vertices),) * 2)
    return np.asarray(connected_components(edges, directed=False)[1], np.intp)


def mesh_areas(mesh: blobtree.Mesh) -> tuple[Float64Array, Float64Array]:
    """Return middles and areas of the triangles of a mesh."""
    return _triangles(mesh.vertices.astype(np.float64), mesh.faces)


def decals_of_parts(model: ThinTree, positions: Float64Array) -> tuple[Int64Array, Float64Array]:
    """Return how many decals have their centres in each part's own region, and the shares by area (n,)."""
    areas = np.array([part.area for part in model.parts])
    found = np.array([part.owns(positions).sum() for part in model.parts])
    return found, found.sum() * areas / areas.sum()


def has_share(found: Int64Array, expected: Float64Array) -> BoolArray:
    """Return True for numbers of decals within SHARE_ERROR of the shares, rounded to whole decals."""
    fewest, most = np.floor((1.0 - SHARE_ERROR) * expected), np.ceil((1.0 + SHARE_ERROR) * expected)
    return np.asarray((fewest <= found) & (found <= most))
