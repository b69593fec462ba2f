"""Windings of a mesh: neighbours wind alike, and closed parts outward."""

import logging
from dataclasses import dataclass
from enum import Enum

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from decals.surfaces.nesting import outward_turns
from decals.surfaces.topology import (
    SharedEdges,
    components,
    consistent_winding,
    edge_keys,
    first_copies,
    shared_edges,
    welded,
)

_logger = logging.getLogger(__name__)

MIN_THICKNESS = 2.0**-21
"""Least volume of a closed part over its area, in coordinates; below it, rounding decides the sign."""

SEAM = 1e-5
"""Widest gap, in sizes of a part, that still closes a seam."""


class MeshOrientation(Enum):
    """Which way the faces of a mesh wind.

    Examples
    --------
    >>> import decals, pyvista
    >>> inward = pyvista.Sphere().flip_faces()
    >>> ball = decals.MeshObject("ball", inward.points, inward.regular_faces)
    >>> bool((ball.surface.normal([[0, 0, 1]]) @ [0, 0, 1] > 0.9)[0])
    True
    >>> room = decals.MeshObject("room", inward.points, inward.regular_faces, orientation="keep")
    >>> bool((room.surface.normal([[0, 0, 1]]) @ [0, 0, 1] < -0.9)[0])
    True
    """

    OUTWARD = "outward"
    """Closed parts turn outward, with what lies inside them; open sheets stay."""
    KEEP = "keep"
    """All parts stay as they are given."""
    FLIP = "flip"
    """All parts are turned: what was inside is outside."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Corners of faces in float64, and their normals.

    Attributes
    ----------
    corners : float64[m, 3, 3]
        Positions of the three corners of each face.
    crosses : float64[m, 3]
        Normals, as long as the doubled areas of the faces.
    """

    corners: Float64Array
    crosses: Float64Array

    @classmethod
    def of(cls, vertices: Float32Array, faces: Int32Array) -> "Triangles":
        """Return the triangles of faces."""
        corners = vertices.astype(np.float64)[faces]
        a, b, c = np.moveaxis(corners, 1, 0)
        return cls(corners, np.cross(b - a, c - a))

    @property
    def doubled_areas(self) -> Float64Array:
        """Doubled areas of the faces, ``float64[m]``."""
        areas: Float64Array = np.sqrt(np.einsum("ij,ij->i", self.crosses, self.crosses))
        return areas

    def turned(self, rows: Int64Array) -> "Triangles":
        """Return the triangles with some faces turned."""
        if not len(rows):
            return self
        corners, crosses = self.corners.copy(), self.crosses.copy()
        corners[rows] = corners[rows, ::-1]
        a, b, c = np.moveaxis(corners[rows], 1, 0)
        crosses[rows] = np.cross(b - a, c - a)
        return Triangles(corners, crosses)


@dataclass(frozen=True, eq=False)
class Windings:
    """How the faces of a mesh are to wind.

    Attributes
    ----------
    turned : bool[m]
        Faces to turn.
    copies : bool[m]
        Copies of other faces, when all are turned.
    one_sided : bool[m]
        Faces of parts that have one side only.
    unlike : int
        Number of faces that wound differently from their neighbours.
    inconsistent : int
        Number of edges where neighbours wind differently, as there is one side only.
    """

    turned: BoolArray
    copies: BoolArray
    one_sided: BoolArray
    unlike: int
    inconsistent: int

    def report(self) -> None:
        """Log the faces that wound differently from their neighbours, and sheets that have no two sides."""
        if self.unlike:
            _logger.warning(
                "Turned %d of %d faces that wound differently from their neighbours",
                self.unlike,
                len(self.turned),
            )
        if self.inconsistent:
            _logger.warning(
                "The mesh has one side only: %d edges join faces that wind differently; "
                "decals show on all of it",
                self.inconsistent,
            )


def turned_faces(vertices: Float32Array, faces: Int32Array, orientation: MeshOrientation) -> BoolArray:
    """Return which faces of a mesh to turn, ``bool[m]``; see `wind`."""
    return wind(faces, welded(vertices), Triangles.of(vertices, faces), orientation).turned


def wind(faces: Int32Array, same: Int64Array, triangles: Triangles, orientation: MeshOrientation) -> Windings:
    """Return which faces to turn, so that neighbours wind alike and parts as the orientation says.

    Parameters
    ----------
    faces : int32[m, 3]
        Corner indices.
    same : int64[n]
        The first vertex at the position of each vertex.
    triangles
        The triangles of the faces.
    orientation
        Rule for closed parts.
    """
    corners = same[faces]
    links = _links(faces, corners)
    areas = triangles.doubled_areas
    winding = consistent_winding(links.edges, areas)
    turned = winding.turned[links.leaders]
    one_sided = winding.one_sided[links.leaders]
    found = int(turned.sum()), winding.inconsistent
    if orientation is MeshOrientation.OUTWARD:
        parts = components(links.edges.faces, len(faces))
        closed = _closed_parts(parts, corners, turned, links.edges.other_sides, triangles)
        closed[parts[one_sided]] = False
        turned ^= _turned_outward(parts, closed, turned, triangles)[parts][links.leaders]
    elif orientation is MeshOrientation.FLIP:
        turned = ~turned
    if links.simple:
        return Windings(turned, np.zeros(len(faces), np.bool_), one_sided, *found)
    wound = np.where(turned[:, None], corners[:, ::-1], corners)
    repeated = _same_walls(wound, links.walls)
    turned[repeated] ^= True
    wound[repeated] = wound[repeated][:, ::-1]
    return Windings(turned, first_copies(wound) != np.arange(len(wound)), one_sided, *found)


@dataclass(frozen=True, eq=False)
class _Links:
    """Edges across which windings pass on.

    Attributes
    ----------
    edges
        Edges of two faces of one solid or sheet.
    leaders : int64[m]
        The face at the same place that each face is turned with; itself for most.
    walls : int64[k, 2]
        Pairs of faces at one place that two touching solids share.
    simple : bool
        True if all neighbours wind alike, and no edge joins more than two faces.
    """

    edges: SharedEdges
    leaders: Int64Array
    walls: Int64Array
    simple: bool


def _links(faces: Int32Array, corners: Int64Array) -> _Links:
    """Return the edges across which windings pass on.

    Where more than two faces meet, solids with vertices of their own are told apart first. Faces at one place
    are then a wall between two solids, which links nothing, or copies, of which the first is linked.
    """
    edges = shared_edges(corners)
    leaders: Int64Array = np.arange(len(faces))
    if not edges.branching and not edges.differ.any():
        return _Links(edges, leaders, np.zeros((0, 2), np.int64), True)
    copied = first_copies(faces)
    areal = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    single = np.flatnonzero(areal & (copied == leaders))
    own = shared_edges(faces[single])
    parts = components(own.faces, len(single))
    solid = ~np.isin(parts, parts[own.other_sides // 3])
    leaders[areal] = copied[areal]
    rest = np.flatnonzero(areal & ~np.isin(copied, single[solid]))
    first, walls = _coincident(corners, rest)
    leaders[rest] = first
    linked = rest[(first == rest) & ~np.isin(rest, walls)]
    welded_edges = shared_edges(corners[linked]).of(linked)
    inner = solid[own.faces[:, 0]]
    together = SharedEdges(
        np.concatenate([single[own.faces[inner]], welded_edges.faces]),
        np.concatenate([own.differ[inner], welded_edges.differ]),
        welded_edges.other_sides,
        welded_edges.branching,
    )
    return _Links(together, leaders, walls, False)


def _coincident(corners: Int64Array, rows: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Return the first of some faces at the place of each, and pairs that are walls between solids.

    A wall is a set of pairs of faces, at whose edges an even number of other faces meet.
    """
    if not len(rows):
        return rows, np.zeros((0, 2), np.int64)
    places = np.sort(corners[rows], axis=1)
    _, first, which, counts = np.unique(
        places, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    which = which.reshape(-1)
    leaders = rows[first[which]]
    doubled = np.flatnonzero(counts == 2)
    if not len(doubled):
        return leaders, np.zeros((0, 2), np.int64)
    order = np.argsort(which, kind="stable")
    pairs = rows[order[(np.cumsum(counts) - counts)[doubled][:, None] + np.arange(2)]]
    keys = edge_keys(corners)
    single, number = np.unique(keys[rows[counts[which] == 1]], return_counts=True)
    at = np.searchsorted(single, keys[pairs[:, 0]])
    present = np.append(single, -1)[np.minimum(at, len(single))] == keys[pairs[:, 0]]
    others = np.where(present, np.append(number, 0)[np.minimum(at, len(single))], 0)
    parts = components(shared_edges(corners[pairs[:, 0]]).faces, len(pairs))
    odd = np.bincount(parts, (others % 2).sum(axis=1)) > 0
    joined = np.bincount(parts, others.sum(axis=1)) > 0
    walls = pairs[(joined & ~odd)[parts]]
    leaders[np.isin(rows, walls)] = rows[np.isin(rows, walls)]
    return leaders, walls


def _same_walls(wound: Int64Array, walls: Int64Array) -> Int64Array:
    """Return the second face of each wall whose two faces wind alike."""
    lowest = wound.argmin(axis=1)[:, None]
    start = np.take_along_axis(wound, (lowest + np.arange(2)) % 3, axis=1)
    alike = (start[walls[:, 0]] == start[walls[:, 1]]).all(axis=1)
    second: Int64Array = walls[alike, 1]
    return second


def _closed_parts(
    parts: Int64Array, corners: Int64Array, turned: BoolArray, sides: Int64Array, triangles: Triangles
) -> BoolArray:
    """Return True for parts without a rim, ``bool[count]``, of those with more than one face.

    Only the given sides may be rims. A seam whose two lines lie at the same place is no rim, whatever
    vertices the lines have.
    """
    closed = np.bincount(parts) > 1
    if not len(sides):
        return closed
    face, k = sides // 3, sides % 3
    start, end = corners[face, k], corners[face, (k + 1) % 3]
    keys = np.stack([parts[face], np.minimum(start, end), np.maximum(start, end)], axis=1)
    _, which = np.unique(keys, axis=0, return_inverse=True)
    direction = np.where((start < end) ^ turned[face], 1.0, -1.0)
    net = np.bincount(which.reshape(-1), direction)
    rim = net[which.reshape(-1)] != 0.0
    if not rim.any():
        return closed
    face, k, direction = face[rim], k[rim], np.where(turned[face[rim]], -1.0, 1.0)
    ends = triangles.corners[face, k], triangles.corners[face, (k + 1) % 3]
    closed &= ~_has_rim(parts, parts[face], ends, direction, triangles)
    return closed


def _has_rim(
    parts: Int64Array,
    owners: Int64Array,
    ends: tuple[Float64Array, Float64Array],
    direction: Float64Array,
    triangles: Triangles,
) -> BoolArray:
    """Return True for parts whose rims do not cancel each other, ``bool[count]``.

    Lines that cancel have no integral of any vector field. The fields here are random cubic polynomials.
    """
    marked = np.unique(owners)
    number = np.full(int(parts.max()) + 1, -1)
    number[marked] = np.arange(len(marked))
    low, high = np.full((2, len(marked), 3), [[[np.inf]], [[-np.inf]]])
    mine = np.flatnonzero(number[parts] >= 0)
    for fold, box in ((np.minimum, low), (np.maximum, high)):
        fold.at(box, np.repeat(number[parts[mine]], 3), triangles.corners[mine].reshape(-1, 3))
    which = number[owners]
    middle, size = 0.5 * (low + high), np.maximum(np.linalg.norm(high - low, axis=1), 1e-300)
    start, end = ((at - middle[which]) / size[which, None] for at in ends)
    factors = np.random.default_rng(0).normal(size=(2, 3, 3, 4))
    nodes = 0.5 - 0.5 * np.sqrt(0.6) * np.array([1.0, 0.0, -1.0])
    sums = np.zeros((2, len(marked)))
    lengths = np.bincount(which, np.linalg.norm(end - start, axis=1), len(marked))
    for node, weight in zip(nodes, np.array([5.0, 8.0, 5.0]) / 18.0, strict=True):
        at = start + node * (end - start)
        homogeneous = np.column_stack([at, np.ones(len(at))])
        for field, factor in zip(sums, factors, strict=True):
            values = np.prod([homogeneous @ factor[:, i].T for i in range(3)], axis=0)
            along = weight * direction * np.einsum("ij,ij->i", values, end - start)
            field += np.bincount(which, along, len(marked))
    open_ = np.abs(sums).max(axis=0) > SEAM * np.maximum(lengths, 1e-300)
    result = np.zeros(len(number), np.bool_)
    result[marked[open_]] = True
    return result


def _turned_outward(
    parts: Int64Array, closed: BoolArray, turned: BoolArray, triangles: Triangles
) -> BoolArray:
    """Return True for the closed parts to turn, ``bool[count]``."""
    count = len(closed)
    if not closed.any():
        return closed
    middle = triangles.corners[:, 0].mean(axis=0)
    heights = np.einsum("ij,ij->i", triangles.corners[:, 0] - middle, triangles.crosses)
    volumes = np.bincount(parts, np.where(turned, -heights, heights), count) / 6.0
    areas = np.bincount(parts, 0.5 * triangles.doubled_areas, count)
    extent = float(np.abs(triangles.corners).max())
    solid = closed & (np.abs(volumes) > MIN_THICKNESS * extent * areas)
    result = np.zeros(count, np.bool_)
    if (volumes[solid] >= 0.0).all():
        return result
    numbers = np.flatnonzero(solid)
    if (volumes[solid] < 0.0).all():
        result[numbers] = True
    else:
        corners = triangles.turned(np.flatnonzero(turned)).corners
        result[numbers] = outward_turns(parts, numbers, volumes[numbers], corners)
    faces = np.bincount(parts, minlength=count)[result].sum()
    if faces:
        _logger.info("Turned %d of %d closed parts outward", result.sum(), len(numbers))
    return result
