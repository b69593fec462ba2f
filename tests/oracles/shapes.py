"""Distances from the skeletons of curves, flats and solids in float64 NumPy, by dense search or by geometry.

Each function returns |q − closest| over the visible radius there (n,), and the same (n,) for the next local
minimum at another place of the skeleton, infinite without another one.
"""

from collections.abc import Callable
from dataclasses import fields
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline

from blobtree import (
    Arc,
    CubicBezier,
    Cylinder,
    HalfSpace,
    Polygon,
    Polyline,
    QuadraticBezier,
    Rectangle,
    Stroke,
    TaperedBezier,
    Triangle,
)
from tests.vectors import unit

Floats = NDArray[np.float64]
Curve = Callable[[Floats], Floats]
"""A function from parameters (m,) in [0, 1] to points and radii (m, 4)."""

SAMPLES = 300
NEAR_ENDS = np.geomspace(1e-7, 0.5 / SAMPLES, 24)
"""Further places along curves, whose ends may be thin."""


KINDS = (
    Arc,
    CubicBezier,
    Cylinder,
    HalfSpace,
    Polygon,
    Polyline,
    QuadraticBezier,
    Rectangle,
    Stroke,
    TaperedBezier,
    Triangle,
)
"""Kinds of nodes of which `distances` are known."""

CURVES = (Arc, QuadraticBezier, CubicBezier, TaperedBezier, Stroke)

FOCUS = 1e-2
"""Distance from a centre of curvature, over the radius of curvature, below which a point is near it.

The closest point moves a hundred times as far as such a point, and float32 gives it only within 1e-4.
"""


class GrownStroke(Stroke):
    """A stroke under an offset: its curve has larger radii everywhere, and keeps its shape."""

    growth = 0.0

    @classmethod
    def of(cls, stroke: Stroke, distance: float) -> "GrownStroke":
        names = [field.name for field in fields(Stroke)]
        grown = cls(**{name: getattr(stroke, name) for name in names})
        object.__setattr__(grown, "growth", growth_of(stroke) + distance)
        return grown


def growth_of(stroke: Stroke) -> float:
    return stroke.growth if isinstance(stroke, GrownStroke) else 0.0


def distances(node: object, q: Floats) -> tuple[Floats, Floats]:
    """Return both for a node of any of these kinds at points (n, 3)."""
    match node:
        case Arc() | QuadraticBezier() | CubicBezier() | TaperedBezier() | Stroke():
            return along_curve(q, curve_of(node))
        case Polyline(points=points, radius=radius):
            return along_lines(q, np.array(points), radius)
        case Rectangle():
            return _alone(_from_rectangle(q, node) / node.radius)
        case Triangle(a=a, b=b, c=c):
            return _alone(from_triangle(q, np.array([a, b, c])) / node.radius)
        case Cylinder(start=start, end=end, cylinder_radius=across):
            return _alone(_from_cylinder(q, np.array(start), np.array(end), across) / node.radius)
        case HalfSpace(point=point, extent=extent):
            normal = np.array(node.normal) / np.linalg.norm(node.normal)
            top = np.array(point) - node.radius * normal
            return _alone(_from_cylinder(q, top, top - extent * normal, extent) / node.radius)
        case Polygon():
            return _from_polygon(q, np.array(node.points), node.radius)
    raise TypeError(type(node))


def _alone(distance: Floats) -> tuple[Floats, Floats]:
    return distance, np.full(len(distance), np.inf)


def curve_of(node: object) -> Curve:
    if isinstance(node, Arc):
        return _arc(node)
    if isinstance(node, Stroke):
        balls = np.column_stack([node.points, node.radii])
        curve = _b_spline(balls) if node.spline == "b_spline" else _stroke(balls)
        growth = np.array([0.0, 0.0, 0.0, growth_of(node)])
        return lambda t: curve(t) + growth
    if isinstance(node, TaperedBezier):
        radii = (node.radius, node.control_radius, node.end_radius)
        points = (node.start, node.control, node.end)
        return bezier([(*point, radius) for point, radius in zip(points, radii, strict=True)])
    if isinstance(node, QuadraticBezier):
        return bezier([(*point, node.radius) for point in (node.start, node.control, node.end)])
    assert isinstance(node, CubicBezier)
    controls = (node.start, node.start_control, node.end_control, node.end)
    return bezier([(*point, node.radius) for point in controls])


def _stroke(balls: Floats) -> Curve:
    """A C¹ spline of two parabolas per span, from their values and slopes at the ends."""
    lengths = np.linalg.norm(np.diff(balls[:, :3], axis=0), axis=1)
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    slopes = np.empty_like(balls)
    slopes[0], slopes[-1] = np.diff(balls[:2], axis=0) / lengths[0], np.diff(balls[-2:], axis=0) / lengths[-1]
    for i in range(1, len(balls) - 1):
        for axis in range(4):
            parabola = np.polyfit(knots[i - 1 : i + 2] - knots[i], balls[i - 1 : i + 2, axis], 2)
            slopes[i, axis] = parabola[1]
    for i, ball in enumerate(balls):
        limit = 2.0 * ball[3] / lengths[max(i - 1, 0) : i + 1].max()
        slopes[i, 3] = np.clip(slopes[i, 3], -limit, limit)

    def curve(t: Floats) -> Floats:
        places = np.clip(t * (len(balls) - 1), 0.0, len(balls) - 1)
        span = np.minimum(places.astype(int), len(balls) - 2)
        x = (places - span)[..., None]
        a, b, h = balls[span], balls[span + 1], lengths[span][..., None]
        start, end = h * slopes[span], h * slopes[span + 1]
        bend, unbend = 2.0 * (b - a) - 1.5 * start - 0.5 * end, 1.5 * end + 0.5 * start - 2.0 * (b - a)
        first = a + start * x + bend * x**2
        second = b - end * (1.0 - x) + unbend * (1.0 - x) ** 2
        result: Floats = np.where(x < 0.5, first, second)
        return result

    return curve


def _b_spline(balls: Floats) -> Curve:
    """A quadratic B-spline with uniform knots, which ends at the first and the last ball."""
    degree = min(2, len(balls) - 1)
    inner = np.linspace(0.0, 1.0, len(balls) - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    spline = BSpline(knots, balls, degree)
    return lambda t: np.asarray(spline(t))


def bezier(controls: ArrayLike) -> Curve:
    """A Bézier curve by de Casteljau's algorithm; radii are the fourth coordinate."""

    def curve(t: Floats) -> Floats:
        level = [np.broadcast_to(row, (*np.shape(t), 4)) for row in np.array(controls, np.float64)]
        while len(level) > 1:
            level = [(1.0 - t)[..., None] * a + t[..., None] * b for a, b in pairwise(level)]
        return level[0]

    return curve


def _arc(node: Arc) -> Curve:
    """The arc by rotation of its start about its centre, found by least squares."""
    points = np.array([node.start, node.through, node.end])
    normal = unit(np.cross(points[1] - points[0], points[2] - points[0]))
    rows = np.vstack([2.0 * (points[1:] - points[0]), normal])
    squares = (points**2).sum(axis=1)
    center = np.linalg.solve(rows, np.append(squares[1:] - squares[0], normal @ points[0]))
    first = points[0] - center
    second = np.cross(normal, first)
    last = points[2] - center
    angle = np.arctan2(last @ second, last @ first) % (2.0 * np.pi)

    def curve(t: Floats) -> Floats:
        place = center + np.cos(angle * t)[..., None] * first + np.sin(angle * t)[..., None] * second
        return np.concatenate([place, np.full((*np.shape(t), 1), node.radius)], axis=-1)

    return curve


def along_curve(q: Floats, curve: Curve) -> tuple[Floats, Floats]:
    """By dense search over the curve, refined around the best place."""
    least, _, lowest, best = _closest_places(q, curve)
    lowest[np.arange(len(q)), best] = np.inf
    return least, lowest.min(axis=1)


def _closest_places(q: Floats, curve: Curve) -> tuple[Floats, Floats, Floats, NDArray[np.intp]]:
    """Least ratios and their places (n,); ratios of samples that are local minima; the least sample."""
    t = np.unique([*np.linspace(0.0, 1.0, SAMPLES + 1), *NEAR_ENDS, *(1.0 - NEAR_ENDS)])
    balls = curve(t)
    ratios = np.linalg.norm(q[:, None] - balls[:, :3], axis=2) / balls[:, 3]
    padded = np.pad(ratios, ((0, 0), (1, 1)), constant_values=np.inf)
    lowest = np.where((ratios <= padded[:, :-2]) & (ratios < padded[:, 2:]), ratios, np.inf)
    best = lowest.argmin(axis=1)
    low, high = t[np.maximum(best - 1, 0)], t[np.minimum(best + 1, len(t) - 1)]
    for _ in range(60):
        third = (high - low) / 3.0
        falls = _ratio(q, curve, low + third) >= _ratio(q, curve, high - third)
        low, high = np.where(falls, low + third, low), np.where(falls, high, high - third)
    place, at_best = 0.5 * (low + high), ratios[np.arange(len(q)), best]
    least = _ratio(q, curve, place)
    return np.minimum(least, at_best), np.where(least <= at_best, place, t[best]), lowest, best


def _ratio(q: Floats, curve: Curve, t: Floats) -> Floats:
    ball = curve(t)
    result: Floats = np.linalg.norm(q - ball[:, :3], axis=1) / ball[:, 3]
    return result


def near_focus(node: object, q: Floats, step: float = 1e-4) -> NDArray[np.bool_]:
    """Points (n,) within `FOCUS` of a centre of curvature, or with two closest points beside each other.

    With ρ = |q − c| / s, the curvature of ½ ρ² s² over |c'|² at its minimum is 1 − |q − c| / radius of
    curvature for a constant radius s.
    """
    curve = curve_of(node)
    place = _closest_places(q, curve)[1]
    inner = (place > 2.0 * step) & (place < 1.0 - 2.0 * step)
    middle = np.clip(place, step, 1.0 - step)
    before, ball, after = curve(middle - step), curve(middle), curve(middle + step)
    speed = np.linalg.norm((after - before)[:, :3], axis=1) / (2.0 * step)
    squares = [_ratio(q, curve, middle + shift) ** 2 for shift in (-step, 0.0, step)]
    bend = 0.5 * (squares[0] - 2.0 * squares[1] + squares[2]) / step**2 * ball[:, 3] ** 2
    around = np.clip(place + np.linspace(-10.0, 10.0, 201)[:, None] / SAMPLES, 0.0, 1.0)
    ratios = np.array([_ratio(q, curve, t) for t in around])
    turns = (np.diff(np.sign(np.diff(ratios, axis=0)), axis=0) > 0.0).sum(axis=0)
    near: NDArray[np.bool_] = inner & ((bend < FOCUS * speed**2) | (turns > 1))
    return near


def _from_rectangle(q: Floats, node: Rectangle) -> Floats:
    axis = np.array(node.axis) / np.linalg.norm(node.axis)
    side = np.array(node.side) / np.linalg.norm(node.side)
    first = unit(side - (side @ axis) * axis)
    second = np.cross(axis, first)
    w = q - np.array(node.center)
    beyond = [np.maximum(np.abs(w @ first) - 0.5 * node.length, 0.0)]
    beyond += [np.maximum(np.abs(w @ second) - 0.5 * node.height, 0.0), w @ axis]
    distance: Floats = np.linalg.norm(beyond, axis=0)
    return distance


def from_triangle(q: Floats, corners: Floats) -> Floats:
    """By barycentric coordinates of the foot of the perpendicular; outside, by the edges."""
    sides = corners[1:] - corners[0]
    shares = np.linalg.solve(sides @ sides.T, sides @ (q - corners[0]).T)
    above = np.linalg.norm(q - corners[0] - shares.T @ sides, axis=1)
    inside = (shares >= 0.0).all(axis=0) & (shares.sum(axis=0) <= 1.0)
    edges, _ = along_lines(q, np.vstack([corners, corners[:1]]), 1.0)
    return np.where(inside, above, edges)


def along_lines(q: Floats, points: Floats, radius: float) -> tuple[Floats, Floats]:
    """By the closest point of each line from one of the points (m, 3) to the next."""
    starts, ways = points[:-1], np.diff(points, axis=0)
    squares = np.maximum((ways**2).sum(axis=1), 1e-300)
    shares = np.einsum("nmi,mi->nm", q[:, None] - starts, ways) / squares
    feet = starts + np.clip(shares, 0.0, 1.0)[:, :, None] * ways
    ratios = np.linalg.norm(q[:, None] - feet, axis=2) / radius
    rows, best = np.arange(len(q)), ratios.argmin(axis=1)
    elsewhere = np.linalg.norm(feet - feet[rows, best][:, None], axis=2) > 1e-6
    return ratios[rows, best], np.where(elsewhere, ratios, np.inf).min(axis=1)


def _from_cylinder(q: Floats, start: Floats, end: Floats, radius: float) -> Floats:
    way = end - start
    length = float(np.linalg.norm(way))
    along = (q - start) @ way / length
    across = np.linalg.norm(q - start - along[:, None] * way / length, axis=1)
    beyond = np.maximum(np.abs(along - 0.5 * length) - 0.5 * length, 0.0)
    distance: Floats = np.hypot(beyond, np.maximum(across - radius, 0.0))
    return distance


def _from_polygon(q: Floats, corners: Floats, radius: float) -> tuple[Floats, Floats]:
    """By the number of edges that a ray in the plane crosses; outside, by the boundary."""
    center = corners.mean(axis=0)
    axes = np.linalg.svd(corners - center)[2]
    flat, x = (corners - center) @ axes[:2].T, (q - center) @ axes[:2].T
    inside = np.zeros(len(q), np.bool_)
    for a, b in pairwise([*flat, flat[0]]):
        if a[1] != b[1]:
            crosses = (a[1] > x[:, 1]) != (b[1] > x[:, 1])
            inside ^= crosses & (x[:, 0] < a[0] + (x[:, 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]))
    edge, other = along_lines(q, np.vstack([corners, corners[:1]]), radius)
    above = np.abs((q - center) @ axes[2]) / radius
    return np.where(inside, above, edge), np.where(inside, np.inf, other)
