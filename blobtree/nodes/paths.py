"""Paths through a tree: find nodes by path, place them in the world, move, resize and replace them."""

import reprlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.node import Node
from blobtree.nodes.numeric_parameters import nodes_with_paths
from blobtree.nodes.primitives import Cone, Leaf, Point, Segment
from blobtree.nodes.tree import Transform
from blobtree.nodes.values import operands_of
from blobtree.tape.bounds import is_endless
from blobtree.tape.model import checked_tree

_RADII = (Quantity.RADIUS, Quantity.SEMI_AXES, Quantity.RADII)
_LENGTHS = (Quantity.LENGTH, Quantity.EXTENTS)

SIMILARITY_TOLERANCE = 1e-9
"""Relative error of a matrix that still counts as one without shear."""

Path = tuple[int, ...]
"""Indices of children, from the root down."""


def primitive_paths(tree: Node) -> list[Path]:
    """Return the paths of all primitives, from left to right."""
    checked_tree(tree)
    return [path for path, node in nodes_with_paths(tree) if isinstance(node, Leaf)]


def nodes_along(tree: Node, path: Path) -> Iterator[Node]:
    """Yield the nodes from the root to the end of a path; raise `InvalidNode` where a child is missing."""
    node = tree
    yield node
    if not isinstance(path, Sequence):
        raise InvalidNode(f"expected a path through the tree, such as (0, 1), got {reprlib.repr(path)}")
    for step in path:
        if not isinstance(step, int | np.integer) or not 0 <= step < len(node.children):
            raise InvalidNode(f"expected a path through the tree, got {path}; {step} is no child there")
        node = node.children[step]
        yield node


def node_at(tree: Node, path: Path) -> Node:
    """Return the node at the end of a path; raise `InvalidNode` if the tree has no such path."""
    *_, node = nodes_along(tree, path)
    return node


def primitive_at(tree: Node, path: Path) -> Leaf:
    """Return the primitive at the end of a path, below any maps there; raise `InvalidNode` otherwise."""
    node = node_at(tree, primitive_path(tree, path))
    assert isinstance(node, Leaf)
    return node


def primitive_path(tree: Node, path: Path) -> Path:
    """Lengthen a path through maps to the primitive below them; raise `InvalidNode` otherwise."""
    node = node_at(tree, path)
    while isinstance(node, Transform):
        path, node = (*path, 0), node.child
    if not isinstance(node, Leaf):
        raise InvalidNode(f"expected the path of a primitive, {path} leads to a {type(node).__name__}")
    return path


def primitives_around(tree: Node, point: Float32Array) -> list[Path]:
    """Return the paths of the primitives whose boxes hold a point float32[1, 3]; of all if no box does."""
    paths = primitive_paths(tree)
    return [path for path in paths if inside_support(point, node_in_world(tree, path))[0]] or paths


def with_node(tree: Node, path: Path, node: Node) -> Node:
    """Return the tree with `node` in place of the node at the end of a path."""
    above = list(nodes_along(tree, path))[:-1]
    for parent, step in zip(reversed(above), reversed(path), strict=True):
        node = _with_child(parent, step, node)
    return node


def _with_child(parent: Node, step: int, child: Node) -> Node:
    """Return `parent` with `child` in place of its child number `step`."""
    first = 0
    for name, operands in operands_of(parent).items():
        if step < first + len(operands):
            replaced = (*operands[: step - first], child, *operands[step - first + 1 :])
            several = isinstance(getattr(parent, name), tuple)
            return replace(parent, **{name: replaced if several else child})  # type: ignore[type-var]  # every node is a dataclass
        first += len(operands)
    raise InvalidNode(f"a {type(parent).__name__} has no child {step}")


def node_in_world(tree: Node, path: Path) -> Node:
    """Return the node at a path under the maps, offsets and warps above it, without what it combines with."""
    nodes = list(nodes_along(tree, path))
    result = nodes[-1]
    for parent, step in zip(reversed(nodes[:-1]), reversed(path), strict=True):
        if not parent.combines:
            result = _with_child(parent, step, result)
    return result


def world_box(tree: Node, path: Path) -> tuple[Float32Array, Float32Array]:
    """Return the corners of the box around the node at a path in the world; the tree's if it has no end."""
    box = node_in_world(tree, path).field_box
    return tree.support if is_endless(box) else box


def ended_box(node: Node) -> tuple[Float32Array, Float32Array]:
    """Return the corners of the box around a node; for an endless one, around the node that it repeats."""
    box = node.field_box
    return ended_box(node.children[0]) if is_endless(box) else box


def inside_support(points: Float32Array, *nodes: Node) -> BoolArray:
    """Return True for each of the points (n, 3) that lies in the support of one of the nodes."""
    inside = np.zeros(len(points), np.bool_)
    for node in nodes:
        lower, upper = node.field_box
        inside |= ((points >= lower) & (points <= upper)).all(axis=1)
    return inside


def world_matrix(tree: Node, path: Path) -> Float64Array:
    """Return the linear part, float64[3, 3], of the map from a node's own space to the world.

    Raises
    ------
    InvalidNode
        The node lies below a warp, where the map differs from point to point.
    """
    return world_transform(tree, path)[:3, :3]


def world_transform(tree: Node, path: Path) -> Float64Array:
    """Return the map, float64[4, 4], from a node's own space to the world; errors as `world_matrix`."""
    return common_transform(list(nodes_along(tree, path))[:-1], "primitive")


def common_transform(nodes: Iterable[Node], what: str) -> Float64Array:
    """Return the map, float64[4, 4], of nodes one below the other; `what` lies below them, for errors."""
    matrix = np.eye(4)
    for node in nodes:
        if isinstance(node, Transform):
            matrix = matrix @ square_matrix(node.matrix)
        elif node.warp is not None:
            raise InvalidNode(f"the {what} lies below a {type(node).__name__}; move that as a whole")
    return matrix


def square_matrix(matrix: ArrayLike) -> Float64Array:
    """Return an affine map, shape (3, 4) or (4, 4), as float64[4, 4]."""
    return np.vstack([np.asarray(matrix, np.float64)[:3], (0.0, 0.0, 0.0, 1.0)])


def mapped(node: Node, change: ArrayLike) -> Node:
    """Return a node under an affine map, float64[4, 4], of its own space.

    A point, segment or cone that is moved, turned, mirrored or scaled as a whole stays of its kind.
    """
    matrix = square_matrix(change)
    if isinstance(node, Transform):
        return node.child.transform(matrix @ square_matrix(node.matrix))
    square = matrix[:3, :3] @ matrix[:3, :3].T
    scale = float(np.sqrt(square[0, 0]))
    similar = np.allclose(square, scale**2 * np.eye(3), rtol=0.0, atol=SIMILARITY_TOLERANCE * scale**2)
    if not (similar and isinstance(node, Point | Segment | Cone)):
        return node.transform(matrix)
    rigid = abs(scale - 1.0) < SIMILARITY_TOLERANCE
    changed: dict[str, Any] = {}
    for name, parameter in parameters_of(type(node)).items():
        value = getattr(node, name)
        if parameter.quantity is Quantity.POINT:
            changed[name] = tuple((matrix[:3, :3] @ value + matrix[:3, 3]).tolist())
        elif parameter.quantity in (Quantity.RADIUS, Quantity.WIDTH) and value is not None and not rigid:
            changed[name] = scale * value
    return replace(node, **changed)


def moved(node: Node, offset: ArrayLike) -> Node:
    """Return a node moved by `offset` (3,) in its own space; a primitive with points stays of its kind."""
    shift = np.asarray(offset, np.float64)
    if isinstance(node, Transform):
        matrix = np.array(node.matrix, np.float64)
        matrix[:3, 3] += shift
        return node.child.transform(matrix)
    points = {
        name: (np.asarray(getattr(node, name)) + shift).tolist()
        for name, parameter in parameters_of(type(node)).items()
        if parameter.quantity in (Quantity.POINT, Quantity.POINTS)
    }
    return replace(node, **points) if points else node.translate(shift)  # type: ignore[type-var]  # every node is a dataclass


def resized(primitive: Leaf, factor: float) -> Leaf:
    """Return a leaf whose visible radii are larger by a factor, or all lengths if it has no radii."""
    parameters = parameters_of(type(primitive)).items()
    radii = [name for name, parameter in parameters if parameter.quantity in _RADII]
    lengths = [name for name, parameter in parameters if parameter.quantity in _LENGTHS]
    sizes: dict[str, Any] = {}
    for name in radii or lengths:
        value = getattr(primitive, name)
        vector = isinstance(value, tuple)
        sizes[name] = tuple(factor * component for component in value) if vector else factor * value
    return replace(primitive, **sizes)
