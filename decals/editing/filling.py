"""Bare places of a document: how to find them, those that an edit opened, and the command that fills them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.editing.document import Document, Edit, EditCommand
from decals.editing.inputs import columns_of, shapes_of
from decals.editing.scatter_commands import object_indices
from decals.errors import InvalidEdit
from decals.field.evaluate import evaluate
from decals.field.mapping import IMAGE_RADIUS_SQUARED
from decals.field.walks import evaluation_options
from decals.model import Decals
from decals.receivers import labels_of, surface_mask, takes_named_only
from decals.rendering.options import Drawing
from decals.scattering.bare_places import filling_points, grown_radii, places_of
from decals.scattering.covering import random_points_around
from decals.scattering.decal_normals import mean_normals
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree
from decals.scattering.orientation import tangents
from decals.scenes.objects import SceneObject, same_shape
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import row_blocks
from decals.validation import instance, whole_number

SAMPLES_PER_CELL = 100
"""Samples for each decal that fits on the surface without gaps, in the first search."""

FINER = 6.0
"""Ratio of the samples of all later searches to those of the first."""

SPREAD = 0.7
"""Standard deviation of the points beside bare samples, in mean distances of the samples."""

BESIDE, MAX_REFINED = 4, 100_000
"""Points beside each bare sample, and most samples that get some."""

MIN_SAMPLES, MAX_SAMPLES = 20_000, 2_000_000
"""Least number of samples of the first search, and largest of any."""

CELL = 2.25
"""Area of a decal among decals without gaps, in squares of its radius."""

MAX_ADDED = 200_000
"""Most decals that one command adds; the search for further bare places takes 10 KB for each."""

MAX_ROUNDS = 8
"""Most searches of `FillBarePlaces`, which ends before them where a search finds no bare place."""

AROUND = 8
"""Nearest decals among which a new one finds those that it is like."""

RIM = 0.3
"""Distance from surface that was bare before, in usual radii, up to which bare points do not count."""

NEAR_RIM = 0.8
"""(Distance from the middle of an image / its radius)² from which a sample is near its rim."""

STREAM = 31
"""First stream of the random samples."""

Choice = Callable[[OrientedPoints], BoolArray]
"""Returns True for the points of bare places that count."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Decals on objects, as they are drawn.

    Attributes
    ----------
    objects
        All objects.
    decals
        The decals.
    drawing
        Contact mode and image mapping.
    """

    objects: tuple[SceneObject, ...]
    decals: Decals
    drawing: Drawing

    @classmethod
    def of(cls, document: Document) -> "Skin":
        """Return the skin of a document."""
        return cls(document.objects, document.decals.decals, document.drawing)

    @property
    def radius(self) -> float:
        """Median radius of the decals, inf without any."""
        return float(np.median(self.decals.radii)) if len(self.decals) else np.inf

    def covers(self, points: OrientedPoints) -> BoolArray:
        """Return True for points, whose surfaces are objects, at which an image shows."""
        covered: BoolArray = self.reaches(points) <= 1.0
        return covered

    def reaches(self, points: OrientedPoints) -> Float64Array:
        """Return (distance from the middle of an image / its radius)² of points, inf where none lies."""
        result = np.full(len(points), np.inf)
        if not len(self.decals):
            return result
        options = evaluation_options(self.drawing, self.decals, self.objects)
        for number in np.unique(points.surface_ids).tolist():
            item, own = self.objects[number], np.flatnonzero(points.surface_ids == number)
            for block in row_blocks(len(own), "looking for bare places"):
                rows = own[block]
                positions, normals = points.positions[rows], points.normals[rows]
                if isinstance(item.surface, MeshSurface):
                    normals = item.surface.smooth_normals(positions)
                found = evaluate(self.decals, positions, normals, on=item, **options)
                squares = ((found.uv.astype(np.float64) - 0.5) ** 2).sum(axis=1)
                result[rows] = np.where(found.owner >= 0, squares / IMAGE_RADIUS_SQUARED, np.inf)
        return result


@dataclass(frozen=True, eq=False)
class BareSamples:
    """Samples of objects at which no image shows.

    Attributes
    ----------
    points
        The samples; their surfaces are the indices of objects.
    beside
        Further bare points around them.
    rim
        All samples near the rims of images, the bare ones too.
    distance
        Mean distance of all samples, bare or not.
    """

    points: OrientedPoints
    beside: OrientedPoints
    rim: OrientedPoints
    distance: float

    @property
    def places(self) -> int:
        """Number of connected places."""
        return places_of(self.points, self.distance)


def bare_samples(
    skin: Skin,
    domain: Domain,
    objects: Sequence[int],
    stream: int,
    chosen: Choice | None = None,
    *,
    finer: float = 1.0,
) -> BareSamples:
    """Return the bare ones among random samples of objects, uniform by area, and others beside them.

    Parameters
    ----------
    skin
        Decals and objects.
    domain
        The surfaces of all objects.
    objects
        Indices of the objects.
    stream
        Stream of random numbers.
    chosen
        Further condition for bare samples. Those beside others, which do not meet it, do not count either:
        the rim of a skin may move a little.
    finer
        Factor of the number of samples.
    """
    areas = np.zeros(len(domain.areas))
    areas[[*objects]] = domain.areas[[*objects]]
    area = float(areas.sum())
    if area == 0.0:
        none = OrientedPoints.empty()
        return BareSamples(none, none, none, 0.0)
    wanted = SAMPLES_PER_CELL * area / (CELL * skin.radius**2)
    count = int(np.clip(finer * max(wanted, MIN_SAMPLES), 0, MAX_SAMPLES))
    counts = np.ceil(count * areas / area).astype(np.int64)
    distance = float(np.sqrt(area / counts.sum()))
    return _bare_among(domain.sample(counts, stream), distance, skin, domain, stream, chosen)


def bare_samples_again(
    skin: Skin, domain: Domain, former: BareSamples, stream: int, chosen: Choice | None = None
) -> BareSamples:
    """Do the same around the rims of a former search, at as many samples for an area."""
    rng = np.random.default_rng(stream)
    found, allowed = domain.project(random_points_around(former.rim, 1, SPREAD * former.distance, rng))
    return _bare_among(found[np.flatnonzero(allowed)], former.distance, skin, domain, stream, chosen)


def _bare_among(
    samples: OrientedPoints,
    distance: float,
    skin: Skin,
    domain: Domain,
    stream: int,
    chosen: Choice | None,
) -> BareSamples:
    """Return the bare ones of some samples of a mean distance, and others beside them."""

    def counting(points: OrientedPoints) -> OrientedPoints:
        if chosen is None or not len(points):
            return points
        blocks = row_blocks(len(points), "looking for bare places")
        counts = np.concatenate([chosen(points[rows]) for rows in blocks])
        near = _distances(points.positions, points.positions[~counts]) < RIM * skin.radius
        return points[np.flatnonzero(counts & ~near)]

    reaches = skin.reaches(samples)
    points = counting(samples[np.flatnonzero(reaches > 1.0)])
    rng = np.random.default_rng(stream)
    around = points[rng.permutation(len(points))[:MAX_REFINED]]
    found, allowed = domain.project(random_points_around(around, BESIDE, SPREAD * distance, rng))
    found = found[np.flatnonzero(allowed)]
    beside = counting(found[np.flatnonzero(~skin.covers(found))])
    return BareSamples(points, beside, samples[np.flatnonzero(reaches > NEAR_RIM)], distance)


def _distances(points: Float32Array, others: Float32Array) -> Float64Array:
    """Return the distance of each point from the nearest of others."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    distances: Float64Array = cKDTree(others).query(points)[0]
    return distances


def stretched_objects(document: Document, edit: Edit) -> tuple[int, ...]:
    """Return the indices of objects whose shape an edit changed below decals, of the document after it.

    New objects do not count, nor a scene that replaces another one.
    """
    touched, former = edit.after.numbers, edit.before.numbers[edit.before.exists]
    numbers = document.decals.numbers
    if not (~np.isin(numbers, touched) | np.isin(numbers, former)).any():
        return ()
    before = {item.name: item for item in edit.parts_before.objects or ()}
    return tuple(
        number
        for number, item in enumerate(document.objects)
        if item.name in before and not same_shape(item, before[item.name])
    )


class OpenedBy:
    """Choice of the bare points that an edit opened: those whose place was covered before.

    A point's place before lies as far from its nearest decal as the point does now.

    Parameters
    ----------
    edit
        The edit.
    document
        The document after it; decals that were added since count as they are.
    """

    def __init__(self, edit: Edit, document: Document) -> None:
        numbers, decals = document.decals.numbers, document.decals.decals
        states = edit.before.numbers[edit.before.exists]
        places = {number: row for row, number in enumerate(states.tolist())}
        rows = np.array([places.get(number, -1) for number in numbers.tolist()], np.int64)
        moved = np.flatnonzero(rows >= 0)
        self._shifts = np.zeros((len(decals), 3))
        self._shifts[moved] = decals.positions[moved].astype(np.float64)
        self._shifts[moved] -= edit.before.decals.positions[rows[moved]]
        self._tree = FacingTree(decals.positions, decals.normals)
        unmoved = decals[np.flatnonzero(~np.isin(numbers, edit.after.numbers))]
        former = tuple(edit.parts_before.objects or document.objects)
        self._skin = Skin(former, Decals.concatenate([unmoved, edit.before.decals]), document.drawing)
        names = [item.name for item in former]
        known = [names.index(item.name) if item.name in names else -1 for item in document.objects]
        self._former = np.array(known, np.int64)

    def __call__(self, points: OrientedPoints) -> BoolArray:
        """Return True for the points whose place was covered."""
        result = np.zeros(len(points), np.bool_)
        if not len(self._shifts):
            return result
        nearest = self._tree.nearest(points.positions, points.normals)[1][:, 0]
        former = self._former[points.surface_ids]
        rows = np.flatnonzero((nearest >= 0) & (former >= 0))
        places = (points.positions[rows] - self._shifts[nearest[rows]]).astype(np.float32)
        positions, normals = np.empty_like(places), np.empty_like(places)
        for number in np.unique(former[rows]).tolist():
            here = former[rows] == number
            positions[here], normals[here] = self._skin.objects[number].surface.project(places[here])
        result[rows] = self._skin.covers(OrientedPoints(positions, normals, former[rows].astype(np.int32)))
        return result


class FillBarePlaces(EditCommand):
    """Cover bare places of objects with new decals like those around them; no other decal moves.

    A new decal has the usual radius of the decals around it, or less in a narrow place. Image, layer,
    interaction and direction are those of one of them. The fewest decals are added that cover a place.

    Parameters
    ----------
    objects
        Indices of the objects.
    opened_by
        Fill only places that this edit opened, such as ``session.next_undo.edit`` after a pull. Places that
        were bare before it stay so. Default: all bare places.
    seed
        Seed of the samples and of all choices.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, FillBarePlaces, MovePrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=0.5)
    >>> session = EditSession(decals.cover(tree, count=60, images=["eye"]))
    >>> edit = session.do(MovePrimitive(0, (1,), (0.6, 0, 0)))
    >>> decals.measure(session.document.scene).coverage > 0.99
    False
    >>> edit = session.do(FillBarePlaces((0,), opened_by=edit))
    >>> decals.measure(session.document.scene).coverage > 0.9999
    True
    """

    objects: tuple[int, ...]
    opened_by: Edit | None = None
    seed: int = 0
    long: ClassVar[bool] = True
    label: ClassVar[str] = "fill bare places"

    def inputs(self, document: Document) -> object:
        """Return what the command reads; new decals take their looks from decals as they are at the start."""
        modes = tuple(document.drawing.modes.values())
        return shapes_of(document.objects), columns_of(document.decals.decals), modes, document.locked_layers

    def compute(self, document: Document) -> Edit:
        """Return the edit, which may take long; it is empty where no place is bare."""
        objects = object_indices(self.objects)
        for number in objects:
            whole_number("object", number, 0, len(document.objects) - 1, InvalidEdit)
        seed = whole_number("seed", self.seed, 0, None, InvalidEdit)
        if self.opened_by is not None:
            instance("opened_by", self.opened_by, Edit, InvalidEdit, "session.next_undo.edit is one")
        if not objects:
            return Edit()
        chosen = None if self.opened_by is None else OpenedBy(self.opened_by, document)
        skin = Skin.of(document)
        models = _Models(skin, document.locked_layers)
        domain = Domain([item.surface for item in document.objects], seed)
        filling = _Filling(skin, domain, models, np.random.default_rng([seed, STREAM]))
        fine: BareSamples | None = None
        for turn in range(MAX_ROUNDS):
            if fine is None:
                finer = FINER if turn else 1.0
                bare = bare_samples(filling.skin, domain, objects, STREAM + turn, chosen, finer=finer)
                fine = bare if turn else None
            else:
                bare = bare_samples_again(filling.skin, domain, fine, STREAM + turn, chosen)
            if not filling.cover(bare):
                break
        return document.compute_addition(filling.added) if len(filling.added) else Edit()


class _Models:
    """Decals that new ones may be like, and the usual radius at points.

    Parameters
    ----------
    skin
        All decals.
    locked_layers
        Layers that get no decals.

    Raises
    ------
    InvalidEdit
        There are none.
    """

    def __init__(self, skin: Skin, locked_layers: tuple[int, ...]) -> None:
        self.decals = skin.decals[np.flatnonzero(~np.isin(skin.decals.layers, locked_layers))]
        if not len(self.decals):
            raise InvalidEdit(
                "expected decals, which new ones would be like, got none on unlocked layers; scatter some"
            )
        self._tree = FacingTree(self.decals.positions, self.decals.normals)
        texts, codes = np.unique(self.decals.receivers, return_inverse=True)
        table = ["", *(text for text in texts.tolist() if text)]
        self._bits = np.array([table.index(text) for text in texts.tolist()])[codes]
        self._masks = [
            surface_mask(labels_of(item), table, named_only=takes_named_only(item)) for item in skin.objects
        ]

    def near(self, points: OrientedPoints) -> tuple[Int64Array, BoolArray, Float64Array, Float64Array]:
        """Return decals near points, which of them new ones may be like, usual radii, and least distances.

        New decals are in the layer and have the interaction of the decal that nearly covers the point.
        Without one that may lie there, the radius is 0.
        """
        blocks = list(row_blocks(len(points), "filling bare places")) or [slice(0)]
        rows, like, usual, distances = zip(*(self._near(points[block]) for block in blocks), strict=True)
        return np.concatenate(rows), np.concatenate(like), np.concatenate(usual), np.concatenate(distances)

    def _near(self, points: OrientedPoints) -> tuple[Int64Array, BoolArray, Float64Array, Float64Array]:
        distances, rows = self._tree.nearest(points.positions, points.normals, count=AROUND)
        masks = np.array(self._masks)[points.surface_ids]
        usable = (rows >= 0) & ((masks[:, None] >> self._bits[rows]) & 1 == 1)
        ratios = np.where(usable, distances / self.decals.radii[rows], np.inf)
        first = rows[np.arange(len(rows)), ratios.argmin(axis=1)]
        like = usable & (self.decals.ranks[rows] == self.decals.ranks[first][:, None])
        radii = np.where(like, self.decals.radii[rows], np.nan).astype(np.float64)
        usual = np.zeros(len(rows))
        some = like.any(axis=1)
        usual[some] = np.nanmedian(radii[some], axis=1)
        return rows, like, usual, distances[:, 0]


class _Filling:
    """New decals beside those of a skin.

    Parameters
    ----------
    skin
        The decals that stay.
    domain
        The surfaces.
    models
        What new decals are like.
    rng
        Chooses the model of each.

    Attributes
    ----------
    added
        The new decals.
    """

    def __init__(self, skin: Skin, domain: Domain, models: _Models, rng: np.random.Generator) -> None:
        self._skin, self._domain, self._models, self._rng = skin, domain, models, rng
        self.added = Decals.empty()
        self._usual = np.zeros(0)
        self._surface_ids = np.zeros(0, np.int32)

    @property
    def skin(self) -> Skin:
        """The skin with the new decals."""
        old = self._skin
        return Skin(old.objects, Decals.concatenate([old.decals, self.added]), old.drawing)

    def cover(self, bare: BareSamples) -> bool:
        """Cover bare samples: decals that were added grow a little, or others are added.

        Return False if nothing changed.
        """
        _, _, usual, depths = self._models.near(bare.points)
        rows = np.flatnonzero(usual > 0.0)
        if not len(rows):
            return False
        points, usual, depths = bare.points[rows], usual[rows], depths[rows]
        expected = len(self.added) + (bare.distance**2 / (CELL * usual**2)).sum()
        if expected > MAX_ADDED:
            raise InvalidEdit(
                f"expected bare places for at most {MAX_ADDED:,} decals, got some for about {expected:,.0f} "
                f"of radius {np.median(usual):.3g}; enlarge the decals first, or scatter others"
            )
        centers = OrientedPoints(self.added.positions, self.added.normals, self._surface_ids)
        radii, reached = grown_radii(points, centers, self.added.radii.astype(np.float64), self._usual)
        if reached.any():
            self.added = self.added.replace(radii=radii)
        rest = np.flatnonzero(~reached)
        if len(rest):
            self._add(*filling_points(self._domain, points[rest], depths[rest], usual[rest], bare.beside))
        return True

    def _add(self, centers: OrientedPoints, radii: Float64Array) -> None:
        """Add decals of some radii, each like one of those around it."""

        def near(trials: Float32Array, rows: Int64Array) -> tuple[Float32Array, Float32Array, Int64Array]:
            return self._domain.near(trials, centers.surface_ids[rows])

        others, like, usual, _ = self._models.near(centers)
        chances = np.where(like, self._rng.random(like.shape), -1.0)
        models = self._models.decals[others[np.arange(len(others)), chances.argmax(axis=1)]]
        normals = mean_normals(centers.positions, centers.normals, radii, near)
        along = tangents(centers.positions, normals, lambda _points: models.tangents, 0)
        added = models.replace(
            positions=centers.positions,
            normals=normals,
            tangents=along,
            radii=radii,
            spill=models.spill | self._domain.one_sided(centers),
        )
        self.added = Decals.concatenate([self.added, added])
        self._usual = np.concatenate([self._usual, usual])
        self._surface_ids = np.concatenate([self._surface_ids, centers.surface_ids])
