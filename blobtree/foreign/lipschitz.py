"""Scenes of Lipschitz Pruning (Barbier et al. 2025) as trees: distances, joined by blends of a given width.

A scene is one object in JSON. An operator has `blendMode` (union, sub, inter), `blendRadius`, `leftChild` and
`rightChild`. A primitive has `primitiveType` (sphere, box, cylinder, cone), its lengths and a colour. Each
has a `matrix` of three rows, which maps points of the scene to the node's; that of a parent comes after it.
"""

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from blobtree._typing import Float64Array
from blobtree.errors import ImplicitDecalsError, InvalidFile
from blobtree.foreign.content import naming, read_bytes
from blobtree.foreign.json_values import chosen, member, number, numbers, parsed_json
from blobtree.nodes.node import Node
from blobtree.nodes.outlines import Outline
from blobtree.nodes.primitives import Box, Point
from blobtree.nodes.profiles import Extrude
from blobtree.nodes.rounds import RoundDifference, RoundIntersection, RoundUnion
from blobtree.nodes.sharp import Frustum
from blobtree.nodes.solids import Cylinder
from blobtree.nodes.tree import Difference, Intersection, Union
from blobtree.validation import LARGEST_NUMBER, describe

WIDTH_FACTOR = 1.5
"""How far fields reach, over the widest blend: so rounded edges fit inside too."""

WIDTH_SHARE = 0.05
"""The same over the diagonal of the scene's box, where nothing blends."""

SHARP_SHARE = 1e-3
"""Width of a blend over the widest one, up to which it is none."""

MOST_ROUNDING = 0.9999
"""Largest radius of edges over half a side: at 1 nothing flat is left, as of a ball."""

SHORTEST_SIDE = 1e-9
"""Shortest side of a box."""

_SHARP: dict[str, Callable[..., Node]] = {"union": Union, "sub": Difference, "inter": Intersection}
_ROUNDED: dict[str, Callable[..., Node]] = {
    "union": RoundUnion,
    "sub": RoundDifference,
    "inter": RoundIntersection,
}

Keywords = dict[str, Any]


def read_lipschitz(path: str | os.PathLike[str]) -> Node:
    """Return the tree of a scene of Lipschitz Pruning.

    Blends leave both surfaces where those of the scene do. In between they are arcs in place of parabolas, by
    at most 0.043 of `blendRadius` apart at right angles.

    Raises
    ------
    InvalidFile
        The file holds no such scene.
    UnusableFile
        The file cannot be read.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from blobtree.foreign import read_lipschitz
    >>> path = pathlib.Path(tempfile.mkdtemp(), "ball.json")
    >>> _ = path.write_text('''{"aabb_min": [-1, -1, -1], "aabb_max": [1, 1, 1], "nodeType": "primitive",
    ...     "primitiveType": "sphere", "radius": 0.5, "matrix": [1, 0, 0, -0.25, 0, 1, 0, 0, 0, 0, 1, 0],
    ...     "round_x": 0, "round_y": 0, "color": [1, 0, 0]}''')
    >>> read_lipschitz(path)([[0.75, 0, 0]]).tolist()
    [0.5]
    """
    content = read_bytes(path)
    with naming(path):
        return lipschitz_tree(parsed_json(content))


class _Entry(NamedTuple):
    """A node of a file, the map from the scene to its parent's children, and its place for errors."""

    values: Any
    matrix: Float64Array
    place: str


def lipschitz_tree(scene: Any) -> Node:
    """Return the tree of a scene that is read; raise `InvalidFile` if it is none."""
    corners = [np.array(numbers(scene, f"aabb_{end}", "scene", 3)) for end in ("min", "max")]
    order, widest = _ordered(scene)
    width = WIDTH_FACTOR * widest if widest else WIDTH_SHARE * float(np.linalg.norm(corners[1] - corners[0]))
    if not width > 0.0:
        raise InvalidFile("scene: expected aabb_min below aabb_max")
    done: list[Node] = []
    for entry in reversed(order):
        try:
            done.append(_node(entry, done, width, SHARP_SHARE * widest))
        except InvalidFile:
            raise
        except ImplicitDecalsError as error:
            raise InvalidFile(f"{entry.place}: {error}") from None
    return done[-1]


def _ordered(scene: Any) -> tuple[list[_Entry], float]:
    """Return all nodes, parents before children, and the width of the widest blend."""
    pending, order, widest = [_Entry(scene, np.eye(4), "scene")], list[_Entry](), 0.0
    while pending:
        values, above, place = pending.pop()
        matrix = above @ np.array([*numbers(values, "matrix", place, 12), 0, 0, 0, 1]).reshape(4, 4)
        if np.abs(matrix).max() > LARGEST_NUMBER:
            raise InvalidFile(
                f"{place}: matrix: expected numbers up to {LARGEST_NUMBER:g} together with those above"
            )
        order.append(_Entry(values, matrix, place))
        kind = member(values, "nodeType", place)
        if kind == "binaryOperator":
            widest = max(widest, number(values, "blendRadius", place, 0.0))
            children = [_Entry(member(values, side, place), matrix, f"node {len(order)}, {side}")
                        for side in ("leftChild", "rightChild")]  # fmt: skip
            pending += reversed(children)
        elif kind != "primitive":
            raise InvalidFile(
                f"{place}: nodeType: expected primitive or binaryOperator, got {describe(kind)}"
            )
    return order, widest


def _node(entry: _Entry, done: list[Node], width: float, sharp: float) -> Node:
    """Return the node of an entry; `done` has those below it last, the left one at the end."""
    values, matrix, place = entry
    if values["nodeType"] == "binaryOperator":
        left, right = done.pop(), done.pop()
        radius, mode = number(values, "blendRadius", place, 0.0), member(values, "blendMode", place)
        if radius <= sharp:
            sharp_join: Node = chosen(_SHARP, mode, "blendMode", place)(left, right)
            return sharp_join
        join: Node = chosen(_ROUNDED, mode, "blendMode", place)(left, right, radius)
        join.program_children  # noqa: B018  (from below, so that each reads what its operands found)
        return join
    keywords = {
        "width": width,
        "color": tuple(np.clip(numbers(values, "color", place, 3), 0.0, 1.0).tolist()),
    }
    make = chosen(_PRIMITIVES, member(values, "primitiveType", place), "primitiveType", place)
    shape: Node = make(values, place, keywords)
    if np.array_equal(matrix, np.eye(4)):
        return shape
    if abs(np.linalg.det(matrix)) < np.finfo(np.float64).tiny:
        raise InvalidFile(f"{place}: matrix: expected an invertible map, got one that flattens space")
    return shape.transform(np.linalg.inv(matrix)[:3])


def _sphere(values: Any, place: str, keywords: Keywords) -> Node:
    return Point((0, 0, 0), radius=number(values, "radius", place, 0.0), **keywords)


def _cylinder(values: Any, place: str, keywords: Keywords) -> Node:
    half = 0.5 * number(values, "height", place, 0.0)
    return Cylinder((0, -half, 0), (0, half, 0), number(values, "radius", place, 0.0), radius=0.0, **keywords)


def _cone(values: Any, place: str, keywords: Keywords) -> Node:
    half = 0.5 * number(values, "height", place, 0.0)
    return Frustum((0, -half, 0), (0, half, 0), number(values, "radius", place, 0.0), 0.0, **keywords)


def _box(values: Any, place: str, keywords: Keywords) -> Node:
    """Return a box, whose vertical edges have radii of their own; those at both ends have one."""
    x, height, z = numbers(values, "sides", place, 3, SHORTEST_SIDE)
    bevels = numbers(values, "bevel", place, 4, 0.0)
    most = MOST_ROUNDING * 0.5 * min(x, height, z)
    edge = min(most, *(number(values, name, place, 0.0) for name in ("round_x", "round_y")))
    if not edge and not any(bevels):
        return Box((0, 0, 0), (x, height, z), radius=0.0, **keywords)
    half = np.array([0.5 * x - edge, 0.5 * z - edge])
    radii = [min(max(bevel - edge, 0.0), MOST_ROUNDING * float(half.min())) for bevel in bevels]
    outline = _rounded_rectangle(half, [radii[0], radii[2], radii[3], radii[1]])
    solid = Extrude(outline, height - 2.0 * edge, origin=(0, 0, edge - 0.5 * height), radius=edge, **keywords)
    return solid.transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]])


_PRIMITIVES: dict[str, Callable[..., Node]] = {
    "sphere": _sphere,
    "box": _box,
    "cylinder": _cylinder,
    "cone": _cone,
}


def _rounded_rectangle(half: Float64Array, radii: list[float]) -> Outline:
    """Return a rectangle with a radius at each corner, counter-clockwise from the first quadrant on."""
    points: list[tuple[float, float]] = []
    bulges: list[float] = []
    quarter = float(np.tan(np.pi / 8.0))
    for (sx, sy), radius in zip(((1, 1), (-1, 1), (-1, -1), (1, -1)), radii, strict=True):
        x, y = sx * half[0], sy * half[1]
        ends = [(x, y - sy * radius), (x - sx * radius, y)]
        if not radius:
            ends = ends[:1]
        elif sx * sy < 0:
            ends.reverse()
        points += ends
        bulges += [quarter, 0.0] if radius else [0.0]
    return Outline.arcs(points, bulges)
