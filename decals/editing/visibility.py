"""Commands that hide, lock and name parts of a scene."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree.nodes.paths import Path, node_at
from blobtree.validation import describe
from decals.editing.document import DecalStates, Document, Edit, EditCommand
from decals.editing.queries import move_decals, nearest_points
from decals.errors import InvalidEdit
from decals.index.rows import as_numbers
from decals.scenes.objects import Paths, TreeObject, check_names, flagged
from decals.scenes.scene import as_layer_names, as_layers

FOLLOW_DISTANCE = 0.02
"""Decals that were hidden go back to the surface if it is farther away than this, in their radii."""


class FlagNodes(EditCommand):
    """Hide, show, lock or unlock nodes of objects; the decals on them stay where they are.

    Parameters
    ----------
    hidden, locked
        For the index of each object that changes, the paths of all its nodes that are hidden, or locked, from
        now on. The path ``()`` is the whole object.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, FlagNodes
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(FlagNodes(hidden={0: ((1,),)}))
    >>> session.document.shown_objects[0].tree.radius
    1.0
    """

    hidden: dict[int, Paths] = field(default_factory=dict)
    locked: dict[int, Paths] = field(default_factory=dict)
    label: str = "hide or lock"
    ignores_locks: ClassVar[bool] = True

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        objects = list(document.objects)
        for name, flags in (("hidden", self.hidden), ("locked", self.locked)):
            if not isinstance(flags, dict):
                raise InvalidEdit(f"{name}: expected paths by the index of their object, got {flags!r:.60}")
            for number, paths in flags.items():
                changed = flagged(document.object(number), **{name: paths})
                if getattr(changed, name) != getattr(objects[number], name):
                    objects[number] = flagged(objects[number], **{name: paths})
        for item in objects:
            if item.shown is None and () not in item.hidden:
                raise InvalidEdit(f"no part of {item.name!r} would be left; hide the object instead")
        same = all(new is old for new, old in zip(objects, document.objects, strict=True))
        return Edit() if same else document.compute_parts(objects=tuple(objects))


def isolating(document: Document, number: int, path: Path) -> FlagNodes:
    """Return the command that hides everything but a node and what is below it."""
    hidden: dict[int, Paths] = {other: ((),) for other in range(len(document.objects)) if other != number}
    item, siblings = document.object(number), []
    if isinstance(item, TreeObject):
        for depth, step in enumerate(path):
            count = len(node_at(item.tree, path[:depth]).children)
            siblings += [(*path[:depth], other) for other in range(count) if other != step]
    return FlagNodes({**hidden, number: tuple(siblings)}, label="isolate")


class HideDecals(EditCommand):
    """Hide decals: they are neither drawn nor edited, and neighbours take their place.

    Parameters
    ----------
    numbers
        Numbers of the decals.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, HideDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(HideDecals([0, 2]))
    >>> session.document.decals.numbers, session.document.hidden.numbers
    (array([1]), array([0, 2]))
    """

    numbers: ArrayLike
    label: ClassVar[str] = "hide decals"
    ignores_locks: ClassVar[bool] = True

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        numbers = as_numbers(self.numbers)
        decals = document.decals.take(numbers)  # raises for numbers without a decal
        hidden = DecalStates.existing(numbers, decals).overlaid_on(document.hidden)
        return document.compute_deletion(numbers, hidden=hidden) if len(numbers) else Edit()


class ShowDecals(EditCommand):
    """Show hidden decals again, at their old places; where the surface moved away, on it.

    Parameters
    ----------
    layers
        Layers of the decals; None for all.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, HideDecals, ShowDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(HideDecals([0, 2])), session.do(ShowDecals())
    >>> session.document.decals.numbers
    array([0, 1, 2])
    """

    layers: Sequence[int] | None = None
    label: ClassVar[str] = "show decals"
    ignores_locks: ClassVar[bool] = True

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        hidden = document.hidden
        shown = np.ones(len(hidden.numbers), np.bool_)
        if self.layers is not None:
            shown = np.isin(hidden.decals.layers, as_layers("layers", self.layers, InvalidEdit))
        if not shown.any():
            return Edit()
        rest = DecalStates.existing(hidden.numbers[~shown], hidden.decals[~shown])
        numbers, decals = hidden.numbers[shown], hidden.decals[shown]
        if document.objects:
            points = nearest_points(document.objects, decals.positions)
            gaps = np.linalg.norm(points.positions.astype(np.float64) - decals.positions, axis=1)
            moved = move_decals(decals, points)
            far = gaps > FOLLOW_DISTANCE * decals.radii
            columns = {
                name: np.where(far[:, None], getattr(moved, name), getattr(decals, name))
                for name in ("positions", "normals", "tangents")
            }
            decals = decals.replace(**columns)
        if document.decals.has(numbers).any():  # a scene that was loaded numbers its decals anew
            numbers = document.decals.next_number + np.arange(len(numbers))
        return document.compute_replacement(numbers, decals, hidden=rest)


class LockLayers(EditCommand):
    """Set the layers whose decals no command changes.

    Parameters
    ----------
    layers
        All layers that are locked from now on.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, LockLayers
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(LockLayers([0]))
    >>> session.document.locked_layers
    (0,)
    """

    layers: Iterable[int]
    label: str = "lock layers"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        return document.compute_parts(locked_layers=as_layers("layers", self.layers, InvalidEdit))


class RenumberLayers(EditCommand):
    """Give layers other numbers, which changes the order in which they are drawn; flags and names go along.

    Parameters
    ----------
    numbers
        The new number of each layer that gets one; different layers get different ones.

    Raises
    ------
    InvalidEdit
        Two layers would have one number.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession
    >>> from decals.editing.visibility import RenumberLayers
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(RenumberLayers({0: 2}))
    >>> session.document.decals.column("layers")
    array([2, 2, 2], dtype=int32)
    """

    numbers: Mapping[int, int]
    label: ClassVar[str] = "reorder layers"
    ignores_locks: ClassVar[bool] = True

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        shown: Any = document.decals.column("layers")
        layers = {*shown.tolist(), *document.hidden.decals.layers.tolist()}
        layers |= {*document.locked_layers, *document.layer_names}
        after = {layer: self.numbers.get(layer, layer) for layer in layers}
        if len({*after.values()}) < len(after):
            raise InvalidEdit(f"layers: expected a number for each alone, got {describe(self.numbers)}")
        as_layers("layers", after.values(), InvalidEdit)

        def renumbered(decals: Any) -> Any:
            return decals.replace(layers=np.array([after[one] for one in decals.layers.tolist()], np.int32))

        changed = [layer for layer, number in after.items() if layer != number]
        numbers, hidden = document.decals_of_layer(*changed), document.hidden
        names = {after[layer]: name for layer, name in document.layer_names.items()}
        return document.compute_replacement(
            numbers,
            renumbered(document.decals.take(numbers)),
            hidden=DecalStates.existing(hidden.numbers, renumbered(hidden.decals)),
            locked_layers=tuple(sorted(after[layer] for layer in document.locked_layers)),
            layer_names=as_layer_names(names),
        )


class Renaming:
    """Base of commands that give a part of a scene a ``name``."""

    name: str

    @property
    def label(self) -> str:
        """The new name, as undo names the command."""
        return f"rename to {describe(self.name)}" if str(self.name) else "remove a name"


class RenameObject(Renaming, EditCommand):
    """Give an object another name.

    Parameters
    ----------
    number
        Index of the object.
    name
        Its new name, unique in the scene.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RenameObject
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(RenameObject(0, "ball"))
    >>> session.document.objects[0].name
    'ball'
    """

    number: int
    name: str

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        renamed = flagged(document.object(self.number), name=self.name)
        objects = document.objects_with(self.number, renamed)
        check_names(objects)
        return document.compute_parts(objects=objects)


class RenameNode(Renaming, EditCommand):
    """Give a node of a BlobTree a name, which it keeps while the tree is edited.

    Parameters
    ----------
    object
        Index of the object.
    path
        Path of the node in the object's tree.
    name
        Its name; "" to name it by its class again.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RenameNode
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(RenameNode(0, (1,), "head"))
    >>> session.document.objects[0].names
    {(1,): 'head'}
    """

    object: int
    path: Path
    name: str

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        item = document.object(self.object)
        if not isinstance(item, TreeObject):
            raise InvalidEdit(f"expected a BlobTree, object {item.name!r} is a mesh; rename the object")
        node_at(item.tree, self.path)  # raises InvalidNode if the path leads to no node
        names = _renamed(item.names, tuple(self.path), self.name)
        objects = document.objects_with(self.object, flagged(item, names=names))
        return Edit() if names == item.names else document.compute_parts(objects=objects)


class RenameLayer(Renaming, EditCommand):
    """Give a layer of decals a name.

    Parameters
    ----------
    layer
        Number of the layer.
    name
        Its name; "" to name it by its number again.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RenameLayer
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(RenameLayer(0, "scales"))
    >>> session.document.layer_names
    {0: 'scales'}
    """

    layer: int
    name: str

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        (layer,) = as_layers("layer", (self.layer,), InvalidEdit)
        names = as_layer_names(_renamed(document.layer_names, layer, self.name))
        return Edit() if names == document.layer_names else document.compute_parts(layer_names=names)


def _renamed(names: dict[Any, str], key: Any, name: str) -> dict[Any, str]:
    """Return names with another one; without it if it is empty."""
    others = {other: text for other, text in names.items() if other != key}
    return others if isinstance(name, str) and name == "" else {**others, key: name}
