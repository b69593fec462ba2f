"""`measure`: how decals lie on a scene, at random points that the scattering did not use."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array
from blobtree.progress import Progress, reporting
from decals.errors import InvalidScene
from decals.field.evaluate import Samples, evaluate
from decals.field.jacobian import folds_of, normal_derivatives_of_triangles, stretch_of
from decals.field.mapping import IMAGE_RADIUS_SQUARED, ImageMapping
from decals.field.rules import AnyContact
from decals.field.walks import evaluation_options
from decals.model import Decals, Interaction
from decals.scattering.center_normals import Centers
from decals.scattering.domain import Domain, OrientedPoints, apportion
from decals.scattering.neighbors import FacingTree, bond_orders, ideal_spacing, spacing_of_distances
from decals.scenes.gaps import gap_widths
from decals.scenes.objects import MeshObject, SceneObject
from decals.scenes.scene import Scene, require_scene
from decals.surfaces.normals import split_at_creases
from decals.surfaces.surface import tangent_axes, unit_rows
from decals.validation import count_number, whole_number

SAMPLES_PER_DECAL = 200
MIN_SAMPLES = 20_000
MAX_DEFAULT_SAMPLES = 1_000_000
MAX_SAMPLES = 100_000_000
"""Points on the surfaces: default for each decal, least and most of the default, and limit."""

CHUNK = 1 << 16
"""Points that are evaluated at a time."""

LINE_STEP = 0.05
"""Length of the segments that find contact lines, in visible radii of the owner."""

TURN_STEP = 1e-2
"""Step of the derivatives of normals, in visible radii."""

STREAM = 9
"""Stream of random numbers that no scattering uses."""

STRETCHED = 5.0
"""Ratio of the largest to the smallest stretch of an image above which it counts as stretched."""

PERCENTILES = (50.0, 95.0, 100.0)


@dataclass(frozen=True, eq=False)
class DecalMeasures:
    """Measures of each decal, float64[n] each; areas and lengths in the scene's units.

    Attributes
    ----------
    visible_area
        Area on which the decal is the topmost one and shows its image.
    overlap_area
        Area inside its undeformed rim that lies inside the rim of another decal too.
    stretch_median, stretch_p95, stretch_max
        Ratio of the largest to the smallest stretch of its image; NaN where nothing of it shows.
    folded
        Share of its visible area on which the image is folded, which means mirrored; NaN likewise.
    contact_length
        Length of the lines on which it meets other contact decals.
    nearest
        Distance to the nearest decal that lies on surface facing the same way; infinity without one.
    undeformed_area
        Area that its image alone would show, without other decals.
    kept
        Share of the undeformed area that contact leaves to it; NaN without any.
    residual_overlap
        Area that it has in common with other decals after contact: those of other layers, and decals that
        overlap or are independent. Contact decals of one layer have none in common.
    bond_order
        Order of the directions to its six nearest neighbours, 1 in a hexagonal lattice; NaN with fewer.
    """

    visible_area: Float64Array
    overlap_area: Float64Array
    stretch_median: Float64Array
    stretch_p95: Float64Array
    stretch_max: Float64Array
    folded: Float64Array
    contact_length: Float64Array
    nearest: Float64Array
    undeformed_area: Float64Array
    kept: Float64Array
    residual_overlap: Float64Array
    bond_order: Float64Array

    def __repr__(self) -> str:
        """Return the number of decals."""
        return f"DecalMeasures({len(self.nearest)})"


@dataclass(frozen=True, eq=False)
class Measures:
    """Measures of a scene; areas and lengths in the scene's units.

    Attributes
    ----------
    area
        Area of all surfaces outside other, closed surfaces.
    coverage
        Share of the area that shows an image, from 0 to 1.
    gap_area
        Area that shows none.
    overlap_area
        Area inside the undeformed rims of two or more decals.
    stretch_median, stretch_p95, stretch_max
        Ratio of the largest to the smallest stretch of an image, over the points that show one; 1 keeps
        shapes. NaN without any.
    stretched
        Share of these points where that ratio is above 5.
    folded
        Share of these points where the image is folded, which means mirrored.
    contact_length
        Length of all lines on which two contact decals of one layer meet.
    kept
        Share of the undeformed areas of all decals that contact leaves to them; NaN without any.
    residual_overlap
        Area on which several images lie over each other after contact.
    gap_mean, gap_cv, gap_p95, gap_max
        Distance of bare surface from the nearest image: mean, coefficient of variation, 95th percentile and
        largest. NaN without gaps or decals. An even width of the gaps has a low variation.
    least_distance, mean_distance, bond_order
        Least and mean distance of a centre from the nearest one, and mean order of the directions to six. A
        high least distance with a high bond order is a lattice, not blue noise.
    rho, cv, cv6
        Evenness of the centres, as `decals.scattering.Spacing` has it: least distance over that of a
        hexagonal tiling, and variations of the distances to one neighbour and to six.
    covering_radius
        Largest distance of the surface from the nearest centre on surface that faces the same way; infinity
        if surface has none, NaN without decals.
    samples
        Number of points that were evaluated.
    decals
        The same for each decal.
    """

    area: float
    coverage: float
    gap_area: float
    overlap_area: float
    stretch_median: float
    stretch_p95: float
    stretch_max: float
    stretched: float
    folded: float
    contact_length: float
    kept: float
    residual_overlap: float
    gap_mean: float
    gap_cv: float
    gap_p95: float
    gap_max: float
    least_distance: float
    mean_distance: float
    bond_order: float
    rho: float
    cv: float
    cv6: float
    covering_radius: float
    samples: int
    decals: DecalMeasures

    def __repr__(self) -> str:
        """Return all measures, to four digits."""
        texts = (
            f"{name}={value if isinstance(value, int) else format(value, '.4g')}"
            for name, value in self.summary().items()
        )
        return f"Measures({', '.join(texts)}, decals={self.decals!r})"

    def summary(self) -> dict[str, float]:
        """Return the measures of the whole scene by name."""
        return {name: value for name, value in vars(self).items() if name != "decals"}

    def to_dict(self) -> dict[str, Any]:
        """Return all measures as numbers and lists for JSON; None stands for what is unknown."""
        each = {name: list(map(_finite, column)) for name, column in asdict(self.decals).items()}
        return {name: _finite(value) for name, value in self.summary().items()} | {"decals": each}


def _finite(value: float) -> float | None:
    return (int(value) if isinstance(value, int) else float(value)) if np.isfinite(value) else None


def measure(
    scene: Scene,
    *,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    samples: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Measures:
    """Measure how decals lie on a scene: coverage, gaps, overlaps, stretch, folds, contact lines, evenness.

    Random points, uniform by area, are evaluated with the normals with which the scene is drawn. So areas and
    lengths are estimates. For m points the error of a share p is about √(p (1 − p)/m), and often far less,
    because the points are stratified. The error of the contact length is about 3/√m of this length for
    decals that touch all around. Figures of a single decal rest on the
    points in it alone. Transparent images count as visible.

    Parameters
    ----------
    scene : Scene
        The scene.
    contact, stiffness, mapping : optional
        Modes, as for `decals.evaluate`; by default those of the scene's ``drawing``.
    samples : int, optional
        Number of points. Default: 200 for each decal, from 20,000 to 1,000,000.
    seed : int
        Seed of the points; equal seeds give equal measures.
    progress : callable, optional
        Called with the name of the stage and the fraction done.

    Returns
    -------
    Measures

    Raises
    ------
    InvalidScene
        No scene, a posed scene, a scene without objects, or an option out of range.

    See Also
    --------
    decals.evaluate : what decals show at given points, with the Jacobian and the neighbours.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=30)
    >>> measures = decals.measure(scene)
    >>> measures.coverage > 0.999, measures.folded < 0.01, len(measures.decals.visible_area)
    (True, True, 30)
    """
    require_scene("scene", scene, "measure the scene that was posed, where its decals lie")
    count = len(scene.decals)
    if samples is None:
        samples = min(max(SAMPLES_PER_DECAL * count, MIN_SAMPLES), MAX_DEFAULT_SAMPLES)
    samples = count_number("samples", samples, 1, MAX_SAMPLES, InvalidScene)
    seed = whole_number("seed", seed, 0, None, InvalidScene)
    if not scene.objects:
        raise InvalidScene("expected a scene with an object to measure, got none; add one")
    drawing = scene.drawing.overridden(contact=contact, stiffness=stiffness, mapping=mapping)
    options = evaluation_options(drawing, scene.decals, scene.objects)
    with reporting(progress) as report:
        report("measuring", 0.0)
        domain = Domain([item.surface for item in scene.objects], seed)
        counts = apportion(domain.areas, samples)
        points = domain.sample(counts, STREAM)
        sums = _Sums(scene.decals, domain.area / samples)
        rng = np.random.default_rng([seed, STREAM])
        done = 0
        for number, item in enumerate(scene.objects):
            rows = np.flatnonzero(points.surface_ids == number)
            for part, normals, turns in _drawn(item, points.positions[rows], points.normals[rows], scene):
                sums.add(part, normals, turns, options | {"on": item}, rng)
                done += len(part)
                report("measuring", done / samples)
        centers = Centers.of(scene.decals, domain.surfaces, ideal_spacing(domain.area, count))
        return sums.result(domain.area, samples, centers, points)


def _drawn(
    item: SceneObject, points: Float32Array, normals: Float32Array, scene: Scene
) -> Iterator[tuple[Float32Array, Float32Array, Float64Array]]:
    """Yield points of an object in parts, the normals with which it is drawn, and their derivatives."""
    split = None
    if isinstance(item, MeshObject):
        split = split_at_creases(item.vertices, item.faces, item.crease_angle)
    radii = scene.decals.radii
    step = TURN_STEP * float(np.median(radii)) if len(radii) else 1.0
    for first in range(0, len(points), CHUNK):
        part, facings = points[first : first + CHUNK], normals[first : first + CHUNK]
        if split is not None and isinstance(item, MeshObject):
            faces, weights = item.surface.locate(part)
            rows = split.faces[faces]
            corners = split.normals[rows]
            turns = normal_derivatives_of_triangles(item.vertices[split.rows[rows]], corners)
            yield part, np.einsum("mk,mki->mi", weights, corners).astype(np.float32), turns
        else:
            yield part, facings, _turns(item, part, facings, step)


def _turns(item: SceneObject, points: Float32Array, normals: Float32Array, step: float) -> Float64Array:
    """Return derivatives of the normals of an implicit surface by differences, float64[m, 3, 3]."""
    turns = np.zeros((len(points), 3, 3))
    for axis in tangent_axes(normals):
        ahead, behind = (item.surface.normal(points + sign * step * axis) for sign in (1.0, -1.0))
        turns += ((ahead - behind).astype(np.float64) / (2.0 * step))[:, :, None] * axis[:, None, :]
    return turns


class _Sums:
    """Sums over points of equal area, and the stretch at each."""

    def __init__(self, decals: Decals, area: float) -> None:
        self.decals, self.area = decals, area
        count = len(decals)
        self.shown, self.overlapped, self.lines = (np.zeros(count) for _ in range(3))
        self.alone, self.kept, self.residues = (np.zeros(count) for _ in range(3))
        self.overlap = self.residue = 0
        self._gaps: list[Float64Array] = []
        self._owners: list[Int32Array] = []
        self._stretch: list[Float64Array] = []
        self._folds: list[BoolArray] = []

    def add(
        self,
        points: Float32Array,
        normals: Float32Array,
        turns: Float64Array,
        modes: dict[str, Any],
        rng: np.random.Generator,
    ) -> None:
        """Add points."""
        found = evaluate(
            self.decals,
            points,
            normals,
            **modes,
            jacobian=True,
            normal_derivatives=turns,
            neighbors=True,
        )
        count = len(self.decals)
        inside = ((found.uv.astype(np.float64) - 0.5) ** 2).sum(axis=1) <= IMAGE_RADIUS_SQUARED
        shown = (found.owner >= 0) & inside
        self.shown += np.bincount(found.owner[shown], minlength=count)
        self._add_overlaps(found)
        if count:
            self._gaps.append(gap_widths(self.decals, points[~shown], normals[~shown]))
        assert found.jacobian is not None
        known = shown & np.isfinite(found.jacobian[:, 0, 0])
        self._owners.append(found.owner[known])
        self._stretch.append(stretch_of(found.jacobian[known]))
        self._folds.append(folds_of(found.jacobian[known], normals[known]))
        self._add_lines(found, points, normals, turns, modes, rng)

    def _add_overlaps(self, found: Samples) -> None:
        near, count = found.neighbors, len(self.decals)
        assert near is not None
        rows = np.repeat(np.arange(len(found.owner)), np.diff(near.offsets))

        def in_common(inside: BoolArray) -> tuple[int, NDArray[np.intp]]:
            several = np.bincount(rows[inside], minlength=len(found.owner)) > 1
            return int(several.sum()), np.bincount(near.decals[inside & several[rows]], minlength=count)

        before, after = in_common(near.fields >= 0.5), in_common(near.in_layer)
        self.overlap, self.overlapped = self.overlap + before[0], self.overlapped + before[1]
        self.residue, self.residues = self.residue + after[0], self.residues + after[1]
        self.alone += np.bincount(near.decals[near.alone], minlength=count)
        self.kept += np.bincount(near.decals[near.in_layer], minlength=count)

    def _add_lines(
        self,
        found: Samples,
        points: Float32Array,
        normals: Float32Array,
        turns: Float64Array,
        modes: dict[str, Any],
        rng: np.random.Generator,
    ) -> None:
        """Count the random segments that leave an owner across a contact line (Crofton's formula)."""
        rows = np.flatnonzero(found.owner >= 0)
        if not len(rows):
            return
        owners, facings = found.owner[rows], normals[rows]
        steps = LINE_STEP * self.decals.radii[owners].astype(np.float64)
        first, second = tangent_axes(unit_rows(facings).astype(np.float64))
        angles = rng.uniform(0.0, 2.0 * np.pi, (len(rows), 1))
        axes = np.cos(angles) * first + np.sin(angles) * second
        across = np.cos(angles) * second - np.sin(angles) * first
        ways = [sign * axis for axis in (axes, across) for sign in (1.0, -1.0)]
        ranks = np.where(self.decals.interactions == Interaction.PUSH, self.decals.ranks, -1)
        for way in ways:
            shift = steps[:, None] * way
            ends = evaluate(
                self.decals,
                points[rows] + shift,
                facings + np.einsum("mij,mj->mi", turns[rows], shift),
                **modes,
            ).owner
            crossed = (ends >= 0) & (ends != owners)
            crossed[crossed] = (ranks[owners] == ranks[ends])[crossed] & (ranks[owners] >= 0)[crossed]
            hits = np.bincount(owners[crossed], 1.0 / steps[crossed], minlength=len(self.decals))
            self.lines += hits * np.pi / len(ways)

    def result(self, area: float, samples: int, centers: Centers, points: OrientedPoints) -> Measures:
        """Return the measures of all points that were added.

        Parameters
        ----------
        area, samples
            Area of the surfaces, and number of the points.
        centers
            Centres of the decals, with the normals of their surfaces.
        points
            The points, with the normals of their surfaces.
        """
        count = len(self.decals)
        owners = np.concatenate([np.zeros(0, np.int32), *self._owners])
        stretch = np.concatenate([np.zeros(0), *self._stretch])
        folds = np.concatenate([np.zeros(0, np.bool_), *self._folds])
        order = np.lexsort((stretch, owners))
        ends = np.cumsum(np.bincount(owners, minlength=count))
        parts = np.split(stretch[order], ends[:-1]) if count else []
        percentiles = np.array([_percentiles(part) for part in parts]).reshape(-1, 3)
        known = np.bincount(owners, minlength=count)
        folded = np.bincount(owners[folds], minlength=count)
        nearest, around = centers.rings()
        bonds = bond_orders(centers.positions, centers.normals, around) if count else np.zeros(0)
        spacing = spacing_of_distances(nearest, ideal_spacing(area, count), bonds)
        tree = FacingTree(centers.positions, centers.normals, centers.heights)
        covering = tree.nearest(points.positions, points.normals)[0][:, 0]
        gaps = np.concatenate([np.zeros(0), *self._gaps])
        lengths = self.area * self.lines
        median, high, most = _percentiles(stretch)
        return Measures(
            area=area,
            coverage=float(self.shown.sum() / samples),
            gap_area=float(area - self.area * self.shown.sum()),
            overlap_area=self.area * self.overlap,
            stretch_median=median,
            stretch_p95=high,
            stretch_max=most,
            stretched=float((stretch > STRETCHED).mean()) if len(stretch) else float("nan"),
            folded=float(folds.mean()) if len(folds) else float("nan"),
            contact_length=0.5 * float(lengths.sum()),
            kept=float(_shares(self.kept.sum(), self.alone.sum())),
            residual_overlap=self.area * self.residue,
            gap_mean=float(gaps.mean()) if len(gaps) else float("nan"),
            gap_cv=float(_shares(gaps.std(), gaps.mean())) if len(gaps) else float("nan"),
            gap_p95=_percentiles(gaps)[1],
            gap_max=_percentiles(gaps)[2],
            least_distance=spacing.least,
            mean_distance=spacing.mean,
            bond_order=spacing.bond_order,
            rho=spacing.rho,
            cv=spacing.cv,
            cv6=spacing.cv6,
            covering_radius=float(covering.max()) if count else float("nan"),
            samples=samples,
            decals=DecalMeasures(
                visible_area=self.area * self.shown,
                overlap_area=self.area * self.overlapped,
                stretch_median=percentiles[:, 0],
                stretch_p95=percentiles[:, 1],
                stretch_max=percentiles[:, 2],
                folded=_shares(folded, known),
                contact_length=lengths,
                nearest=nearest[:, 0],
                undeformed_area=self.area * self.alone,
                kept=_shares(self.kept, self.alone),
                residual_overlap=self.area * self.residues,
                bond_order=bonds,
            ),
        )


def _percentiles(values: NDArray[np.floating]) -> Sequence[float]:
    if not len(values):
        return [float("nan")] * len(PERCENTILES)
    return [float(value) for value in np.percentile(values, PERCENTILES)]


def _shares(parts: ArrayLike, wholes: ArrayLike) -> Float64Array:
    """Return the parts over the wholes; NaN where a whole is 0."""
    whole = np.asarray(wholes, np.float64)
    return np.where(whole > 0.0, np.asarray(parts, np.float64) / np.where(whole > 0.0, whole, 1.0), np.nan)
