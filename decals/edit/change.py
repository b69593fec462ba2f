"""A change of a document as data: what was before and what is after, so that undo needs no thinking."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from decals.grid.editor import DecalEditor
from decals.model import Decals

Numbers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Rows:
    """What some numbers hold: ``decals`` are those of the numbers that are ``there``, in their order."""

    numbers: Numbers
    there: NDArray[np.bool_]
    decals: Decals

    @classmethod
    def of(cls, editor: DecalEditor, numbers: Numbers) -> Self:
        """Copy what an editor holds."""
        there = editor.has(numbers)
        return cls(numbers, there, editor.take(numbers[there]))

    @classmethod
    def full(cls, numbers: Numbers, decals: Decals) -> Self:
        """A decal for each number."""
        return cls(numbers, np.ones(len(numbers), np.bool_), decals)

    @classmethod
    def bare(cls, numbers: Numbers) -> Self:
        """No decal for any number."""
        return cls(numbers, np.zeros(len(numbers), np.bool_), Decals.empty())

    def overlaid(self, other: "Rows") -> "Rows":
        """These, and the other's for the numbers that only that one has."""
        if np.array_equal(other.numbers, self.numbers):  # as in each step of a drag
            return self
        news = ~np.isin(other.numbers, self.numbers)
        if not news.any():
            return self
        return Rows(
            np.concatenate([self.numbers, other.numbers[news]]),
            np.concatenate([self.there, other.there[news]]),
            Decals.concatenate([self.decals, other.decals[news[other.there]]]),
        )

    def put_into(self, editor: DecalEditor) -> None:
        """Make an editor hold this."""
        gone = self.numbers[~self.there]
        gone = gone[editor.has(gone)]
        if len(gone):
            editor.delete(gone)
        if self.there.any():
            editor.put(self.numbers[self.there], self.decals)


NOTHING = Rows.bare(np.zeros(0, np.int64))


@dataclass(frozen=True, eq=False)
class Parts:
    """Objects, images or camera that a change exchanges; None where it leaves them."""

    objects: Any = None
    images: Any = None
    camera: Any = None

    def overlaid(self, other: "Parts") -> "Parts":
        """These, and the other's where this has none."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("objects", "images", "camera"))
        return Parts(*(theirs if own is None else own for own, theirs in pairs))


@dataclass(frozen=True, eq=False)
class Change:
    """Rows and parts before and after; both sides name the same numbers and parts.

    A document puts on one side or the other, so what is undone is what was, bit for bit.
    """

    before: Rows = NOTHING
    after: Rows = NOTHING
    parts_before: Parts = Parts()
    parts_after: Parts = Parts()

    @property
    def empty(self) -> bool:
        """Whether it names nothing."""
        parts = (self.parts_after.objects, self.parts_after.images, self.parts_after.camera)
        return not len(self.after.numbers) and all(part is None for part in parts)

    def then(self, later: "Change") -> "Change":
        """Both as one: what was before this, what is after the later."""
        return Change(
            self.before.overlaid(later.before),
            later.after.overlaid(self.after),
            self.parts_before.overlaid(later.parts_before),
            later.parts_after.overlaid(self.parts_after),
        )
