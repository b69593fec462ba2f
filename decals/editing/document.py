"""The edited document, the one owner of objects, decals, images and camera, and its edits as data.

An edit holds the state of a document before and after, so that undo is exact.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Int64Array
from decals.errors import InvalidEdit, InvalidMesh, InvalidScene
from decals.index.editor import DecalEditor
from decals.index.rows import as_numbers
from decals.model import Decals
from decals.receivers import check_receivers
from decals.rendering.options import Drawing
from decals.scenes.camera import Camera
from decals.scenes.objects import MeshObject, SceneObject, shown_objects
from decals.scenes.origin import WORLD, Origin
from decals.scenes.recipe import Recipe
from decals.scenes.scene import DecalImage, Scene, require_scene
from decals.surfaces.base_color import BaseColor
from decals.validation import instance, whole_number


@dataclass(frozen=True, eq=False)
class DecalStates:
    """States of some decals: which of these numbers exist, and their values.

    Attributes
    ----------
    numbers
        Decal numbers, shape (n,).
    exists
        True for numbers that belong to a decal, shape (n,).
    decals
        Values of the existing decals, in the order of their numbers.
    """

    numbers: Int64Array
    exists: BoolArray
    decals: Decals

    @classmethod
    def read(cls, editor: DecalEditor, numbers: Int64Array) -> Self:
        """Copy the present states from an editor."""
        exists = editor.has(numbers)
        return cls(numbers, exists, editor.take(numbers[exists]))

    @classmethod
    def existing(cls, numbers: Int64Array, decals: Decals) -> Self:
        """Return states in which every number has a decal."""
        return cls(numbers, np.ones(len(numbers), np.bool_), decals)

    @classmethod
    def deleted(cls, numbers: Int64Array) -> Self:
        """Return states in which no number has a decal."""
        return cls(numbers, np.zeros(len(numbers), np.bool_), Decals.empty())

    def overlaid_on(self, other: "DecalStates") -> "DecalStates":
        """Return these states, and the other ones for numbers that only they contain."""
        if np.array_equal(other.numbers, self.numbers):  # as in each step of a drag
            return self
        only_other = ~np.isin(other.numbers, self.numbers)
        if not only_other.any():
            return self
        return DecalStates(
            np.concatenate([self.numbers, other.numbers[only_other]]),
            np.concatenate([self.exists, other.exists[only_other]]),
            Decals.concatenate([self.decals, other.decals[only_other[other.exists]]]),
        )

    def apply_to(self, editor: DecalEditor) -> None:
        """Set the decals of an editor to these states."""
        deleted = self.numbers[~self.exists]
        deleted = deleted[editor.has(deleted)]
        if len(deleted):
            editor.delete(deleted)
        if self.exists.any():
            editor.assign(self.numbers[self.exists], self.decals)


NO_DECALS = DecalStates.deleted(np.zeros(0, np.int64))


def hidden_states(scene: Scene, first: int | None = None) -> DecalStates:
    """Return the hidden decals of a scene under numbers from a first one on."""
    first = len(scene.decals) if first is None else first
    numbers = np.arange(first, first + len(scene.hidden_decals))
    return DecalStates.existing(numbers, scene.hidden_decals)


@dataclass(frozen=True, eq=False)
class SceneParts:
    """Parts of a scene beside its decals; in an edit, None for parts that stay.

    ``recipes`` has the recipe in a tuple, ``hidden`` the hidden decals under their numbers.
    """

    objects: Any = None
    images: Any = None
    camera: Any = None
    drawing: Any = None
    recipes: Any = None
    hidden: Any = None
    locked_layers: Any = None
    layer_names: Any = None

    @classmethod
    def of(cls, scene: Scene, first: int | None = None) -> Self:
        """Return all parts of a scene; its hidden decals get numbers from a first one on."""
        same = {name: getattr(scene, name) for name in SAME_PARTS}
        recipes = () if scene.recipe is None else (scene.recipe,)
        return cls(**same, recipes=recipes, hidden=hidden_states(scene, first))

    def overlaid_on(self, other: "SceneParts") -> "SceneParts":
        """Return these parts, and the other ones where these are None."""
        given = {name: part for name, part in vars(self).items() if part is not None}
        return replace(other, **given)


SAME_PARTS = ("objects", "images", "camera", "drawing", "locked_layers", "layer_names")
"""Parts that a scene has under the same names."""


@dataclass(frozen=True, eq=False)
class Edit:
    """Decal states and scene parts before and after; both sides name the same numbers and parts.

    Applying ``before`` undoes the edit bit for bit, applying ``after`` redoes it.

    Attributes
    ----------
    before, after
        States of the edited decals.
    parts_before, parts_after
        Replaced parts of the scene.
    """

    before: DecalStates = NO_DECALS
    after: DecalStates = NO_DECALS
    parts_before: SceneParts = SceneParts()
    parts_after: SceneParts = SceneParts()

    @property
    def empty(self) -> bool:
        """True if the edit changes nothing."""
        parts = vars(self.parts_after).values()
        return not len(self.after.numbers) and all(part is None for part in parts)

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """Objects before the edit, then those after it; none if they stay."""
        return *(self.parts_before.objects or ()), *(self.parts_after.objects or ())

    @cached_property
    def held_bytes(self) -> int:
        """Approximate memory that undo alone needs: decals, and objects and images that were replaced."""
        states = [*vars(self.before.decals).values(), *vars(self.after.decals).values()]
        before, after = ({*map(id, parts.objects or ())} for parts in (self.parts_before, self.parts_after))
        kept = _parts_bytes(self.parts_after, before & after)
        held = _parts_bytes(self.parts_before, before & after)
        return sum(_arrays(states).values()) + sum(held[key] for key in held.keys() - kept)

    def then(self, later: "Edit") -> "Edit":
        """Return one edit that does this one and then a later one."""
        return Edit(
            self.before.overlaid_on(later.before),
            later.after.overlaid_on(self.after),
            self.parts_before.overlaid_on(later.parts_before),
            later.parts_after.overlaid_on(self.parts_after),
        )


NODE_BYTES = 200
"""Memory of a node, and of its part of the tape, approximately."""


def _arrays(values: Iterable[object]) -> dict[int, int]:
    """Return the bytes of arrays by their identity."""
    return {id(array): array.nbytes for array in values if isinstance(array, np.ndarray)}


def _parts_bytes(parts: SceneParts, known: set[int]) -> dict[int, int]:
    """Return the bytes of each array and node of a scene's parts, by its identity; skip the known trees."""
    held = _arrays(array for image in parts.images or () for array in vars(image).values())
    for item in parts.objects or ():
        if isinstance(item, MeshObject):
            colors = item.color.held_arrays if isinstance(item.color, BaseColor) else []
            held |= _arrays([item.vertices, item.faces, item.coordinates, *colors])
            continue
        if id(item) in known:
            continue
        nodes: set[int] = set()
        pending = [item.tree]
        while pending:
            node = pending.pop()
            if id(node) not in nodes:
                nodes.add(id(node))
                held[id(node)] = NODE_BYTES
                held |= _arrays(vars(node).values())
                pending.extend(node.children)
        held[id(item.tree)] += NODE_BYTES * len(nodes)  # the tape has a part for each
    return held


ANY_POINT, ANY_DIRECTION = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
"""A query of a surface that is made only so that its lazy structures are built."""


@dataclass_transform(frozen_default=True, eq_default=False)
class EditCommand:
    """Base of the commands of this package: values whose parameters are the annotations of their class."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False)(cls)


class ForkFamily:
    """Identity that a document shares with its forks; results cached for one hold for all."""


class Document:
    """A scene whose decals keep their numbers while they are edited; renderers draw it in place.

    Only `apply` changes a document, and `draw_as` how it is drawn. The ``compute_…`` methods return an `Edit`
    and change nothing.

    Parameters
    ----------
    decals
        The decals by number.
    parts
        All other parts of the scene.
    family
        The family of the document from which this fork was made. Default: a new family.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import Document
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=4, images=["eye"])
    >>> document = Document.from_scene(scene)
    >>> len(document.decals), len(document.objects)
    (4, 1)
    """

    def __init__(self, decals: DecalEditor, parts: SceneParts, family: ForkFamily | None = None) -> None:
        self._decals, self._parts = decals, parts
        self._first_drawing = parts.drawing
        self._family = ForkFamily() if family is None else family

    @classmethod
    def from_scene(cls, scene: Scene) -> Self:
        """Return a document that begins as a scene.

        Raises
        ------
        InvalidScene
            The argument is not a `Scene`.
        """
        require_scene("scene to edit", scene, "edit the scene that was posed")
        return cls(DecalEditor(scene.decals), SceneParts.of(scene))

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """Meshes and trees."""
        objects: tuple[SceneObject, ...] = self._parts.objects
        return objects

    @property
    def shown_objects(self) -> list[SceneObject]:
        """The objects without their hidden parts, see `decals.scenes.objects.shown_objects`."""
        return shown_objects(self.objects)

    @property
    def hidden(self) -> DecalStates:
        """The hidden decals, under the numbers that they had."""
        hidden: DecalStates = self._parts.hidden
        return hidden

    @property
    def locked_layers(self) -> tuple[int, ...]:
        """Layers whose decals no command changes, ascending."""
        layers: tuple[int, ...] = self._parts.locked_layers
        return layers

    @property
    def has_locks(self) -> bool:
        """True if a layer, or an object or a part of one, is locked."""
        return bool(self.locked_layers) or any(item.locked for item in self.objects)

    @property
    def layer_names(self) -> dict[int, str]:
        """Names of layers, by their numbers."""
        names: dict[int, str] = self._parts.layer_names
        return names

    @property
    def images(self) -> tuple[DecalImage, ...]:
        """Images that the decals show."""
        images: tuple[DecalImage, ...] = self._parts.images
        return images

    @property
    def camera(self) -> Camera:
        """Camera of the scene."""
        camera: Camera = self._parts.camera
        return camera

    @property
    def drawing(self) -> Drawing:
        """How the scene is drawn."""
        drawing: Drawing = self._parts.drawing
        return drawing

    def draw_as(self, drawing: Drawing) -> None:
        """Draw the scene in another way from now on; that is no edit, and saved with the next one."""
        instance("drawing", drawing, Drawing, InvalidScene, "a scene has .drawing")
        self._parts = replace(self._parts, drawing=drawing)

    @property
    def recipe(self) -> Recipe | None:
        """How the decals were made, if that is known."""
        return self.recipes[0] if self.recipes else None

    @property
    def recipes(self) -> tuple[Recipe, ...]:
        """The recipe, if it is known, in a tuple: the part of the scene that edits replace."""
        recipes: tuple[Recipe, ...] = self._parts.recipes
        return recipes

    @property
    def origin(self) -> Origin:
        """Point that all coordinates are relative to; see `decals.Scene.origin`."""
        return self.objects[0].origin if self.objects else WORLD

    @property
    def decals(self) -> DecalEditor:
        """The decals, by number."""
        return self._decals

    @property
    def family(self) -> ForkFamily:
        """Identity shared with all forks."""
        return self._family

    @property
    def scene(self) -> Scene:
        """Immutable copy; its decals are in the order of their numbers."""
        same: dict[str, Any] = {name: getattr(self._parts, name) for name in SAME_PARTS}
        return Scene(decals=self.decals.decals, recipe=self.recipe, hidden_decals=self.hidden.decals, **same)

    def object(self, number: int) -> SceneObject:
        """Return an object by its index, or raise `InvalidEdit`."""
        return self.objects[whole_number("object", number, 0, len(self.objects) - 1, InvalidEdit)]

    def objects_with(self, number: int, item: SceneObject) -> tuple[SceneObject, ...]:
        """Return the objects with another one at an index."""
        return (*self.objects[:number], item, *self.objects[number + 1 :])

    def decals_of_layer(self, *layers: int) -> Int64Array:
        """Return the numbers of the decals of a layer, or of several layers."""
        numbers: Int64Array = self.decals.numbers[np.isin(self.decals.column("layers"), layers)]
        return numbers

    # -- forks ------------------------------------------------------------------------------------------

    def fork(self) -> "Document":
        """Return an independent copy; objects and images are shared."""
        return Document(self._decals.copy(), self._parts, self._family)

    def adopt(self, fork: "Document") -> None:
        """Take over the state of a fork, which must not be used afterwards; renderers keep this document."""
        keeps_drawing = fork.drawing is fork._first_drawing
        self._parts = replace(fork._parts, drawing=self.drawing) if keeps_drawing else fork._parts
        self._decals.adopt(fork._decals)

    def prepare_surfaces(self) -> None:
        """Build what the surfaces build on their first query, such as bounding volume hierarchies."""
        for item in self.objects:
            with suppress(InvalidMesh):  # a tree without a visible surface
                item.surface.project(ANY_POINT)
                item.surface.raycast(ANY_POINT, ANY_DIRECTION)

    # -- edits ------------------------------------------------------------------------------------------

    def compute_replacement(self, numbers: ArrayLike, decals: Decals, **parts: Any) -> Edit:
        """Return the edit that gives decals new values and replaces scene parts.

        Raises
        ------
        InvalidEdit
            A decal would show an image that does not exist, or lie on an object that does not exist.
        """
        images = parts.get("images", self.images)
        last = int(decals.images.max(initial=-1))
        if last >= len(images):
            raise InvalidEdit(
                f"expected an image from 0 to {len(images) - 1}, got {last}; add the image first"
            )
        check_receivers(decals.receivers, parts.get("objects", self.objects), InvalidEdit)
        return self._compute(DecalStates.existing(as_numbers(numbers), decals), parts)

    def compute_addition(self, decals: Decals) -> Edit:
        """Return the edit that adds decals under new numbers."""
        instance("decals", decals, Decals, InvalidEdit, "decals.scatter makes some")
        first = self.decals.next_number
        return self.compute_replacement(np.arange(first, first + len(decals)), decals)

    def compute_deletion(self, numbers: ArrayLike, **parts: Any) -> Edit:
        """Return the edit that deletes decals and replaces scene parts."""
        numbers = as_numbers(numbers)
        self.decals.take(numbers)  # raises for numbers without a decal
        self._check_receivers(numbers, parts)
        return self._compute(DecalStates.deleted(numbers), parts)

    def compute_parts(self, **parts: Any) -> Edit:
        """Return the edit that replaces objects, images or camera.

        Raises
        ------
        InvalidEdit
            Decals lie only on objects that would no longer exist.
        """
        self._check_receivers(NO_DECALS.numbers, parts)
        return self._compute(NO_DECALS, parts)

    def _check_receivers(self, deleted: Int64Array, parts: dict[str, Any]) -> None:
        """Raise InvalidEdit if new objects lack a receiver of the decals that stay."""
        if "objects" not in parts:
            return
        check_receivers(parts.get("hidden", self.hidden).decals.receivers, parts["objects"], InvalidEdit)
        if self.decals.limited:
            staying = self.decals.numbers[~np.isin(self.decals.numbers, deleted)]
            check_receivers(self.decals.take(staying).receivers, parts["objects"], InvalidEdit)

    def _compute(self, after: DecalStates, parts: dict[str, Any]) -> Edit:
        before = DecalStates.read(self.decals, after.numbers)
        parts_before = SceneParts(**{name: getattr(self, name) for name in parts})
        return Edit(before, after, parts_before, SceneParts(**parts))

    def apply(self, states: DecalStates, parts: SceneParts) -> None:
        """Apply one side of an edit."""
        states.apply_to(self._decals)
        self._parts = parts.overlaid_on(self._parts)
