"""Decals that follow an edited node of a tree: how far each moves, and its point on the new surface."""

from weakref import WeakKeyDictionary

import numpy as np

from blobtree import ISO, Node
from blobtree._typing import Float32Array, Float64Array, IndexArray, Int64Array
from blobtree.lazy import Lazy
from blobtree.nodes.paths import Path, inside_support, moved, node_at, node_in_world, with_node, world_box
from blobtree.nodes.places import Place, mirror_maps
from decals.editing.document import Document, ForkFamily
from decals.editing.queries import SurfacePoints, nearest_points
from decals.scenes.objects import SceneObject, TreeObject
from decals.surfaces.implicit import project_without_mesh

DIFFERENCE_STEP = 2.5e-4
"""Step of the finite differences with respect to the node's position, in widths of its box."""

UNKNOWN_OBJECT = -2
"""Mark of a decal whose object was not looked up yet."""

FIELD_TOLERANCE = 1e-5
"""A decal stays where it is while the field there differs from ISO by at most so much."""

DragKey = tuple[tuple[SceneObject, ...], int, Path]
"""Objects, the index of one of them, and the path of a node in its tree."""


def followers(
    document: Document, number: int, path: Path, item: TreeObject, offset: Float64Array
) -> tuple[Int64Array, SurfacePoints]:
    """Return the decals that move when an object gets another tree, and their new points.

    Parameters
    ----------
    document
        The state before.
    number
        Index of the object.
    path
        Path of the node that differs in ``item``.
    item
        The object with its new tree.
    offset
        Displacement of the node in the world, shape (3,), or the affine map of its points, shape (4, 4).

    Returns
    -------
    numbers : int64, shape (n,)
        Numbers of the decals that move.
    points : SurfacePoints
        Their points on the new surface.
    """
    before = document.objects[number]
    assert isinstance(before, TreeObject)
    tree = before.tree
    numbers, decals = document.decals.numbers, document.decals.decals
    anchor = _drag_anchor(document, (document.objects, number, path), tree, decals.positions)
    near = np.flatnonzero(
        inside_support(decals.positions, node_in_world(tree, path), node_in_world(item.tree, path))
    )
    rows = anchor.on_object(near) if len(near) else near
    positions = decals.positions[rows].astype(np.float64)
    shift = _displacements(anchor, rows, positions, offset)
    targets = positions + shift
    moves = shift.any(axis=1) | (np.abs(item.tree(targets) - ISO) > FIELD_TOLERANCE)
    if not moves.any():  # nothing to compute, or to compile
        none = np.zeros((0, 3), np.float32)
        return numbers[:0], SurfacePoints(none, none, np.zeros(0, np.int32))
    projected = project_without_mesh(item.tree, targets[moves])
    if projected is None:
        projected = item.surface.project(targets[moves])
    positions_after, normals_after = projected
    objects_after = np.full(int(moves.sum()), number, np.int32)
    return numbers[rows[moves]], SurfacePoints(positions_after, normals_after, objects_after)


def _displacements(
    anchor: "DragAnchor", rows: IndexArray, positions: Float64Array, offset: Float64Array
) -> Float64Array:
    """Return how far decals follow the node, or the mirror image of it that they lie on."""
    if not offset.any():
        return np.zeros((len(rows), 3))
    matrix = offset
    if offset.ndim == 1:
        matrix = np.eye(4)
        matrix[:3, 3] = offset
    weights = anchor.weights[:, rows]
    nearest = weights.argmax(axis=0)
    result = np.zeros((len(rows), 3))
    for number, image in enumerate(anchor.images):
        change = image @ matrix @ np.linalg.inv(image) - np.eye(4)
        chosen = nearest == number
        moved_by = positions[chosen] @ change[:3, :3].T + change[:3, 3]
        result[chosen] = weights[number, chosen, None] * moved_by
    return result


class DragAnchor:
    """Results of the state in which a drag began, computed once for all its steps."""

    def __init__(self, key: DragKey, tree: Node, positions: Float32Array) -> None:
        self._key, self._tree, self._positions = key, tree, positions
        self._objects = np.full(len(positions), UNKNOWN_OBJECT, np.int32)

    def matches(self, key: DragKey, positions: Float32Array) -> bool:
        """Return True if the anchor belongs to this node and these decal positions."""
        return self._key == key and np.array_equal(self._positions, positions)

    def on_object(self, rows: IndexArray) -> IndexArray:
        """Return those of some decals that lie on the object."""
        objects, number, _ = self._key
        unknown = rows[self._objects[rows] == UNKNOWN_OBJECT]
        self._objects[unknown] = nearest_points(objects, self._positions[unknown]).objects
        result: IndexArray = rows[self._objects[rows] == number]
        return result

    @Lazy
    def images(self) -> list[Float64Array]:
        """Return the maps from the node in the world to itself and to its mirror images."""
        return mirror_maps(self._tree, self._key[2])

    @Lazy
    def weights(self) -> Float64Array:
        """Part of the displacement of each image that each decal follows, shape (images, n).

        It is 0 outside the support of the node and its images.
        """
        _, _, path = self._key
        shifted = [node_in_world(tree, path) for pair in _shifted_trees(self._tree, path)[1] for tree in pair]
        near = inside_support(self._positions, *shifted)
        weights = np.zeros((len(self.images), len(near)))
        points = self._positions[near].astype(np.float64)
        turns = np.stack([image[:3, :3] for image in self.images])
        weights[:, near] = following_weights(self._tree, path, points, turns)
        return weights


_anchors: WeakKeyDictionary[ForkFamily, DragAnchor] = WeakKeyDictionary()


def _drag_anchor(document: Document, key: DragKey, tree: Node, positions: Float32Array) -> DragAnchor:
    """Return the anchor of the last step of the drag if it matches, else a new one."""
    anchor = _anchors.get(document.family)
    if anchor is None or not anchor.matches(key, positions):
        anchor = _anchors[document.family] = DragAnchor(key, tree, positions)
    return anchor


def following_weights(tree: Node, path: Path, points: Float64Array, turns: Float64Array) -> Float64Array:
    """Return the part of an image's displacement that the surface follows at each point, from 0 to 1.

    With f the field and t the position of the node, the surface moves along its normal n by −(∂f/∂t)/|∇f|. A
    rigid motion would move it by n. The weight is the component of the first along the second. The image of
    the node under the linear map C moves by C t, so that C n takes the place of n.

    Parameters
    ----------
    tree, path
        The tree, and the path of the node.
    points
        Points of the surface, shape (n, 3).
    turns
        The linear maps from the node to its images, shape (k, 3, 3).

    Returns
    -------
    float64, shape (k, n)
    """
    if not len(points):
        return np.zeros((len(turns), 0))
    step, pairs = _shifted_trees(tree, path)
    change = np.stack([ahead(points) - behind(points) for ahead, behind in pairs], axis=1) / (2.0 * step)
    slope = tree.gradient(points).astype(np.float64)
    squared = np.einsum("ni,ni->n", slope, slope)
    ratios = -np.einsum("ni,kji,nj->kn", change, turns, slope) / np.where(squared > 0, squared, 1.0)
    weights: Float64Array = np.clip(ratios, 0.0, 1.0)
    return weights


def _shifted_trees(tree: Node, path: Path) -> tuple[float, list[tuple[Node, Node]]]:
    """Return a small step, and for each world axis the trees with the node moved ahead and back by it."""
    low, high = world_box(tree, path)
    step = DIFFERENCE_STEP * float((high - low).min())
    place = Place(tree, path)

    def with_moved(offset: Float64Array) -> Node:
        return with_node(tree, path, moved(node_at(tree, path), offset))

    offsets = [place.moved(axis) for axis in step * np.eye(3)]
    return step, [(with_moved(offset), with_moved(-offset)) for offset in offsets]
