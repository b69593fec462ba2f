"""What a ray meets, and whose outline is where: exact, without graphics."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from decals.checks import whole
from decals.edit.document import Document
from decals.edit.places import Doubles, first_hit, nearest
from decals.errors import InvalidEdit
from decals.field.contact import Contact
from decals.field.evaluate import evaluate
from decals.surfaces.surface import Floats

ANGLES, RINGS = 48, 12
"""Directions in which an outline is sought, and steps on the way out."""

LIFT = 0.01
"""How far above the surface an outline runs, in radii."""


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
    hit = first_hit(document.objects, origin, direction)
    if not len(hit.objects):
        return None
    owner = -1
    if len(document.decals):
        owner = int(evaluate(document.decals, hit.positions, hit.normals, contact=contact).owner[0])
    return Pick(int(hit.objects[0]), hit.positions[0], hit.normals[0], owner)


def outline(document: Document, number: int, *, contact: Contact = Contact.PAPER) -> Floats:
    """Line around what is seen of a decal, ``float32[ANGLES + 1, 3]``, closed.

    Neighbours that push it, and the surface, count: along rays from its centre the outline lies where
    somebody else begins to show. A decal that does not show at its own centre gets its undisturbed rim.
    """
    decal = document.decals[whole("decal", number, 0, document.decals.next_number - 1, InvalidEdit)]
    center, radius = decal.positions[0].astype(np.float64), float(decal.radii[0])
    turn = np.linspace(0.0, 2.0 * np.pi, ANGLES, endpoint=False)
    ways = np.cos(turn)[:, None] * decal.tangents[0] + np.sin(turn)[:, None] * decal.bitangents[0]
    shares = np.arange(RINGS + 1) / RINGS
    low = _owned(document, number, center, radius * ways, np.tile(shares, (ANGLES, 1)), contact)
    if not low.any():
        low = np.ones(ANGLES)
    else:
        finer = low[:, None] + np.arange(RINGS + 1) / RINGS**2
        low = np.minimum(_owned(document, number, center, radius * ways, finer, contact), 1.0)
    found = nearest(document.objects, center + (low * radius)[:, None] * ways)
    line = found.positions + np.float32(LIFT * radius) * found.normals
    return np.concatenate([line, line[:1]])


def rims(document: Document, numbers: ArrayLike) -> Floats:
    """Undisturbed rims of decals, laid onto the surfaces, ``float32[n, ANGLES / 2 + 1, 3]``, closed."""
    decals = document.decals.take(numbers)
    if not len(decals):
        return np.zeros((0, ANGLES // 2 + 1, 3), np.float32)
    turn = np.linspace(0.0, 2.0 * np.pi, ANGLES // 2 + 1)
    around = [
        np.cos(turn)[None, :, None] * decals.tangents[:, None, :],
        np.sin(turn)[None, :, None] * decals.bitangents[:, None, :],
    ]
    points = decals.positions[:, None] + decals.radii[:, None, None] * (around[0] + around[1])
    found = nearest(document.objects, points.reshape(-1, 3))
    lifts = LIFT * np.repeat(decals.radii, len(turn))[:, None]
    lines: Floats = (found.positions + lifts * found.normals).astype(np.float32)
    return lines.reshape(points.shape)


def _owned(
    document: Document, number: int, center: Doubles, ways: Doubles, shares: Doubles, contact: Contact
) -> Doubles:
    """Largest of each way's shares up to which the decal shows without a break, else the first."""
    points = center + shares[:, :, None] * ways[:, None, :]
    found = nearest(document.objects, points.reshape(-1, 3))
    owner = evaluate(document.decals, found.positions, found.normals, contact=contact).owner
    shows = (owner == number).reshape(shares.shape)
    last = np.logical_and.accumulate(shows, axis=1).sum(axis=1) - 1
    result: Doubles = np.take_along_axis(shares, np.maximum(last, 0)[:, None], axis=1)[:, 0]
    return result
