"""Contact lines and rims as polylines on surfaces.

The triangles of a surface are divided until they are small beside the decals. Where the corners of a triangle
show different decals, a line passes: its points on the edges are found by bisection, to the rounding of
`decals.evaluate`. Where three decals meet, the triangle is divided again and again around the meeting point.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.progress import Progress, reporting
from decals.errors import InvalidScene
from decals.field.evaluate import evaluate
from decals.field.mapping import IMAGE_RADIUS_SQUARED, ImageMapping
from decals.field.rules import AnyContact
from decals.field.walks import evaluation_options
from decals.model import Decals, Interaction
from decals.scenes.objects import MeshObject, SceneObject, TreeObject
from decals.scenes.scene import Scene, require_scene
from decals.surfaces.normals import split_at_creases
from decals.surfaces.subdivide import subdivided
from decals.validation import allowed_number

STEP = 0.05
"""Default length of the edges that find lines, in visible radii of the smallest decal there."""

BISECTIONS, DIVISIONS = 20, 30
"""Steps that find a point on an edge, and a point where three decals meet."""

SHRINKING = 0.6
"""Factor by which the window around such a point shrinks in a step."""

GROWTH = 2.0
"""Factor by which the window grows after it has lost the point."""

MISSING = 2.0
"""Distance to a label that no point of a window has, longer than all in it."""

WINDOW = np.array([(i, j, 5 - i - j) for i in range(6) for j in range(6 - i)]) / 5.0
"""Barycentric coordinates of the points in a window."""

BESIDE = 1.25
"""Distance from the centre, in visible radii, up to which a decal makes edges short."""

NOTHING = -1
"""Number of bare surface."""

Surface = Callable[[Float64Array], Float64Array]
"""Moves points onto a surface; points on edges of a mesh lie on it already."""

Labels = Callable[[Float64Array], Int32Array]
"""Returns the number of the decal that shows at each point of a surface, or NOTHING."""


class LineKind(Enum):
    """Kinds of lines around decals.

    Examples
    --------
    >>> import decals
    >>> [kind.value for kind in decals.LineKind]
    ['contact', 'rim']
    """

    CONTACT = "contact"
    """Between two contact decals of one layer, on which each pushes the other."""
    RIM = "rim"
    """Where an image ends: beside bare surface, or over a lower decal."""


@dataclass(frozen=True, eq=False)
class SurfaceLine:
    """A polyline on a surface.

    Attributes
    ----------
    points : float32[k, 3]
        Points of the surface, in order; the last one equals the first one if the line is closed.
    kind : LineKind
        Contact line or rim.
    decals : (int, int)
        Numbers of the decals on both sides. Of a rim the first one ends here, and the second one is the decal
        below, or −1 for bare surface.
    object : str
        Name of the object.

    Examples
    --------
    >>> import decals
    >>> square = decals.MeshObject("square", [[-2, -2, 0], [2, -2, 0], [0, 3, 0]], [[0, 1, 2]])
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.5)
    >>> scene = decals.Scene(objects=[square], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    >>> (line,) = decals.outlines(scene)
    >>> line.kind, line.decals, line.closed, round(line.length, 2)
    (<LineKind.RIM: 'rim'>, (0, -1), True, 3.14)
    """

    points: Float32Array
    kind: LineKind
    decals: tuple[int, int]
    object: str

    def __repr__(self) -> str:
        """Return the kind, the decals and the number of points."""
        return f"SurfaceLine({self.kind.value}, decals={self.decals}, {len(self.points)} points)"

    @property
    def closed(self) -> bool:
        """True if the line ends where it begins."""
        return len(self.points) > 2 and bool((self.points[0] == self.points[-1]).all())

    @property
    def length(self) -> float:
        """Length in model units."""
        return float(np.linalg.norm(np.diff(self.points.astype(np.float64), axis=0), axis=1).sum())


def outlines(
    scene: Scene,
    *,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    step: float = STEP,
    progress: Progress | None = None,
) -> list[SurfaceLine]:
    """Return the contact lines and rims of the decals of a scene, as polylines on its surfaces.

    Lines run where the decal that shows changes: along the ends of images, which are the rims of the fields
    but for the curvature that the image mapping counts. A detail smaller than a step may be missing.

    Parameters
    ----------
    scene : Scene
        The scene.
    contact, stiffness, mapping : optional
        Modes, as for `decals.evaluate`; by default those of the scene's ``drawing``.
    step : float
        Greatest distance of neighbouring points, in visible radii of the smallest decal there. Points lie on
        the line, and the polyline is off by about an eighth of the squared step between them.
    progress : callable, optional
        Called with the name of the stage and the fraction done.

    Returns
    -------
    list of SurfaceLine
        By object, pair of decals, and place.

    Raises
    ------
    InvalidScene
        No scene, a posed scene, or an option out of range.
    InvalidMesh
        So small a step needs too many triangles.

    See Also
    --------
    decals.measure : their lengths, estimated.
    decals.save_figure : these lines in SVG or PDF.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> lines = decals.outlines(scene)
    >>> {line.kind.value for line in lines} <= {"contact", "rim"}
    True
    """
    require_scene("scene", scene, "take the scene that was posed, where its decals lie")
    step = allowed_number("step", step, "a number above 0, at most 1", lambda x: 0.0 < x <= 1.0, InvalidScene)
    drawing = scene.drawing.overridden(contact=contact, stiffness=stiffness, mapping=mapping)
    decals = scene.decals
    options = evaluation_options(drawing, decals, scene.objects)
    contacts = np.where(decals.interactions == Interaction.PUSH, decals.ranks, NOTHING)
    found: list[SurfaceLine] = []
    if not len(decals):
        return found
    with reporting(progress) as report:
        for number, item in enumerate(scene.objects):
            report("tracing lines", number / len(scene.objects))
            normals_at = _normals_of(item)
            modes = options | {"on": item}

            def labels(
                points: Float64Array,
                normals_at: _NormalsAt = normals_at,
                modes: dict[str, Any] = modes,
            ) -> Int32Array:
                rows = points.astype(np.float32)
                samples = evaluate(decals, rows, normals_at(rows), **modes)
                inside = ((samples.uv.astype(np.float64) - 0.5) ** 2).sum(axis=1) <= IMAGE_RADIUS_SQUARED
                return np.where(inside, samples.owner, NOTHING).astype(np.int32)

            project = partial(_projected, item)
            onto = project if isinstance(item, TreeObject) else _unchanged
            vertices, faces = _triangles(item, decals, step, onto)
            for pair, points in _Tracer(vertices, faces, labels, onto, project).lines():
                first, second = sorted(pair, key=lambda decal: (-decals.ranks[decal], decal))
                if NOTHING in pair:
                    first, second = max(pair), NOTHING
                meets = second != NOTHING and contacts[first] == contacts[second] != NOTHING
                kind = LineKind.CONTACT if meets else LineKind.RIM
                found.append(SurfaceLine(points.astype(np.float32), kind, (first, second), item.name))
        report("tracing lines", 1.0)
    return found


_NormalsAt = Callable[[Float32Array], Float32Array]


def _normals_of(item: SceneObject) -> _NormalsAt:
    """Return the function of the normals with which an object is drawn."""
    if not isinstance(item, MeshObject):
        return item.surface.normal
    surface, split = item.surface, split_at_creases(item.vertices, item.faces, item.crease_angle)

    def normals(points: Float32Array) -> Float32Array:
        faces, weights = surface.locate(points)
        corners = split.normals[split.faces[faces]]
        rows: Float32Array = np.einsum("mk,mki->mi", weights, corners).astype(np.float32)
        return rows

    return normals


def _projected(item: SceneObject, points: Float64Array) -> Float64Array:
    return item.surface.project(points.astype(np.float32))[0].astype(np.float64)


def _unchanged(points: Float64Array) -> Float64Array:
    return points


def _triangles(
    item: SceneObject, decals: Decals, step: float, onto: Surface
) -> tuple[Float64Array, Int64Array]:
    """Return triangles of an object, short beside its decals."""
    least = float(decals.radii.min())
    surface = item.surface if isinstance(item, MeshObject) else item.surface.triangulated(0.5 * least)
    places, welded = np.unique(surface.vertices + np.float32(0), axis=0, return_inverse=True)
    faces = welded.reshape(-1)[surface.faces[surface.sound]].astype(np.int64)

    def middles(rows: Float64Array, ends: Int64Array) -> Float64Array:
        return onto(0.5 * (rows[ends[:, 0]] + rows[ends[:, 1]]))

    return subdivided(places.astype(np.float64), faces, _LongEdges(decals, step), middles)


class _LongEdges:
    """Tells which edges are longer than a step of the smallest decal beside them."""

    def __init__(self, decals: Decals, step: float) -> None:
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        octaves = np.floor(np.log2(decals.radii))
        parts = [decals[octaves == octave] for octave in np.unique(octaves)]
        self._parts = [(cKDTree(part.positions), part.radii.min(), part.radii.max()) for part in parts]
        self._step = step

    def __call__(self, starts: Float64Array, ends: Float64Array) -> BoolArray:
        lengths = np.linalg.norm(ends - starts, axis=1)
        long = np.zeros(len(lengths), np.bool_)
        for tree, least, most in self._parts:
            rows = np.flatnonzero(~long & (lengths > self._step * least))
            reach = BESIDE * most + 0.5 * lengths[rows]
            long[rows] = tree.query(0.5 * (starts + ends)[rows])[0] < reach
        return long


class _Tracer:
    """Lines on triangles between points of different labels."""

    def __init__(
        self, vertices: Float64Array, faces: Int64Array, labels: Labels, onto: Surface, project: Surface
    ) -> None:
        self._labels, self._onto, self._project = labels, onto, project
        known = labels(vertices)
        crossed = faces[(known[faces] != known[faces[:, :1]]).any(axis=1)]
        corners = np.stack([crossed, np.roll(crossed, -1, axis=1)], axis=2)  # [m, 3 edges, 2 ends]
        corners.sort(axis=2)
        flat = corners.reshape(-1, 2)
        differ = known[flat[:, 0]] != known[flat[:, 1]]
        edges, which = np.unique(flat[differ], axis=0, return_inverse=True)
        nodes = np.full(len(flat), -1)
        nodes[differ] = which.reshape(-1)
        self._nodes: Int64Array = nodes.reshape(-1, 3)
        self._pairs = np.sort(known[edges], axis=1)
        ends = vertices[edges[:, 0]], vertices[edges[:, 1]]
        self._points, self._direct = self._crossings(*ends, known[edges[:, 0]], known[edges[:, 1]])
        self._corners = vertices[crossed]

    def _crossings(
        self, starts: Float64Array, ends: Float64Array, labels: Int32Array, others: Int32Array
    ) -> tuple[Float64Array, BoolArray]:
        """Return the points between starts and ends at which the labels of the starts end, ``[k, 3]``.

        The flags ``[k]`` are False where the labels of the ends, `others`, do not begin there: a third label
        lies between, and a meeting point is near.
        """
        inner, outer = starts, ends
        direct = np.ones(len(starts), np.bool_)
        for _ in range(BISECTIONS):
            middles = self._onto(0.5 * (inner + outer))
            found = self._labels(middles)
            same = (found == labels)[:, None]
            direct = np.where(same[:, 0], direct, found == others)
            inner, outer = np.where(same, middles, inner), np.where(same, outer, middles)
        return self._onto(0.5 * (inner + outer)), direct

    def _meetings(self, corners: Float64Array) -> Float64Array:
        """Return the points in triangles ``[m, 3, 3]`` near which the labels of the corners meet, ``[m, 3]``.

        A window of points around the best guess shrinks. The best guess is the one nearest to all labels. It
        may lie a little outside of the triangle, if a line crosses an edge twice. A window without one of the
        labels has lost the meeting point, and grows.
        """
        count = len(corners)
        wanted = self._labels(corners.reshape(-1, 3)).reshape(count, 3)
        apart = np.linalg.norm(WINDOW[:, None] - WINDOW, axis=2)
        places, sizes = np.full((count, 3), 1.0 / 3.0), np.ones(count)
        for _ in range(DIVISIONS if count else 0):
            weights = places[:, None] + sizes[:, None, None] * (WINDOW - 1.0 / 3.0)
            points = self._project(np.einsum("mkc,mci->mki", weights, corners).reshape(-1, 3))
            labels = self._labels(points).reshape(count, -1)
            off = np.stack(
                [np.where((labels == wanted[:, [k]])[:, None], apart, MISSING).min(axis=2) for k in range(3)]
            ).max(axis=0)
            best = np.take_along_axis(weights, off.argmin(axis=1)[:, None, None], axis=1)[:, 0]
            met = off.min(axis=1) < MISSING
            places = np.where(met[:, None], best, places)
            sizes *= np.where(met, SHRINKING, GROWTH)
        return self._project(np.einsum("mc,mci->mi", places, corners))

    def lines(self) -> Iterator[tuple[tuple[int, int], Float64Array]]:
        """Yield the two labels of each line, the lower first, and its points."""
        triple = (self._nodes >= 0).all(axis=1)
        meetings = self._meetings(self._corners[triple])
        points = np.concatenate([self._points, meetings])
        segments: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
        for row in self._nodes[~triple].tolist():
            first, second = (node for node in row if node >= 0)
            segments[self._pair(first)].append((first, second))
        for number, row in enumerate(self._nodes[triple].tolist(), len(self._points)):
            for node in row:
                segments[self._pair(node)].append((node, number))
        for pair in sorted(segments):
            for nodes in chains(segments[pair]):
                kept = [node for node in nodes if node >= len(self._direct) or self._direct[node]]
                yield pair, points[kept if len(kept) > 1 else nodes]

    def _pair(self, node: int) -> tuple[int, int]:
        low, high = self._pairs[node].tolist()
        return low, high


def chains(segments: Iterable[tuple[int, int]]) -> Iterator[list[int]]:
    """Yield segments between numbered nodes as chains: open ones first, then rings, whose ends are equal.

    Chains end where another number of segments than two meets.
    """
    around: dict[int, list[int]] = defaultdict(list)
    for first, second in segments:
        around[first].append(second)
        around[second].append(first)

    def follow(start: int, second: int) -> list[int]:
        chain = [start]
        before, node = start, second
        while True:
            around[before].remove(node)
            around[node].remove(before)
            chain.append(node)
            if len(around[node]) != 1 or node in ends:
                return chain
            before, node = node, around[node][0]

    ends = {node for node, others in around.items() if len(others) != 2}
    for start in sorted(ends):
        while around[start]:
            yield follow(start, around[start][0])
    for start in sorted(around):
        if around[start]:
            yield follow(start, around[start][0])
