"""Primitives around flat skeletons: rectangles, triangles and polygons, with rounded edges."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import KW_ONLY
from itertools import combinations, product

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import unit_vectors
from blobtree.declare.skeleton import PLATE_CELLS
from blobtree.errors import InvalidNode
from blobtree.formulas.skeletons import JOINT_YIELD, least_influence_at_joints
from blobtree.lazy import Lazy
from blobtree.nodes.crossings import cross_products, meeting_edges
from blobtree.nodes.node import Node
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.primitives import Columns, JoinedPrimitive, Primitive, beside
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

SMALLEST_SINE = 1e-6
"""Sine of an angle below which two directions count as parallel."""

FLATNESS = 1e-5
"""Distance of a polygon's corners from a plane, over its size, up to which it counts as planar."""


class Rectangle(Primitive):
    """A flat rectangle with a rounded edge: everything within `radius` of the rectangle.

    Raises
    ------
    InvalidNode
        `side` is parallel to `axis`.

    Examples
    --------
    >>> from blobtree import Rectangle
    >>> plate = Rectangle((0, 0, 0), (0, 0, 1), (1, 0, 0), 2.0, 1.0, radius=0.1)
    >>> plate([[0.9, 0.4, 0.1], [1.1, 0, 0], [0, 0.6, 0]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    convex = True
    cells = PLATE_CELLS

    center: Vector = par.point("centre of the rectangle")
    axis: Vector = par.direction("normal of the rectangle's plane, of any length")
    side: Vector = par.direction("direction of the length; its part along the axis is left out")
    length: float = par.length("length along `side`, without the radius")
    height: float = par.length("length across `side`, without the radius")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edge, half the thickness")

    def __post_init__(self) -> None:
        super().__post_init__()
        across = np.cross(*unit_vectors(np.array([self.axis, self.side])))
        if np.linalg.norm(across) < SMALLEST_SINE:
            raise InvalidNode(
                f"side: expected a direction in the plane across the axis, got {self.side}, which is "
                f"parallel to the axis {self.axis}; give another direction"
            )

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of the rectangle."""
        u, v = _sides(columns)
        signs = np.array(list(product((-0.5, 0.5), repeat=2)))
        across, along = (columns["length"] * u)[:, None], (columns["height"] * v)[:, None]
        corners: Float64Array = columns["center"][:, None] + signs[:, :1] * across + signs[:, 1:] * along
        return corners

    @classmethod
    def numbers(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return centres; unit vectors along the sides with half their lengths."""
        u, v = _sides(columns)
        sides = [u, 0.5 * columns["length"], v, 0.5 * columns["height"]]
        return np.concatenate([columns["center"], *sides], axis=1)

    @formula
    def closest(
        q: wp.vec3, center: wp.vec3, u: wp.vec3, along: wp.float32, v: wp.vec3, across: wp.float32
    ) -> wp.vec3:
        """`u` and `v` are unit vectors along the sides, and the numbers half their lengths."""
        w = q - center
        c = u * wp.clamp(wp.dot(w, u), -along, along) + v * wp.clamp(wp.dot(w, v), -across, across)
        return center + c


def _sides(columns: Columns) -> tuple[Float64Array, Float64Array]:
    """Return unit vectors (n, 3) along both sides of rectangles."""
    normals = unit_vectors(columns["axis"])
    v = unit_vectors(np.cross(normals, unit_vectors(columns["side"])))
    return np.cross(v, normals), v


@wp.func
def foot_on_edge(w: wp.vec3, edge: wp.vec3) -> wp.vec3:
    """Return the point of the line segment from 0 to `edge` that is closest to w."""
    return edge * wp.clamp(wp.dot(w, edge) / wp.max(wp.dot(edge, edge), 1.0e-37), 0.0, 1.0)


@wp.func
def closer(w: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return a, or b if it is closer to w.

    |w − a|² − |w − b|² is written as a product with b − a: feet near a corner differ little, and float32 does
    not show in the squares which one is closer.
    """
    if wp.dot(b - a, (w - a) + (w - b)) > 0.0:
        return b
    return a


@wp.func
def is_beside(w: wp.vec3, edge: wp.vec3, outward: wp.vec3) -> wp.bool:
    """Return True if w lies outside the line segment from 0 to `edge`, between the normals at its ends."""
    t = wp.dot(w, edge)
    return wp.dot(w, outward) > 0.0 and t > 0.0 and t < wp.dot(edge, edge)


@wp.func
def closest_on_triangle(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (corner a, influence); tape[at + 1] = (b − a, joint ab); tape[at + 2] = (c − a, joint ac).

    tape[at + 3] = (unit normal, joint bc); float32 could not compute the normal of slivers. A joint is 1 if
    another triangle goes on behind the edge, else 0. A point outside has the closest one inside an edge if it
    is beside this edge, which signs tell: distances to that point and to a corner near it differ by less than
    float32 shows.
    """
    corner = tape[at]
    to_b = tape[at + 1]
    to_c = tape[at + 2]
    upright = tape[at + 3]
    w = q - wp.vec3(corner[0], corner[1], corner[2])
    ab = wp.vec3(to_b[0], to_b[1], to_b[2])
    ac = wp.vec3(to_c[0], to_c[1], to_c[2])
    bc = ac - ab
    n = wp.vec3(upright[0], upright[1], upright[2])
    beyond_ab = wp.cross(ab, n)
    beyond_ac = wp.cross(n, ac)
    beyond_bc = wp.cross(bc, n)
    outside = wp.dot(w, beyond_ab) > 0.0 or wp.dot(w, beyond_ac) > 0.0 or wp.dot(w - ab, beyond_bc) > 0.0
    c = w - n * wp.dot(w, n)
    joint = float(0.0)
    if outside:
        if is_beside(w, ab, beyond_ab):
            c = foot_on_edge(w, ab)
            joint = to_b[3]
        elif is_beside(w, ac, beyond_ac):
            c = foot_on_edge(w, ac)
            joint = to_c[3]
        elif is_beside(w - ab, bc, beyond_bc):
            c = ab + foot_on_edge(w - ab, bc)
            joint = upright[3]
        else:
            c = closer(w, foot_on_edge(w, ab), foot_on_edge(w, ac))
            c = closer(w, c, ab + foot_on_edge(w - ab, bc))
            joint = wp.max(wp.max(to_b[3], to_c[3]), upright[3])
    influence = corner[3] * (1.0 - JOINT_YIELD * joint)
    return wp.vec4(corner[0] + c[0], corner[1] + c[1], corner[2] + c[2], influence)


class Triangle(JoinedPrimitive):
    """A flat triangle with a rounded edge: everything within `radius` of the triangle.

    Raises
    ------
    InvalidNode
        The corners lie on a line: then use a `Segment`.

    Examples
    --------
    >>> from blobtree import Triangle
    >>> fin = Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0), radius=0.1)
    >>> fin([[0.2, 0.2, 0.1], [0.5, -0.1, 0], [1.1, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    convex = True
    cells = PLATE_CELLS
    joint_texels = (1, 2, 3)
    texels_read = 4
    closest_with_influence = formula(closest_on_triangle)
    least_influence = formula(least_influence_at_joints)

    a: Vector = par.point("first corner")
    b: Vector = par.point("second corner")
    c: Vector = par.point("third corner")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edge, half the thickness")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_corners(self.a, self.b, self.c, SMALLEST_SINE, "a Segment")

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return the first corner and the influence radius; the edges from it; the unit normal."""
        return triangle_texels(columns, influences[:, 0])


def check_corners(a: Vector, b: Vector, c: Vector, flattest: float, instead: str) -> None:
    """Raise `InvalidNode` for a triangle whose height is below `flattest` of its longest side."""
    corners = np.array([a, b, c])
    edges = corners - np.roll(corners, 1, axis=0)
    longest = np.linalg.norm(edges, axis=1).max()
    if not longest or np.linalg.norm(np.cross(*(edges[:2] / longest))) < flattest:
        raise InvalidNode(
            f"triangle: expected three corners that span a plane, got {a}, {b}, {c}, which lie on a line or "
            f"are equal; use {instead}"
        )


def triangle_texels(columns: Columns, numbers: Float64Array) -> Float64Array:
    """Return the first corners beside numbers (n,), the edges from it, and the unit normals (n, 4, 4)."""
    a, b, c = columns["a"], columns["b"], columns["c"]
    normals = unit_vectors(np.cross(unit_vectors(b - a), unit_vectors(c - a)))
    zeros = np.zeros(len(a))
    rows = [beside(vectors, zeros) for vectors in (b - a, c - a, normals)]
    return np.stack([beside(a, numbers), *rows], axis=1)


class Polygon(Pieces):
    """A flat polygon with a rounded edge, also a concave one: the union of triangles that fill it.

    The triangles are ears of the polygon (Meisters 1975), and differ from it by `FLATNESS` at most.

    Raises
    ------
    InvalidNode
        There are less than three corners, they do not lie in a plane, or edges cross or touch each other.

    Examples
    --------
    >>> from blobtree import Polygon
    >>> arrow = Polygon([(0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0)], radius=0.1)
    >>> arrow([[1, 1, 0.1], [0.2, 1, 0]]).round(3).tolist()
    [0.5, 0.0]
    """

    file_tag = "polygon"

    points: tuple[Vector, ...] = par.points("corners in order, at least three")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edge, half the thickness")

    def __post_init__(self) -> None:
        super().__post_init__()
        polygon_in_plane(self.points)

    @Lazy
    def expanded(self) -> Node:
        """Return the union of ears."""
        ears = _ears(polygon_in_plane(self.points))
        edges = Counter(frozenset(pair) for ear in ears for pair in combinations(ear, 2))
        return self.united(
            Triangle(*(self.points[place] for place in ear), radius=self.radius, **self.shared).joined(
                [float(edges[frozenset(pair)] > 1) for pair in combinations(ear, 2)]
            )
            for ear in ears
        )


def polygon_in_plane(points: Sequence[Vector]) -> Float64Array:
    """Return `_in_plane` of the corners of a simple polygon; raise `InvalidNode` for any other."""
    if len(points) < 3:
        raise InvalidNode(f"points: expected at least three corners, got {points}; use a Segment")
    flat = _in_plane(np.array(points))
    if crossing := meeting_edges(flat):
        raise InvalidNode(
            f"points: expected a simple polygon, got edges from corners {crossing[0]} and {crossing[1]} "
            "that meet; remove repeated corners, and split the polygon where it crosses itself"
        )
    return flat


def _in_plane(points: Float64Array) -> Float64Array:
    """Return the corners of a polygon (n, 3) in its plane (n, 2), in units of its size, counter-clockwise."""
    centered = points - points.mean(axis=0)
    size = np.abs(centered).max()
    if size > 0.0:
        centered = centered / size
    _, _, axes = np.linalg.svd(centered, full_matrices=False)
    away = np.abs(centered @ axes[2]).max()
    if size == 0.0 or away > FLATNESS:
        raise InvalidNode(
            f"points: expected corners in one plane, got corners up to {away * size:g} away from it; "
            "split the polygon into triangles"
        )
    flat: Float64Array = centered @ axes[:2].T
    if cross_products(flat, np.roll(flat, -1, axis=0)).sum() < 0.0:
        flat[:, 1] *= -1.0
    return flat


def _ears(points: Float64Array) -> list[tuple[int, int, int]]:
    """Return triangles, by their corners, that fill a simple polygon; corners on a line are left out."""
    left = list(range(len(points)))
    ears: list[tuple[int, int, int]] = []
    while len(left) > 2:
        place, flat = _ear(points, left)
        if not flat:
            ears.append((left[place - 1], left[place], left[(place + 1) % len(left)]))
        del left[place]
    return ears


def _ear(points: Float64Array, left: list[int]) -> tuple[int, bool]:
    """Return a corner to cut off a polygon: one on a line (then True), or else the roundest ear."""
    corners = points[left]
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    turns = cross_products(corners - before, after - corners)
    edges = [np.linalg.norm(a - b, axis=1) for a, b in ((corners, before), (after, corners), (before, after))]
    roundness = turns / np.maximum(np.max(edges, axis=0) ** 2, 1e-300)
    flat = np.abs(roundness) <= 2.0 * SMALLEST_SINE
    if flat.any():
        return int(flat.argmax()), True
    for place in np.argsort(-roundness.round(3), kind="stable"):  # rounding chooses no ear among equal ones
        a, b, c = before[place], corners[place], after[place]
        inside = (cross_products(b - a, corners - a) >= 0.0) & (cross_products(c - b, corners - b) >= 0.0)
        inside &= cross_products(a - c, corners - c) >= 0.0
        inside &= (corners != a).any(axis=1) & (corners != b).any(axis=1) & (corners != c).any(axis=1)
        if not inside.any():
            return int(place), False
    return int(np.argmax(roundness)), False  # rounding hides the ear that every simple polygon has
