"""Brushes for decals: scatter, push, erase and relax within a radius around a surface point."""

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, Int64Array
from blobtree.validation import LARGEST_NUMBER, SMALLEST_NUMBER, describe, finite_number, finite_vector
from decals.editing.brush_settings import Brush, BrushSettings
from decals.editing.commands import DeleteDecals, SetValues
from decals.editing.document import Document, Edit, EditCommand
from decals.editing.queries import SurfacePoints, move_decals, nearest_points
from decals.editing.scatter_commands import SPACING, RelaxDecals
from decals.editing.session import Command
from decals.errors import InvalidEdit
from decals.model import NO_IMAGE, Decals
from decals.scattering.orientation import tangents
from decals.scenes.objects import bounds_of
from decals.validation import whole_number

CLOSEST = 0.8
"""Least distance of new decals in spacings: random discs at full distance would leave two fifths bare."""

CANDIDATES = 30
"""Random points that the scatter brush tries for each decal that fits into its disc."""

STEEP = 0.2
"""Cosine of the angle between a stroke and a surface beyond which the align brush skips a decal."""

MAX_NEW_DECALS = 400
"""Decals that one touch of the scatter brush adds, at most."""


def decals_within(document: Document, point: ArrayLike, radius: float) -> Int64Array:
    """Return the numbers of the decals whose centres lie within a radius around a point, shape (3,).

    Decals of locked layers are left out.
    """
    center = finite_vector("point", point, InvalidEdit)
    reach = positive_number("radius", radius)
    distances = np.linalg.norm(document.decals.decals.positions - center, axis=1)
    near = (distances < reach) & ~np.isin(document.decals.column("layers"), document.locked_layers)
    numbers: Int64Array = document.decals.numbers[near]
    return numbers


def positive_number(name: str, value: float) -> float:
    """Return a number of a brush, above 0 and of a usable size, or raise `InvalidEdit`."""
    number, most = finite_number(name, value, InvalidEdit), 1.0 if name == "density" else LARGEST_NUMBER
    if not SMALLEST_NUMBER <= number <= most:
        raise InvalidEdit(f"{name}: expected a number above 0, at most {most:g}, got {number:g}")
    return number


class BrushDecals(EditCommand):
    """Add decals in a disc on the surface, by dart throwing: none closer to another than their spacing.

    Decals that lie there count too, so a second touch at the same place adds almost none.

    Parameters
    ----------
    point, normal
        Centre of the disc on the surface and unit normal there, shape (3,) each.
    radius
        Radius of the disc, in model units.
    decal_radius
        Radius of the decals.
    density
        1 for decals without gaps; less for wider spacing, which grows with the inverse square root.
    images
        Indices of the images to choose from; empty for all.
    seed
        Random seed.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import BrushDecals, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=0, images=["eye"]))
    >>> edit = session.do(BrushDecals((0, 0, 1), (0, 0, 1), 0.5, decal_radius=0.1))
    >>> len(session.document.decals) > 8
    True
    """

    point: ArrayLike
    normal: ArrayLike
    radius: float
    decal_radius: float
    density: float = 1.0
    images: tuple[int, ...] = ()
    seed: int = 0
    label: ClassVar[str] = "scatter brush"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        reach = positive_number("radius", self.radius)
        decal_radius = positive_number("decal radius", self.decal_radius)
        density = positive_number("density", self.density)
        if not isinstance(self.images, tuple | list):
            raise InvalidEdit(
                f"images: expected indices of images, such as (0, 2), got {describe(self.images)}"
            )
        whole_number("seed", self.seed, 0, None, InvalidEdit)
        images = self.images or tuple(range(len(document.images)))
        for image in images:
            whole_number("image", image, 0, len(document.images) - 1, InvalidEdit)
        if not document.objects:
            return Edit()
        spacing = CLOSEST * SPACING * decal_radius / density**0.5
        points = self._thrown(document, reach, spacing)
        if not len(points.objects):
            return Edit()
        rng = np.random.default_rng([self.seed, 1])
        frames = tangents(points.positions, points.normals, (1.0, 0.0, 0.0), self.seed)
        return document.compute_addition(
            Decals(
                points.positions,
                points.normals,
                frames,
                decal_radius,
                images=rng.choice(images or (NO_IMAGE,), len(points.objects)),
            )
        )

    def _thrown(self, document: Document, reach: float, spacing: float) -> SurfacePoints:
        """Return random points of the disc that keep their distance from decals and from each other."""
        center = finite_vector("point", self.point, InvalidEdit)
        normal = finite_vector("normal", self.normal, InvalidEdit)
        rng = np.random.default_rng(self.seed)
        count = int(min(CANDIDATES * (1.0 + (reach / spacing) ** 2), CANDIDATES * MAX_NEW_DECALS))
        helper = np.eye(3)[np.abs(normal).argmin()]
        along = np.cross(normal, helper)
        along /= np.linalg.norm(along)
        lengths = reach * np.sqrt(rng.uniform(size=count))
        turns = rng.uniform(0.0, 2.0 * np.pi, count)
        offsets = np.cos(turns)[:, None] * along + np.sin(turns)[:, None] * np.cross(normal, along)
        points = nearest_points(document.shown_objects, center + lengths[:, None] * offsets)
        near = document.decals.decals.positions[
            np.linalg.norm(document.decals.decals.positions - center, axis=1) < 2.0 * reach + spacing
        ]
        positions = points.positions.astype(np.float64)

        def far(rows: Int64Array, place: Float64Array) -> Int64Array:
            """Return those of some points that keep their distance from a place."""
            kept_rows: Int64Array = rows[np.linalg.norm(positions[rows] - place, axis=1) >= spacing]
            return kept_rows

        inside = np.flatnonzero(np.linalg.norm(points.positions - center, axis=1) <= reach)
        taken, kept = [*near.astype(np.float64)], list[int]()
        for free in np.split(inside, [2 * MAX_NEW_DECALS]):  # where most stay, the first ones are enough
            for place in taken if len(kept) < MAX_NEW_DECALS else ():
                free = far(free, place)
            while len(free) and len(kept) < MAX_NEW_DECALS:
                kept.append(int(free[0]))
                taken.append(positions[kept[-1]])
                free = far(free, taken[-1])
        return SurfacePoints(points.positions[kept], points.normals[kept], points.objects[kept])


class PushDecals(EditCommand):
    """Push the decals around a point; those farther away yield less, and those outside the brush stay.

    A decal at distance d of the point moves by the offset times (1 − (d/r)²)³, the paper's kernel (eq. 2), so
    the order of neighbours stays for offsets below r/2.

    Parameters
    ----------
    point
        Centre of the brush before the push, shape (3,).
    offset
        Displacement of the brush, shape (3,).
    radius
        Radius of the brush, r.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, PushDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=40, images=["eye"]))
    >>> edit = session.do(PushDecals((0, 0, 1), (0.1, 0, 0), 0.6))
    >>> 0 < len(edit.after.numbers) < 40
    True
    """

    point: ArrayLike
    offset: ArrayLike
    radius: float
    label: ClassVar[str] = "push brush"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        center = finite_vector("point", self.point, InvalidEdit)
        offset = finite_vector("offset", self.offset, InvalidEdit)
        numbers = decals_within(document, center, self.radius)
        if not len(numbers) or not any(offset):
            return Edit()
        before = document.decals.take(numbers)
        squares = np.square((before.positions - center) / self.radius).sum(axis=1)
        shares = np.maximum(1.0 - squares, 0.0) ** 3
        targets = before.positions + shares[:, None] * offset
        points = nearest_points(document.shown_objects, targets)
        return document.compute_replacement(numbers, move_decals(before, points))


class BrushStroke:
    """A drag with a brush, of touches that are one undo entry.

    Parameters
    ----------
    document
        Returns the edited document.
    settings
        The brush.
    run
        Carries out a command.
    select
        Adds decals to the selection, by their numbers.
    """

    def __init__(
        self,
        document: Callable[[], Document],
        settings: BrushSettings,
        run: Callable[[Command], None],
        select: Callable[[Int64Array], None],
    ) -> None:
        self._document, self._settings, self._run, self._select = document, settings, run, select
        self._last: Float32Array | None = None

    @property
    def label(self) -> str:
        """Name of the undo entry."""
        return f"{self._settings.brush} brush"

    def touch(self, position: Float32Array, normal: Float32Array) -> None:
        """Apply the brush at a surface point, shape (3,) each."""
        settings, document = self._settings, self._document()
        radius = settings.radius or default_radius(document)
        last, self._last = self._last, position
        match settings.brush:
            case Brush.SCATTER:
                size = settings.decal_radius or default_decal_radius(document)
                images = tuple(i for i in settings.images if i < len(document.images))
                settings.seed += 1
                self._run(
                    BrushDecals(position, normal, radius, size, settings.density, images, settings.seed)
                )
            case Brush.PUSH if last is not None:
                steps = int(np.ceil(np.linalg.norm(position - last) / (radius / 2)))
                for step in range(steps):
                    start = last + (position - last) * (step / steps)
                    self._run(PushDecals(start, (position - last) / steps, radius))
            case Brush.ERASE:
                numbers = decals_within(document, position, radius)
                if len(numbers):
                    self._run(DeleteDecals(numbers))
            case Brush.PAINT:
                self._select(decals_within(document, position, radius))
            case Brush.RELAX | Brush.ALIGN if last is not None and distance(position, last) <= radius / 4:
                self._last = last
            case Brush.RELAX:
                self._run(RelaxDecals(position, radius))
            case Brush.ALIGN if last is not None:
                command = aligned(document, decals_within(document, position, radius), position - last)
                if command is not None:
                    self._run(command)


def distance(point: Float32Array, other: Float32Array) -> float:
    """Return the distance between two points, shape (3,) each."""
    return float(np.linalg.norm(point - other))


def aligned(document: Document, numbers: Int64Array, direction: Float32Array) -> SetValues | None:
    """Return the command that turns images along a direction, shape (3,); None if it turns none.

    Decals that the direction hits nearly at a right angle are left out.
    """
    rows = document.decals.take(numbers)
    along = direction - (rows.normals @ direction)[:, None] * rows.normals
    lengths = np.linalg.norm(along, axis=1)
    kept = lengths > STEEP * np.linalg.norm(direction)
    if not kept.any():
        return None
    return SetValues.each(numbers[kept], "align", tangents=along[kept] / lengths[kept, None])


def default_radius(document: Document) -> float:
    """Return the radius of a brush: a tenth of the size of the scene, and of 1 without objects."""
    low, high = bounds_of(document.objects) if document.objects else (np.zeros(3), np.ones(3))
    return 0.1 * float((high - low).max())


def default_decal_radius(document: Document) -> float:
    """Return the radius of new decals: the median of the scene, or a fortieth of its size."""
    radii = document.decals.column("radii")
    return float(np.median(radii)) if len(radii) else 0.25 * default_radius(document)
