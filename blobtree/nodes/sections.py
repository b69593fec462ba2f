"""Sections: outlines in kernels, as distances, faces and sizes of solids whose section is an outline.

Such a kind places a point beside the outline: (x, y) in its plane, the distance from the nearer end, below 0
between the ends, and the side of that end. The rest is one code.

The data region holds a binary tree of boxes around edges in their order, so that few edges are tried for a
point: after a header the boxes of a heap whose root is 1, then three texels for each edge, then the faces. A
face is a chain of edges between corners. Behind its first and its last edge it goes on straight.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Float64Array
from blobtree.nodes.outlines import SHORTEST, Outline
from blobtree.nodes.sharp import SharpSolid
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

EDGES_OF_BOX = wp.constant(4)
"""Edges in a smallest box."""

EDGE_TEXELS = wp.constant(3)
"""Texels of an edge: start and way; normals at both ends; the edges before and behind, and the face."""

FAR = wp.constant(1.0e18)
"""A distance beyond all others, whose square is finite."""

MUCH_THINNER = 0.25
"""Width of thin parts over the mean radius, at most: meshes have smaller cells for such parts."""

PARALLEL = np.cos(np.radians(3.0))
"""Cosine of the angle between both sides of a thin part, at least: others are tips of corners."""

LEAST_SHARE = 0.005
"""Least share of an outline's length that counts as a thin part."""

THINNEST = 0.1
"""Share of the thin places that may be thinner than the width of thin parts."""

MOST_SAMPLES = 2000
"""Most places along an outline at which its thickness is measured."""

MOST_PAIRS = 20_000_000
"""Most pairs of such a place and an edge."""


@wp.func
def box_squared(p: wp.vec2, box: wp.vec4) -> wp.float32:
    """Return the squared distance of p from a box (low, high)."""
    x = wp.max(wp.max(box[0] - p[0], p[0] - box[2]), 0.0)
    y = wp.max(wp.max(box[1] - p[1], p[1] - box[3]), 0.0)
    return x * x + y * y


@wp.func
def edge_foot(p: wp.vec2, edge: wp.vec4, low: wp.float32, high: wp.float32) -> wp.vec3:
    """Return the way to p from an edge's closest point, and the parameter (low to high) of that point."""
    w = wp.vec2(p[0] - edge[0], p[1] - edge[1])
    way = wp.vec2(edge[2], edge[3])
    t = wp.clamp(wp.dot(w, way) / wp.dot(way, way), low, high)
    return wp.vec3(w[0] - t * way[0], w[1] - t * way[1], t)


@wp.func
def nearest_in_box(
    p: wp.vec2, best: wp.vec2, tape: Texels, edges: wp.int32, first: wp.int32, end: wp.int32
) -> wp.vec2:
    """Return (squared distance, edge) of the best or of a nearer edge from `first` to `end`."""
    for i in range(first, end):
        foot = edge_foot(p, tape[edges + EDGE_TEXELS * i], 0.0, 1.0)
        squared = foot[0] * foot[0] + foot[1] * foot[1]
        if squared < best[0]:
            best = wp.vec2(squared, float(i))
    return best


@wp.func
def nearest_edge(p: wp.vec2, tape: Texels, first: wp.int32) -> wp.int32:
    """Return the nearest edge. A way down through nearer boxes finds a near one, then all boxes are tried.

    tape[first] = (number of leaves of the heap, number of edges, ·, ·).
    """
    leaves = int(tape[first][0])
    count = int(tape[first][1])
    edges = first + 2 * leaves
    k = int(1)
    while k < leaves:
        k = 2 * k
        if box_squared(p, tape[first + k + 1]) < box_squared(p, tape[first + k]):
            k = k + 1
    start = EDGES_OF_BOX * (k - leaves)
    best = nearest_in_box(p, wp.vec2(FAR * FAR, 0.0), tape, edges, start, wp.min(start + EDGES_OF_BOX, count))
    k = int(1)
    while k > 0:
        inside = box_squared(p, tape[first + k]) < best[0]
        if inside and k < leaves:
            k = 2 * k
        else:
            if inside:
                start = EDGES_OF_BOX * (k - leaves)
                best = nearest_in_box(p, best, tape, edges, start, wp.min(start + EDGES_OF_BOX, count))
            while (k & 1) == 1:
                k = k >> 1
            if k > 0:
                k = k + 1
    return int(best[1])


@wp.func
def signed_row(foot: wp.vec3, low: wp.float32, high: wp.float32, edge: wp.vec4, ends: wp.vec4) -> wp.vec3:
    """Return (d, ∇d) for a foot on an edge: beside it by its normal, at its ends by the normals there."""
    away = wp.vec2(foot[0], foot[1])
    normal = wp.normalize(wp.vec2(edge[3], -edge[2]))
    if foot[2] > low and foot[2] < high:
        return wp.vec3(wp.dot(away, normal), normal[0], normal[1])
    normal = wp.vec2(ends[2], ends[3])
    if foot[2] <= low:
        normal = wp.vec2(ends[0], ends[1])
    d = wp.length(away)
    if d == 0.0:
        return wp.vec3(0.0, normal[0], normal[1])
    if wp.dot(away, normal) < 0.0:
        d = -d
    return wp.vec3(d, away[0] / d, away[1] / d)


@wp.func
def outline_row(p: wp.vec2, tape: Texels, first: wp.int32) -> wp.vec4:
    """Return (d, ∇d, nearest edge) of an outline.

    Near a corner, distances from both edges differ by less than they are rounded. At an end of an edge,
    therefore, the next one is taken if its closest point is none of its ends.
    """
    i = nearest_edge(p, tape, first)
    edges = first + 2 * int(tape[first][0])
    at = edges + EDGE_TEXELS * i
    foot = edge_foot(p, tape[at], 0.0, 1.0)
    if foot[2] <= 0.0 or foot[2] >= 1.0:
        link = int(tape[at + 2][1])
        if foot[2] <= 0.0:
            link = int(tape[at + 2][0])
        beside = edge_foot(p, tape[edges + EDGE_TEXELS * link], 0.0, 1.0)
        if beside[2] > 0.0 and beside[2] < 1.0:
            i = link
            at = edges + EDGE_TEXELS * i
            foot = beside
    row = signed_row(foot, 0.0, 1.0, tape[at], tape[at + 1])
    return wp.vec4(row[0], row[1], row[2], float(i))


@wp.func
def face_row(p: wp.vec2, face: wp.int32, tape: Texels, first: wp.int32) -> wp.vec3:
    """Return (d, ∇d) of a face, which goes on behind its ends.

    The texel of a face is (its first edge, their number, 1 if it is a whole loop, ·).
    """
    edges = first + 2 * int(tape[first][0])
    chain = tape[edges + EDGE_TEXELS * int(tape[first][1]) + face]
    start = int(chain[0])
    count = int(chain[1])
    best = FAR * FAR
    row = wp.vec3()
    for i in range(count):
        at = edges + EDGE_TEXELS * (start + i)
        low = float(0.0)
        high = float(1.0)
        if chain[2] == 0.0 and i == 0:
            low = -FAR
        if chain[2] == 0.0 and i == count - 1:
            high = FAR
        foot = edge_foot(p, tape[at], low, high)
        squared = foot[0] * foot[0] + foot[1] * foot[1]
        if squared < best:
            best = squared
            row = signed_row(foot, low, high, tape[at], tape[at + 1])
    return row


@wp.func
def end_share(flat: wp.float32, end: wp.float32) -> wp.vec3:
    """Return (d, ∂d / ∂flat, ∂d / ∂end) of the solid between ends whose section is an outline."""
    if flat > 0.0 and end > 0.0:
        d = wp.length(wp.vec2(flat, end))
        return wp.vec3(d, flat / d, end / d)
    if end > flat:
        return wp.vec3(end, 0.0, 1.0)
    return wp.vec3(flat, 1.0, 0.0)


@wp.func
def profile_sheet_at(place: wp.vec4, tolerance: wp.float32, tape: Texels, first: wp.int32) -> wp.int32:
    """Return 1 and 2 for the ends, and from 3 on the faces along the outline.

    At a convex corner the face is the one that is farther away, as it goes on.
    """
    p = wp.vec2(place[0], place[1])
    flat = outline_row(p, tape, first)
    if wp.min(flat[0], place[2]) > tolerance:
        return 0
    if place[2] >= flat[0]:
        if place[3] < 0.0:
            return 1
        return 2
    at = first + 2 * int(tape[first][0]) + EDGE_TEXELS * int(flat[3])
    face = int(tape[at + 2][2])
    beyond = face_row(p, face, tape, first)[0]
    if flat[0] > tolerance and flat[0] > beyond:
        link = int(tape[at + 2][1])
        if edge_foot(p, tape[at], 0.0, 1.0)[2] < 0.5:
            link = int(tape[at + 2][0])
        other = int(tape[first + 2 * int(tape[first][0]) + EDGE_TEXELS * link + 2][2])
        beside = face_row(p, other, tape, first)[0]
        if wp.min(beyond, beside) > tolerance:
            return 0
        if beside > beyond:
            face = other
    return 3 + face


class SectionSolid(SharpSolid):
    """A solid whose section is an `outline`."""

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the radii of the solids, or of parts that are much thinner."""
        radii = super().inradii(leaves)
        thin = np.array([thin_width(leaf.outline) + leaf.offset for leaf in leaves])
        return np.where((thin > 0.0) & (thin < MUCH_THINNER * radii), thin, radii)


def box_corners(outline: Outline) -> Float64Array:
    """Return the corners (4, 2) of the box around an outline."""
    (x, y), (to_x, to_y) = outline.bounds
    return np.array([(x, y), (to_x, y), (to_x, to_y), (x, to_y)])


@lru_cache(maxsize=64)
def outline_texels(outline: Outline, around: bool = False) -> Float64Array:
    """Return the texels (n, 4) of an outline, see the head of this file; `around` an axis at x = 0.

    Edges on that axis bound nothing: they are left out, and the normals at their ends lie along the axis.
    """
    counts = [len(loop.points) for loop in outline.loops]
    starts = outline.points
    ends = np.concatenate([np.roll(loop.points, -1, axis=0) for loop in outline.loops])
    numbers = np.arange(len(starts))
    loops = np.split(numbers, np.cumsum(counts)[:-1])
    before = np.concatenate([np.roll(loop, 1) for loop in loops])
    after = np.concatenate([np.roll(loop, -1) for loop in loops])
    firsts = np.concatenate([loop.corners | (np.arange(len(loop.points)) == 0) for loop in outline.loops])
    closed = np.repeat([not loop.corners.any() for loop in outline.loops], counts)
    faces = np.cumsum(firsts) - 1
    ways = ends - starts
    normals = np.column_stack([ways[:, 1], -ways[:, 0]]) / np.linalg.norm(ways, axis=1)[:, None]
    on_axis = around & (np.maximum(starts[:, 0], ends[:, 0]) <= SHORTEST * np.ptp(starts, axis=0).max())
    bisectors = normals + normals[before]
    beside = on_axis != on_axis[before]
    bisectors[beside] = np.where(on_axis[beside, None], normals[before[beside]], normals[beside]) * (0.0, 1.0)
    bisectors /= np.linalg.norm(bisectors, axis=1)[:, None]
    places = np.cumsum(~on_axis) - 1
    links = [np.where(on_axis[other], places, places[other]) for other in (before, after)]
    kept = ~on_axis
    edges = np.stack(
        [
            np.concatenate([starts, ways], axis=1),
            np.concatenate([bisectors, bisectors[after]], axis=1),
            np.stack([*links, faces, 0.0 * faces], axis=1),
        ],
        axis=1,
    )[kept]
    chains = np.zeros((firsts.sum(), 4))
    chains[:, 1] = np.bincount(faces[kept], minlength=len(chains))
    chains[:, 0] = np.cumsum(chains[:, 1]) - chains[:, 1]
    chains[:, 2] = closed[firsts]
    boxes = _heap(np.minimum(starts, ends)[kept], np.maximum(starts, ends)[kept])
    boxes[0] = len(boxes) / 2, len(edges), 0.0, 0.0
    return np.concatenate([boxes, edges.reshape(-1, 4), chains])


def _heap(lower: Float64Array, upper: Float64Array) -> Float64Array:
    """Return boxes (2 · leaves, 4) around edges in their order, as a heap whose root is 1."""
    used = -(-len(lower) // EDGES_OF_BOX)
    leaves = 1 << (used - 1).bit_length()
    boxes = np.full((2 * leaves, 4), (FAR, FAR, -FAR, -FAR))
    starts = np.arange(0, len(lower), EDGES_OF_BOX)
    boxes[leaves : leaves + used, :2] = np.minimum.reduceat(lower, starts)
    boxes[leaves : leaves + used, 2:] = np.maximum.reduceat(upper, starts)
    for k in range(leaves - 1, 0, -1):
        boxes[k, :2] = np.minimum(boxes[2 * k, :2], boxes[2 * k + 1, :2])
        boxes[k, 2:] = np.maximum(boxes[2 * k, 2:], boxes[2 * k + 1, 2:])
    return boxes


@lru_cache(maxsize=64)
def mean_radius(outline: Outline) -> float:
    """Return twice the area of an outline over its length: the radius of a circle."""
    lengths = [
        np.linalg.norm(np.roll(loop.points, -1, axis=0) - loop.points, axis=1).sum() for loop in outline.loops
    ]
    return float(2.0 * outline.area / sum(lengths))


def mean_distance(outline: Outline) -> float:
    """Return the x of the centroid of an outline."""
    (x, y), (to_x, to_y) = (
        np.concatenate([np.roll(loop.points, -step, axis=0) for loop in outline.loops]).T for step in (0, 1)
    )
    return float(((x * to_y - to_x * y) * (x + to_x)).sum() / (6.0 * outline.area))


@lru_cache(maxsize=64)
def thin_width(outline: Outline) -> float:
    """Return the width of an outline's thin parts, infinity if it has none.

    It is measured at even distances along the outline: inward, to the next edge.
    """
    starts = outline.points
    ways = np.concatenate([np.roll(loop.points, -1, axis=0) - loop.points for loop in outline.loops])
    lengths = np.linalg.norm(ways, axis=1)
    units = ways / lengths[:, None]
    ends = np.cumsum(lengths)
    count = min(MOST_SAMPLES, MOST_PAIRS // len(ways))
    along = (np.arange(count) + 0.5) / count * ends[-1]
    edges = np.minimum(np.searchsorted(ends, along), len(ways) - 1)
    places = starts[edges] + (along - ends[edges] + lengths[edges])[:, None] * units[edges]
    nearest = SHORTEST * np.ptp(starts, axis=0).max()

    def width(place: Float64Array, unit: Float64Array) -> float:
        """Return the distance of the next edge on the left of a place, infinity if it is not parallel."""
        x, y = (starts - place).T
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = -1.0 / (ways @ unit)
            distances, shares = (x * ways[:, 1] - y * ways[:, 0]) * rates, (x * unit[0] + y * unit[1]) * rates
        distances[~((shares >= 0.0) & (shares <= 1.0) & (distances > nearest))] = np.inf
        edge = distances.argmin()
        return float(distances[edge]) if units[edge] @ unit < -PARALLEL else np.inf

    widths = np.array([width(*sample) for sample in zip(places, units[edges], strict=True)])
    thin = widths[widths < MUCH_THINNER * mean_radius(outline)]
    return float(np.quantile(thin, THINNEST)) if len(thin) > LEAST_SHARE * count else np.inf
