"""Lines around what is seen of decals, on the surfaces: exact, without graphics."""

import numpy as np
from numpy.typing import ArrayLike

from decals.checks import instance, whole
from decals.edit.document import Document
from decals.edit.places import Doubles, nearest
from decals.errors import InvalidEdit
from decals.field.contact import Contact
from decals.field.evaluate import evaluate
from decals.field.mapping import Mapping
from decals.model import Decals
from decals.surfaces.surface import Floats, unit_rows

ANGLES, RINGS = 48, 12
"""Directions in which an outline is sought, and steps on the way out."""

LIFT = 0.01
"""How far above the surface an outline runs, in radii."""

STEPS = 4
"""Along the surface, to where an image ends: each leaves a small part of what was missing."""

APART = 16.0
"""Between decals that are asked as if each were alone, in radii: none knows of another."""

ALMOST = 1.003
"""Distance from an image's centre, in its radii, up to which a point counts as in it."""


def outline(
    document: Document,
    number: int,
    *,
    contact: Contact = Contact.PAPER,
    mapping: Mapping = Mapping.CORRECTED,
) -> Floats:
    """Line around what is seen of a decal, ``float32[ANGLES + 1, 3]``, closed.

    Neighbours that push it, and the surface, count: on ways from its centre to where its image ends, the
    outline lies where somebody else begins to show. A decal that does not show at its own centre gets its
    undisturbed rim.
    """
    instance("document", document, Document, InvalidEdit, "a session has one")
    decal = document.decals[whole("decal", number, 0, document.decals.next_number - 1, InvalidEdit)]
    center = decal.positions[0].astype(np.float64)
    ways = _ends(document, decal, ANGLES, mapping)[0] - center
    shares = np.arange(RINGS + 1) / RINGS
    modes = contact, mapping
    low = _shown(document, number, center, ways, np.tile(shares, (ANGLES, 1)), modes)
    if not low.any():
        low = np.ones(ANGLES)
    else:
        finer = np.minimum(low[:, None] + np.arange(RINGS + 1) / RINGS**2, 1.0)
        low = _shown(document, number, center, ways, finer, modes)
    line: Floats = _lifted(document, (center + low[:, None] * ways)[None], decal.radii)[0]
    return line


def rims(document: Document, numbers: ArrayLike, *, mapping: Mapping = Mapping.CORRECTED) -> Floats:
    """Where the images of decals end that nobody pushes, ``float32[n, ANGLES / 2 + 1, 3]``, closed."""
    decals = document.decals.take(numbers)
    if not len(decals):
        return np.zeros((0, ANGLES // 2 + 1, 3), np.float32)
    return _lifted(document, _ends(document, decals, ANGLES // 2, mapping), decals.radii)


def _lifted(document: Document, points: Doubles, radii: Floats) -> Floats:
    """Lines ``[n, k, 3]`` on the surface, a little above it and closed."""
    found = nearest(document.objects, points.reshape(-1, 3))
    lifts = LIFT * np.repeat(radii, points.shape[1])[:, None]
    lines = (found.positions + lifts * found.normals).reshape(points.shape)
    closed: Floats = np.concatenate([lines, lines[:, :1]], axis=1).astype(np.float32)
    return closed


def _ends(document: Document, decals: Decals, angles: int, mapping: Mapping) -> Doubles:
    """Where the images of decals end in each of so many directions, ``float64[n, angles, 3]``."""
    turn = np.linspace(0.0, 2.0 * np.pi, angles, endpoint=False)
    along, across = decals.tangents[:, None].astype(np.float64), decals.bitangents[:, None]
    ways = (np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * across).reshape(-1, 3)
    centers = np.repeat(decals.positions.astype(np.float64), angles, axis=0)
    radii = np.repeat(decals.radii.astype(np.float64), angles)[:, None]
    points, missing = centers, np.ones((len(centers), 1))
    for _ in range(STEPS):
        found = nearest(document.objects, points + missing * radii * ways)
        points, normals = found.positions.astype(np.float64), found.normals.astype(np.float64)
        offsets = (points - centers) / radii
        ways = offsets - np.einsum("ni,ni->n", offsets, normals)[:, None] * normals
        ways = unit_rows(ways).astype(np.float64)
        missing = 1.0 - _distances(decals, offsets, normals, mapping)[:, None]
    return points.reshape(len(decals), angles, 3)


def _distances(decals: Decals, offsets: Doubles, normals: Doubles, mapping: Mapping) -> Doubles:
    """How far from the middle of its image, in radii of it, a decal alone shows what lies at an offset.

    Offsets ``[n · k, 3]`` from the centres are in radii, k for each. It is 1 or more where nothing shows.
    """
    places = np.zeros((len(decals), 3))
    places[:, 0] = APART * np.arange(len(decals))
    alone = decals.replace(positions=places, radii=np.ones(len(decals)))
    rows = np.repeat(np.arange(len(decals)), len(offsets) // len(decals))
    found = evaluate(alone, places[rows] + offsets, normals, mapping=mapping)
    lengths = 2.0 * np.linalg.norm(found.uv - 0.5, axis=1)
    result: Doubles = np.where(found.owner == rows, lengths, np.maximum(np.linalg.norm(offsets, axis=1), 1.0))
    return result


def _shown(
    document: Document,
    number: int,
    center: Doubles,
    ways: Doubles,
    shares: Doubles,
    modes: tuple[Contact, Mapping],
) -> Doubles:
    """Largest of each way's shares up to which the decal shows without a break, else the first."""
    points = center + shares[:, :, None] * ways[:, None, :]
    found = nearest(document.objects, points.reshape(-1, 3))
    contact, mapping = modes
    seen = evaluate(document.decals, found.positions, found.normals, contact=contact, mapping=mapping)
    inside = np.linalg.norm(seen.uv - 0.5, axis=1) <= 0.5 * ALMOST
    shows = ((seen.owner == number) & inside).reshape(shares.shape)
    last = np.logical_and.accumulate(shows, axis=1).sum(axis=1) - 1
    result: Doubles = np.take_along_axis(shares, np.maximum(last, 0)[:, None], axis=1)[:, 0]
    return result
