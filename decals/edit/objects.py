"""Whole objects: one more, or one less."""

from dataclasses import dataclass
from typing import ClassVar

from decals.checks import shown
from decals.edit.change import Change
from decals.edit.document import Document
from decals.edit.population import lying_on
from decals.errors import InvalidEdit
from decals.scenes.scene import MeshObject, SceneObject, TreeObject, check_names


@dataclass(frozen=True, eq=False)
class AddObject:
    """One more mesh or BlobTree; the decals that are there stay where they are."""

    object: SceneObject
    label: ClassVar[str] = "add an object"

    def change(self, document: Document) -> Change:
        """Put it last."""
        if not isinstance(self.object, MeshObject | TreeObject):
            raise InvalidEdit(f"expected a MeshObject or a TreeObject to add, got {shown(self.object)}")
        objects = (*document.objects, self.object)
        check_names(objects)
        self.object.surface  # noqa: B018  # refuses a tree that shows nothing, before anything changes
        return document.with_parts(objects=objects)


@dataclass(frozen=True, eq=False)
class RemoveObject:
    """An object less, and the decals that lie on it; later objects move up."""

    number: int
    label: ClassVar[str] = "remove an object"

    def change(self, document: Document) -> Change:
        """Leave the others, and the decals that are closer to them."""
        gone = document.object(self.number)
        others = tuple(item for item in document.objects if item is not gone)
        return document.without(lying_on(document, [self.number]), objects=others)
