"""Connectivity of a triangle mesh: vertices at one position, winding, coincident faces, connected parts."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from decals.sorting import distinct_numbers, groups, ranges, runs

BORDER_GAP = 3e-3
"""Largest distance of the borders of two parts that are one sheet, in diagonals of the larger border."""

MEETING_SHARE = 0.1
"""Share of a border that meets another part, from which the two are one sheet."""

MAX_BORDER_POINTS = 100_000
"""Largest number of points along borders, besides one for each edge."""

MAX_BORDER_PAIRS = 20_000_000
"""Number of pairs of near border points beyond which all parts are sheets of their own."""

SAMPLED_REACH = 1.12
"""Distance of points along borders that meet, in gaps: their spacing is a gap."""

MIN_STEP = 1e-30


def welded(vertices: Float32Array) -> Int64Array:
    """Return for each vertex the first vertex at the same position, ``int64[n]``."""
    bits = np.ascontiguousarray(vertices + np.float32(0)).view(np.uint32).astype(np.uint64)
    factors = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    keys = bits[:, 0] * factors[0] + bits[:, 1] * factors[1] + bits[:, 2] * factors[2]
    keys ^= keys >> np.uint64(29)
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    same: Int64Array = first[which.reshape(-1)]
    if not np.array_equal(vertices[same], vertices):  # two positions with one key
        _, first, which = np.unique(vertices + np.float32(0), axis=0, return_index=True, return_inverse=True)
        same = first[which.reshape(-1)]
    return same


@dataclass(frozen=True, eq=False)
class SharedEdges:
    """Edges that exactly two faces share, and the sides of faces at other edges.

    Attributes
    ----------
    faces : int64[k, 2]
        The two faces at each edge.
    differ : bool[k]
        True where both go along the edge in the same direction, so one of them winds the wrong way.
    other_sides : int64[l]
        Sides ``3 f + k`` of faces at edges of one face, or of more than two.
    branching : bool
        True if there are edges of more than two faces.
    """

    faces: Int64Array
    differ: BoolArray
    other_sides: Int64Array
    branching: bool

    def of(self, rows: Int64Array) -> "SharedEdges":
        """Return the same edges for faces that are some rows of another array."""
        sides = 3 * rows[self.other_sides // 3] + self.other_sides % 3
        return SharedEdges(rows[self.faces], self.differ, sides, self.branching)


def shared_edges(corners: NDArray[np.integer]) -> SharedEdges:
    """Return the edges of two faces, for welded corners ``int[m, 3]``; sides without length have no edge."""
    starts = corners.reshape(-1).astype(np.int64)
    ends = np.roll(corners, -1, axis=1).reshape(-1).astype(np.int64)
    size = int(starts.max(initial=0)) + 1
    forward = starts < ends
    keys = np.where(forward, starts * size + ends, ends * size + starts)
    keys[starts == ends] = -1
    order, first, counts = runs(keys)
    counts[keys[order[first]] < 0] = 0
    pairs = first[counts == 2]
    odd = np.flatnonzero((counts == 1) | (counts > 2))
    starts_of_odd = np.repeat(first[odd] - np.cumsum(counts[odd]) + counts[odd], counts[odd])
    others = order[starts_of_odd + np.arange(len(starts_of_odd))]
    one, other = order[pairs], order[pairs + 1]
    faces = np.stack([one, other], axis=1) // 3
    return SharedEdges(faces, forward[one] == forward[other], others, bool((counts > 2).any()))


def first_copies(corners: NDArray[np.integer]) -> Int64Array:
    """Return for each face the first face with the same corners and winding, ``int64[m]``."""
    lowest = corners.argmin(axis=1)
    turned = np.take_along_axis(corners, (lowest[:, None] + np.arange(3)) % 3, axis=1)
    size = int(turned.max(initial=0)) + 1
    _, pair, _ = groups(turned[:, 0] * np.int64(size) + turned[:, 1])
    first, which, _ = groups(pair * size + turned[:, 2])
    return first[which]


@dataclass(frozen=True, eq=False)
class Winding:
    """Faces to turn so that neighbours wind alike.

    Attributes
    ----------
    turned : bool[m]
        True for each face to turn.
    inconsistent : int
        Edges of two faces that wind differently even then: the surface there has one side only.
    one_sided : bool[m]
        True for the faces of connected parts with such edges.
    """

    turned: BoolArray
    inconsistent: int
    one_sided: BoolArray


def consistent_winding(edges: SharedEdges, areas: Float64Array) -> Winding:
    """Pass the winding on from face to face across edges of two faces.

    Each connected part keeps the winding of the larger share of its area. A part with one side only, such as
    a Möbius strip, stays as it is.

    Parameters
    ----------
    edges
        Edges of two faces.
    areas
        Area of each face, ``float64[m]``.
    """
    count = len(areas)
    turned, one_sided = np.zeros((2, count), np.bool_)
    if edges.differ.any():
        turned = _turned(edges, count)
        parts = components(edges.faces, count)
        balance = np.bincount(parts, np.where(turned, areas, -areas))
        one_sided = _one_sided(edges, turned, parts)
        turned ^= (balance > 0)[parts] & ~one_sided
    left = edges.differ ^ turned[edges.faces[:, 0]] ^ turned[edges.faces[:, 1]]
    return Winding(turned, int(left.sum()), one_sided)


def _one_sided(edges: SharedEdges, turned: BoolArray, parts: Int64Array) -> BoolArray:
    """Return True for faces of parts in which some neighbours wind differently, ``bool[m]``."""
    left = edges.differ ^ turned[edges.faces[:, 0]] ^ turned[edges.faces[:, 1]]
    marked = np.zeros(int(parts.max()) + 1, np.bool_)
    marked[parts[edges.faces[left, 0]]] = True
    return marked[parts]


def parts_of(corners: Int64Array) -> Int64Array:
    """Return the number of the connected part of each face; parts share no vertex, ``int64[m]``."""
    links = np.concatenate([corners[:, :2], corners[:, 1:]])
    labels = components(links, int(corners.max()) + 1)[corners[:, 0]]
    return _numbered(labels, distinct_numbers(labels, int(labels.max()) + 1))


def sheets_of(parts: Int64Array, borders: Float64Array, owners: Int64Array) -> Int64Array:
    """Return the number of the sheet of each face: parts whose borders meet are one, ``int64[m]``.

    Parameters
    ----------
    parts : int64[m]
        Number of the connected part of each face.
    borders : float64[k, 2, 3]
        Ends of the edges of single faces.
    owners : int64[k]
        Parts of these edges.
    """
    count = int(parts.max()) + 1
    if count == 1 or not len(borders):
        return parts
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    lower, upper = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lower, owners, borders.min(axis=1))
    np.maximum.at(upper, owners, borders.max(axis=1))
    gaps = BORDER_GAP * np.linalg.norm(np.maximum(upper - lower, 0.0), axis=1)
    points, owners = _border_points(borders, owners, float(gaps.max()))
    tree, reach = cKDTree(points), SAMPLED_REACH * float(gaps.max())
    if reach == 0.0 or tree.count_neighbors(tree, reach) > MAX_BORDER_PAIRS:
        return parts
    pairs = tree.query_pairs(reach, output_type="ndarray")
    distances = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    ends = owners[pairs]
    pairs = pairs[(ends[:, 0] != ends[:, 1]) & (distances <= SAMPLED_REACH * gaps[ends].max(axis=1))]
    met = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)  # a point, and one that it meets
    met = np.unique(np.column_stack([met[:, 0], owners[met[:, 1]]]), axis=0)  # a point, and a part
    links, shares = np.unique(np.column_stack([owners[met[:, 0]], met[:, 1]]), axis=0, return_counts=True)
    joined = shares >= MEETING_SHARE * np.bincount(owners, minlength=count)[links[:, 0]]
    return components(links[joined], count)[parts]


def _border_points(borders: Float64Array, owners: Int64Array, gap: float) -> tuple[Float64Array, Int64Array]:
    """Return points along borders with their parts, one of each part in a cell of the size of the gap."""
    lengths = np.linalg.norm(borders[:, 1] - borders[:, 0], axis=1)
    step = max(gap, float(lengths.sum()) / MAX_BORDER_POINTS)
    counts = np.maximum(np.ceil(lengths / max(step, MIN_STEP)), 1).astype(np.int64)
    rows = np.repeat(np.arange(len(counts)), counts)
    along = (ranges(np.zeros_like(counts), counts) / counts[rows])[:, None]
    points = (1.0 - along) * borders[rows, 0] + along * borders[rows, 1]
    cells = np.column_stack([owners[rows], np.floor(points / max(gap, MIN_STEP))])
    first = np.unique(cells, axis=0, return_index=True)[1]
    return points[first], owners[rows[first]]


def components(links: Int64Array, count: int) -> Int64Array:
    """Return the component of each of `count` nodes that pairs ``int64[m, 2]`` link, ``int64[count]``.

    Components are numbered by their first nodes. In each round, a node that has a smaller neighbour joins
    one of them. A call takes less time than the import of SciPy's function.
    """
    labels: Int64Array = np.arange(count)
    first, second = links.T
    while len(first):
        ends = labels[first], labels[second]
        apart = np.flatnonzero(ends[0] != ends[1])
        first, second = ends[0][apart], ends[1][apart]
        labels[np.maximum(first, second)] = np.minimum(first, second)
        while not np.array_equal(labels, shorter := labels[labels]):
            labels = shorter
    return _numbered(labels, np.flatnonzero(labels == np.arange(count)))


def _numbered(labels: Int64Array, known: Int64Array) -> Int64Array:
    """Return for each label its row among the known ones."""
    number = np.empty(int(known.max(initial=-1)) + 1, np.int64)
    number[known] = np.arange(len(known))
    return number[labels]


def _turned(edges: SharedEdges, count: int) -> BoolArray:
    """Return the faces to turn in one of the two windings of each part.

    Each face is two nodes, as it is and turned. An edge links like nodes of two faces that wind alike, and
    unlike ones of faces that do not. A part has two components, one for each winding; where it has one side
    only, it has one.
    """
    (a, b), differ = edges.faces.T, edges.differ
    pairs = [
        np.stack([a, np.where(differ, b + count, b)], axis=1),
        np.stack([a + count, np.where(differ, b, b + count)], axis=1),
    ]
    labels = components(np.concatenate(pairs), 2 * count)
    turned: BoolArray = labels[:count] > labels[count:]
    return turned


def edge_keys(corners: Int64Array) -> Int64Array:
    """Return a number for the edge of each side of faces, ``int64[m, 3]``; both faces at it have the same."""
    ends = np.roll(corners, -1, axis=1)
    size = int(corners.max(initial=0)) + 1
    keys: Int64Array = np.minimum(corners, ends) * size + np.maximum(corners, ends)
    return keys


def edge_twins(corners: Int64Array) -> Int32Array:
    """Return for side k of face f, from corner k to the next, the same side ``3 f' + k'`` of the neighbour.

    Parameters
    ----------
    corners : int64[m, 3]
        Welded corners of faces that wind alike.

    Returns
    -------
    int32[3 m]
        −1 where a side has no neighbour, or more than one.
    """
    starts, ends = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)
    order, first, counts = runs(edge_keys(corners).reshape(-1))
    pairs = first[counts == 2]
    one, other = order[pairs], order[pairs + 1]
    against = (starts[one] == ends[other]) & (starts[one] != ends[one])
    one, other = one[against], other[against]
    twins = np.full(len(starts), -1, np.int32)
    twins[one], twins[other] = other, one
    return twins
