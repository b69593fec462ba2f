"""Exact CSG in float64: signed distances of trees of unions, intersections, differences and affine maps.

`signed_distance` is below 0 inside, changes by at most 1 per unit, and vanishes on the surface alone. So rays
march in steps of its magnitude.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from blobtree import (
    Box,
    Circle,
    Cone,
    Cylinder,
    Difference,
    Disc,
    Ellipsoid,
    HalfSpace,
    Intersection,
    Node,
    Point,
    Polygon,
    Polyline,
    Rectangle,
    Segment,
    Superquadric,
    SymmetricDifference,
    Torus,
    Transform,
    Triangle,
    Union,
    Volume,
)
from tests.oracles import shapes, volumes

Floats = NDArray[np.float64]

CURVE_BALLS = 4001
COARSE_STEP = 16

POINTS_AT_ONCE = 2048
"""Points for which an evaluation of a tree takes hardly longer than for one."""


def signed_distance(node: Node, q: Floats) -> Floats:
    """A bound (n,) on the distance of points (n, 3) from the surface, below 0 inside."""
    match node:
        case Union(operands=operands):
            return np.asarray(np.min([signed_distance(operand, q) for operand in operands], axis=0))
        case Intersection(operands=operands):
            return np.asarray(np.max([signed_distance(operand, q) for operand in operands], axis=0))
        case Difference(solid=solid, tool=tool):
            return np.maximum(signed_distance(solid, q), -signed_distance(tool, q))
        case Transform(child=child, matrix=matrix):
            linear, offset = np.array(matrix)[:, :3], np.array(matrix)[:, 3]
            local = np.linalg.solve(linear, (q - offset).T).T
            smallest = float(np.linalg.svd(linear, compute_uv=False)[-1])
            return np.asarray(smallest * signed_distance(child, local))
        case SymmetricDifference():
            return signed_distance(node.expanded, q)
        case Volume():
            return np.asarray(volumes.distance(node, q) / np.sqrt(3.0))  # each of its slopes is 1 at most
        case Superquadric():
            return _from_superquadric(q, node)
        case Ellipsoid(center=center, semi_axes=axes):
            ratio = np.linalg.norm((q - np.array(center)) / np.array(axes), axis=1)
            return np.asarray(min(axes) * (ratio - 1.0))
    return _primitive(node, q)


def _primitive(node: Any, q: Floats) -> Floats:
    """A skeleton's distance less the radius; in a solid skeleton, its depth too."""
    match node:
        case Point(center=center):
            distance = np.linalg.norm(q - np.array(center), axis=1)
        case Segment(start=start, end=end):
            distance = _from_lines(q, np.array([start, end]))
        case Polyline(points=points):
            distance = _from_lines(q, np.array(points))
        case Cone():
            return _from_cone(q, node)
        case Torus(ring_radius=ring) | Circle(circle_radius=ring):
            across, along = _cylindrical(q, np.array(node.center), np.array(node.axis))
            distance = np.hypot(across - ring, along)
        case Disc(center=center, axis=axis, disc_radius=ring):
            across, along = _cylindrical(q, np.array(center), np.array(axis))
            distance = np.hypot(np.maximum(across - ring, 0.0), along)
        case Box(center=center, size=size):
            distance = _beyond(np.abs(q - np.array(center)) - 0.5 * np.array(size))
        case Cylinder(start=start, end=end, cylinder_radius=across):
            distance = _from_cylinder(q, np.array(start), np.array(end), across)
        case HalfSpace(point=point, normal=normal, extent=extent):
            unit = np.array(normal) / np.linalg.norm(normal)
            top = np.array(point) - node.radius * unit
            distance = _from_cylinder(q, top, top - extent * unit, extent)
        case Rectangle() | Triangle() | Polygon():
            distance = shapes.distances(node, q)[0] * node.radius
        case _:
            return _from_curve(q, node)
    return np.asarray(distance - float(node.radius))


def _beyond(excess: Floats) -> Floats:
    """The distance from a box or a cylinder, by how far points are beyond each pair of faces."""
    outside: Floats = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
    return np.asarray(outside + np.minimum(excess.max(axis=1), 0.0))


def _cylindrical(q: Floats, center: Floats, axis: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) from the line through `center` along `axis`, and heights (n,) along it."""
    along = (q - center) @ axis / np.linalg.norm(axis)
    across = np.linalg.norm(q - center - along[:, None] * axis / np.linalg.norm(axis), axis=1)
    return across, along


def _from_cylinder(q: Floats, start: Floats, end: Floats, radius: float) -> Floats:
    across, along = _cylindrical(q, start, end - start)
    length = float(np.linalg.norm(end - start))
    return _beyond(np.stack([across - radius, np.abs(along - 0.5 * length) - 0.5 * length], axis=1))


def _from_lines(q: Floats, points: Floats) -> Floats:
    """The least distance from lines, each from one of the points to the next."""
    least = np.full(len(q), np.inf)
    for a, b in pairwise(points):
        way = b - a
        share = np.clip((q - a) @ way / max(way @ way, 1e-300), 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(q - a - share[:, None] * way, axis=1))
    return least


def _from_cone(q: Floats, cone: Cone) -> Floats:
    """The least |q − c(t)| − radius(t): with k the slope of the radius, at x + k y / √(1 − k²) along it."""
    start, end = np.array(cone.start), np.array(cone.end)
    length = float(np.linalg.norm(end - start))
    rise = cone.end_radius - cone.radius
    if abs(rise) >= length:
        ball, radius = max((end, cone.end_radius), (start, cone.radius), key=lambda pair: pair[1])
        return np.asarray(np.linalg.norm(q - ball, axis=1) - radius)
    slope = rise / length
    across, along = _cylindrical(q, start, end - start)
    place = np.clip(along + slope * across / np.sqrt(1.0 - slope**2), 0.0, length)
    return np.asarray(np.hypot(across, along - place) - (cone.radius + slope * place))


def _from_superquadric(q: Floats, node: Superquadric) -> Floats:
    """The norm less 1, over its largest slope: those of p-norms, p = 2 / exponent, multiply."""
    x, y, z = (np.abs(q - np.array(node.center)) / np.array(node.semi_axes)).T
    across = _p_norm(x, y, 2.0 / node.horizontal)
    excess = [max(0.5 * exponent - 0.5, 0.0) for exponent in (node.horizontal, node.vertical)]
    slope = 2.0 ** sum(excess) / min(node.semi_axes)
    return np.asarray((_p_norm(across, z, 2.0 / node.vertical) - 1.0) / slope)


def _p_norm(x: Floats, y: Floats, p: float) -> Floats:
    largest = np.maximum(np.maximum(x, y), 1e-300)
    return np.asarray(largest * ((x / largest) ** p + (y / largest) ** p) ** (1.0 / p))


def _from_curve(q: Floats, node: object) -> Floats:
    """The least distance less radius, over every COARSE_STEP-th ball of a curve and all beside the best."""
    balls = shapes.curve_of(node)(np.linspace(0.0, 1.0, CURVE_BALLS))
    coarse = balls[::COARSE_STEP]
    best = (cdist(q, coarse[:, :3]) - coarse[:, 3]).argmin(axis=1)
    places = COARSE_STEP * best[:, None] + np.arange(-COARSE_STEP, COARSE_STEP + 1)
    near = balls[np.clip(places, 0, CURVE_BALLS - 1)]
    gaps: Floats = np.linalg.norm(q[:, None] - near[..., :3], axis=2) - near[..., 3]
    return np.asarray(gaps.min(axis=1))


def deep_hits(node: Node, origins: Floats, directions: Floats, depth: float) -> Floats:
    """Distances (n,) along rays of unit direction at which they first are `depth` inside; inf for none.

    Rays march in steps of the signed distance, half the depth at least. Where few rays are left, each takes
    several of the least steps at once.
    """
    center = np.mean(node.support, axis=0, dtype=np.float64)
    radius = 0.5 * float(np.linalg.norm(np.subtract(*node.support[::-1])))
    middle = ((center - origins) * directions).sum(axis=1)
    t, far = np.maximum(middle - radius, 0.0), middle + radius
    found, active = np.full(len(t), np.inf), np.arange(len(t))
    while len(active):
        ahead = 0.5 * depth * np.arange(max(POINTS_AT_ONCE // len(active), 1))
        ways = t[active, None] + ahead
        points = origins[active, None] + ways[..., None] * directions[active, None]
        distances = signed_distance(node, points.reshape(-1, 3)).reshape(ways.shape)
        free = np.maximum.accumulate(ways + np.maximum(np.abs(distances), 0.5 * depth), axis=1)
        deep = distances < -depth
        first = np.where(deep.any(axis=1), deep.argmax(axis=1), -1)
        found[active] = np.where(first < 0, np.inf, ways[np.arange(len(active)), first])
        t[active] = free[:, -1]
        active = active[(first < 0) & (t[active] <= far[active])]
    return found
