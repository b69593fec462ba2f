"""Outlines of decals as lines on the surfaces, exact and without graphics."""

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array
from decals.editing.document import Document
from decals.editing.queries import nearest_points
from decals.errors import InvalidEdit
from decals.field.evaluate import evaluate
from decals.field.mapping import ImageMapping
from decals.model import Decals
from decals.record import Contact
from decals.surfaces.surface import unit_rows
from decals.validation import instance, whole_number

ANGLES, RINGS = 48, 12
"""Directions in which an outline is sampled, and steps from the centre to the rim."""

LIFT = 0.01
"""Height of a line above the surface, in radii."""

RIM_STEPS = 4
"""Steps along the surface to the rim; each one leaves a small part of the remaining distance."""

SEPARATION = 16.0
"""Distance between decals that are evaluated as if each were alone, in radii."""

INSIDE_TOLERANCE = 1.003
"""Distance from an image's centre, in its radii, up to which a point counts as inside."""


def outline(
    document: Document,
    number: int,
    *,
    contact: Contact = Contact.PRODUCT,
    mapping: ImageMapping = ImageMapping.CORRECTED,
) -> Float32Array:
    """Return the line around the visible part of a decal.

    The line ends at neighbours that push the decal. A decal that does not show at its own centre gets the rim
    that it would have without neighbours.

    Parameters
    ----------
    document
        The document, such as ``session.document``.
    number
        Number of the decal.
    contact, mapping
        As for `decals.evaluate`.

    Returns
    -------
    float32, shape (49, 3)
        Points of the closed line, slightly above the surface.

    Raises
    ------
    InvalidEdit
        The decal does not exist.

    Examples
    --------
    >>> from blobtree import Point
    >>> from decals import cover
    >>> from decals.editing import EditSession, outline
    >>> session = EditSession(cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"]))
    >>> outline(session.document, 3).shape
    (49, 3)
    """
    instance("document", document, Document, InvalidEdit, "session.document is one")
    decal = document.decals[whole_number("decal", number, 0, document.decals.next_number - 1, InvalidEdit)]
    center = decal.positions[0].astype(np.float64)
    spokes = _rim_points(document, decal, ANGLES, mapping)[0] - center
    fractions = np.arange(RINGS + 1) / RINGS
    modes = contact, mapping
    visible = _visible_fractions(document, number, center, spokes, np.tile(fractions, (ANGLES, 1)), modes)
    if not visible.any():
        visible = np.ones(ANGLES)
    else:
        finer = np.minimum(visible[:, None] + np.arange(RINGS + 1) / RINGS**2, 1.0)
        visible = _visible_fractions(document, number, center, spokes, finer, modes)
    line: Float32Array = _lifted(document, (center + visible[:, None] * spokes)[None], decal.radii)[0]
    return line


def undisturbed_rims(
    document: Document, numbers: ArrayLike, *, mapping: ImageMapping = ImageMapping.CORRECTED
) -> Float32Array:
    """Return the rims that decals would have without neighbours, float32, shape (n, 25, 3), closed."""
    decals = document.decals.take(numbers)
    if not len(decals):
        return np.zeros((0, ANGLES // 2 + 1, 3), np.float32)
    return _lifted(document, _rim_points(document, decals, ANGLES // 2, mapping), decals.radii)


def _lifted(document: Document, points: Float64Array, radii: Float32Array) -> Float32Array:
    """Return lines (n, k, 3) put onto the surface, slightly above it, and closed."""
    nearest = nearest_points(document.objects, points.reshape(-1, 3))
    lifts = LIFT * np.repeat(radii, points.shape[1])[:, None]
    lines = (nearest.positions + lifts * nearest.normals).reshape(points.shape)
    closed: Float32Array = np.concatenate([lines, lines[:, :1]], axis=1).astype(np.float32)
    return closed


def _rim_points(document: Document, decals: Decals, angles: int, mapping: ImageMapping) -> Float64Array:
    """Return points on the rims of decals without neighbours, float64, shape (n, angles, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, angles, endpoint=False)
    along, across = decals.tangents[:, None].astype(np.float64), decals.bitangents[:, None]
    directions = (np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * across).reshape(-1, 3)
    centers = np.repeat(decals.positions.astype(np.float64), angles, axis=0)
    radii = np.repeat(decals.radii.astype(np.float64), angles)[:, None]
    points, remaining = centers, np.ones((len(centers), 1))
    for _ in range(RIM_STEPS):
        nearest = nearest_points(document.objects, points + remaining * radii * directions)
        points, normals = nearest.positions.astype(np.float64), nearest.normals.astype(np.float64)
        offsets = (points - centers) / radii
        directions = offsets - np.einsum("ni,ni->n", offsets, normals)[:, None] * normals
        directions = unit_rows(directions).astype(np.float64)
        remaining = 1.0 - _image_distances(decals, offsets, normals, mapping)[:, None]
    return points.reshape(len(decals), angles, 3)


def _image_distances(
    decals: Decals, offsets: Float64Array, normals: Float64Array, mapping: ImageMapping
) -> Float64Array:
    """Return distances from the image centres, in image radii, at offsets from decals without neighbours.

    Offsets (n · k, 3) from the centres are in radii, k for each decal. The result is at least 1 outside.
    """
    centers = np.zeros((len(decals), 3))
    centers[:, 0] = SEPARATION * np.arange(len(decals))
    separate = decals.replace(positions=centers, radii=np.ones(len(decals)))
    rows = np.repeat(np.arange(len(decals)), len(offsets) // len(decals))
    samples = evaluate(separate, centers[rows] + offsets, normals, mapping=mapping)
    lengths = 2.0 * np.linalg.norm(samples.uv - 0.5, axis=1)
    outside = np.maximum(np.linalg.norm(offsets, axis=1), 1.0)
    result: Float64Array = np.where(samples.owner == rows, lengths, outside)
    return result


def _visible_fractions(
    document: Document,
    number: int,
    center: Float64Array,
    spokes: Float64Array,
    fractions: Float64Array,
    modes: tuple[Contact, ImageMapping],
) -> Float64Array:
    """Return per spoke the largest fraction up to which the decal shows without a gap, else the first one."""
    points = center + fractions[:, :, None] * spokes[:, None, :]
    nearest = nearest_points(document.objects, points.reshape(-1, 3))
    contact, mapping = modes
    samples = evaluate(document.decals, nearest.positions, nearest.normals, contact=contact, mapping=mapping)
    inside = np.linalg.norm(samples.uv - 0.5, axis=1) <= 0.5 * INSIDE_TOLERANCE
    shows = ((samples.owner == number) & inside).reshape(fractions.shape)
    last = np.logical_and.accumulate(shows, axis=1).sum(axis=1) - 1
    result: Float64Array = np.take_along_axis(fractions, np.maximum(last, 0)[:, None], axis=1)[:, 0]
    return result
