"""Many decals at once: coats over whole objects, and neighbourhoods that even out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.progress import Progress
from decals.checks import shown, triple, whole
from decals.coat.seeding import seed
from decals.edit.change import Change
from decals.edit.document import Document
from decals.edit.places import Places, carried, nearest
from decals.errors import InvalidEdit
from decals.model import Decals
from decals.scenes.scene import SceneObject
from decals.seeds.local_relaxation import OUTER, relax_near
from decals.seeds.population import Sites, World
from decals.surfaces.surface import as_points

SPACING = 3.0**0.5 / 1.03
"""Distance of neighbours in an even coat without gaps, in radii: `sizing.MARGIN` is in the radii."""

MOST = 1_000_000

FARTHEST = 1.01 * OUTER
"""How far away decals are asked where they lie, in spacings, when a neighbourhood relaxes."""


def lying_on(document: Document, objects: Sequence[int]) -> NDArray[np.int64]:
    """Numbers of the decals that are closest to one of these objects."""
    places = nearest(document.objects, document.decals.decals.positions)
    return document.decals.numbers[np.isin(places.objects, objects)]


def object_numbers(objects: object) -> tuple[int, ...]:
    """Numbers of objects that a command was given, or `InvalidEdit`; what they stand for is not looked at."""
    if not isinstance(objects, Sequence) or isinstance(objects, str | bytes):
        raise InvalidEdit(f"objects: expected their numbers, such as (0,), got {shown(objects)}")
    return tuple(objects)


@dataclass(frozen=True, eq=False)
class Coat:
    """New decals in place of those that lie on some objects.

    ``made_for`` are those objects themselves, if the coat fits no others.
    """

    objects: tuple[int, ...]
    decals: Decals
    made_for: tuple[SceneObject, ...] = ()
    label: ClassVar[str] = "scatter"

    def change(self, document: Document) -> Change:
        """Delete and add at once."""
        there = [document.object(number) for number in object_numbers(self.objects)]
        if any(item is not known for item, known in zip(there, self.made_for, strict=False)):
            raise InvalidEdit("an object changed while its new coat was made; scatter again")
        gone = document.without(lying_on(document, self.objects))
        return gone.then(document.with_added(self.decals))


@dataclass(frozen=True, eq=False)
class Scatter:
    """An even coat of so many decals over some objects, in place of what lies there.

    Spreading seeds takes long: `coat` does it anywhere, a thread for instance, for a `Coat` that is quick.
    """

    objects: tuple[int, ...]
    count: int
    seed: int = 0
    label: ClassVar[str] = "scatter"

    def coat(
        self,
        objects: Sequence[SceneObject],
        images: int,
        *,
        progress: Progress | None = None,
        cancel: Callable[[], bool] | None = None,
    ) -> Coat:
        """Spread the decals over a document's objects; arguments are as for `decals.seed`."""
        for number in object_numbers(self.objects):
            whole("object", number, 0, len(objects) - 1, InvalidEdit)
        whole("count", self.count, 0, MOST, InvalidEdit)
        if images < 1:
            raise InvalidEdit("expected an image for the decals to show, got none; add one first")
        covered = tuple(objects[number] for number in self.objects)
        decals = seed(
            [item.surface for item in covered],
            count=self.count,
            seed=self.seed,
            images=images,
            progress=progress,
            cancel=cancel,
        )
        return Coat(self.objects, decals, covered)

    def change(self, document: Document) -> Change:
        """Spread and put on, however long it takes."""
        return self.coat(document.objects, len(document.images)).change(document)


@dataclass(frozen=True, eq=False)
class Relax:
    """Let the decals around a place find their rest; all others stay where they are.

    Decals of the drawing order of the nearest one take part: scales make room for scales, not for eyes.
    """

    place: ArrayLike
    label: ClassVar[str] = "relax"

    def change(self, document: Document) -> Change:
        """Move the neighbourhood, sizes unchanged."""
        center = as_points(triple("place", self.place, InvalidEdit)[None])[0]
        numbers, decals = document.decals.numbers, document.decals.decals
        if not len(decals) or not document.objects:
            return Change()
        distances = np.linalg.norm(decals.positions - center, axis=1)
        closest = int(distances.argmin())
        near = distances < FARTHEST * SPACING * decals.radii[closest]  # the others take no part
        rows = np.flatnonzero(near & (decals.ranks == decals.ranks[closest]))
        if len(rows) < 2:
            return Change()
        surfaces = nearest(document.objects, decals.positions[rows]).objects
        order = np.argsort(surfaces, kind="stable")  # particles come sorted by surface
        rows, surfaces = rows[order], surfaces[order]
        before = Sites(decals.positions[rows], decals.normals[rows], surfaces)
        after = relax_near(
            World([item.surface for item in document.objects], 0),
            before,
            np.ones(len(rows), np.bool_),
            (SPACING * decals.radii[rows]).astype(np.float32),
            center,
        )
        moved = np.flatnonzero((after.positions != before.positions).any(axis=1))
        places = Places(after.positions[moved], after.normals[moved], after.surface_ids[moved])
        return document.with_decals(numbers[rows[moved]], carried(decals[rows[moved]], places))
