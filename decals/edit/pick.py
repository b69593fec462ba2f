"""What a ray meets: exact, without graphics."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from decals.checks import instance
from decals.edit.document import Document
from decals.edit.places import first_hit
from decals.errors import InvalidEdit
from decals.field.contact import Contact
from decals.field.evaluate import evaluate
from decals.surfaces.surface import Floats


@dataclass(frozen=True, eq=False)
class Pick:
    """Where a ray meets a surface: object, ``float32[3]`` position and normal, topmost decal (−1: none)."""

    object: int
    position: Floats
    normal: Floats
    owner: int


def pick(
    document: Document, origin: ArrayLike, direction: ArrayLike, *, contact: Contact = Contact.PAPER
) -> Pick | None:
    """Follow a ray to the first surface, and ask who shows there."""
    instance("document", document, Document, InvalidEdit, "a session has one")
    hit = first_hit(document.objects, origin, direction)
    if not len(hit.objects):
        return None
    owner = -1
    if len(document.decals):
        owner = int(evaluate(document.decals, hit.positions, hit.normals, contact=contact).owner[0])
    return Pick(int(hit.objects[0]), hit.positions[0], hit.normals[0], owner)
