"""Courses: curves through points as lines and arcs of circles, with a frame that turns as little as possible.

A smooth course has two arcs between neighbours, which meet without a corner (biarcs, Bolton 1975). Its
tangents are those of the circles through three neighbours, so points of a circle lead to that circle. A frame
that goes rigidly along each arc turns least about the tangent (Wang et al. 2008).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.errors import InvalidNode

MOST_POINTS = 500
"""Most points of a course."""

STRAIGHT = 1e-7
"""Angle up to which two lines are one, and an arc is a line."""

SHARPEST = math.radians(150.0)
"""Largest turn at a corner."""

FIRST_FRAME = -0.75 * math.pi
"""Least angle of a frame, far from quarter turns: frames of plane courses have these, up to rounding."""

LARGEST_ARC = 0.5 * math.pi
"""Largest angle of one arc."""

SHARPEST_ARC = math.pi - 1e-3
"""Largest turn from line to line through the points of a smooth course: beyond it the course turns back."""


class Span(NamedTuple):
    """A line or an arc of a course, and the planes at its ends."""

    start: Float64Array
    tangent: Float64Array
    inward: Float64Array
    """Unit vector across the tangent, toward the centre of the arc."""
    curvature: float
    length: float
    end: Float64Array
    end_tangent: Float64Array
    frame: float
    """Angle of the outline's x axis from `inward`, from FIRST_FRAME on."""
    start_plane: Float64Array
    end_plane: Float64Array
    """Unit normals, along the course; across the tangents but at corners."""

    @property
    def corners(self) -> tuple[bool, bool]:
        """True at the start or at the end if the course turns sharply there."""
        cosines = self.start_plane @ self.tangent, self.end_plane @ self.end_tangent
        return bool(cosines[0] < 1.0 - 1e-12), bool(cosines[1] < 1.0 - 1e-12)


def spans_of(
    points: ArrayLike, up: Sequence[float], *, smooth: bool, closed: bool
) -> tuple[list[Span], float]:
    """Return lines and arcs through points, and the angle by which a closed course must turn the frame.

    The y axis of the frame at the start is as near to `up` as it can be.

    Raises
    ------
    InvalidNode
        There are too few points, neighbours are equal, or the course turns back.
    """
    through = np.array(points, np.float64)
    least = 3 if closed else 2
    if not least <= len(through) <= MOST_POINTS:
        raise InvalidNode(f"points: expected {least} to {MOST_POINTS}, got {len(through)}")
    if closed:
        through = np.vstack([through, through[:1]])
    ways = np.diff(through, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    if lengths.min() <= STRAIGHT * lengths.max():
        raise InvalidNode("points: two neighbours are equal; remove one")
    curves = _arcs(through, ways, closed) if smooth and len(through) > 2 else _lines(through, ways, closed)
    return _framed(curves, np.array(up, np.float64), closed)


Curve = tuple[Float64Array, Float64Array, Float64Array, float, float]
"""Start, unit tangent, unit vector toward the centre, curvature and length."""


def _lines(points: Float64Array, ways: Float64Array, closed: bool) -> list[Curve]:
    """Return lines from point to point, one for neighbours that are straight."""
    units = ways / np.linalg.norm(ways, axis=1)[:, None]
    turns = [_angle(a, b) for a, b in zip(units, np.roll(units, -1, axis=0), strict=True)]
    if max(turns if closed else turns[:-1], default=0.0) > SHARPEST:
        raise InvalidNode("points: expected turns up to 150 degrees, got a sharper one; use more points")
    kept = [0, *(at + 1 for at, turn in enumerate(turns[:-1]) if turn > STRAIGHT), len(ways)]
    corners = points[kept]
    if closed and turns[-1] <= STRAIGHT:
        corners = np.vstack([corners[1:-1], corners[1:2]])
    legs = np.diff(corners, axis=0)
    return [
        (start, leg / np.linalg.norm(leg), _across(leg), 0.0, float(np.linalg.norm(leg)))
        for start, leg in zip(corners, legs, strict=False)
    ]


def _angle(a: Float64Array, b: Float64Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _across(way: Float64Array) -> Float64Array:
    """Return a unit vector across a way."""
    across = np.cross(way, np.eye(3)[np.abs(way).argmin()])
    unit: Float64Array = across / np.linalg.norm(across)
    return unit


def _arcs(points: Float64Array, ways: Float64Array, closed: bool) -> list[Curve]:
    """Return two arcs from each point to the next."""
    before, after = (np.roll(ways, 1, axis=0), ways) if closed else (ways[:-1], ways[1:])
    tangents = before / (before**2).sum(axis=1)[:, None] + after / (after**2).sum(axis=1)[:, None]
    norms = np.linalg.norm(tangents, axis=1)
    sharpest = max(_angle(a, b) for a, b in zip(before, after, strict=True))
    if sharpest > SHARPEST_ARC or norms.min() * np.linalg.norm(ways, axis=1).max() <= STRAIGHT:
        raise InvalidNode("points: the curve turns back at one; use more points")
    tangents = tangents / norms[:, None]
    if closed:
        tangents = np.vstack([tangents, tangents[:1]])
    else:
        ends = [(ways[0], tangents[0]), (ways[-1], tangents[-1])]
        first, last = (2.0 * (way @ t) / (way @ way) * way - t for way, t in ends)
        tangents = np.vstack([first, tangents, last])
    curves: list[Curve] = []
    for start, end, t0, t1 in zip(points, points[1:], tangents, tangents[1:], strict=False):
        way, both, spread = end - start, t0 + t1, 2.0 * (1.0 - t0 @ t1)
        along = way @ both
        root = math.sqrt(along**2 + spread * (way @ way))
        reach = (way @ way) / max(along + root, 1e-9 * root)
        middle = 0.5 * (start + end + reach * (t0 - t1))
        curves += _arc(start, t0, middle)
        curves += _arc(middle, (end - start - reach * both) / (2.0 * reach), end)
    return curves


def _arc(start: Float64Array, tangent: Float64Array, end: Float64Array) -> list[Curve]:
    """Return the arc with a tangent at its start, in equal pieces of at most LARGEST_ARC."""
    way, unit = end - start, tangent / np.linalg.norm(tangent)
    inward = way - (way @ unit) * unit
    beside = float(np.linalg.norm(inward))
    angle = 2.0 * math.atan2(beside, way @ unit)
    if angle <= STRAIGHT:
        return [(start, unit, _across(unit), 0.0, float(np.linalg.norm(way)))]
    inward /= beside
    curvature = 2.0 * beside / float(way @ way)
    count = math.ceil(angle / LARGEST_ARC - 1e-9)
    step = angle / count
    curves = []
    for number in range(count):
        c, s = math.cos(number * step), math.sin(number * step)
        place = start + (s * unit + (1.0 - c) * inward) / curvature
        curves.append((place, c * unit + s * inward, c * inward - s * unit, curvature, step / curvature))
    return curves


def _framed(curves: list[Curve], up: Float64Array, closed: bool) -> tuple[list[Span], float]:
    """Return spans with frames and planes, and the angle from the last frame back to the first."""
    first = curves[0][1]
    v = up - (up @ first) * first
    if np.linalg.norm(v) <= 1e-6 * np.linalg.norm(up):
        v = np.array([0.0, 1.0, 0.0]) - first[1] * first
        v = v if np.linalg.norm(v) > 1e-6 else np.array([0.0, 0.0, 1.0])
    u = np.cross(v / np.linalg.norm(v), first)
    begun, spans = u, list[Span]()
    last = curves[-1]
    before = _turned(last[1], last[1], last[2], last[3] * last[4]) if closed else first
    for number, (start, tangent, inward, curvature, length) in enumerate(curves):
        u = _least_turn(u, before, tangent) if number else u
        beside = np.cross(tangent, inward)
        turn = curvature * length
        end_tangent = _turned(tangent, tangent, inward, turn)
        lead = math.sin(turn) / curvature if curvature else length
        end = start + lead * tangent + (2.0 * math.sin(0.5 * turn) ** 2 / max(curvature, 1e-300)) * inward
        follows = curves[(number + 1) % len(curves)][1]
        after = follows if closed or number + 1 < len(curves) else end_tangent
        planes = [(a + b) / np.linalg.norm(a + b) for a, b in ((before, tangent), (end_tangent, after))]
        frame = math.atan2(u @ beside, u @ inward)
        frame += 2.0 * math.pi * (frame < FIRST_FRAME)
        spans.append(Span(start, tangent, inward, curvature, length, end, end_tangent, frame, *planes))
        u = _turned(u, tangent, inward, turn)
        before = end_tangent
    if not closed:
        return spans, 0.0
    u = _least_turn(u, before, first)
    return spans, math.atan2(np.cross(u, begun) @ first, u @ begun)


def _turned(way: Float64Array, tangent: Float64Array, inward: Float64Array, angle: float) -> Float64Array:
    """Return a vector turned in the plane of an arc, from the tangent toward the centre."""
    along, across = way @ tangent, way @ inward
    c, s = math.cos(angle) - 1.0, math.sin(angle)
    turned: Float64Array = way + (c * along - s * across) * tangent + (s * along + c * across) * inward
    return turned


def _least_turn(way: Float64Array, before: Float64Array, after: Float64Array) -> Float64Array:
    """Return a vector, turned as one tangent is to the next."""
    middle = before + after
    for normal in (before, middle / np.linalg.norm(middle)):
        way = way - 2.0 * (way @ normal) * normal
    return way
