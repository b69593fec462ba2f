"""Actions on the parts of a scene that an outline lists: objects, nodes, layers of decals, and images."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple, Self

import numpy as np

from blobtree import Mirror
from blobtree.nodes.paths import Path, node_at
from blobtree.validation import describe
from decals.editing.action_state import ActionState, WindowActions
from decals.editing.commands import DeleteDecals, RemoveImage, SetValues
from decals.editing.document import Document
from decals.editing.scatter_commands import MoveObject, RemoveObject
from decals.editing.tree_actions import TreeActions
from decals.editing.visibility import RenameLayer, RenameNode, RenameObject, RenumberLayers
from decals.editing.visibility_actions import VisibilityActions
from decals.errors import InvalidEdit
from decals.scenes.objects import TreeObject

FLAGS = {"hide": "hidden", "lock": "locked"}
"""Flags of two of the changes."""


class Part(NamedTuple):
    """A part of a scene, and its key in an outline.

    Attributes
    ----------
    kind
        "object", "node", "layer" or "image".
    number
        Number of the layer; index of the image, or of the object, to which a node belongs.
    path
        Path of the node in the object's tree.
    """

    kind: str
    number: int
    path: Path = ()

    @property
    def key(self) -> str:
        """Text that names the part: "object 0", "layer 0", "image 0", and "0/1/2" for a node."""
        path = "/".join(map(str, (self.number, *self.path)))
        return path if self.kind == "node" else f"{self.kind} {path}"

    @classmethod
    def named(cls, key: object) -> Self:
        """Return the part of a key, which the scene need not have; raise `InvalidEdit` for other texts."""
        kind, _, rest = str(key).rpartition(" ")
        with suppress(ValueError):
            number, *path = map(int, rest.split("/"))
            if kind == "" or (kind in ("object", "layer", "image") and not path):
                return cls(kind or "node", number, tuple(path))
        raise InvalidEdit(
            f"row: expected that of an object, a node, a layer or an image, got {describe(key)}"
        )

    @classmethod
    def node(cls, key: object) -> Self:
        """Return the node of a key, the root for an object; raise `InvalidEdit` for other keys."""
        part = cls.named(key)
        if part.kind not in ("object", "node"):
            raise InvalidEdit(f"row: expected that of an object or a node, got {describe(key)}")
        return part._replace(kind="node")


def image_on_layer(document: Document, image: int, layer: int) -> SetValues:
    """Return the command that lets the decals of a layer show an image."""
    return SetValues.each(document.decals_of_layer(layer), "change the image", images=image)


class OutlineActions(WindowActions):
    """Actions on parts of the scene, independent of the selection.

    Parameters
    ----------
    state
        State of the window.
    trees, visibility
        Other actions of the window, which these use.
    """

    def __init__(self, state: ActionState, trees: TreeActions, visibility: VisibilityActions) -> None:
        super().__init__(state)
        self._trees, self._visibility = trees, visibility

    def change(self, key: object, change: object, value: Any = None, marked: Sequence[str] = ()) -> None:
        """Change a part of the scene; if it is marked, hide, lock, group or remove all that are marked.

        Parameters
        ----------
        key
            Key of the part; see `Part.key`.
        change
            "rename", "remove", "duplicate", "group", "move", "reorder", "hide", "lock" or "isolate". "hide"
            shows a hidden part, and "lock" unlocks a locked one.
        value
            New name; or the key of the part to which a part is moved: a node of any object, where a mirror
            takes it as an operand, or the layer of an image. A layer or an object that is reordered takes
            the place of another one.
        marked
            Keys of the marked nodes, or layers.

        Raises
        ------
        InvalidEdit
            The scene has no such part, or it has no such change.
        """
        kind, number, path = Part.named(key)
        document, run = self._state.session.document, self._state.run
        parts = map(Part.named, marked if key in marked else [str(key)])
        nodes = [part[1:] for part in parts if (part.kind == "layer") == (kind == "layer")]
        layers = [layer for layer, _ in nodes]
        match kind, change:
            case "layer", "hide" | "lock":
                self._visibility.flag_layer(FLAGS[str(change)], number, layers)
            case "layer", "isolate":
                self._visibility.isolate_layer(number)
            case "layer", "remove":
                run(DeleteDecals(document.decals_of_layer(*layers)))
            case "layer", "rename":
                run(RenameLayer(number, value))
            case "image", "remove":
                self._state.brush.images = ()  # its indices stand for other images now
                run(RemoveImage(number))
            case "image", "move":
                target = Part.named(value)
                if target.kind != "layer":
                    raise InvalidEdit(f"move: expected the row of a layer, got {describe(value)}")
                run(image_on_layer(document, number, target.number))
            case "object" | "node", "hide" | "lock":
                self._visibility.flag_node(FLAGS[str(change)], number, path, nodes)
            case "object" | "node", "isolate":
                self._visibility.isolate_node(number, path)
            case "node", "rename":
                run(RenameNode(number, path, value))
            case "node", "group":
                self._trees.group_nodes(nodes)
            case "node", "remove":
                self._trees.delete_nodes(nodes)
            case "node", "duplicate":
                self._trees.select_node(number, path)
                self._trees.duplicate_selected()
            case "object" | "node", "move":
                target = Part.node(value)
                self._trees.move_node(number, path, target.number, self._operand_of_mirror(target))
            case "object" | "layer", "reorder":
                target = Part.named(value)
                if target.kind != kind:
                    raise InvalidEdit(f"reorder: expected the row of another {kind}, got {describe(value)}")
                self._reorder(kind, number, target.number)
            case "object", "rename":
                run(RenameObject(number, value))
            case "object", "remove":
                run(RemoveObject(number))
            case "object", "duplicate":
                self._trees.duplicate_object(number)
            case _, "move":
                raise InvalidEdit(f"move: expected a node, or an image onto a layer, got {describe(key)}")
            case _:
                raise InvalidEdit(f"change: expected one that {describe(key)} has, got {describe(change)}")

    def _operand_of_mirror(self, target: Part) -> Path:
        """Return the path of a mirror's operand, which shows twice; of another node, its own."""
        item = self._state.session.document.object(target.number)
        mirrors = isinstance(item, TreeObject) and isinstance(node_at(item.tree, target.path), Mirror)
        return (*target.path, 0) if mirrors else target.path

    def _reorder(self, kind: str, number: int, place: int) -> None:
        """Let an object or a layer take the place of another one; those between move by one place."""
        document, state = self._state.session.document, self._state
        if kind == "object":
            state.run(MoveObject(number, place), lambda: setattr(state, "primitive", None))
            return
        present = np.concatenate([document.decals.column("layers"), document.hidden.decals.layers])
        layers = np.unique(present).tolist()
        if not {number, place} <= {*layers}:
            raise InvalidEdit(f"layers: expected two of {layers} to reorder, got {number} and {place}")
        order = [layer for layer in layers if layer != number]
        order.insert(layers.index(place), number)
        state.run(RenumberLayers(dict(zip(order, layers, strict=True))))
