"""What is being edited: the one owner of objects, decals, images and camera."""

from contextlib import suppress
from typing import Any, Self

import numpy as np

from decals.checks import instance, whole
from decals.edit.change import NOTHING, Change, Numbers, Parts, Rows
from decals.errors import InvalidEdit, InvalidMesh, InvalidScene
from decals.grid.editor import DecalEditor
from decals.model import Decals
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, Scene, SceneObject

NOWHERE, ANYWHERE = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
"""Any point, and any direction: what is asked about them for the first time is made then."""


class Lineage:
    """What a document and its forks have in common; what is known of one may be kept for all."""


class Document:
    """A scene whose decals keep their numbers while they are edited; renderers draw it as it is.

    Nothing but `put` changes it, and that takes a `Change`.

    Attributes
    ----------
    lineage
        The same for a document and its forks.
    """

    def __init__(self, scene: Scene) -> None:
        instance("what to edit", scene, Scene, InvalidScene, "decals.cover makes one")
        self._objects, self._images, self._camera = scene.objects, scene.images, scene.camera
        self._decals = DecalEditor(scene.decals)
        self.lineage = Lineage()

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """Meshes and trees."""
        return self._objects

    @property
    def images(self) -> tuple[DecalImage, ...]:
        """What the decals show."""
        return self._images

    @property
    def camera(self) -> Camera:
        """Where pictures are taken from."""
        return self._camera

    @property
    def decals(self) -> DecalEditor:
        """The decals, by number."""
        return self._decals

    @property
    def scene(self) -> Scene:
        """A copy that stays as it is; decals are in the order of their numbers."""
        return Scene(objects=self.objects, images=self.images, camera=self.camera, decals=self.decals.decals)

    def fork(self) -> Self:
        """Give the same document again, to be changed on its own; objects and images are shared."""
        made = type(self).__new__(type(self))
        made._objects, made._images, made._camera = self._objects, self._images, self._camera
        made._decals, made.lineage = self._decals.copy(), self.lineage
        return made

    def make_surfaces(self) -> None:
        """Make what is made when surfaces are asked for the first time, such as trees of boxes."""
        for item in self._objects:
            with suppress(InvalidMesh):  # a tree that shows nothing
                item.surface.project(NOWHERE)
                item.surface.raycast(NOWHERE, ANYWHERE)

    def adopt(self, other: "Document") -> None:
        """Become another document, which nobody may use any more; renderers go on with this one."""
        self._objects, self._images, self._camera = other._objects, other._images, other._camera
        self._decals.adopt(other._decals)

    def object(self, number: int) -> SceneObject:
        """Give an object by its number, or `InvalidEdit`."""
        return self.objects[whole("object", number, 0, len(self.objects) - 1, InvalidEdit)]

    # -- changes of it ----------------------------------------------------------------------------------

    def with_decals(self, numbers: Numbers, decals: Decals, **parts: Any) -> Change:
        """The change that gives numbers these decals, and exchanges parts.

        Raises
        ------
        InvalidEdit
            A decal would show an image that is not there.
        """
        images = parts.get("images", self.images)
        last = int(decals.images.max(initial=-1))
        if last >= len(images):
            raise InvalidEdit(
                f"expected an image from 0 to {len(images) - 1}, got {last}; add the image first"
            )
        return self._change(Rows.full(numbers, decals), parts)

    def with_added(self, decals: Decals) -> Change:
        """The change that adds decals under new numbers."""
        instance("decals", decals, Decals, InvalidEdit, "decals.seed makes some")
        first = self.decals.next_number
        return self.with_decals(np.arange(first, first + len(decals)), decals)

    def without(self, numbers: Numbers, **parts: Any) -> Change:
        """The change that deletes decals, and exchanges parts."""
        self.decals.take(numbers)
        return self._change(Rows.bare(numbers), parts)

    def with_parts(self, **parts: Any) -> Change:
        """The change that exchanges objects, images or camera."""
        return self._change(NOTHING, parts)

    def _change(self, after: Rows, parts: dict[str, Any]) -> Change:
        before = Rows.of(self.decals, after.numbers)
        return Change(before, after, Parts(**{name: getattr(self, name) for name in parts}), Parts(**parts))

    def put(self, rows: Rows, parts: Parts) -> None:
        """Put one side of a change on."""
        rows.put_into(self._decals)
        if parts.objects is not None:
            self._objects = parts.objects
        if parts.images is not None:
            self._images = parts.images
        if parts.camera is not None:
            self._camera = parts.camera
