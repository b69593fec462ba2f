"""Signed distances of solids with sharp edges, in float64 NumPy, below 0 inside."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import Box, Cone, Cylinder, Extrude, Frustum, Outline, Prism, Revolve, Sweep
from blobtree.nodes.courses import Span, spans_of

Floats = NDArray[np.float64]

KINDS = (Box, Cone, Cylinder, Frustum)

ALWAYS = (Prism, Frustum, Extrude, Revolve, Sweep)
"""Kinds whose field is that of a signed distance with every radius."""


STENCIL = 5e-3
"""Step of differences that show where a distance has a kink, over the mean radius."""


def is_sharp(node: Any) -> bool:
    """True for a solid whose field is that of its signed distance."""
    if isinstance(node, ALWAYS):
        return True
    return isinstance(node, KINDS) and min(node.radius, getattr(node, "end_radius", node.radius)) == 0.0


def is_swept(node: Any) -> bool:
    """True for a sweep, or an extrusion whose section grows or turns."""
    return isinstance(node, Sweep) or (
        isinstance(node, Extrude) and (node.top_scale != 1.0 or node.top_turn != 0.0)
    )


def grown(node: Any, distance: float) -> Any:
    """A solid whose surface lies farther out by a distance, and whose field is the same function."""
    larger = replace(node)
    object.__setattr__(larger, "growth", getattr(node, "growth", 0.0) + distance)
    return larger


def ratio(node: Any, q: Floats) -> tuple[Floats, Floats]:
    """One more than the distance (n,) from the surface over the mean radius; and 0 beside kinks, else ∞."""
    mean = mean_radius(node)
    offset = getattr(node, "growth", 0.0) + (0.0 if isinstance(node, Cone) else node.radius)
    shifts = STENCIL * mean * np.concatenate([np.eye(3), -np.eye(3)])
    around = distance(node, (q + shifts[:, None]).reshape(-1, 3)).reshape(2, 3, -1)
    here = distance(node, q)
    if is_swept(node):
        # sines differ between languages, which turns gradients close to corners of an outline
        kink = 5.0 * np.abs(around.sum(axis=0) - 2.0 * here).max(axis=0) / (2.0 * STENCIL * mean)
    else:
        kink = np.abs(np.linalg.norm((around[0] - around[1]) / (2.0 * STENCIL * mean), axis=0) - 1.0)
    return 1.0 + (here - offset) / mean, np.where(kink < 0.01, np.inf, 0.0)


def mean_radius(node: Any) -> float:
    """The length to which the width of a node is relative."""
    match node:
        case Cone():
            return float(max(node.radius, node.end_radius))
        case Prism() | Frustum() | Extrude() | Revolve() | Sweep() if node.radius > 0.0:
            return float(node.radius)
        case Extrude():
            return min(0.5 * node.height, mean_of(node.outline))
        case Revolve():
            return mean_of(node.outline)
        case Sweep():
            length = sum(span.length for span in course_of(node)[0])
            return min(0.5 * length, mean_of(node.outline) * min(1.0, node.end_scale))
        case Box():
            return 0.5 * min(node.size)
        case Prism():
            return min(0.5 * node.height, mean_of(Outline.polygon(in_plane(node)[0])))
    corners = profile(node)
    x = np.linspace(0.0, corners[2, 1], 200_001)
    axis = np.column_stack([np.zeros_like(x), x])
    return float(-outline(axis, corners, off_axis).min())


def mean_of(shape: Outline) -> float:
    """Twice the area of an outline over its length."""
    area, length = 0.0, 0.0
    for corners in loops_of(shape):
        x, y = corners.T
        area += 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
        length += float(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1).sum())
    return 2.0 * area / length


def loops_of(shape: Outline) -> list[Floats]:
    """The corners of the polygons of an outline."""
    return [loop.points for loop in shape.loops]


def flat_distance(p: Floats, shape: Outline, counted: Any = None) -> Floats:
    """The signed distance (n,) of points (n, 2) from an outline, or from those of its sides that count."""
    each = [outline(p, corners, counted) for corners in loops_of(shape)]
    inside = np.logical_xor.reduce([distances < 0.0 for distances in each])
    nearest = np.min(np.abs(each), axis=0)
    return np.asarray(np.where(inside, -nearest, nearest))


def revolution(node: Revolve, q: Floats) -> Floats:
    """The signed distance of an outline that turns: the least of those from its side and from both ends."""
    w = q - np.array(node.origin)
    r, z, angle = np.hypot(w[:, 0], w[:, 1]), w[:, 2], np.radians(node.angle)
    azimuth = np.mod(np.arctan2(w[:, 1], w[:, 0]), 2.0 * np.pi)

    def in_plane_at(turn: Floats) -> tuple[Floats, Floats]:
        return np.column_stack([r * np.cos(turn), z]), r * np.abs(np.sin(turn))

    past_end, before_start = azimuth - angle, 2.0 * np.pi - azimuth
    gap = np.where(azimuth <= angle, 0.0, np.minimum(np.abs(past_end), before_start))
    p, away = in_plane_at(gap)
    nearest = np.hypot(flat_distance(p, node.outline, off_axis), away)
    inside = (flat_distance(np.column_stack([r, z]), node.outline) < 0.0) & (azimuth <= angle)
    for turn in () if node.angle == 360.0 else (azimuth, past_end):
        p, away = in_plane_at(turn)
        nearest = np.minimum(nearest, np.hypot(np.maximum(flat_distance(p, node.outline), 0.0), away))
    return np.where(inside, -nearest, nearest)


def course_of(node: Any) -> tuple[list[Span], float, float, bool]:
    """Spans of a sweep or of a tapered or twisted extrusion, its whole turn, its last scale; True if open."""
    if hasattr(node, "top_scale"):
        base = np.array(node.origin)
        points = [base, base + np.array([0.0, 0.0, node.height])]
        spans, missing = spans_of(points, (0.0, 1.0, 0.0), smooth=False, closed=False)
        return spans, np.radians(node.top_turn) + missing, node.top_scale, True
    closed = node.ends == "closed"
    spans, missing = spans_of(node.points, node.up, smooth=node.corners == "smooth", closed=closed)
    return spans, np.radians(node.end_turn) + missing, node.end_scale, not closed


def sweep(node: Any, q: Floats) -> Floats:
    """The signed distance (n,) of points from the surface of a sweep, as if its radius were 0."""
    spans, turn, last_scale, is_open = course_of(node)
    whole, behind, nearest = sum(span.length for span in spans), 0.0, np.full(len(q), np.inf)
    for number, span in enumerate(spans):
        shares = np.array([behind, behind + span.length]) / whole
        behind += span.length
        ends = is_open & (number == 0), is_open & (number == len(spans) - 1)
        here = of_span(span, q, node.outline, shares, turn, last_scale, whole, is_open, ends)
        nearest = np.minimum(nearest, here)
    return nearest


def of_span(
    span: Span,
    q: Floats,
    outline: Outline,
    shares: Floats,
    turn: float,
    last_scale: float,
    whole: float,
    is_open: bool,
    ends: tuple[bool, bool],
) -> Floats:
    beside = np.cross(span.tangent, span.inward)
    before, after = -(q - span.start) @ span.start_plane, (q - span.end) @ span.end_plane
    sharp_ends = np.where(before >= after, span.corners[0], span.corners[1])
    beyond = np.maximum(before, after)
    x, y, across = ((q - span.start) @ way for way in (span.tangent, span.inward, beside))
    if span.curvature:
        radius = 1.0 / span.curvature
        toward = radius - np.hypot(x, radius - y)
        along = np.arctan2(x, radius - y) * radius
    else:
        toward, along = y, x
    if not any(span.corners):
        outside = beyond > 0.0
        inward_there = np.cross(beside, span.end_tangent)
        clamped = np.where(before >= after, y, (q - span.end) @ inward_there)
        toward = np.where(outside, clamped, toward)
        along = np.where(outside, np.where(before >= after, 0.0, span.length), along)
    share = shares[0] + np.clip(along / span.length, 0.0, 1.0) * (shares[1] - shares[0])
    scale, angle = 1.0 + (last_scale - 1.0) * share, span.frame + turn * share
    place = (toward + 1j * across) * np.exp(-1j * angle) / scale
    flat = scale * flat_distance(np.column_stack([place.real, place.imag]), outline)
    end = whole * np.maximum(-share, share - 1.0) if is_open else np.full(len(q), -np.inf)
    inside = np.maximum(flat, end)
    outside = np.where(
        sharp_ends, np.maximum(flat, 0.0) + 2.0 * beyond, np.hypot(np.maximum(flat, 0.0), beyond)
    )
    return np.asarray(np.where(beyond > 0.0, outside, inside))


def off_axis(a: Floats, b: Floats) -> bool:
    """True for an edge that does not lie on the axis of a turn."""
    return bool(max(a[0], b[0]) > 1e-12)


def distance(node: Any, q: Floats) -> Floats:
    """The signed distance (n,) of points from the surface of a solid, as if its radius were 0."""
    if is_swept(node):
        return sweep(node, q)
    match node:
        case Box():
            beyond = np.abs(q - np.array(node.center)) - 0.5 * np.array(node.size)
            return extended(beyond.T)
        case Cone():
            return drop(node, q)
        case Prism():
            corners, height = in_plane(node, q)[1:]
            flat = outline(corners, in_plane(node)[0])
            return extended(np.stack([flat, np.abs(height - 0.5 * node.height) - 0.5 * node.height]))
        case Extrude():
            w = q - np.array(node.origin)
            ends = np.abs(w[:, 2] - 0.5 * node.height) - 0.5 * node.height
            return extended(np.stack([flat_distance(w[:, :2], node.outline), ends]))
        case Revolve():
            return revolution(node, q)
    axis = np.subtract(node.end, node.start)
    unit = axis / np.linalg.norm(axis)
    along = (q - np.array(node.start)) @ unit
    across = np.linalg.norm(q - np.array(node.start) - along[:, None] * unit, axis=1)
    return outline(np.column_stack([across, along]), profile(node), off_axis)


def extended(beyond: Floats) -> Floats:
    """The distance of a product of sets, from the distances (k, n) of each."""
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=0)
    return np.asarray(outside + np.minimum(beyond.max(axis=0), 0.0))


def drop(cone: Cone, q: Floats) -> Floats:
    """The distance of the hull of a ball and a point: the least over the balls of which it is the union."""
    ends, radii = np.array([cone.start, cone.end]), np.array([cone.radius, cone.end_radius])

    def distance(t: Floats) -> Floats:
        centers = ends[0] + t[:, None] * (ends[1] - ends[0])
        return np.asarray(np.linalg.norm(q - centers, axis=1) - (radii[0] + t * (radii[1] - radii[0])))

    return least(distance, len(q), rounds=80)


def least(function: Callable[[Floats], Floats], count: int, *, rounds: int) -> Floats:
    """The least value between 0 and 1 of functions that fall, then rise; by ternary search."""
    low, high = np.zeros(count), np.ones(count)
    for _ in range(rounds):
        third = (high - low) / 3.0
        falls = function(low + third) >= function(high - third)
        low, high = np.where(falls, low + third, low), np.where(falls, high, high - third)
    ends = np.minimum(function(np.zeros(count)), function(np.ones(count)))
    return np.minimum(function(0.5 * (low + high)), ends)


def profile(node: Any) -> Floats:
    """The corners (4, 2), (across, along), of half a section through the axis of a cylinder or cone."""
    first, last = (
        (node.cylinder_radius, node.cylinder_radius)
        if isinstance(node, Cylinder)
        else (node.start_radius, node.end_radius)
    )
    length = float(np.linalg.norm(np.subtract(node.end, node.start)))
    return np.array([(0.0, 0.0), (first, 0.0), (last, length), (0.0, length)])


def outline(p: Floats, corners: Floats, counted: Any = None) -> Floats:
    """The signed distance (n,) of points (n, 2) from a polygon, or from those of its sides that count."""
    count, inside = len(corners), np.zeros(len(p), bool)
    nearest = np.full(len(p), np.inf)
    for i in range(count):
        a, b = corners[i], corners[(i + 1) % count]
        way, w = b - a, p - a
        if way.any() and (counted is None or counted(a, b)):
            t = np.clip(w @ way / (way @ way), 0.0, 1.0)
            nearest = np.minimum(nearest, np.linalg.norm(w - t[:, None] * way, axis=1))
        crosses = (a[1] > p[:, 1]) != (b[1] > p[:, 1])
        height = np.where(crosses, b[1] - a[1], 1.0)
        inside ^= crosses & (p[:, 0] < a[0] + (p[:, 1] - a[1]) * way[0] / height)
    return np.where(inside, -nearest, nearest)


def in_plane(prism: Prism, q: Floats | None = None) -> tuple[Floats, Floats, Floats]:
    """The corners of the base in its plane (k, 2); points there (n, 2), and their heights (n,) above it."""
    points = np.array(prism.points)
    normal = sum(np.cross(points[i - 1] - points[0], points[i] - points[0]) for i in range(2, len(points)))
    normal = np.asarray(normal) / np.linalg.norm(normal)
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    frame = np.array([u, np.cross(normal, u)])
    w = np.zeros((0, 3)) if q is None else q - points[0]
    return (points - points[0]) @ frame.T, w @ frame.T, w @ normal
