"""Random trees of exact CSG: unions, intersections and differences of all primitives with a radius."""

from collections.abc import Callable

import numpy as np

from blobtree import (
    Arc,
    Box,
    Circle,
    Cone,
    CubicBezier,
    Cylinder,
    Disc,
    Ellipsoid,
    HalfSpace,
    Node,
    Point,
    Polygon,
    Polyline,
    QuadraticBezier,
    Rectangle,
    Segment,
    Stroke,
    TaperedBezier,
    Torus,
    Triangle,
)
from blobtree.validation import Vector
from tests.blobtree.trees import triple

THINNEST, THICKEST = -5.0, -1.0
"""Powers of ten of radii."""

SOLIDS = ("box", "cylinder", "half_space", "point", "ellipsoid", "torus", "cone")
"""Kinds with an inside, whatever their radius."""

PRIMITIVES = (
    *SOLIDS,
    *("segment", "disc", "rectangle", "triangle", "polygon", "circle"),
    *("arc", "quadratic", "cubic", "tapered", "polyline", "stroke"),
)


def csg_primitive(rng: np.random.Generator, kind: str, radius: float) -> Node:
    """A primitive of a kind in PRIMITIVES with a sharp edge: of this visible radius, or of this width."""
    a, b, c, d = (triple(point) for point in rng.uniform(-0.8, 0.8, (4, 3)))
    axis, size = triple(rng.normal(size=3)), triple(rng.uniform(0.4, 1.6, 3))
    middle, breadth = triple(0.5 * np.array(a)), float(rng.uniform(0.3, 0.8))
    width = max(radius, 2e-4)  # a sharper falloff is refused
    makers: dict[str, Callable[[], Node]] = {
        "box": lambda: Box(middle, size, radius=radius),
        "cylinder": lambda: Cylinder(a, triple(np.array(a) + 0.8 * np.array(axis)), breadth, radius=radius),
        "half_space": lambda: HalfSpace(middle, axis, 1.5, radius=radius),
        "point": lambda: Point(middle, radius=breadth, width=width),
        "ellipsoid": lambda: Ellipsoid(middle, triple(0.6 * np.array(size)), width=width),
        "torus": lambda: Torus(middle, axis, breadth, radius=0.4 * breadth, width=width),
        "cone": lambda: Cone(a, b, radius=breadth, end_radius=radius),
        "segment": lambda: Segment(a, b, radius=0.3, width=width),
        "disc": lambda: Disc(middle, axis, breadth, radius=radius),
        "rectangle": lambda: Rectangle(middle, axis, b, breadth, 1.2, radius=radius),
        "triangle": lambda: Triangle(a, b, c, radius=radius),
        "polygon": lambda: Polygon(_arrow(a, b, c), radius=radius),
        "circle": lambda: Circle(middle, axis, breadth, radius=radius),
        "arc": lambda: Arc(a, b, c, radius=radius),
        "quadratic": lambda: QuadraticBezier(a, b, c, radius=radius),
        "cubic": lambda: CubicBezier(a, b, c, d, radius=radius),
        "tapered": lambda: TaperedBezier(a, b, c, radius=radius, control_radius=0.3, end_radius=0.2),
        "polyline": lambda: Polyline((a, b, c, d), radius=radius),
        "stroke": lambda: Stroke((a, b, c), radii=(0.2, radius, 0.3)),
    }
    return makers[kind]()


def _arrow(a: Vector, b: Vector, c: Vector) -> tuple[Vector, ...]:
    """The corners of a concave polygon."""
    corner, u, v = np.array(a), np.array(b), np.array(c)
    return a, triple(corner + u), triple(corner + 0.3 * (u + v)), triple(corner + v)


def csg_tree(rng: np.random.Generator, depth: int) -> Node:
    """A tree of this depth at most; a solid of a random kind is most often the left operand."""
    if depth == 0 or rng.random() < 0.1:
        kinds = SOLIDS if rng.random() < 0.7 else PRIMITIVES
        radius = float(10.0 ** rng.uniform(THINNEST, THICKEST))
        return _placed(rng, csg_primitive(rng, str(rng.choice(kinds)), radius))
    a, b = csg_tree(rng, depth - 1), csg_tree(rng, depth - 1)
    kind = rng.integers(0, 3)
    return _placed(rng, (a | b, a & b, a - b)[kind])


def _placed(rng: np.random.Generator, node: Node) -> Node:
    """The node as it is, turned, or under a map that is no similarity."""
    kind = rng.integers(0, 4)
    if kind == 1:
        node = node.rotate(triple(rng.normal(size=3)), float(rng.uniform(0.0, 360.0)))
    if kind == 2:
        node = node.scale(triple(rng.uniform(0.6, 1.4, 3)))
    if kind == 3:
        return node.translate(triple(rng.uniform(-0.2, 0.2, 3)))
    return node
