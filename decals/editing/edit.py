"""An edit as data: the state of a document before and after, so that undo is exact."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from blobtree._typing import BoolArray, Int64Array
from decals.index.editor import DecalEditor
from decals.model import Decals


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


@dataclass(frozen=True, eq=False)
class SceneParts:
    """Objects, images and camera that an edit replaces; None for parts that stay."""

    objects: Any = None
    images: Any = None
    camera: Any = None

    def overlaid_on(self, other: "SceneParts") -> "SceneParts":
        """Return these parts, and the other ones where these are None."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("objects", "images", "camera"))
        return SceneParts(*(theirs if own is None else own for own, theirs in pairs))


@dataclass(frozen=True, eq=False)
class Edit:
    """Decal states and scene parts before and after; both sides name the same numbers and parts.

    Applying ``before`` undoes the edit bit for bit, applying ``after`` redoes it.

    Attributes
    ----------
    before, after
        States of the edited decals.
    parts_before, parts_after
        Replaced objects, images and camera.
    """

    before: DecalStates = NO_DECALS
    after: DecalStates = NO_DECALS
    parts_before: SceneParts = SceneParts()
    parts_after: SceneParts = SceneParts()

    @property
    def empty(self) -> bool:
        """True if the edit changes nothing."""
        parts = (self.parts_after.objects, self.parts_after.images, self.parts_after.camera)
        return not len(self.after.numbers) and all(part is None for part in parts)

    def then(self, later: "Edit") -> "Edit":
        """Return one edit that does this one and then a later one."""
        return Edit(
            self.before.overlaid_on(later.before),
            later.after.overlaid_on(self.after),
            self.parts_before.overlaid_on(later.parts_before),
            later.parts_after.overlaid_on(self.parts_after),
        )
