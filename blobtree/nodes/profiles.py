"""Profiles: solids whose section is an outline, drawn along a line or turned around an axis.

Both kinds place a point beside the outline: (x, y) in its plane, the distance from the nearer end, below 0
between the ends, and the side of that end. The rest is one code.

The data region holds a binary tree of boxes around edges in their order, so that few edges are tried for a
point: after a header the boxes of a heap whose root is 1, then three texels for each edge, then the faces. A
face is a chain of edges between corners. Behind its first and its last edge it goes on straight.
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from functools import lru_cache
from typing import Any

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import unit_vectors
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.flats import polygon_in_plane
from blobtree.nodes.node import Node
from blobtree.nodes.outlines import SHORTEST, Outline, Section
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.sharp import SHEET_TOLERANCE, SharpSolid, relative_bounds, relative_distance
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

EDGES_OF_BOX = wp.constant(4)
"""Edges in a smallest box."""

EDGE_TEXELS = wp.constant(3)
"""Texels of an edge: start and way; normals at both ends; the edges before and behind, and the face."""

FAR = wp.constant(1.0e18)
"""A distance beyond all others, whose square is finite."""

WHOLE_TURN = 360.0

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
    """Return (d, ∇d, nearest edge) of an outline."""
    i = nearest_edge(p, tape, first)
    at = first + 2 * int(tape[first][0]) + EDGE_TEXELS * i
    row = signed_row(edge_foot(p, tape[at], 0.0, 1.0), 0.0, 1.0, tape[at], tape[at + 1])
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


@wp.func
def extrusion_place(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the place of q beside the outline of an extrusion, see the head of this file.

    tape[at] = (first texel of the outline, origin); tape[at + 1] = (u, height); tape[at + 2] = (v, ·);
    tape[at + 3] = (offset, mean, ·, ·).
    """
    head = tape[at]
    along = tape[at + 1]
    across = tape[at + 2]
    w = q - wp.vec3(head[1], head[2], head[3])
    u = wp.vec3(along[0], along[1], along[2])
    v = wp.vec3(across[0], across[1], across[2])
    z = wp.dot(w, wp.cross(u, v)) - 0.5 * along[3]
    return wp.vec4(wp.dot(w, u), wp.dot(w, v), wp.abs(z) - 0.5 * along[3], wp.where(z < 0.0, -1.0, 1.0))


@wp.func
def in_extrusion(d: wp.float32, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) for a distance and its gradient along u, v and the normal of their plane."""
    along = tape[at + 1]
    across = tape[at + 2]
    u = wp.vec3(along[0], along[1], along[2])
    v = wp.vec3(across[0], across[1], across[2])
    n = u * g[0] + v * g[1] + wp.cross(u, v) * g[2]
    return relative_distance(wp.vec4(d, n[0], n[1], n[2]), tape[at + 3][0], tape[at + 3][1])


@wp.func
def extrusion_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of an extrusion."""
    place = extrusion_place(q, tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))
    share = end_share(flat[0], place[2])
    return in_extrusion(
        share[0], wp.vec3(share[1] * flat[1], share[1] * flat[2], share[2] * place[3]), tape, at
    )


@wp.func
def extrusion_bounds(ball: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball."""
    place = extrusion_place(ball, tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))[0]
    return relative_bounds(end_share(flat, place[2])[0], radius, tape[at + 3][0], tape[at + 3][1])


@wp.func
def extrusion_sheet_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.int32:
    """Return `profile_sheet_at`: 1 for the base, 2 for the top."""
    tolerance = SHEET_TOLERANCE * tape[at + 3][1]
    return profile_sheet_at(extrusion_place(q, tape, at), tolerance, tape, int(tape[at][0]))


@wp.func
def extrusion_sheet_value_gradient(q: wp.vec3, sheet: wp.int32, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of the distance from the plane of an end, or from a face."""
    place = extrusion_place(q, tape, at)
    if sheet < 3:
        side = float(2 * sheet - 3)
        height = tape[at + 1][3]
        z = (place[2] + 0.5 * height) * place[3]
        return in_extrusion(side * z - 0.5 * height, wp.vec3(0.0, 0.0, side), tape, at)
    row = face_row(wp.vec2(place[0], place[1]), sheet - 3, tape, int(tape[at][0]))
    return in_extrusion(row[0], wp.vec3(row[1], row[2], 0.0), tape, at)


@wp.func
def from_origin(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return q from the origin of a revolution.

    tape[at] = (first texel of the outline, origin); tape[at + 1] = (cosine and sine of the angle, normal of
    the plane in its middle); tape[at + 2] = (offset, mean, 1 for a whole turn, ·).
    """
    head = tape[at]
    return q - wp.vec3(head[1], head[2], head[3])


@wp.func
def nearer_end(w: wp.vec3, turn: wp.vec4) -> wp.vec3:
    """Return (direction from the axis, side) of the nearer end of a turn: −1 for its start, 1 for its end."""
    if w[0] * turn[2] + w[1] * turn[3] < 0.0:
        return wp.vec3(1.0, 0.0, -1.0)
    return wp.vec3(turn[0], turn[1], 1.0)


@wp.func
def revolution_place(w: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the place of w beside the outline, see the head of this file.

    Beyond an end the closest point lies in its plane, since the distance between two points grows with the
    angle between them around the axis. Between the ends it has the same angle as w.
    """
    end = nearer_end(w, tape[at + 1])
    r = wp.length(wp.vec2(w[0], w[1]))
    if tape[at + 2][2] == 1.0:
        return wp.vec4(r, w[2], -FAR, end[2])
    x = w[0] * end[0] + w[1] * end[1]
    beyond = (w[1] * end[0] - w[0] * end[1]) * end[2]
    if beyond > 0.0:
        return wp.vec4(x, w[2], beyond, end[2])
    if x < 0.0:
        beyond = -r
    return wp.vec4(r, w[2], beyond, end[2])


@wp.func
def outward(w: wp.vec3) -> wp.vec3:
    """Return the direction from the axis to w."""
    if w[0] == 0.0 and w[1] == 0.0:
        return wp.vec3(1.0, 0.0, 0.0)
    return wp.normalize(wp.vec3(w[0], w[1], 0.0))


@wp.func
def revolution_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of a revolution."""
    w = from_origin(q, tape, at)
    place = revolution_place(w, tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))
    share = end_share(flat[0], place[2])
    end = nearer_end(w, tape[at + 1])
    across = outward(w)
    normal = wp.vec3(-end[1], end[0], 0.0) * end[2]
    if place[2] > 0.0:
        across = wp.vec3(end[0], end[1], 0.0)
    elif place[2] == -place[0]:
        normal = -across
    g = across * (share[1] * flat[1]) + normal * share[2]
    return relative_distance(
        wp.vec4(share[0], g[0], g[1], share[1] * flat[2]), tape[at + 2][0], tape[at + 2][1]
    )


@wp.func
def revolution_bounds(ball: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball."""
    place = revolution_place(from_origin(ball, tape, at), tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))[0]
    return relative_bounds(end_share(flat, place[2])[0], radius, tape[at + 2][0], tape[at + 2][1])


@wp.func
def revolution_sheet_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.int32:
    """Return `profile_sheet_at`: 1 for the start of the turn, 2 for its end; the axis is no face."""
    place = revolution_place(from_origin(q, tape, at), tape, at)
    place[0] = wp.max(place[0], 0.0)
    return profile_sheet_at(place, SHEET_TOLERANCE * tape[at + 2][1], tape, int(tape[at][0]))


@wp.func
def revolution_sheet_value_gradient(q: wp.vec3, sheet: wp.int32, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of the distance from the plane of an end, or from a face turned all around."""
    w = from_origin(q, tape, at)
    turn = tape[at + 1]
    shape = tape[at + 2]
    if sheet == 1:
        return relative_distance(wp.vec4(-w[1], 0.0, -1.0, 0.0), shape[0], shape[1])
    if sheet == 2:
        d = w[1] * turn[0] - w[0] * turn[1]
        return relative_distance(wp.vec4(d, -turn[1], turn[0], 0.0), shape[0], shape[1])
    row = face_row(wp.vec2(wp.length(wp.vec2(w[0], w[1])), w[2]), sheet - 3, tape, int(tape[at][0]))
    g = outward(w) * row[1]
    return relative_distance(wp.vec4(row[0], g[0], g[1], row[2]), shape[0], shape[1])


class _Profile(SharpSolid):
    """A solid whose section is an outline."""

    outline: Section
    origin: Vector = par.point("where the outline's origin lies")

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the radii of the solids, or of parts that are much thinner."""
        radii = super().inradii(leaves)
        thin = np.array([thin_width(leaf.outline) + leaf.offset for leaf in leaves])
        return np.where((thin > 0.0) & (thin < MUCH_THINNER * radii), thin, radii)


class _Extrusion(_Profile):
    """An outline, drawn along the normal of its plane."""

    tag = "sharp_extrusion"
    texels_read = 4
    value_gradient = formula(extrusion_value_gradient)
    bounds = formula(extrusion_bounds)
    sheet_at = formula(extrusion_sheet_at)
    sheet_value_gradient = formula(extrusion_sheet_value_gradient)

    u: Vector = par.direction("direction of the outline's x axis")
    v: Vector = par.direction("direction of the outline's y axis")
    height: float = par.length("length along the normal of the plane")

    @property
    def data(self) -> Float64Array:
        """The outline."""
        return outline_texels(self.outline)

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of the outlines' boxes at both ends."""
        corners = np.array([_box_corners(leaf.outline) for leaf in leaves])
        frames = np.array([[leaf.u, leaf.v] for leaf in leaves])
        bases = np.array([[leaf.origin] for leaf in leaves]) + corners @ frames
        ways = np.array([[leaf.height] for leaf in leaves]) * np.cross(*frames.transpose(1, 0, 2))
        return np.concatenate([bases, bases + ways[:, None]], axis=1)

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the numbers that the formulas read; the index of the outline is filled in later."""
        rows = [
            [0.0, *leaf.origin, *leaf.u, leaf.height, *leaf.v, 0.0, leaf.offset, leaf.mean, 0.0, 0.0]
            for leaf in leaves
        ]
        return np.array(rows, np.float64).reshape(len(rows), 4, 4)


class _Revolution(_Profile):
    """An outline, turned around the z axis from the x axis on."""

    tag = "sharp_revolution"
    texels_read = 3
    value_gradient = formula(revolution_value_gradient)
    bounds = formula(revolution_bounds)
    sheet_at = formula(revolution_sheet_at)
    sheet_value_gradient = formula(revolution_sheet_value_gradient)

    angle: float = par.angle("angle of the turn", low=0.0, high=WHOLE_TURN)

    @property
    def data(self) -> Float64Array:
        """The outline, without edges on the axis if the turn is whole."""
        return outline_texels(self.outline, around=self.angle == WHOLE_TURN)

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of the outlines' boxes, at both ends and where the turn passes an axis."""
        corners = np.array([_box_corners(leaf.outline) for leaf in leaves])
        quarters = np.array([0.0, 90.0, 180.0, 270.0, 360.0])
        angles = np.radians(np.minimum(quarters, [[leaf.angle] for leaf in leaves]))[:, None]
        x, y = corners[:, :, :1], np.broadcast_to(corners[:, :, 1:], (len(leaves), 4, 5))
        around = np.stack([x * np.cos(angles), x * np.sin(angles), y], axis=-1).reshape(len(leaves), 20, 3)
        return np.array([[leaf.origin] for leaf in leaves]) + around

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the numbers that the formulas read; the index of the outline is filled in later."""
        rows = [
            [0.0, *leaf.origin, np.cos(angle), np.sin(angle), -np.sin(0.5 * angle), np.cos(0.5 * angle),
             leaf.offset, leaf.mean, leaf.angle == WHOLE_TURN, 0.0]
            for leaf, angle in zip(leaves, np.radians([leaf.angle for leaf in leaves]), strict=True)
        ]  # fmt: skip
        return np.array(rows, np.float64).reshape(len(rows), 3, 4)


def _box_corners(outline: Outline) -> Float64Array:
    """Return the corners (4, 2) of the box around an outline."""
    (x, y), (to_x, to_y) = outline.bounds
    return np.array([(x, y), (to_x, y), (to_x, to_y), (x, to_y)])


@lru_cache(maxsize=64)
def outline_texels(outline: Outline, around: bool = False) -> Float64Array:
    """Return the texels (n, 4) of an outline, see the head of this file; `around` an axis at x = 0.

    Edges on that axis bound nothing: they are left out, and the normals at their ends lie along the axis.
    """
    counts = [len(loop.points) for loop in outline.loops]
    starts = np.concatenate([loop.points for loop in outline.loops])
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


def _mean_radius(outline: Outline) -> float:
    """Return twice the area of an outline over its length: the radius of a circle."""
    lengths = [
        np.linalg.norm(np.roll(loop.points, -1, axis=0) - loop.points, axis=1).sum() for loop in outline.loops
    ]
    return float(2.0 * outline.area / sum(lengths))


def _mean_distance(outline: Outline) -> float:
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
    starts = np.concatenate([loop.points for loop in outline.loops])
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
    thin = widths[widths < MUCH_THINNER * _mean_radius(outline)]
    return float(np.quantile(thin, THINNEST)) if len(thin) > LEAST_SHARE * count else np.inf


def _polygon_frame(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return unit vectors (2, 3) in the plane of corners (n, 3), counter-clockwise; and the corners there."""
    w = points - points[0]
    (normal,) = unit_vectors(np.cross(w[1:-1], w[2:]).sum(axis=0, keepdims=True))
    u = w[1] - (w[1] @ normal) * normal
    u = u / np.linalg.norm(u)
    axes = np.array([u, np.cross(normal, u)])
    return axes, w @ axes.T


class Prism(Pieces):
    """A solid with a polygon as its base, also a concave one: it rises along the normal of the base.

    The corners of the base are counter-clockwise seen from the top. With `radius` 0 all edges are sharp. With
    a larger one, the solid also holds all points within `radius` of the sharp one. A width grows with the
    radius, or with the mean radius of a sharp prism: the smaller one of half its height and twice the area of
    the base over its perimeter.

    Raises
    ------
    InvalidNode
        There are less than three corners, they do not lie in a plane, or edges cross or touch each other.

    Examples
    --------
    >>> from blobtree import Prism
    >>> wedge = Prism([(0, 0, 0), (2, 0, 0), (0, 1, 0)], 1.0)
    >>> wedge([[0, 0, 0.5], [1, 0.5, 1], [0.5, 0.3, 0.5]]).astype(float).round(3).tolist()
    [0.5, 0.5, 0.972]
    """

    file_tag = "prism"

    points: tuple[Vector, ...] = par.points("corners of the base in order, at least three")
    height: float = par.length("length along the normal of the base")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        polygon_in_plane(self.points)

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid."""
        (u, v), corners = _polygon_frame(np.array(self.points))
        base = Outline.polygon(corners)
        mean = self.radius or min(0.5 * self.height, _mean_radius(base))
        return _Extrusion(
            base,
            self.points[0],
            tuple(u.tolist()),
            tuple(v.tolist()),
            self.height,
            offset=self.radius,
            mean=mean,
            **self.shared,
        )


class Extrude(Pieces):
    """An outline in the xy plane, drawn upward: letters, logos, gears, plates with holes.

    With `radius` 0 all edges are sharp. With a larger one, the solid also holds all points within `radius` of
    the sharp one. A width grows with the radius, or with the mean radius of a sharp solid: the smaller one of
    half its height and twice the area of the outline over its length.

    A scale and a turn of the top are a taper and a twist: the surface is exact, and the field is no longer
    that of a distance.

    Raises
    ------
    InvalidNode
        The outline is none, see `Outline`.

    Examples
    --------
    >>> from blobtree import Extrude, Outline
    >>> washer = Extrude(Outline.arcs([(-1, 0), (1, 0)], 1) + Outline.arcs([(-0.5, 0), (0.5, 0)], 1), 0.2)
    >>> washer([[0.5, 0, 0.1], [0.75, 0, 0.2], [0, 0, 0.1]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "extrude"

    outline: Section
    height: float = par.length("length along z")
    _: KW_ONLY
    origin: Vector = par.point("where the outline's origin lies", default=(0.0, 0.0, 0.0))
    top_scale: float = par.factor(
        "scale of the top, from the outline's origin", low=0.001, high=1000.0, default=1.0
    )
    top_turn: float = par.angle("angle by which the top is turned around the outline's origin", default=0.0)
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid, under the warps."""
        warped = self.top_scale != 1.0 or self.top_turn != 0.0
        solid: Node = _Extrusion(
            self.outline,
            (0.0, 0.0, 0.0) if warped else self.origin,
            (1.0, 0.0, 0.0),
            (0.0, 1.0, 0.0),
            self.height,
            offset=self.radius,
            mean=self.radius or min(0.5 * self.height, _mean_radius(self.outline)),
            **self.shared,
        )
        if self.top_scale != 1.0:
            solid = solid.taper(self.top_scale, (0.0, self.height))
        if self.top_turn != 0.0:
            solid = solid.twist(self.top_turn / self.height)
        return solid.translate(self.origin) if warped else solid


class Revolve(Pieces):
    """An outline in the xz plane, turned around the z axis from there: vases, wheels, wedges of them.

    The outline's x is the distance from the axis, and its y is z. With `radius` 0 all edges are sharp. With a
    larger one, the solid also holds all points within `radius` of the sharp one. A width grows with the
    radius, or with the mean radius of a sharp solid: twice the area of the outline over its length,
    and at most the length of the turn at the outline's centroid.

    Raises
    ------
    InvalidNode
        The outline is none, see `Outline`, or it crosses the axis.

    Examples
    --------
    >>> from blobtree import Revolve
    >>> ring = Revolve("M1 0H2V1H1Z")
    >>> ring([[-2, 0, 0.5], [0, 1.5, 1], [0, 0, 0.5]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "revolve"

    outline: Section
    angle: float = par.angle(
        "angle of the turn, counter-clockwise from above", low=0.1, high=WHOLE_TURN, default=WHOLE_TURN
    )
    _: KW_ONLY
    origin: Vector = par.point("where the outline's origin lies", default=(0.0, 0.0, 0.0))
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        (x, y), (to_x, to_y) = self.outline.bounds
        if x < -SHORTEST * max(to_x - x, to_y - y):
            raise InvalidNode(f"outline: expected x from 0, the distance from the axis, got {x:g}; move it")

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid."""
        mean = self.radius or _mean_radius(self.outline)
        if self.angle < WHOLE_TURN and not self.radius:
            mean = min(mean, np.radians(self.angle) * _mean_distance(self.outline))
        return _Revolution(
            self.outline, self.origin, self.angle, offset=self.radius, mean=mean, **self.shared
        )
