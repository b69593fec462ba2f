"""What can be done to decals and images; each command is a value, and computes a change."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from decals.edit.change import Change, Numbers
from decals.edit.document import Document
from decals.edit.places import Places, carried, nearest, turns
from decals.errors import InvalidEdit
from decals.grid.rows import as_numbers
from decals.model import PLAIN, Decals
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage
from decals.surfaces.surface import Floats, unit_rows

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
        before = document.decals.take(self.numbers)
        arrays = {name: _spread(before, name, value) for name, value in self.values.items()}
        return document.with_decals(self.numbers, before.replace(**arrays))


@dataclass(frozen=True, eq=False)
class Scale(OfNumbers):
    """Make decals larger, or smaller for a factor below 1."""

    factor: float
    label: ClassVar[str] = "scale"

    def change(self, document: Document) -> Change:
        """Multiply the radii."""
        _check_number("factor", self.factor)
        before = document.decals.take(self.numbers)
        radii = before.radii.astype(np.float64) * self.factor
        return document.with_decals(self.numbers, before.replace(radii=radii))


@dataclass(frozen=True, eq=False)
class Turn(OfNumbers):
    """Turn images about their normals, counter-clockwise seen from outside."""

    degrees: float
    label: ClassVar[str] = "turn"

    def change(self, document: Document) -> Change:
        """Turn the tangents."""
        _check_number("degrees", self.degrees)
        before = document.decals.take(self.numbers)
        angle = np.radians(self.degrees)
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
        return document.with_parts(images=(*document.images, self.image))


@dataclass(frozen=True, eq=False)
class ChangeImage:
    """Another picture in place of an image; decals that show it show the other."""

    number: int
    image: DecalImage
    label: ClassVar[str] = "change an image"

    def change(self, document: Document) -> Change:
        """Exchange it."""
        _check_image(document, self.number)
        images = list(document.images)
        images[self.number] = self.image
        return document.with_parts(images=tuple(images))


@dataclass(frozen=True, eq=False)
class RemoveImage:
    """An image less. Decals that showed it show their tint alone; later images move up."""

    number: int
    label: ClassVar[str] = "remove an image"

    def change(self, document: Document) -> Change:
        """Renumber the others."""
        _check_image(document, self.number)
        images = (*document.images[: self.number], *document.images[self.number + 1 :])
        decals, numbers = document.decals.decals, document.decals.numbers
        touched = decals.images >= self.number
        shown = decals.images[touched]
        renumbered = np.where(shown == self.number, PLAIN, shown - 1)
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
        return document.with_parts(camera=self.camera)


def _rows(position: ArrayLike, normal: ArrayLike) -> tuple[Floats, Floats]:
    """Check a place, and give it as arrays of one row."""
    rows = np.array([position, normal], np.float32)
    if rows.shape != (2, 3) or not np.isfinite(rows).all() or not rows[1].any():
        raise InvalidEdit(f"expected a position and a normal, got {position!r:.60} and {normal!r:.60}")
    return rows[:1], unit_rows(rows[1:])


def _spread(decals: Decals, name: str, value: ArrayLike) -> Any:
    """Give a row of a value to each decal."""
    known = getattr(decals, name, None)
    if not isinstance(known, np.ndarray):
        raise InvalidEdit(f"expected the name of an array of decals, such as 'layers', got {name!r}")
    array = np.asarray(value)
    return array if array.ndim == known.ndim else np.broadcast_to(array, known.shape)


def _check_number(name: str, value: float) -> None:
    if not np.isfinite(value):
        raise InvalidEdit(f"{name}: expected a finite number, got {value!r}")


def _check_image(document: Document, number: int) -> None:
    if not 0 <= number < len(document.images):
        raise InvalidEdit(f"expected the number of an image, 0 to {len(document.images) - 1}, got {number}")
