"""Decals that follow a node of a tree: how far each goes along, and where it ends on the new surface."""

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from blobtree import ISO, Node
from blobtree.lazy import Lazy
from decals.edit.document import Document, Lineage
from decals.edit.places import Places, nearest
from decals.edit.trees import Doubles, Path, alone, moved, node_at, with_node, within, world_matrix
from decals.scenes.scene import SceneObject, TreeObject
from decals.surfaces.implicit import straight_onto
from decals.surfaces.surface import Floats

STEP = 2.5e-4
"""Of the differences that tell how the surface follows a node, in lengths of its box."""

UNKNOWN = -2
"""Nobody has asked yet which object a decal lies on."""

FIELD_ERROR = 1e-5
"""A decal stays where it is as long as the field there is no farther from ISO."""


def followers(
    document: Document, number: int, path: Path, item: TreeObject, offset: Doubles
) -> tuple[NDArray[np.int64], Places]:
    """Decals that object ``number`` carries along when it becomes another tree, and where to.

    Parameters
    ----------
    document
        What there is before.
    number
        Of the object.
    path
        Of the node in its tree that is another in ``item``.
    item
        What the object becomes.
    offset
        How far the node was moved in the world, ``float64[3]``.

    Returns
    -------
    int64[n], Places
        Numbers of the decals that have to move, and their places on the new surface.
    """
    held = document.objects[number]
    assert isinstance(held, TreeObject)
    before = held.tree
    numbers, decals = document.decals.numbers, document.decals.decals
    start = _start_of(document, (document.objects, number, path), before, decals.positions)
    rows = start.own(np.flatnonzero(within(decals.positions, alone(before, path), alone(item.tree, path))))
    positions = decals.positions[rows].astype(np.float64)
    weights = start.weights[rows] if offset.any() else np.zeros(len(rows))
    wished = positions + weights[:, None] * offset
    changed = (weights * np.linalg.norm(offset) > 0) | (np.abs(item.tree(wished) - ISO) > FIELD_ERROR)
    goal = straight_onto(item.tree, wished[changed])
    if goal is None:
        goal = item.surface.project(wished[changed])
    goal_positions, goal_normals = goal
    goals = np.full(int(changed.sum()), number, np.int32)
    return numbers[rows[changed]], Places(goal_positions, goal_normals, goals)


Asked = tuple[tuple[SceneObject, ...], int, Path]
"""Objects, the number of one of them, and the path of a node in its tree."""


class Start:
    """What every step of a drag asks of the decals where the drag began: it is worked out once."""

    def __init__(self, asked: Asked, tree: Node, positions: Floats) -> None:
        self._asked, self._tree, self._positions = asked, tree, positions
        self._owners = np.full(len(positions), UNKNOWN, np.int32)

    def same(self, asked: Asked, positions: Floats) -> bool:
        """Whether this is about that node, and decals at these places."""
        return self._asked == asked and np.array_equal(self._positions, positions)

    def own(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Those of some decals that lie on the object."""
        objects, number, _ = self._asked
        news = rows[self._owners[rows] == UNKNOWN]
        self._owners[news] = nearest(objects, self._positions[news]).objects
        owned: NDArray[np.intp] = rows[self._owners[rows] == number]
        return owned

    @Lazy
    def weights(self) -> Doubles:
        """How far each decal goes along with the node; not at all beyond its reach."""
        _, _, path = self._asked
        around = [alone(tree, path) for pair in _shifted(self._tree, path)[1] for tree in pair]
        near = within(self._positions, *around)
        weights = np.zeros(len(near))
        weights[near] = following(self._tree, path, self._positions[near].astype(np.float64))
        return weights


_starts: WeakKeyDictionary[Lineage, Start] = WeakKeyDictionary()


def _start_of(document: Document, asked: Asked, tree: Node, positions: Floats) -> Start:
    """Give where a drag began, the same as for its last step where nothing else happened."""
    start = _starts.get(document.lineage)
    if start is None or not start.same(asked, positions):
        start = _starts[document.lineage] = Start(asked, tree, positions)
    return start


def following(tree: Node, path: Path, points: Doubles) -> Doubles:
    """How far the surface at each point goes along with a node, from 0 to 1.

    Where fields blend, a node moves the surface by its part of the field's change: with f the field
    and t the node's position, the surface moves along its normal n by −(∂f/∂t)/|∇f|, a rigid one by n.
    """
    if not len(points):
        return np.zeros(0)
    step, pairs = _shifted(tree, path)
    change = np.stack([ahead(points) - behind(points) for ahead, behind in pairs], axis=1) / (2.0 * step)
    slope = tree.gradient(points).astype(np.float64)
    squared = np.einsum("ni,ni->n", slope, slope)
    shares = -np.einsum("ni,ni->n", change, slope) / np.where(squared > 0, squared, 1.0)
    weights: Doubles = np.clip(shares, 0.0, 1.0)
    return weights


def _shifted(tree: Node, path: Path) -> tuple[float, list[tuple[Node, Node]]]:
    """A small step, and trees with the node moved by it: ahead and back along each axis of the world."""
    low, high = alone(tree, path).bounds
    step = STEP * float((high - low).min())
    inverse = np.linalg.inv(world_matrix(tree, path))

    def with_moved(offset: Doubles) -> Node:
        return with_node(tree, path, moved(node_at(tree, path), offset))

    offsets = [inverse @ axis for axis in step * np.eye(3)]
    return step, [(with_moved(offset), with_moved(-offset)) for offset in offsets]
