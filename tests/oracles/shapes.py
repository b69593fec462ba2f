"""Distances from the skeletons of curves, flats and solids in float64 NumPy, by dense search or by geometry.

Each function returns |q − closest| over the visible radius there (n,), and the same (n,) for the next local
minimum at another place of the skeleton, infinite if there is none.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import Arc, CubicBezier, Cylinder, QuadraticBezier, Rectangle, Triangle

Floats = NDArray[np.float64]
Curve = Callable[[Floats], Floats]
"""A function from parameters (m,) in [0, 1] to points and radii (m, 4)."""

SAMPLES = 300


def distances(node: object, q: Floats) -> tuple[Floats, Floats]:
    """Return both for a node of any of these kinds at points (n, 3)."""
    match node:
        case Arc() | QuadraticBezier() | CubicBezier():
            return along_curve(q, curve_of(node))
        case Rectangle():
            return _alone(_from_rectangle(q, node) / node.radius)
        case Triangle(a=a, b=b, c=c):
            return _alone(from_triangle(q, np.array([a, b, c])) / node.radius)
        case Cylinder():
            return _alone(_from_cylinder(q, node) / node.radius)
    raise TypeError(type(node))


def _alone(distance: Floats) -> tuple[Floats, Floats]:
    return distance, np.full(len(distance), np.inf)


def curve_of(node: Arc | QuadraticBezier | CubicBezier) -> Curve:
    if isinstance(node, Arc):
        return _arc(node)
    if isinstance(node, QuadraticBezier):
        return bezier([(*point, node.radius) for point in (node.start, node.control, node.end)])
    points = (node.start, node.start_control, node.end_control, node.end)
    return bezier([(*point, node.radius) for point in points])


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
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    normal /= np.linalg.norm(normal)
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
    t = np.linspace(0.0, 1.0, SAMPLES + 1)
    balls = curve(t)
    ratios = np.linalg.norm(q[:, None] - balls[:, :3], axis=2) / balls[:, 3]
    padded = np.pad(ratios, ((0, 0), (1, 1)), constant_values=np.inf)
    lowest = np.where((ratios <= padded[:, :-2]) & (ratios < padded[:, 2:]), ratios, np.inf)
    best = lowest.argmin(axis=1)
    low, high = t[np.maximum(best - 1, 0)], t[np.minimum(best + 1, SAMPLES)]

    def ratio(s: Floats) -> Floats:
        ball = curve(s)
        result: Floats = np.linalg.norm(q - ball[:, :3], axis=1) / ball[:, 3]
        return result

    for _ in range(60):
        third = (high - low) / 3.0
        falls = ratio(low + third) >= ratio(high - third)
        low, high = np.where(falls, low + third, low), np.where(falls, high, high - third)
    least = np.minimum(ratio(0.5 * (low + high)), ratios[np.arange(len(q)), best])
    lowest[np.arange(len(q)), best] = np.inf
    return least, lowest.min(axis=1)


def _from_rectangle(q: Floats, node: Rectangle) -> Floats:
    axis = np.array(node.axis) / np.linalg.norm(node.axis)
    side = np.array(node.side) / np.linalg.norm(node.side)
    first = side - (side @ axis) * axis
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    w = q - np.array(node.center)
    beyond = [np.maximum(np.abs(w @ first) - 0.5 * node.width, 0.0)]
    beyond += [np.maximum(np.abs(w @ second) - 0.5 * node.height, 0.0), w @ axis]
    distance: Floats = np.linalg.norm(beyond, axis=0)
    return distance


def from_triangle(q: Floats, corners: Floats) -> Floats:
    """By barycentric coordinates of the foot of the perpendicular; outside, by the edges."""
    sides = corners[1:] - corners[0]
    shares = np.linalg.solve(sides @ sides.T, sides @ (q - corners[0]).T)
    above = np.linalg.norm(q - corners[0] - shares.T @ sides, axis=1)
    inside = (shares >= 0.0).all(axis=0) & (shares.sum(axis=0) <= 1.0)
    return np.where(inside, above, from_edges(q, corners, closed=True))


def from_edges(q: Floats, points: Floats, *, closed: bool) -> Floats:
    """Distances from a polyline through points (m, 3)."""
    starts, ends = points, np.roll(points, -1, axis=0)
    if not closed:
        starts, ends = starts[:-1], ends[:-1]
    ways = ends - starts
    shares = np.einsum("nmi,mi->nm", q[:, None] - starts, ways) / (ways**2).sum(axis=1)
    feet = starts + np.clip(shares, 0.0, 1.0)[:, :, None] * ways
    distance: Floats = np.linalg.norm(q[:, None] - feet, axis=2).min(axis=1)
    return distance


def _from_cylinder(q: Floats, node: Cylinder) -> Floats:
    way = np.array(node.end) - np.array(node.start)
    length = float(np.linalg.norm(way))
    along = (q - np.array(node.start)) @ way / length
    across = np.linalg.norm(q - np.array(node.start) - along[:, None] * way / length, axis=1)
    beyond = np.maximum(np.abs(along - 0.5 * length) - 0.5 * length, 0.0)
    distance: Floats = np.hypot(beyond, np.maximum(across - node.cylinder_radius, 0.0))
    return distance
