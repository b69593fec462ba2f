"""Shapes of trees: primitives more and less, copies, and other ways to join; decals go along."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree import ISO, Difference, Intersection, Node, Ricci, Sum, Union
from blobtree.nodes.tree import Combination, Transform
from decals.checks import instance, member, triple
from decals.edit.change import Change
from decals.edit.document import Document
from decals.edit.primitives import OfPrimitive
from decals.edit.trees import (
    Path,
    down,
    moved,
    node_at,
    primitive_at,
    primitives_around,
    resized,
    with_node,
    world_matrix,
)
from decals.errors import InvalidEdit
from decals.scenes.scene import SceneObject, TreeObject
from decals.surfaces.surface import as_points

SOFTNESS = 3.0
"""Exponent of Ricci's blend where `Join.SOFT` makes one: about half way from a blend to a union."""


GROWTH = 1e-3
"""Part of its radius by which a primitive grows to see what that does."""


class Join(Enum):
    """How a part of a tree joins what is beside it."""

    BLEND = "blend"
    SOFT = "soft union"
    UNION = "union"
    INTERSECTION = "intersection"
    DIFFERENCE = "difference"


_KINDS: dict[type[Node], Join] = {
    Sum: Join.BLEND,
    Ricci: Join.SOFT,
    Union: Join.UNION,
    Intersection: Join.INTERSECTION,
    Difference: Join.DIFFERENCE,
}


def combined(join: Join, first: Node, second: Node) -> Node:
    """Two nodes as one; a difference takes the second away."""
    match join:
        case Join.BLEND:
            return Sum((first, second))
        case Join.SOFT:
            return Ricci((first, second), exponent=SOFTNESS)
        case Join.UNION:
            return Union((first, second))
        case Join.INTERSECTION:
            return Intersection((first, second))
        case Join.DIFFERENCE:
            return Difference(first, second)


def joined(tree: Node, path: Path, node: Node, join: Join) -> tuple[Node, Path]:
    """Join a node to the one at a path: the tree with it, and the path of the new node.

    A combination of that kind takes it as one more operand, last.
    """
    first = node_at(tree, path)
    if _takes_more(first, join):
        return with_operand(tree, path, node)
    return with_node(tree, path, combined(join, first, node)), (*path, 1)


def with_operand(tree: Node, path: Path, node: Node) -> tuple[Node, Path]:
    """Give the combination at a path one more operand, last: the tree, and the path of the operand."""
    parent: Any = node_at(tree, path)
    more = replace(parent, operands=(*parent.operands, node))
    return with_node(tree, path, more), (*path, len(parent.operands))


def _takes_more(node: Node, join: Join) -> bool:
    """Whether joining one more is the same as an operand more."""
    alike = not isinstance(node, Ricci) or node.exponent == SOFTNESS
    return join is not Join.DIFFERENCE and _KINDS.get(type(node)) is join and alike


def without(tree: Node, path: Path) -> Node:
    """Give a tree without the branch at a path, and without what is nothing then.

    A combination of one is that one; a difference without its solid is nothing, as a map of nothing is.

    Raises
    ------
    InvalidEdit
        Nothing would be left.
    """
    *above, _ = down(tree, path)
    while above:
        parent, step, path = above.pop(), path[-1], path[:-1]
        if isinstance(parent, Combination) and not (isinstance(parent, Difference) and step == 0):
            rest = _rest(parent, step)
            if rest is not None:
                return with_node(tree, path, rest)
    raise InvalidEdit(
        "expected a part of a shape, got all that is to be seen of it; remove the object instead"
    )


def _rest(parent: Node, step: int) -> Node | None:
    """What a combination is without one of its children, if anything."""
    rest = (*parent.children[:step], *parent.children[step + 1 :])
    if len(rest) > 1:
        return replace(parent, operands=rest)  # type: ignore[type-var]  # every node is a dataclass
    return rest[0] if rest else None


def branch_of(tree: Node, path: Path) -> Path:
    """Shorten a path to what a combination has as its operand: maps above a primitive go with it."""
    *above, _ = down(tree, path)
    while above and not isinstance(above.pop(), Combination):
        path = path[:-1]
    return path


def in_world(tree: Node, path: Path) -> Path:
    """Shorten a path to the first node that is no combination: it lies in the world's own space."""
    for depth, node in enumerate(down(tree, path)):
        if not isinstance(node, Combination):
            return path[:depth]
    return path


def join_of(tree: Node, path: Path) -> Join | None:
    """How the branch at a path joins what is beside it; None for a way that is not one of `Join`.

    In a difference it is the tool that joins.
    """
    path = branch_of(tree, path)
    if not path or (join := _KINDS.get(type(node_at(tree, path[:-1])))) is None:
        return None
    return None if join is Join.DIFFERENCE and path[-1] == 0 else join


def primitive_shown(tree: Node, point: ArrayLike) -> Path:
    """Path of the primitive that shows at a point of the surface: if it grew, the field would change most.

    In a hole that is the tool of a difference, whose field is not the highest there.
    """
    place = as_points(triple("point", point, InvalidEdit)[None])
    before = float(tree(place)[0])

    def pull(path: Path) -> float:
        grown = with_node(tree, path, resized(primitive_at(tree, path), 1.0 + GROWTH))
        return abs(float(grown(place)[0]) - before)

    return max(primitives_around(tree, place), key=pull)


def same_structure(before: SceneObject, after: SceneObject) -> bool:
    """Whether paths lead to the same parts of two objects; maps that moves put around parts do not count."""
    return before is after or (
        isinstance(before, TreeObject)
        and isinstance(after, TreeObject)
        and before.name == after.name
        and _structure(before.tree) == _structure(after.tree)
    )


def _structure(tree: Node) -> list[tuple[type[Node], int]]:
    """Kinds of nodes and how many children they have, from the root down."""
    found: list[tuple[type[Node], int]] = []
    pending = [tree]
    while pending:
        node = pending.pop()
        if not isinstance(node, Transform):
            found.append((type(node), len(node.children)))
        pending.extend(reversed(node.children))
    return found


def reshaped(document: Document, number: int, tree: Node) -> Change:
    """Exchange the tree of an object. Decals on it go to the new surface, or with what they lay on.

    What is inside now comes up to the surface. What is outside comes down to it, if that is no farther than
    its radius; otherwise its ground was taken away, and it goes too.
    """
    change = OfPrimitive(number, ()).exchanged(document, tree)
    after = change.after
    before = document.decals.take(after.numbers)
    ways = np.linalg.norm(after.decals.positions.astype(np.float64) - before.positions, axis=1)
    groundless = (ways > before.radii) & (tree(before.positions) < ISO)
    return change.then(document.without(after.numbers[groundless])) if groundless.any() else change


@dataclass(frozen=True, eq=False)
class Reshaping(OfPrimitive):
    """A command that exchanges the tree of an object for one of another structure."""

    label: ClassVar[str]

    @property
    def text(self) -> str:
        """What it did, in plain words."""
        return self.label

    def made(self, tree: Node) -> tuple[Node, Path | None]:
        """The new tree, and the path in it of what the command is about, if it is still there."""
        raise NotImplementedError  # every kind has its own

    def change(self, document: Document) -> Change:
        """Exchange the tree; see `reshaped` for the decals."""
        return reshaped(document, self.object, self.made(self.tree(document))[0])


@dataclass(frozen=True, eq=False)
class AddPrimitive(Reshaping):
    """One more primitive, or any branch, joined to the branch at a path and given in that branch's space."""

    node: Node
    join: Join = Join.BLEND
    label: ClassVar[str] = "add a primitive"

    def made(self, tree: Node) -> tuple[Node, Path]:
        """Join it."""
        instance("node", self.node, Node, InvalidEdit, "such as Point(...)")
        join = member("join", self.join, Join, InvalidEdit)
        *above, _ = down(tree, self.path)
        if above and _takes_more(above[-1], join):
            return with_operand(tree, self.path[:-1], self.node)
        return joined(tree, self.path, self.node, join)


@dataclass(frozen=True, eq=False)
class RemovePrimitive(Reshaping):
    """A primitive, or any branch, less; never the last. Decals whose ground is gone go with it."""

    label: ClassVar[str] = "remove a primitive"

    def made(self, tree: Node) -> tuple[Node, None]:
        """Leave the rest."""
        return without(tree, self.path), None


@dataclass(frozen=True, eq=False)
class DuplicatePrimitive(Reshaping):
    """A copy of a primitive, or any branch, moved by an offset in the world; it joins as the first one does.

    A copy of what cuts, or is cut, is blended with it, so that it cuts or is cut too.
    """

    offset: ArrayLike
    label: ClassVar[str] = "duplicate a primitive"

    def made(self, tree: Node) -> tuple[Node, Path]:
        """Put the copy beside it."""
        offset = triple("offset", self.offset, InvalidEdit)
        own = np.linalg.solve(world_matrix(tree, self.path), offset)
        *above, node = down(tree, self.path)
        copy = moved(node, own)
        if above and isinstance(above[-1], Sum | Ricci | Union):
            return with_operand(tree, self.path[:-1], copy)
        return joined(tree, self.path, copy, Join.BLEND)


@dataclass(frozen=True, eq=False)
class JoinPrimitive(Reshaping):
    """Let a primitive, or any branch, join what is beside it in another way: `Join`, or its value.

    What is beside it stays joined as it was. A difference takes the primitive away from the rest.
    """

    join: Join
    label: ClassVar[str] = "join in another way"

    @property
    def text(self) -> str:
        """How it is joined then."""
        return f"joined by {Join(self.join).value}"

    def made(self, tree: Node) -> tuple[Node, Path]:
        """Take it out, and join it to the rest."""
        join = member("join", self.join, Join, InvalidEdit)
        path = branch_of(tree, self.path)
        node = node_at(tree, path)
        rest = _rest(node_at(tree, path[:-1]), path[-1]) if path else None
        if rest is None:
            raise InvalidEdit(
                "expected a primitive with others beside it, got one that is alone in its shape"
            )
        tree, found = joined(with_node(tree, path[:-1], rest), path[:-1], node, join)
        return tree, (*found, *self.path[len(path) :])
