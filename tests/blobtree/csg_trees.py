"""Random trees of exact CSG: unions, intersections and differences of all solids with a sharp edge."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    Superquadric,
    SymmetricDifference,
    TaperedBezier,
    Torus,
    Triangle,
    Volume,
    from_sdf,
)
from blobtree.errors import InvalidNode
from blobtree.validation import Vector
from tests.blobtree.trees import triple

THINNEST, THICKEST = -5.0, -1.0
"""Powers of ten of radii."""

GRID = 0.2
"""Distance of the planes on which the corners and centres of regular trees lie."""

SHARPEST_WIDTH = 2e-4
"""Least width that all solids take: a sharper falloff is refused."""

SOLIDS = (
    *("box", "cylinder", "half_space", "point", "ellipsoid", "torus", "cone"),
    *("superquadric", "volume"),
)
"""Kinds with an inside, whatever their radius."""

PRIMITIVES = (
    *SOLIDS,
    *("segment", "disc", "rectangle", "triangle", "polygon", "circle"),
    *("arc", "quadratic", "cubic", "tapered", "polyline", "stroke"),
)


def csg_primitive(rng: np.random.Generator, kind: str, radius: float, *, regular: bool = False) -> Node:
    """A solid of a kind in PRIMITIVES with a sharp edge: of this visible radius, or of this width.

    Faces of `regular` ones lie in the planes of a grid, so that those of several coincide.
    """
    a, b, c, d = (triple(point) for point in _snapped(rng.uniform(-0.8, 0.8, (4, 3)), regular=regular))
    size = triple(np.maximum(_snapped(rng.uniform(0.4, 1.6, 3), regular=regular), GRID))
    axis = triple(rng.normal(size=3))
    if regular:
        axis = triple(np.roll([1.0, 0.0, 0.0], rng.integers(3)))
    breadth = float(_snapped(rng.uniform(0.3, 0.8), regular=regular))
    middle = a if regular else triple(0.5 * np.array(a))
    exponents = [float(exponent) for exponent in 10.0 ** rng.uniform(-1.0, 0.3, 2)]
    width = max(radius, SHARPEST_WIDTH)
    makers: dict[str, Callable[[], Node]] = {
        "box": lambda: Box(middle, size, radius=radius),
        "cylinder": lambda: Cylinder(a, triple(np.array(a) + 0.8 * np.array(axis)), breadth, radius=radius),
        "half_space": lambda: HalfSpace(middle, axis, 1.5, radius=radius),
        "point": lambda: Point(middle, radius=breadth, width=width),
        "ellipsoid": lambda: Ellipsoid(middle, triple(0.6 * np.array(size)), width=width),
        "torus": lambda: Torus(middle, axis, breadth, radius=0.4 * breadth, width=width),
        "cone": lambda: Cone(a, b, radius=breadth, end_radius=radius),
        "superquadric": lambda: Superquadric(middle, triple(0.6 * np.array(size)), *exponents, width=width),
        "volume": lambda: _block(middle, size, width),
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


def _snapped(values: Any, *, regular: bool) -> Any:
    """Numbers as they are, or rounded to the grid of regular trees."""
    return GRID * np.round(values / GRID) if regular else values


def _block(middle: Vector, size: Vector, width: float) -> Volume:
    """A block by samples of its signed distances."""
    half = 0.5 * np.array(size)

    def distance(q: NDArray[np.float64]) -> NDArray[np.float64]:
        beyond = np.abs(q - np.array(middle)) - half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))

    corners = (np.array(middle) - half - 0.15, np.array(middle) + half + 0.15)
    return from_sdf(distance, *corners, spacing=0.1, width=width)


def _arrow(a: Vector, b: Vector, c: Vector) -> tuple[Vector, ...]:
    """The corners of a concave polygon."""
    corner, u, v = np.array(a), np.array(b), np.array(c)
    return a, triple(corner + u), triple(corner + 0.3 * (u + v)), triple(corner + v)


def csg_tree(rng: np.random.Generator, depth: int, *, regular: bool = False) -> Node:
    """A tree of this depth at most; a solid of a random kind is most often the left operand."""
    if depth == 0 or rng.random() < 0.1:
        kinds = SOLIDS if rng.random() < 0.7 else PRIMITIVES
        radius = float(10.0 ** rng.uniform(THINNEST, THICKEST))
        return _placed(
            rng, csg_primitive(rng, str(rng.choice(kinds)), radius, regular=regular), regular=regular
        )
    a, b = csg_tree(rng, depth - 1, regular=regular), csg_tree(rng, depth - 1, regular=regular)
    kind = rng.integers(0, 7)
    return _placed(
        rng, SymmetricDifference(a, b) if kind == 6 else (a | b, a & b, a - b)[kind % 3], regular=regular
    )


def visible_tree(rng: np.random.Generator, depth: int, *, regular: bool = False) -> Node:
    """A random tree of this depth at most that is valid and not empty."""
    while True:
        try:
            tree = csg_tree(rng, depth, regular=regular)
        except InvalidNode:  # a regular one whose corners coincide
            continue
        if bool((tree.support[1] > tree.support[0]).all()):
            return tree


def _placed(rng: np.random.Generator, node: Node, *, regular: bool) -> Node:
    """The node as it is, turned, or under a map that is no similarity; on its grid if it is regular."""
    kind = rng.integers(0, 4)
    if regular:
        return node.translate(triple(GRID * rng.integers(-1, 2, 3))) if kind == 3 else node
    if kind == 1:
        node = node.rotate(triple(rng.normal(size=3)), float(rng.uniform(0.0, 360.0)))
    if kind == 2:
        node = node.scale(triple(rng.uniform(0.6, 1.4, 3)))
    if kind == 3:
        return node.translate(triple(rng.uniform(-0.2, 0.2, 3)))
    return node
