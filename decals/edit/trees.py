"""Nodes of a tree: finding them by path, moving and exchanging them."""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import Cone, Node, Point, Segment
from blobtree.nodes.primitives import Primitive
from blobtree.nodes.tree import Combination, Transform
from decals.checks import instance, shown, triple
from decals.errors import InvalidEdit
from decals.surfaces.surface import Floats, as_points

Path = tuple[int, ...]
"""Which child to take, from the root down."""

Doubles = NDArray[np.float64]

_PLACES = {Point: ("center",), Segment: ("start", "end"), Cone: ("start", "end")}
"""Parameters of primitives that move along with them; other nodes are wrapped in a map."""


def primitive_paths(tree: Node) -> list[Path]:
    """Paths of all primitives, from the first to the last."""
    instance("tree", tree, Node, InvalidEdit, "give the tree of a TreeObject")
    found: list[Path] = []
    pending: list[tuple[Path, Node]] = [((), tree)]
    while pending:
        path, node = pending.pop()
        if isinstance(node, Primitive):
            found.append(path)
        pending.extend(((*path, i), child) for i, child in reversed(list(enumerate(node.children))))
    return found


def down(tree: Node, path: Path) -> Iterator[Node]:
    """Nodes from the root to the one that a path leads to."""
    node = tree
    yield node
    if not isinstance(path, Sequence):
        raise InvalidEdit(f"expected a path through the tree, such as (0, 1), got {shown(path)}")
    for step in path:
        if not isinstance(step, int | np.integer) or not 0 <= step < len(node.children):
            raise InvalidEdit(f"expected a path through the tree, got {path}; {step} is no child there")
        node = node.children[step]
        yield node


def node_at(tree: Node, path: Path) -> Node:
    """Give the node that a path leads to, or `InvalidEdit`."""
    *_, node = down(tree, path)
    return node


def primitive_at(tree: Node, path: Path) -> Primitive:
    """Give the primitive at the end of a path, past affine maps, or `InvalidEdit`."""
    node = node_at(tree, to_primitive(tree, path))
    assert isinstance(node, Primitive)
    return node


def to_primitive(tree: Node, path: Path) -> Path:
    """Lengthen a path through affine maps to the primitive below them, or `InvalidEdit`."""
    node = node_at(tree, path)
    while isinstance(node, Transform):
        path, node = (*path, 0), node.child
    if not isinstance(node, Primitive):
        raise InvalidEdit(f"expected the path of a primitive, {path} leads to a {type(node).__name__}")
    return path


def primitive_near(tree: Node, point: ArrayLike) -> Path:
    """Path of the primitive whose field is the highest at a point; the first of equals."""
    place = as_points(triple("point", point, InvalidEdit)[None])
    return max(primitives_around(tree, place), key=lambda path: float(alone(tree, path)(place)[0]))


def primitives_around(tree: Node, place: Floats) -> list[Path]:
    """Paths of the primitives whose boxes hold a place ``float32[1, 3]``, or of all where none does."""
    paths = primitive_paths(tree)
    return [path for path in paths if within(place, alone(tree, path))[0]] or paths


def with_node(tree: Node, path: Path, node: Node) -> Node:
    """Give the tree with another node at the end of a path."""
    above = list(down(tree, path))[:-1]
    for parent, step in zip(reversed(above), reversed(path), strict=True):
        node = _with_child(parent, step, node)
    return node


def _with_child(parent: Node, step: int, child: Node) -> Node:
    """Exchange one child of a node, whichever of its fields holds it."""
    count = 0
    for field in fields(parent):  # type: ignore[arg-type]  # every node is a dataclass
        value = getattr(parent, field.name)
        held = value if isinstance(value, tuple) else (value,)
        if not held or not isinstance(held[0], Node):
            continue
        if step < count + len(held):
            news = (*held[: step - count], child, *held[step - count + 1 :])
            return replace(parent, **{field.name: news if isinstance(value, tuple) else child})  # type: ignore[type-var]
        count += len(held)
    raise InvalidEdit(f"a {type(parent).__name__} has no child {step}")


def alone(tree: Node, path: Path) -> Node:
    """Give the node at a path as it lies in the world, without what it is combined with."""
    nodes = list(down(tree, path))
    result = nodes[-1]
    for parent, step in zip(reversed(nodes[:-1]), reversed(path), strict=True):
        if not isinstance(parent, Combination):
            result = _with_child(parent, step, result)
    return result


def within(points: NDArray[np.float32], *nodes: Node) -> NDArray[np.bool_]:
    """Whether each point is where one of the nodes has a field."""
    inside = np.zeros(len(points), np.bool_)
    for node in nodes:
        low, high = node.bounds
        inside |= ((points >= low) & (points <= high)).all(axis=1)
    return inside


def world_matrix(tree: Node, path: Path) -> Doubles:
    """Linear part of the map from a primitive's own space to the world, ``float64[3, 3]``.

    Raises
    ------
    InvalidEdit
        The primitive lies below a warp, where that differs from place to place.
    """
    matrix = np.eye(3)
    for node in list(down(tree, path))[:-1]:
        if isinstance(node, Transform):
            matrix = matrix @ np.asarray(node.matrix, np.float64)[:3, :3]
        elif hasattr(node, "warp"):
            raise InvalidEdit(f"the primitive lies below a {type(node).__name__}; move that as a whole")
    return matrix


def moved(node: Node, offset: ArrayLike) -> Node:
    """Give a node moved in the space around it; it stays of its kind if its kind says where it is."""
    shift = np.asarray(offset, np.float64)
    if isinstance(node, Transform):
        matrix = np.array(node.matrix, np.float64)
        matrix[:3, 3] += shift
        return node.child.transform(matrix)
    points = {
        name: tuple((np.asarray(getattr(node, name)) + shift).tolist())
        for name in _PLACES.get(type(node), ())
    }
    return replace(node, **points) if points else node.translate(shift)  # type: ignore[type-var]


def resized(primitive: Primitive, factor: float) -> Primitive:
    """Give a primitive whose radii are larger by a factor."""
    radii = {
        field.name: factor * getattr(primitive, field.name)
        for field in fields(primitive)  # type: ignore[arg-type]  # every node is a dataclass
        if field.name == "radius" or field.name.endswith("_radius")
    }
    return replace(primitive, **radii)  # type: ignore[type-var]
