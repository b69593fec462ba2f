"""Primitives of a tree: finding them by path, moving and changing them, and decals that follow."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import ISO, Cone, Node, Point, Segment
from blobtree.nodes.primitives import Primitive
from blobtree.nodes.tree import Combination, Transform
from decals.checks import finite, instance, shown, triple
from decals.edit.change import Change
from decals.edit.document import Document
from decals.edit.places import Places, carried, nearest
from decals.errors import InvalidEdit
from decals.scenes.scene import TreeObject
from decals.surfaces.implicit import straight_onto
from decals.surfaces.surface import as_points

Path = tuple[int, ...]
"""Which child to take, from the root down."""

Doubles = NDArray[np.float64]

_PLACES = {Point: ("center",), Segment: ("start", "end"), Cone: ("start", "end")}
"""Parameters of primitives that move along with them; other nodes are wrapped in a map."""

STEP = 2.5e-4
"""Of the differences that tell how the surface follows a node, in lengths of its box."""

FIELD_ERROR = 1e-5
"""A decal stays where it is as long as the field there is no farther from ISO."""


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


def _down(tree: Node, path: Path) -> Iterator[Node]:
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
    *_, node = _down(tree, path)
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
    paths = primitive_paths(tree)
    near = [path for path in paths if _within(place, alone(tree, path))[0]] or paths
    return max(near, key=lambda path: float(alone(tree, path)(place)[0]))


def with_node(tree: Node, path: Path, node: Node) -> Node:
    """Give the tree with another node at the end of a path."""
    above = list(_down(tree, path))[:-1]
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
    nodes = list(_down(tree, path))
    result = nodes[-1]
    for parent, step in zip(reversed(nodes[:-1]), reversed(path), strict=True):
        if not isinstance(parent, Combination):
            result = _with_child(parent, step, result)
    return result


def world_matrix(tree: Node, path: Path) -> Doubles:
    """Linear part of the map from a primitive's own space to the world, ``float64[3, 3]``.

    Raises
    ------
    InvalidEdit
        The primitive lies below a warp, where that differs from place to place.
    """
    matrix = np.eye(3)
    for node in list(_down(tree, path))[:-1]:
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


@dataclass(frozen=True, eq=False)
class OfPrimitive:
    """A command for a primitive of a tree: the object's number, and the path to it."""

    object: int
    path: Path

    def tree(self, document: Document) -> Node:
        """The object's tree, or `InvalidEdit`."""
        item = document.object(self.object)
        if not isinstance(item, TreeObject):
            raise InvalidEdit(f"expected a BlobTree, object {item.name!r} is a mesh")
        return item.tree

    def exchanged(
        self, document: Document, node: Node, offset: ArrayLike = (0.0, 0.0, 0.0), *, quick: bool = False
    ) -> Change:
        """Put another node in place of the primitive; decals follow, with the offset as far as it counts."""
        before = self.tree(document)
        after = with_node(before, self.path, node)
        item = TreeObject(document.objects[self.object].name, after)
        if not quick:
            item.surface  # noqa: B018  # refuses a tree that shows nothing, before anything changes
        objects = (*document.objects[: self.object], item, *document.objects[self.object + 1 :])
        numbers, places = _followers(document, self, item, np.asarray(offset, np.float64))
        followed = carried(document.decals.take(numbers), places)
        return document.with_decals(numbers, followed, objects=objects)


def _followers(
    document: Document, edited: OfPrimitive, item: TreeObject, offset: Doubles
) -> tuple[NDArray[np.int64], Places]:
    """Decals that a changed tree carries along, and where to."""
    before = edited.tree(document)
    numbers, decals = document.decals.numbers, document.decals.decals
    rows = np.flatnonzero(
        _within(decals.positions, alone(before, edited.path), alone(item.tree, edited.path))
    )
    places = nearest(document.objects, decals.positions[rows])
    rows = rows[places.objects == edited.object]
    positions = decals.positions[rows].astype(np.float64)
    weights = (
        _kept_following(before, tuple(edited.path), positions.tobytes())
        if offset.any()
        else np.zeros(len(rows))
    )
    wished = positions + weights[:, None] * offset
    changed = (weights * np.linalg.norm(offset) > 0) | (np.abs(item.tree(wished) - ISO) > FIELD_ERROR)
    goal = straight_onto(item.tree, wished[changed])
    if goal is None:
        goal = item.surface.project(wished[changed])
    goal_positions, goal_normals = goal
    goals = np.full(int(changed.sum()), edited.object, np.int32)
    return numbers[rows[changed]], Places(goal_positions, goal_normals, goals)


def _within(points: NDArray[np.float32], *nodes: Node) -> NDArray[np.bool_]:
    """Whether each point is where one of the nodes has a field."""
    inside = np.zeros(len(points), np.bool_)
    for node in nodes:
        low, high = node.bounds
        inside |= ((points >= low) & (points <= high)).all(axis=1)
    return inside


def following(tree: Node, path: Path, points: Doubles) -> Doubles:
    """How far the surface at each point goes along with a node, from 0 to 1.

    Where fields blend, a node moves the surface by its part of the field's change: with f the field
    and t the node's position, the surface moves along its normal n by −(∂f/∂t)/|∇f|, a rigid one by n.
    """
    if not len(points):
        return np.zeros(0)
    low, high = alone(tree, path).bounds
    step = STEP * float((high - low).min())
    inverse = np.linalg.inv(world_matrix(tree, path))
    offsets = [inverse @ axis for axis in step * np.eye(3)]
    differences = [_shifted(tree, path, way)(points) - _shifted(tree, path, -way)(points) for way in offsets]
    change = np.stack(differences, axis=1) / (2.0 * step)
    slope = tree.gradient(points).astype(np.float64)
    squared = np.einsum("ni,ni->n", slope, slope)
    shares = -np.einsum("ni,ni->n", change, slope) / np.where(squared > 0, squared, 1.0)
    weights: Doubles = np.clip(shares, 0.0, 1.0)
    return weights


@lru_cache(maxsize=1)
def _kept_following(tree: Node, path: Path, points: bytes) -> Doubles:
    """`following` of float64 points; every step of a drag asks it of where the drag began."""
    weights = following(tree, path, np.frombuffer(points).reshape(-1, 3))
    weights.flags.writeable = False
    return weights


def _shifted(tree: Node, path: Path, offset: Doubles) -> Node:
    return with_node(tree, path, moved(node_at(tree, path), offset))


@dataclass(frozen=True, eq=False)
class MovePrimitive(OfPrimitive):
    """Move a primitive, or a whole branch, by an offset in the world; decals go along with their surface.

    A ``quick`` one makes no surface of the tree where it can do without, so it may leave one that shows too
    little to lay decals on: whoever moves again and again asks for the surface in the end.
    """

    offset: ArrayLike
    quick: bool = False
    label: ClassVar[str] = "move a primitive"

    def change(self, document: Document) -> Change:
        """Exchange the tree, and carry the decals that it moves."""
        tree = self.tree(document)
        offset = triple("offset", self.offset, InvalidEdit)
        own = np.linalg.solve(world_matrix(tree, self.path), offset)
        node = moved(node_at(tree, self.path), own)
        return self.exchanged(document, node, offset, quick=self.quick)


@dataclass(frozen=True, eq=False)
class ResizePrimitive(OfPrimitive):
    """Make a primitive thicker, or thinner for a factor below 1; decals stay on the surface."""

    factor: float
    label: ClassVar[str] = "resize a primitive"

    def change(self, document: Document) -> Change:
        """Exchange the tree, and put the decals back onto it."""
        factor = finite("factor", self.factor, InvalidEdit)
        if factor <= 0:
            raise InvalidEdit(f"factor: expected a number above 0, got {factor}")
        tree = self.tree(document)
        whole = replace(self, path=to_primitive(tree, self.path))
        return whole.exchanged(document, resized(primitive_at(tree, self.path), factor))


@dataclass(frozen=True, eq=False)
class PaintPrimitive(OfPrimitive):
    """Give a primitive another colour, three numbers in [0, 1]."""

    color: Any
    label: ClassVar[str] = "paint a primitive"

    def change(self, document: Document) -> Change:
        """Exchange the tree; its shape stays."""
        tree = self.tree(document)
        path = to_primitive(tree, self.path)
        primitive = replace(primitive_at(tree, path), color=self.color)  # type: ignore[type-var]
        item = TreeObject(document.objects[self.object].name, with_node(tree, path, primitive))
        objects = (*document.objects[: self.object], item, *document.objects[self.object + 1 :])
        return document.with_parts(objects=objects)
