"""Sweeps: solids whose section is an outline that moves along lines and arcs, and may grow and turn.

At each point of a solid the nearest span of the course counts, see `nodes.courses`. There the point has the
distances from the course toward the centre of the arc and across its plane, and the share of the course that
lies behind. The field is that of the distance from the section. It is exact where the section neither grows
nor turns and the course has no corners.

The slope of a distance within a section that grows at the rate s' and turns at the rate α' is known: along
the course it changes by no more than R √(s'² + α'² s²), for an outline that reaches to R from its origin.
"""

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, Any

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.declare.skeleton import BALL_CELLS, PLATE_CELLS
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import RIM
from blobtree.lazy import Lazy
from blobtree.nodes.courses import Span, spans_of
from blobtree.nodes.node import Node
from blobtree.nodes.outlines import Outline, Section
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.sections import (
    FAR,
    MUCH_THINNER,
    SectionSolid,
    end_share,
    face_row,
    mean_radius,
    outline_row,
    outline_texels,
    profile_sheet_at,
    thin_width,
)
from blobtree.nodes.sharp import DISTANCE_MARGIN, SHEET_TOLERANCE, relative_distance
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

SPAN_TEXELS = wp.constant(8)
"""Texels of a span, see `_span_texels`."""

JOINT_SLACK = 1e-6
"""Length over the size by which spans overlap, so that rounding leaves no gap."""

LEAST_ROOM = wp.constant(1e-3)
"""Least distance from the axis of an arc, over its radius, at which bounds hold."""

PLATE_MARGIN = wp.constant(BALL_CELLS / PLATE_CELLS)
"""Factor of the thickness of sides, which take fewer cells than balls."""

MOST_BENT = 0.98
"""Reach of the section toward the centre of an arc, over the radius of the arc, at most."""

ARC_STEP = math.radians(5.0)
"""Largest angle between places of an arc at which its box is measured."""

Ends = Annotated[str, Parameter(Quantity.CHOICE, "an open curve or a closed one", choices=("open", "closed"))]
Corners = Annotated[
    str,
    Parameter(
        Quantity.CHOICE,
        "lines with sharp corners between the points, or a smooth curve of arcs",
        choices=("sharp", "smooth"),
    ),
]


@wp.func
def span_place(q: wp.vec3, tape: Texels, span: wp.int32) -> wp.vec4:
    """Return the place of q at a span: distances toward the centre and across, share, distance beyond.

    The share is that of the span behind the place. The last number is the distance beyond the nearer end. A
    span is (start, length), (tangent, curvature), (inward, share of the course behind its start), (end,
    share at its end), (tangent at the end, angle of the frame), (plane at the start, slack), (plane at the
    end, slack), (1 if it starts, ends at a corner, number of the leg, ·).
    """
    start = tape[span]
    along = tape[span + 1]
    inward = tape[span + 2]
    end = tape[span + 3]
    first = tape[span + 5]
    last = tape[span + 6]
    t = wp.vec3(along[0], along[1], along[2])
    n = wp.vec3(inward[0], inward[1], inward[2])
    b = wp.cross(t, n)
    w = q - wp.vec3(start[0], start[1], start[2])
    v = q - wp.vec3(end[0], end[1], end[2])
    before = -wp.dot(w, wp.vec3(first[0], first[1], first[2])) - first[3]
    behind = wp.dot(v, wp.vec3(last[0], last[1], last[2])) - last[3]
    beyond = wp.max(before, behind)
    corner = tape[span + 7][0] + tape[span + 7][1]
    x = wp.dot(w, t)
    y = wp.dot(w, n)
    if beyond > 0.0 and corner == 0.0:
        if before >= behind:
            return wp.vec4(y, wp.dot(w, b), 0.0, beyond)
        to = tape[span + 4]
        return wp.vec4(wp.dot(v, wp.cross(b, wp.vec3(to[0], to[1], to[2]))), wp.dot(v, b), 1.0, beyond)
    k = along[3]
    h = wp.length(wp.vec2(k * x, 1.0 - k * y))
    share = x / start[3]
    if k > 0.0:
        share = wp.atan2(k * x, 1.0 - k * y) / (k * start[3])
    toward = (2.0 * y - k * (x * x + y * y)) / (1.0 + h)
    return wp.vec4(toward, wp.dot(w, b), wp.clamp(share, 0.0, 1.0), beyond)


@wp.func
def share_behind(place: wp.vec4, tape: Texels, span: wp.int32) -> wp.float32:
    """Return the share of the course behind a place."""
    return tape[span + 2][3] + place[2] * (tape[span + 3][3] - tape[span + 2][3])


@wp.func
def in_section(place: wp.vec4, tape: Texels, at: wp.int32, span: wp.int32) -> wp.vec4:
    """Return the point (x, y) of the outline at a place, the scale and the angle of the section.

    tape[at + 1] = (growth of the scale, angle, length of the course, 1 for an open one).
    """
    f = share_behind(place, tape, span)
    scale = 1.0 + tape[at + 1][0] * f
    angle = tape[span + 4][3] + tape[at + 1][1] * f
    c = wp.cos(angle)
    s = wp.sin(angle)
    return wp.vec4((c * place[0] + s * place[1]) / scale, (c * place[1] - s * place[0]) / scale, scale, angle)


@wp.func
def first_of_outline(tape: Texels, at: wp.int32) -> wp.int32:
    """Return the first texel of the outline; tape[at] = (first span, their number, offset, mean)."""
    return int(tape[at][0]) + SPAN_TEXELS * int(tape[at][1])


@wp.func
def section_row(row: wp.vec3, point: wp.vec4, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (D, ∂D toward the centre, across, along the share of the course) for (d, ∇d) in the outline."""
    c = wp.cos(point[3])
    s = wp.sin(point[3])
    turning = point[2] * tape[at + 1][1] * (row[1] * point[1] - row[2] * point[0])
    growing = tape[at + 1][0] * (row[0] - row[1] * point[0] - row[2] * point[1])
    return wp.vec4(point[2] * row[0], c * row[1] - s * row[2], s * row[1] + c * row[2], growing + turning)


@wp.func
def end_distance(place: wp.vec4, tape: Texels, at: wp.int32, span: wp.int32) -> wp.float32:
    """Return the distance beyond an end of the span, else that from the course's nearer end, below 0."""
    if place[3] > 0.0:
        return place[3]
    if tape[at + 1][3] == 0.0:
        return -FAR
    f = share_behind(place, tape, span)
    return tape[at + 1][2] * wp.max(-f, f - 1.0)


@wp.func
def is_behind_corner(q: wp.vec3, place: wp.vec4, tape: Texels, span: wp.int32) -> wp.bool:
    """Return True for a point beyond an end of a line, at which the course has a corner."""
    if place[3] <= 0.0:
        return False
    return tape[span + 7][side_of(q, tape, span)] > 0.0


@wp.func
def side_of(q: wp.vec3, tape: Texels, span: wp.int32) -> wp.int32:
    """Return 0 for a point that is nearer to the start of a span, 1 for one that is nearer to its end."""
    start = tape[span]
    end = tape[span + 3]
    first = tape[span + 5]
    last = tape[span + 6]
    before = -wp.dot(q - wp.vec3(start[0], start[1], start[2]), wp.vec3(first[0], first[1], first[2]))
    behind = wp.dot(q - wp.vec3(end[0], end[1], end[2]), wp.vec3(last[0], last[1], last[2]))
    if before - first[3] >= behind - last[3]:
        return 0
    return 1


@wp.func
def span_distance(q: wp.vec3, tape: Texels, at: wp.int32, span: wp.int32) -> wp.float32:
    """Return the distance of q from the solid around a span."""
    place = span_place(q, tape, span)
    point = in_section(place, tape, at, span)
    d = point[2] * outline_row(wp.vec2(point[0], point[1]), tape, first_of_outline(tape, at))[0]
    if is_behind_corner(q, place, tape, span):
        return wp.max(d, 0.0) + 2.0 * place[3]
    return end_share(d, end_distance(place, tape, at, span))[0]


@wp.func
def least_distance(q: wp.vec3, tape: Texels, at: wp.int32, span: wp.int32) -> wp.float32:
    """Return a bound on the distance of q from the solid around a span.

    tape[at + 2] = (reach of the outline, of the largest section, cosine of half the sharpest turn, faces).
    """
    start = tape[span]
    end = tape[span + 3]
    a = wp.vec3(start[0], start[1], start[2])
    b = wp.vec3(end[0], end[1], end[2])
    away = wp.length(q - 0.5 * (a + b)) - 0.5 * wp.length(b - a)
    return tape[at + 2][2] * away - tape[at + 2][1]


@wp.func
def nearest_span(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec2:
    """Return the least distance, and the number of the first texel of its span."""
    best = wp.vec2(FAR, 0.0)
    for i in range(int(tape[at][1])):
        span = int(tape[at][0]) + SPAN_TEXELS * i
        if least_distance(q, tape, at, span) < best[0]:
            d = span_distance(q, tape, at, span)
            if d < best[0]:
                best = wp.vec2(d, float(i))
    return wp.vec2(best[0], float(int(tape[at][0]) + SPAN_TEXELS * int(best[1])))


@wp.func
def in_course(
    row: wp.vec4, q: wp.vec3, place: wp.vec4, tape: Texels, at: wp.int32, span: wp.int32
) -> wp.vec4:
    """Return (d, ∇d) for derivatives toward the centre, across and along the share of the course."""
    start = tape[span]
    along = tape[span + 1]
    inward = tape[span + 2]
    t = wp.vec3(along[0], along[1], along[2])
    n = wp.vec3(inward[0], inward[1], inward[2])
    b = wp.cross(t, n)
    corner = tape[span + 7][0] + tape[span + 7][1]
    rate = row[3] / tape[at + 1][2]
    if place[3] > 0.0 and corner == 0.0:
        rate = 0.0
        if side_of(q, tape, span) == 1:
            to = tape[span + 4]
            t = wp.vec3(to[0], to[1], to[2])
            n = wp.cross(b, t)
    elif along[3] > 0.0:
        k = along[3]
        w = q - wp.vec3(start[0], start[1], start[2])
        turned = wp.vec2(k * wp.dot(w, t), 1.0 - k * wp.dot(w, n))
        h = wp.max(wp.length(turned), LEAST_ROOM)
        u = t * (turned[1] / h) + n * (turned[0] / h)
        n = n * (turned[1] / h) - t * (turned[0] / h)
        t = u
        rate = rate / h
    g = n * row[1] + b * row[2] + t * rate
    return wp.vec4(row[0], g[0], g[1], g[2])


@wp.func
def sweep_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of a sweep."""
    span = int(nearest_span(q, tape, at)[1])
    place = span_place(q, tape, span)
    point = in_section(place, tape, at, span)
    flat = outline_row(wp.vec2(point[0], point[1]), tape, first_of_outline(tape, at))
    row = section_row(wp.vec3(flat[0], flat[1], flat[2]), point, tape, at)
    end = end_distance(place, tape, at, span)
    share = end_share(row[0], end)
    more = wp.vec3(0.0, 0.0, 0.0)
    if place[3] > 0.0:
        more = -wp.vec3(tape[span + 5][0], tape[span + 5][1], tape[span + 5][2])
        if side_of(q, tape, span) == 1:
            more = wp.vec3(tape[span + 6][0], tape[span + 6][1], tape[span + 6][2])
        if is_behind_corner(q, place, tape, span):
            share = wp.vec3(wp.max(row[0], 0.0) + 2.0 * end, wp.where(row[0] > 0.0, 1.0, 0.0), 2.0)
    flat_row = wp.vec4(share[0], share[1] * row[1], share[1] * row[2], share[1] * row[3])
    if place[3] <= 0.0:
        f = share_behind(place, tape, span)
        flat_row[3] = flat_row[3] + share[2] * tape[at + 1][2] * wp.where(f < 0.5, -1.0, 1.0)
    d = in_course(flat_row, q, place, tape, at, span)
    moved = wp.vec4(d[0], d[1] + share[2] * more[0], d[2] + share[2] * more[1], d[3] + share[2] * more[2])
    return relative_distance(moved, tape[at][2], tape[at][3])


@wp.func
def section_slope(place: wp.vec4, radius: wp.float32, tape: Texels, at: wp.int32, span: wp.int32) -> wp.vec3:
    """Return (slope, largest change, slope along the course) of the distance from the section in a ball."""
    course = tape[at + 1]
    speed = 1.0 / wp.max(1.0 - tape[span + 1][3] * (place[0] + radius), LEAST_ROOM)
    reach = tape[at + 2][0]
    way = speed * radius / course[2]
    f = share_behind(place, tape, span)
    ends = wp.vec2(wp.clamp(f - way, 0.0, 1.0), wp.clamp(f + way, 0.0, 1.0))
    scale = wp.max(1.0 + course[0] * ends[0], 1.0 + course[0] * ends[1])
    growth = wp.abs(course[0])
    turn = wp.abs(course[1])
    steep = reach * wp.length(wp.vec2(growth, turn * scale)) * speed / course[2]
    slope = wp.sqrt(1.0 + steep * steep)
    beside = wp.length(wp.vec2(place[0], place[1])) + radius
    moved = reach * growth * way + 2.0 * beside * wp.sin(0.5 * wp.min(turn * way, 3.1415927))
    return wp.vec3(slope, wp.min(slope * radius, radius + moved), speed)


@wp.func
def sweep_bounds(ball: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball.

    Of one span the distance from the section and that from the ends are bounded apart, so that a steep side
    does not loosen the bounds at flat ends.
    """
    best = nearest_span(ball, tape, at)
    count = int(tape[at][1])
    low = float(FAR)
    change = float(0.0)
    slope = float(1.0)
    high = float(FAR)
    for i in range(count):
        span = int(tape[at][0]) + SPAN_TEXELS * i
        farther = least_distance(ball, tape, at, span) - radius
        if farther < best[0] + wp.max(change, radius):
            place = span_place(ball, tape, span)
            point = in_section(place, tape, at, span)
            d = point[2] * outline_row(wp.vec2(point[0], point[1]), tape, first_of_outline(tape, at))[0]
            steep = section_slope(place, radius, tape, at, span)
            end = end_distance(place, tape, at, span)
            beyond = end - radius * wp.where(end > 0.0, 1.0, steep[2])
            bend = wp.where(tape[span + 7][0] + tape[span + 7][1] > 0.0, 3.0, 1.0)
            low = wp.min(low, wp.max(end_share(d - steep[1], beyond)[0], farther))
            change = wp.max(change, bend * wp.max(steep[1], radius))
            slope = wp.max(slope, bend * wp.max(steep[0], steep[2]))
            if count == 1:
                high = end_share(d + steep[1], end + radius)[0]
    high = wp.min(high, best[0] + change)
    rate = RIM / tape[at][3]
    margin = DISTANCE_MARGIN * (1.0 + rate * (wp.abs(best[0]) + radius) + rate * tape[at + 1][2])
    offset = tape[at][2]
    return wp.vec3(RIM + (low - offset) * rate - margin, RIM + (high - offset) * rate + margin, rate * slope)


@wp.func
def sweep_part_size(ball: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return half the least thickness of a sweep in a ball; tape[at + 3] = (half that of the outline, …).

    Half its length counts, and the outline's thickness where the side may be, over its slope.
    """
    size = 0.5 * tape[at + 1][2]
    if tape[at + 1][3] == 0.0:
        size = FAR
    for i in range(int(tape[at][1])):
        span = int(tape[at][0]) + SPAN_TEXELS * i
        if least_distance(ball, tape, at, span) <= radius + wp.max(tape[at][2], 0.0):
            place = span_place(ball, tape, span)
            point = in_section(place, tape, at, span)
            d = point[2] * outline_row(wp.vec2(point[0], point[1]), tape, first_of_outline(tape, at))[0]
            steep = section_slope(place, radius, tape, at, span)
            if wp.abs(d - tape[at][2]) <= steep[1]:
                wall = PLATE_MARGIN * (tape[at + 3][0] * point[2] + tape[at][2]) / steep[0]
                size = wp.min(size + wp.max(tape[at][2], 0.0), wall)
    return wp.max(size, 1.0e-12)


@wp.func
def sweep_sheet_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.int32:
    """Return 1 for the start, 2 for the end, and from 3 on the faces along the outline, leg by leg."""
    span = int(nearest_span(q, tape, at)[1])
    place = span_place(q, tape, span)
    point = in_section(place, tape, at, span)
    end = end_distance(place, tape, at, span)
    side = wp.where(share_behind(place, tape, span) < 0.5, -1.0, 1.0)
    beside = wp.vec4(point[0], point[1], end / point[2], side)
    tolerance = SHEET_TOLERANCE * tape[at][3] / point[2]
    sheet = profile_sheet_at(beside, tolerance, tape, first_of_outline(tape, at))
    if sheet < 3:
        return sheet
    return sheet + int(tape[span + 7][2]) * int(tape[at + 2][3])


@wp.func
def span_of_leg(q: wp.vec3, leg: wp.float32, tape: Texels, at: wp.int32) -> wp.int32:
    """Return the span of a leg that is nearest to a point."""
    best = float(FAR)
    nearest = int(tape[at][0])
    for i in range(int(tape[at][1])):
        span = int(tape[at][0]) + SPAN_TEXELS * i
        if tape[span + 7][2] == leg:
            place = span_place(q, tape, span)
            away = wp.length(wp.vec3(place[0], place[1], wp.max(place[3], 0.0)))
            if away < best:
                best = away
                nearest = span
    return nearest


@wp.func
def sweep_sheet_value_gradient(q: wp.vec3, sheet: wp.int32, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of the distance from the plane of an end, or from a face along a leg."""
    offset = tape[at][2]
    mean = tape[at][3]
    first = int(tape[at][0])
    if sheet == 1:
        start = tape[first]
        t = -wp.vec3(tape[first + 1][0], tape[first + 1][1], tape[first + 1][2])
        d = wp.dot(q - wp.vec3(start[0], start[1], start[2]), t)
        return relative_distance(wp.vec4(d, t[0], t[1], t[2]), offset, mean)
    if sheet == 2:
        last = first + SPAN_TEXELS * (int(tape[at][1]) - 1)
        end = tape[last + 3]
        t = wp.vec3(tape[last + 4][0], tape[last + 4][1], tape[last + 4][2])
        d = wp.dot(q - wp.vec3(end[0], end[1], end[2]), t)
        return relative_distance(wp.vec4(d, t[0], t[1], t[2]), offset, mean)
    faces = int(tape[at + 2][3])
    leg = (sheet - 3) // faces
    span = span_of_leg(q, float(leg), tape, at)
    place = span_place(q, tape, span)
    point = in_section(place, tape, at, span)
    face = face_row(wp.vec2(point[0], point[1]), sheet - 3 - leg * faces, tape, first_of_outline(tape, at))
    row = section_row(face, point, tape, at)
    return relative_distance(in_course(row, q, place, tape, at, span), offset, mean)


class _SweptSolid(SectionSolid):
    """An outline that moves along a course."""

    tag = "sharp_sweep"
    texels_read = 4
    value_gradient = formula(sweep_value_gradient)
    bounds = formula(sweep_bounds)
    sheet_at = formula(sweep_sheet_at)
    sheet_value_gradient = formula(sweep_sheet_value_gradient)
    part_size = formula(sweep_part_size)

    outline: Section
    points: tuple[Vector, ...] = par.points("points of the course in order")
    up: Vector = par.direction("direction to which the outline's y axis is nearest at the start")
    end_scale: float = par.factor("scale of the outline at the end", low=0.001, high=1000.0, default=1.0)
    end_turn: float = par.angle("angle by which the outline is turned at the end", default=0.0)
    corners: Corners = "sharp"
    ends: Ends = "open"

    @Lazy
    def course(self) -> tuple[list[Span], float]:
        """Return the spans, and the angle of the turn along all of them."""
        smooth, closed = self.corners == "smooth", self.ends == "closed"
        spans, missing = spans_of(self.points, self.up, smooth=smooth, closed=closed)
        return spans, math.radians(self.end_turn) + missing

    @property
    def length(self) -> float:
        """The length of the course."""
        return sum(span.length for span in self.course[0])

    @property
    def data(self) -> Float64Array:
        """The spans and the outline."""
        texels, faces = _span_texels(self), outline_texels(self.outline)
        return np.concatenate([texels, faces])

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return bounds on half the least thickness: of sides over their largest slope, or the length."""
        return np.array([_least_thickness(leaf) for leaf in leaves])

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of boxes around the solids."""
        return np.array([_box(leaf) for leaf in leaves])

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the numbers that the formulas read; the index of the spans is filled in later."""
        rows = []
        for leaf in leaves:
            spans, turn = leaf.course
            reach = reach_of(leaf.outline)
            turns = [span.start_plane @ span.tangent for span in spans]
            faces = len({(at, face) for at, loop in enumerate(leaf.outline.loops)
                         for face in range(max(int(loop.corners.sum()), 1))})  # fmt: skip
            rows.append([
                [0.0, len(spans), leaf.offset, leaf.mean],
                [leaf.end_scale - 1.0, turn, leaf.length, leaf.ends == "open"],
                [reach, reach * max(1.0, leaf.end_scale), min(turns), faces],
                [wall_of(leaf.outline), 0.0, 0.0, 0.0],
            ])  # fmt: skip
        return np.array(rows, np.float64)


def reach_of(outline: Outline) -> float:
    """Return the largest distance of an outline from its origin."""
    return float(np.linalg.norm(outline.points, axis=1).max())


def wall_of(outline: Outline) -> float:
    """Return half the thickness of an outline, or of parts that are much thinner."""
    mean, thin = mean_radius(outline), thin_width(outline)
    return thin if thin < MUCH_THINNER * mean else mean


def _least_thickness(leaf: Any) -> float:
    """Return a bound on the least half thickness of a sweep."""
    spans, turn = leaf.course
    reach, scales = reach_of(leaf.outline), (1.0, leaf.end_scale)
    bend = max(span.curvature for span in spans) * reach * max(scales)
    steep = reach * math.hypot(leaf.end_scale - 1.0, turn * max(scales)) / leaf.length
    wall = wall_of(leaf.outline) * min(scales) / math.hypot(1.0, steep / max(1.0 - bend, 1.0 - MOST_BENT))
    return min(wall, 0.5 * leaf.length if leaf.ends == "open" else math.inf) + leaf.offset


def _span_texels(leaf: _SweptSolid) -> Float64Array:
    """Return the texels (n, 4) of the spans, see `span_place`."""
    spans, _ = leaf.course
    size = JOINT_SLACK * float(np.ptp([_box(leaf)], axis=1).max())
    rows, done, leg = [], 0.0, 0
    for number, span in enumerate(spans):
        first, last = number == 0 and leaf.ends == "open", number + 1 == len(spans) and leaf.ends == "open"
        sharp = span.corners
        leg += sharp[0] and number > 0
        share = done / leaf.length
        done += span.length
        rows += [
            [*span.start, span.length],
            [*span.tangent, span.curvature],
            [*span.inward, share],
            [*span.end, done / leaf.length],
            [*span.end_tangent, span.frame],
            [*span.start_plane, 0.0 if first else size],
            [*span.end_plane, 0.0 if last else size],
            [*sharp, leg, 0.0],
        ]
    return np.array(rows, np.float64)


def _box(leaf: Any) -> Float64Array:
    """Return the lower and the upper corner (2, 3) of a box around a sweep."""
    spans, turn = leaf.course
    reach, corners, done = reach_of(leaf.outline), list[Float64Array](), 0.0
    points = leaf.outline.points
    growth = (leaf.end_scale - 1.0) / leaf.length
    for span in spans:
        places = list[Float64Array]()
        beside = np.cross(span.tangent, span.inward)
        r = 1.0 / span.curvature if span.curvature else 0.0
        steps = max(math.ceil(span.curvature * span.length / ARC_STEP), 1)
        for t in np.arange(steps + 1) / steps:
            scale = 1.0 + growth * (done + t * span.length)
            angle = span.curvature * span.length * t
            c, s = math.cos(angle), math.sin(angle)
            lead = r * s if span.curvature else t * span.length
            center = span.start + lead * span.tangent + r * (1.0 - c) * span.inward
            inward, along = c * span.inward - s * span.tangent, c * span.tangent + s * span.inward
            across = scale * reach * np.hypot(inward, beside)
            if turn == 0.0:
                u = math.cos(span.frame) * inward + math.sin(span.frame) * beside
                v = np.cross(along, u)
                places.append(center + scale * (points[:, :1] * u + points[:, 1:] * v))
            else:
                places.append(np.array([center - across, center + across]))
            if any(span.corners) and t in (0.0, 1.0):
                plane = span.end_plane if t else span.start_plane
                lean = np.linalg.norm(plane - (plane @ along) * along) / (plane @ along)
                places.append(center + np.outer([-1.0, 1.0], across + lean * reach * np.abs(along)))
        done += span.length
        bulge = 0.0
        if span.curvature:
            bent = r + reach * (max(1.0, leaf.end_scale) + 2.0 * abs(growth) * r)
            bulge = 0.125 * ARC_STEP**2 * bent
        everything = np.concatenate(places)
        corners += [everything.min(axis=0) - bulge, everything.max(axis=0) + bulge]
    return np.array([np.min(corners, axis=0), np.max(corners, axis=0)])


def _check_room(leaf: _SweptSolid) -> None:
    """Raise `InvalidNode` where sections of neighbouring places of the course would cross."""
    spans, turn = leaf.course
    points = leaf.outline.points * max(1.0, leaf.end_scale)
    for span in spans:
        c, s = math.cos(span.frame), math.sin(span.frame)
        toward = c * points[:, 0] - s * points[:, 1]
        inner = reach_of(leaf.outline) * max(1.0, leaf.end_scale) if turn else float(toward.max())
        if span.curvature * inner > MOST_BENT:
            x, y, z = span.start
            raise InvalidNode(
                f"points: the curve bends too tightly near ({x:g}, {y:g}, {z:g}): its radius is "
                f"{1.0 / span.curvature:g}, and the outline reaches to {inner:g}; use a smaller outline"
            )
        if any(span.corners):
            across = np.cross(span.tangent, span.inward)
            beside = toward[:, None] * span.inward + (s * points[:, :1] + c * points[:, 1:]) * across
            room = span.length + sum(
                (beside @ plane) / (plane @ span.tangent) * way
                for plane, way in ((span.start_plane, 1.0), (span.end_plane, -1.0))
            )
            if np.min(room) <= 0.0:
                x, y, z = span.start
                raise InvalidNode(
                    f"points: the line from ({x:g}, {y:g}, {z:g}) is too short for its corners; use a "
                    "smaller outline, or fewer points"
                )


def upright_sweep(outline: Outline, origin: Vector, height: float, **keywords: Any) -> Node:
    """Return the direct field of an outline that moves upward from the xy plane."""
    x, y, z = origin
    return _SweptSolid(outline, (origin, (x, y, z + height)), (0.0, 1.0, 0.0), **keywords)


class Sweep(Pieces):
    """An outline that moves along a curve: mouldings, rails, pipes of any section, frames, springs.

    The outline lies across the curve, which goes through its origin, and turns about the curve as little as
    it can. At the start its y axis is as near to `up` as it can be. Sharp corners are mitred. A smooth
    curve is made of arcs of circles that meet without corners: three points lead to the arc through them,
    and points of a circle to that circle. A closed curve may turn the outline a little all along, so that
    its ends meet.

    With `radius` 0 all edges are sharp. With a larger one, the solid also holds what is within `radius` of
    the sharp one; mitred corners stay sharp. A width grows with the radius, or with the mean radius of a
    sharp solid: the smaller one of half the curve's length and twice the area of the outline over its length.

    A scale and a turn of the end grow along the curve. The surface is exact then, and the field is steeper
    than that of a distance.

    Raises
    ------
    InvalidNode
        The curve bends more tightly than the outline allows, or turns back; lines with corners have a scale
        or a turn; or the ends of a closed curve do not meet.

    Examples
    --------
    >>> from blobtree import Sweep
    >>> rail = Sweep("M-.1-.2H.1V.2H-.1Z", [(0, 0, 0), (2, 0, 0), (2, 2, 0)])
    >>> rail([[1, 0, 0.2], [2.1, 1, 0], [2.05, -0.05, 0]]).astype(float).round(3).tolist()
    [0.5, 0.5, 0.777]
    """

    file_tag = "sweep"

    outline: Section
    points: tuple[Vector, ...] = par.points("points of the curve in order")
    _: KW_ONLY
    corners: Corners = "sharp"
    ends: Ends = "open"
    up: Vector = par.direction(
        "direction to which the outline's y axis is nearest at the start", default=(0.0, 0.0, 1.0)
    )
    end_scale: float = par.factor("scale of the outline at the end", low=0.001, high=1000.0, default=1.0)
    end_turn: float = par.angle("angle by which the outline is turned at the end", default=0.0)
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        solid = self.expanded
        spans, turn = solid.course
        changes = self.end_scale != 1.0 or abs(turn) > 1e-6
        if changes and any(any(span.corners) for span in spans):
            raise InvalidNode(
                "corners: expected 'smooth' for a curve along which the outline grows or turns, got 'sharp'; "
                "sharp closed curves must bring the outline back unturned"
            )
        if self.ends == "closed":
            if self.end_scale != 1.0:
                raise InvalidNode(f"end_scale: expected 1 for a closed curve, got {self.end_scale:g}")
            if not _is_turned_to_itself(self.outline, math.radians(self.end_turn)):
                raise InvalidNode(
                    "end_turn: expected a turn of the outline to itself for a closed curve, got "
                    f"{self.end_turn:g}"
                )
        _check_room(solid)

    @property
    def fixed_numbers(self) -> frozenset[str]:
        """The scale of the end, where the curve is closed or has corners."""
        spans, _ = self.expanded.course
        grows = self.ends == "open" and not any(any(span.corners) for span in spans)
        return frozenset() if grows else frozenset(("end_scale",))

    @Lazy
    def expanded(self) -> Any:
        """Return the direct field of the solid."""
        solid = _SweptSolid(
            self.outline,
            self.points,
            self.up,
            self.end_scale,
            self.end_turn,
            self.corners,
            self.ends,
            offset=self.radius,
            mean=1.0,
            **self.shared,
        )
        mean = self.radius or min(0.5 * solid.length, mean_radius(self.outline) * min(1.0, self.end_scale))
        return replace(solid, mean=mean)


def _is_turned_to_itself(outline: Outline, angle: float) -> bool:
    """Return True if a turn maps the corners of an outline to its corners."""
    points = outline.points
    turned = (points[:, 0] + 1j * points[:, 1]) * np.exp(1j * angle)
    nearest = [np.abs(points[:, 0] + 1j * points[:, 1] - place).min() for place in turned]
    return max(nearest) <= 1e-4 * reach_of(outline)
