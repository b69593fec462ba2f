"""Commands for primitives of trees: move, resize and paint them; decals follow."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node
from decals.checks import finite, triple
from decals.edit.change import Change
from decals.edit.document import Document
from decals.edit.following import followers
from decals.edit.places import carried
from decals.edit.trees import (
    Path,
    moved,
    node_at,
    primitive_at,
    resized,
    to_primitive,
    with_node,
    world_matrix,
)
from decals.errors import InvalidEdit
from decals.scenes.scene import TreeObject


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
        numbers, places = followers(
            document, self.object, tuple(self.path), item, np.asarray(offset, np.float64)
        )
        followed = carried(document.decals.take(numbers), places)
        return document.with_decals(numbers, followed, objects=objects)


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
