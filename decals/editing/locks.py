"""The check that an edit changes nothing that is locked."""

import numpy as np

from blobtree import Node
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import node_at
from blobtree.nodes.surgery import path_of
from decals.editing.document import Document, Edit
from decals.errors import InvalidEdit
from decals.scenes.objects import SceneObject, TreeObject


def check_locks(document: Document, edit: Edit) -> None:
    """Raise `InvalidEdit` if an edit of a document changes something that is locked there.

    Decals of a locked layer may still follow a surface that changes.
    """
    after = edit.parts_after.objects
    if after is None:
        if document.locked_layers and len(edit.before.decals):
            for layer in np.intersect1d(edit.before.decals.layers, document.locked_layers).tolist():
                raise InvalidEdit(
                    f"layer {layer} is locked; unlock it in the outline, or deselect its decals"
                )
        return
    by_name = {item.name: item for item in after}
    new = (item for item in after if not any(item is other for other in document.objects))
    changed = [tree for item in new if (tree := _tree(item)) is not None]
    for number, item in enumerate(document.objects):
        other = after[number] if len(after) == len(document.objects) else by_name.get(item.name)
        if not item.locked or other is item:
            continue
        kept = other is not None and other.name == item.name and _tree(other) is _tree(item)
        if () in item.locked and not kept:
            raise InvalidEdit(f"{item.name!r} is locked; unlock it in the outline")
        before = _tree(item)
        if before is None:
            continue
        for node in (node_at(before, path) for path in item.locked if path):
            if not any(_has(tree, node) for tree in changed):
                raise InvalidEdit(
                    f"a {type(node).__name__} of {item.name!r} is locked; unlock it in the outline"
                )


def _tree(item: SceneObject) -> Node | None:
    return item.tree if isinstance(item, TreeObject) else None


def _has(tree: Node, node: Node) -> bool:
    """Return True if a tree has a node."""
    try:
        path_of(tree, node)
    except InvalidNode:
        return False
    return True
