"""What can be done to decals and images; each command is a value, and computes a change."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from decals.checks import finite, instance, shown, triple, whole
from decals.edit.change import Change, Numbers
from decals.edit.document import Document
from decals.edit.places import Places, carried, nearest, turns
from decals.errors import InvalidEdit
from decals.grid.rows import as_numbers
from decals.model import PLAIN, Decals
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage
from decals.surfaces.surface import Floats, as_points, unit_rows

NEXT_TO = 1.0
"""How far a duplicate lies from what it was made of, in radii."""


@dataclass(frozen=True, eq=False)
class Add:
    """New decals, under numbers of their own."""

    decals: Decals
    label: ClassVar[str] = "add"

    def change(self, document: Document) -> Change:
        """Put them on top of their layers."""
        return document.with_added(self.decals)


@dataclass(frozen=True, eq=False)
class OfNumbers:
    """A command for some decals, told by their numbers."""

    numbers: Numbers

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", as_numbers(self.numbers))


@dataclass(frozen=True, eq=False)
class Delete(OfNumbers):
    """Take decals away; nobody else gets their numbers."""

    label: ClassVar[str] = "delete"

    def change(self, document: Document) -> Change:
        """Leave gaps."""
        return document.without(self.numbers)


@dataclass(frozen=True, eq=False)
class Alter(OfNumbers):
    """Exchange values: image, tint, opacity, layer, interaction, radius, ...

    ``values`` are named as in `Decals`; each is one for all of the decals, or a row for each.
    """

    values: Mapping[str, ArrayLike]
    label: str = "change"

    @classmethod
    def each(cls, numbers: ArrayLike, label: str = "change", **values: ArrayLike) -> Self:
        """Exchange values by name."""
        return cls(as_numbers(numbers), values, label)

    def change(self, document: Document) -> Change:
        """Exchange them."""
        if not isinstance(self.values, Mapping):
            raise InvalidEdit(f"values: expected {{'layers': 1}} or such, got {shown(self.values)}")
        before = document.decals.take(self.numbers)
        arrays = {name: _spread(before, name, value) for name, value in self.values.items()}
        return document.with_decals(self.numbers, before.replace(**arrays))


@dataclass(frozen=True, eq=False)
class Adjust(OfNumbers):
    """Exchange one value by what a function makes of the decals as they are: a layer up, half as opaque."""

    name: str
    value: Callable[[Decals], ArrayLike]
    label: str = "change"

    def change(self, document: Document) -> Change:
        """Ask the function."""
        values = {self.name: self.value(document.decals.take(self.numbers))}
        return Alter(self.numbers, values, self.label).change(document)


@dataclass(frozen=True, eq=False)
class Scale(OfNumbers):
    """Make decals larger, or smaller for a factor below 1."""

    factor: float
    label: ClassVar[str] = "scale"

    def change(self, document: Document) -> Change:
        """Multiply the radii."""
        factor = finite("factor", self.factor, InvalidEdit)
        before = document.decals.take(self.numbers)
        radii = before.radii.astype(np.float64) * factor
        return document.with_decals(self.numbers, before.replace(radii=radii))


@dataclass(frozen=True, eq=False)
class Turn(OfNumbers):
    """Turn images about their normals, counter-clockwise seen from outside."""

    degrees: float
    label: ClassVar[str] = "turn"

    def change(self, document: Document) -> Change:
        """Turn the tangents."""
        angle = np.radians(finite("degrees", self.degrees, InvalidEdit))
        before = document.decals.take(self.numbers)
        tangents = np.cos(angle) * before.tangents + np.sin(angle) * before.bitangents
        return document.with_decals(self.numbers, before.replace(tangents=tangents))


@dataclass(frozen=True, eq=False)
class Carry(OfNumbers):
    """Move decals over surfaces, and from one object to another.

    The first one goes to a place on a surface. The others keep where they lie as seen from it, as far as
    the surfaces allow: they are turned along with its normal, then put onto what is nearest.
    """

    position: Floats
    normal: Floats
    label: ClassVar[str] = "move"

    def change(self, document: Document) -> Change:
        """Carry positions and frames."""
        before = document.decals.take(self.numbers)
        goal = Places(*_rows(self.position, self.normal), np.zeros(1, np.int32))
        first = carried(before[:1], goal)
        if len(before) == 1:
            return document.with_decals(self.numbers, first)
        turn = turns(before.normals[:1], first.normals)[0]
        offsets = (before.positions[1:].astype(np.float64) - before.positions[0]) @ turn.T
        others = carried(before[1:], nearest(document.objects, first.positions + offsets))
        return document.with_decals(self.numbers, Decals.concatenate([first, others]))


@dataclass(frozen=True, eq=False)
class Duplicate(OfNumbers):
    """Make copies beside decals, along their images' u axes; the new numbers follow the last one."""

    label: ClassVar[str] = "duplicate"

    def change(self, document: Document) -> Change:
        """Add the copies."""
        before = document.decals.take(self.numbers)
        wished = before.positions + NEXT_TO * before.radii[:, None] * before.tangents
        return document.with_added(carried(before, nearest(document.objects, wished)))


@dataclass(frozen=True, eq=False)
class AddImage:
    """One more image that decals may show."""

    image: DecalImage
    label: ClassVar[str] = "add an image"

    def change(self, document: Document) -> Change:
        """Put it last."""
        _check_image(self.image)
        return document.with_parts(images=(*document.images, self.image))


@dataclass(frozen=True, eq=False)
class ChangeImage:
    """Another picture in place of an image; decals that show it show the other."""

    number: int
    image: DecalImage
    label: ClassVar[str] = "change an image"

    def change(self, document: Document) -> Change:
        """Exchange it."""
        _check_image(self.image)
        images = list(document.images)
        images[_image_number(document, self.number)] = self.image
        return document.with_parts(images=tuple(images))


@dataclass(frozen=True, eq=False)
class RemoveImage:
    """An image less. Decals that showed it show their tint alone; later images move up."""

    number: int
    label: ClassVar[str] = "remove an image"

    def change(self, document: Document) -> Change:
        """Renumber the others."""
        number = _image_number(document, self.number)
        images = (*document.images[:number], *document.images[number + 1 :])
        decals, numbers = document.decals.decals, document.decals.numbers
        touched = decals.images >= number
        images_there = decals.images[touched]
        renumbered = np.where(images_there == number, PLAIN, images_there - 1)
        return document.with_decals(
            numbers[touched], decals[touched].replace(images=renumbered), images=images
        )


@dataclass(frozen=True, eq=False)
class Look:
    """Another camera."""

    camera: Camera
    label: ClassVar[str] = "look from elsewhere"

    def change(self, document: Document) -> Change:
        """Exchange it."""
        instance("camera", self.camera, Camera, InvalidEdit, "Camera.framing makes one")
        return document.with_parts(camera=self.camera)


def _rows(position: ArrayLike, normal: ArrayLike) -> tuple[Floats, Floats]:
    """Check a place, and give it as arrays of one row."""
    place = triple("position", position, InvalidEdit)
    direction = triple("normal", normal, InvalidEdit)
    if not direction.any():
        raise InvalidEdit("normal: expected a direction, got a zero vector")
    return as_points(place[None]), unit_rows(direction[None])


def _spread(decals: Decals, name: str, value: ArrayLike) -> Any:
    """Give a row of a value to each decal."""
    known = getattr(decals, name, None)
    if not isinstance(known, np.ndarray):
        raise InvalidEdit(f"expected the name of an array of decals, such as 'layers', got {name!r}")
    try:
        array = np.asarray(value)
        return array if array.ndim == known.ndim else np.broadcast_to(array, known.shape)
    except ValueError as error:
        raise InvalidEdit(
            f"{name}: expected a value for all, or one for each of {len(decals)}, got {value!r:.60}"
        ) from error


def _image_number(document: Document, number: int) -> int:
    return whole("image", number, 0, len(document.images) - 1, InvalidEdit)


def _check_image(image: object) -> None:
    instance("image", image, DecalImage, InvalidEdit, "DecalImage.load makes one")
