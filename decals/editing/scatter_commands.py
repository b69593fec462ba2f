"""Commands for whole objects and many decals: scatter, relax, add and remove objects."""

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, IndexArray, Int64Array
from blobtree.progress import Progress
from blobtree.validation import describe, finite_vector, point_array
from decals.editing.document import Document, Edit, EditCommand
from decals.editing.inputs import columns_of, shapes_of
from decals.editing.queries import SurfacePoints, move_decals, nearest_points
from decals.errors import InvalidEdit
from decals.model import MAX_COORDINATE, Decals
from decals.scattering.appearance import Appearance
from decals.scattering.domain import Domain, Mask, OrientedPoints, checked_values
from decals.scattering.local_relaxation import PUSHING_RADIUS, relax_near
from decals.scattering.scatter import check_regularity, scatter
from decals.scenes.objects import (
    MeshObject,
    SceneObject,
    TreeObject,
    check_names,
    relative_to,
    same_shape,
)
from decals.scenes.recipe import Recipe
from decals.validation import (
    any_number,
    count_number,
    function_or_none,
    instance,
    one_of,
    whole_number,
)

SPACING = 3.0**0.5 / 1.03
"""Distance of neighbours among decals without gaps, in radii (see `covering.RADIUS_MARGIN`)."""

MAX_SCATTERED_DECALS = 1_000_000

SCATTER_OPTIONS = ("regularity", "sizing", "factor", "direction", "images", "choice", "jitter", "weights")
"""Arguments of `decals.scatter` that a command may have besides count and seed."""

RELAXED_DISTANCE = 1.01 * PUSHING_RADIUS
"""Distance up to which decals take part when a neighbourhood is relaxed, in spacings."""


def decals_on(document: Document, objects: Sequence[int]) -> Int64Array:
    """Return the numbers of the decals whose nearest object has one of these indices."""
    nearest = nearest_points(document.objects, document.decals.decals.positions)
    return document.decals.numbers[np.isin(nearest.objects, objects)]


def object_indices(objects: object) -> tuple[int, ...]:
    """Return the objects of a command as a tuple, or raise `InvalidEdit`; the indices are not checked."""
    if not isinstance(objects, Sequence) or isinstance(objects, str | bytes):
        raise InvalidEdit(f"objects: expected their numbers, such as (0,), got {describe(objects)}")
    return tuple(objects)


class ReplaceDecals(EditCommand):
    """Delete the decals on some objects, and add others.

    Parameters
    ----------
    objects
        Indices of the objects.
    decals
        The new decals.
    expected_objects
        The objects for which the decals were made. The command is refused if their shapes changed meanwhile.
    recipe
        How they were made. Default: the scene keeps its recipe.
    mask
        A function that is True for the points (n, 3) where decals are deleted. Default: everywhere.
    label
        Label of the history entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ReplaceDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(ReplaceDecals((0,), session.document.scene.decals[:2]))
    >>> session.document.decals.numbers
    array([3, 4])
    """

    objects: tuple[int, ...]
    decals: Decals
    expected_objects: tuple[SceneObject, ...] = ()
    recipe: Recipe | None = None
    mask: Mask | None = None
    label: str = "scatter"
    long: ClassVar[bool] = True

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        objects = [document.object(number) for number in object_indices(self.objects)]
        pairs = zip(objects, self.expected_objects, strict=False)
        if not all(same_shape(item, expected) for item, expected in pairs):
            raise InvalidEdit("an object changed while its new decals were computed; scatter again")
        numbers = decals_on(document, self.objects)
        function_or_none("mask", self.mask, InvalidEdit)
        if self.mask is not None and len(numbers):
            positions = document.decals.take(numbers).positions
            numbers = numbers[checked_values("mask", self.mask, positions, truths=True) != 0.0]
        deletion = document.compute_deletion(numbers)
        edit = deletion.then(document.compute_addition(self.decals))
        return edit if self.recipe is None else edit.then(document.compute_parts(recipes=(self.recipe,)))


class ScatterDecals(EditCommand):
    """Distribute decals evenly over some objects, in place of the decals that lie there.

    Parameters
    ----------
    objects
        Indices of the objects.
    count
        Number of decals.
    seed
        Random seed.
    options
        More arguments of `decals.scatter`, such as ``{"regularity": 0.5}``.
    mask
        A zone, as the mask of `decals.scatter`: decals outside it stay. Default: everywhere.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ScatterDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(ScatterDecals((0,), count=5))
    >>> len(session.document.decals)
    5
    """

    objects: tuple[int, ...]
    count: int
    seed: int = 0
    options: dict[str, Any] = field(default_factory=dict)
    mask: Mask | None = None
    long: ClassVar[bool] = True
    label: ClassVar[str] = "scatter"

    def compute_command(
        self,
        objects: Sequence[SceneObject],
        images: int,
        *,
        progress: Progress | None = None,
        cancel: Callable[[], bool] | None = None,
    ) -> ReplaceDecals:
        """Distribute the decals, in any thread, and return the quick command that adds them.

        Parameters
        ----------
        objects
            All objects of the document.
        images
            Number of images that the decals may show.
        progress, cancel
            As for `decals.scatter`.
        """
        covered = self.covered(objects)
        if images < 1:
            raise InvalidEdit("expected an image for the decals to show, got none; add one first")
        self.check_values()
        chosen = {"images": images, **self.options}
        decals = scatter(
            [item.surface for item in covered],
            count=self.count,
            seed=self.seed,
            mask=self.mask,
            progress=progress,
            cancel=cancel,
            **chosen,
        )
        if self.mask is not None:
            return ReplaceDecals(self.objects, decals, covered, mask=self.mask)
        names = [item.name for item in covered]
        given = {"models": names, "count": len(decals), **chosen}
        recipe = Recipe.of("decals.scatter", seed=self.seed, **given).giving(decals, covered)
        return ReplaceDecals(self.objects, decals, covered, recipe)

    def covered(self, objects: Sequence[SceneObject]) -> tuple[SceneObject, ...]:
        """Return the objects of the command among all objects, or raise `InvalidEdit`."""
        numbers = object_indices(self.objects)
        for number in numbers:
            whole_number("object", number, 0, len(objects) - 1, InvalidEdit)
        return tuple(objects[number] for number in numbers)

    def check_values(self) -> None:
        """Raise `InvalidEdit` or `InvalidScattering` for a count, a seed or an option that is not valid."""
        count_number("count", self.count, 0, MAX_SCATTERED_DECALS, InvalidEdit)
        function_or_none("mask", self.mask, InvalidEdit)
        whole_number("seed", self.seed, 0, None, InvalidEdit)
        options = dict(instance("options", self.options, dict, InvalidEdit, "such as {'factor': 0.5}"))
        for name in options:
            one_of("option", name, SCATTER_OPTIONS, InvalidEdit)
        check_regularity(options.pop("regularity", 1.0))
        options.pop("weights", None)  # as many as there are images
        Appearance(**options)

    def compute(self, document: Document) -> Edit:
        """Return the edit, which may take long."""
        return self.compute_command(document.objects, len(document.images)).compute(document)


class RelaxDecals(EditCommand):
    """Even out the decals around a point; all others stay where they are.

    Only decals with the draw order of the nearest one take part.

    Parameters
    ----------
    point
        Centre of the neighbourhood, shape (3,).
    radius
        Decals within this distance move. Default: those about the nearest decal.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RelaxDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"]))
    >>> edit = session.do(RelaxDecals((0, 0, 1)))
    >>> session.labels
    ('relax',)
    """

    point: ArrayLike
    radius: float | None = None
    long: ClassVar[bool] = True
    label: ClassVar[str] = "relax"

    def inputs(self, document: Document) -> object:
        """Return what the command reads: the shapes of objects, and the decals around the point."""
        _, rows = self._around(document)
        decals = document.decals.decals[rows]
        return shapes_of(document.objects), document.decals.numbers[rows].tolist(), columns_of(decals)

    def _around(self, document: Document) -> tuple[Float32Array, IndexArray]:
        """Return the point, and the rows of the decals that take part."""
        center = point_array([finite_vector("point", self.point, InvalidEdit)])[0]
        radius = self.radius
        if radius is not None:  # no scene is larger than the largest coordinate
            radius = min(any_number("radius", radius, InvalidEdit), MAX_COORDINATE)
        decals = document.decals.decals
        if not len(decals) or not document.objects:
            return center, np.zeros(0, np.intp)
        distances = np.linalg.norm(decals.positions - center, axis=1)
        closest = int(distances.argmin())
        reach = RELAXED_DISTANCE * SPACING * decals.radii[closest]
        if radius is not None:
            reach += radius
        near = distances < reach
        near &= ~np.isin(decals.layers, document.locked_layers)
        return center, np.flatnonzero(near & (decals.ranks == decals.ranks[closest]))

    def compute(self, document: Document) -> Edit:
        """Return the edit; radii stay."""
        center, rows = self._around(document)
        numbers, decals = document.decals.numbers, document.decals.decals
        if len(rows) < 2:
            return Edit()
        surfaces = nearest_points(document.objects, decals.positions[rows]).objects
        order = np.argsort(surfaces, kind="stable")  # the solver expects particles sorted by surface
        rows, surfaces = rows[order], surfaces[order]
        before = OrientedPoints(decals.positions[rows], decals.normals[rows], surfaces)
        after = relax_near(
            Domain([item.surface for item in document.objects], 0),
            before,
            np.ones(len(rows), np.bool_),
            (SPACING * decals.radii[rows]).astype(np.float32),
            center,
            None if self.radius is None else min(self.radius, MAX_COORDINATE),
        )
        moved = np.flatnonzero((after.positions != before.positions).any(axis=1))
        points = SurfacePoints(after.positions[moved], after.normals[moved], after.surface_ids[moved])
        return document.compute_replacement(numbers[rows[moved]], move_decals(decals[rows[moved]], points))


class AddObject(EditCommand):
    """Add a mesh or a BlobTree, as the last object; the decals stay where they are.

    Parameters
    ----------
    object
        The object; its name must be new.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import AddObject, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(AddObject(decals.TreeObject("ball", Point((3, 0, 0), radius=1.0))))
    >>> session.document.objects[1].name
    'ball'
    """

    long: ClassVar[bool] = True
    object: SceneObject
    label: str = "add an object"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        if not isinstance(self.object, MeshObject | TreeObject):
            raise InvalidEdit(f"expected a MeshObject or a TreeObject to add, got {describe(self.object)}")
        item = relative_to(self.object, document.origin) if document.objects else self.object
        objects = (*document.objects, item)
        check_names(objects)
        item.surface  # noqa: B018  # raises for a tree without a visible surface
        return document.compute_parts(objects=objects)


class MoveObject(EditCommand):
    """Give an object another place in the order of the objects.

    Parameters
    ----------
    number
        Index of the object.
    place
        Its index afterwards.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession
    >>> from decals.editing.scatter_commands import MoveObject
    >>> balls = [Point((x, 0, 0), radius=1.0) for x in (0, 3, 6)]
    >>> session = EditSession(decals.cover(balls, count=3, images=["eye"]))
    >>> edit = session.do(MoveObject(0, 2))
    >>> [item.name for item in session.document.objects]
    ['model 2', 'model 3', 'model 1']
    """

    number: int
    place: int
    label: ClassVar[str] = "reorder objects"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        for number in (self.number, self.place):
            document.object(number)
        objects = list(document.objects)
        objects.insert(self.place, objects.pop(self.number))
        return document.compute_parts(objects=tuple(objects))


class RemoveObject(EditCommand):
    """Remove an object and the decals on it; the index of later objects decreases by one.

    Parameters
    ----------
    number
        Index of the object.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RemoveObject
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(RemoveObject(0))
    >>> len(session.document.objects), len(session.document.decals)
    (0, 0)
    """

    number: int
    long: ClassVar[bool] = True
    label: ClassVar[str] = "remove an object"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        removed = document.object(self.number)
        others = tuple(item for item in document.objects if item is not removed)
        return document.compute_deletion(decals_on(document, [self.number]), objects=others)
