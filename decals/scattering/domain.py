"""The domain of a relaxation: visible area, density and mask of surfaces, apportionment, initial sampling."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.device import known_device
from blobtree.validation import point_array
from decals.errors import InvalidScattering
from decals.scattering.boundary import Boundary
from decals.scattering.projection import SurfaceProjection, spans_of
from decals.surfaces.convert import as_surfaces
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.space_curve import curve_keys
from decals.surfaces.surface import Surface, vectors
from decals.validation import allowed_number, count_number, function_or_none, function_values, real_array

_logger = logging.getLogger(__name__)

AREA_SAMPLES = 16384
"""Samples that estimate the visible area of a surface."""

MAX_SAMPLING_ROUNDS = 12
"""Number of times that the samples double before a surface counts as hidden."""

SAMPLES_PER_CHOICE = 8
"""Samples for each particle that is drawn from a varying density."""

SAMPLES_AT_PEAK = 2
"""Samples for each particle where the density is highest."""

MAX_PEAK_SAMPLES = 262_144
"""Most samples of a surface that are drawn for the sake of the peak."""

DENSITY_STEP = 1.2
"""Factor between two levels of density; a particle stays within it of the density at which it began."""

MAX_PARTICLES = 100_000_000
"""Largest number of particles of one relaxation; each takes some hundred bytes."""

Density: TypeAlias = Callable[[Float32Array], ArrayLike]
"""Relative density of particles: a function of ``points[n, 3]`` to numbers above zero, ``[n]``."""

Mask: TypeAlias = Callable[[Float32Array], ArrayLike]
"""Where particles may lie: a function of ``points[n, 3]`` to ``bool[n]``."""


LEAST_SHEET = 20.0
"""Least area of a sheet with decals of its own, in squared spacings."""

SAME_NORMAL = 0.9998
"""Cosine of the angle between two normals that count as the same."""


@dataclass(frozen=True)
class OrientedPoints:
    """Points with unit normals, each on one of several surfaces.

    `heights` are those at which decals there end on other sheets, infinity for those that do not; ``[n]``.
    """

    positions: Float32Array
    normals: Float32Array
    surface_ids: Int32Array
    heights: Float64Array | None = None

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, rows: slice | Int64Array) -> "OrientedPoints":
        return OrientedPoints(self.positions[rows], self.normals[rows], self.surface_ids[rows])

    def replaced(self, rows: Int64Array, others: "OrientedPoints") -> "OrientedPoints":
        """Return these points with some of them at the places of others."""
        positions, normals = self.positions.copy(), self.normals.copy()
        positions[rows], normals[rows] = others.positions, others.normals
        return OrientedPoints(positions, normals, self.surface_ids)

    @staticmethod
    def empty() -> "OrientedPoints":
        """Return no points."""
        rows = np.zeros((0, 3), np.float32)
        return OrientedPoints(rows, rows, np.zeros(0, np.int32))

    @staticmethod
    def joined(parts: "Sequence[OrientedPoints]") -> "OrientedPoints":
        """Return the points of all parts, in their order."""
        return OrientedPoints(
            np.concatenate([part.positions for part in parts]),
            np.concatenate([part.normals for part in parts]),
            np.concatenate([part.surface_ids for part in parts]),
        )


class Domain:
    """The surfaces of a relaxation, and where and how densely particles may lie on them.

    Particles are forbidden inside other, closed surfaces and outside the mask. Every surface draws from its
    own stream of random numbers, derived from the seed and the surface's index.

    Parameters
    ----------
    surfaces
        One surface, or several.
    seed
        Seed of all samples.
    density
        Relative density of particles; the same everywhere by default.
    mask
        Where particles may lie; everywhere by default.
    device
        Warp device on which points are projected.
    """

    def __init__(
        self,
        surfaces: Surface | Sequence[Surface],
        seed: int,
        *,
        density: Density | None = None,
        mask: Mask | None = None,
        device: str = "cpu",
    ) -> None:
        self.surfaces = as_surfaces(surfaces)
        self.device = known_device(device)
        function_or_none("density", density, InvalidScattering)
        function_or_none("mask", mask, InvalidScattering)
        self._seed, self._density, self._mask = seed, density, mask
        outside = self._outside_mask if mask is not None else None
        self.projection = SurfaceProjection(self.surfaces, outside, self.device)
        measures = [self._measure(index) for index in range(len(self.surfaces))]
        self.areas = np.array([area for area, _, _ in measures])
        """Visible area of each surface."""
        self.masses = np.array([mass for _, mass, _ in measures])
        """Integral of the density over the visible area of each surface."""
        self._peaks = [peak for _, _, peak in measures]
        self._boundaries: dict[int, Boundary] = {}

    def deformed(self, surfaces: Surface | Sequence[Surface]) -> "Domain":
        """Return a domain of other surfaces, one for each of these, with the same density and mask."""
        others = as_surfaces(surfaces)
        if len(others) != len(self.surfaces):
            raise InvalidScattering(f"expected {len(self.surfaces)} surfaces as before, got {len(others)}")
        return Domain(others, self._seed, density=self._density, mask=self._mask, device=self.device)

    @property
    def has_thin_parts(self) -> bool:
        """True if a part of a tree may be thinner than decals lie apart."""
        return any(
            isinstance(surface, ImplicitSurface) and surface.has_small_parts for surface in self.surfaces
        )

    def parts(self, points: OrientedPoints) -> Int64Array:
        """Return numbers (n,) of the parts between which particles do not change: surfaces, or their leaves.

        Leaves count on surfaces with small parts. How crowded particles are there says nothing: on both sides
        of a plate or in a small box they have fewer, or nearer, neighbours.
        """
        numbers = points.surface_ids.astype(np.int64)
        for index, surface in enumerate(self.surfaces):
            if isinstance(surface, ImplicitSurface) and surface.has_small_parts:
                rows = np.flatnonzero(points.surface_ids == index)
                numbers[rows] += len(self.surfaces) * surface.parts(points.positions[rows])
        return numbers

    @property
    def sheeted(self) -> list[int]:
        """Indices of the meshes that have several sheets."""
        return [
            index
            for index, surface in enumerate(self.surfaces)
            if isinstance(surface, MeshSurface) and surface.sheet_areas.size > 1
        ]

    def sheets(self, points: OrientedPoints, least_area: float) -> Int64Array | None:
        """Return numbers (n,) of the sheets that points lie on; None if there are not several in any mesh.

        Sheets of a smaller area than the least one are −1: they have too few decals to keep to themselves.
        """
        if not self.sheeted:
            return None
        numbers = points.surface_ids.astype(np.int64)
        for index in self.sheeted:
            surface = cast("MeshSurface", self.surfaces[index])
            rows = np.flatnonzero(points.surface_ids == index)
            faces = np.searchsorted(surface.sound, surface.locate(points.positions[rows])[0])
            sheets = surface.sheets[faces]
            numbers[rows] += len(self.surfaces) * sheets
            numbers[rows[surface.sheet_areas[sheets] < least_area]] = -1
        return numbers

    @property
    def area(self) -> float:
        """Visible area of all surfaces together."""
        return float(self.areas.sum())

    @property
    def mass(self) -> float:
        """Integral of the density over the visible area of all surfaces."""
        return float(self.masses.sum())

    @property
    def uniform(self) -> bool:
        """True if the density is the same everywhere."""
        return self._density is None

    def density(self, positions: Float32Array) -> Float64Array:
        """Return the relative density, ``float64[n]``, or raise `InvalidScattering` for invalid values."""
        if self._density is None or len(positions) == 0:
            return np.ones(len(positions))
        return checked_values("density", self._density, positions)

    def boundary(self, spacing: float) -> Boundary | None:
        """Return the open boundaries for particles about a spacing apart; None without an open mesh."""
        if not any(isinstance(surface, MeshSurface) and not surface.closed for surface in self.surfaces):
            return None
        octave = int(np.round(np.log2(max(spacing, 1e-30))))
        if octave not in self._boundaries:
            self._boundaries[octave] = Boundary(self.surfaces, 2.0**octave, self.device)
        return self._boundaries[octave]

    def forbidden(self, index: int, positions: Float32Array, normals: Float32Array) -> BoolArray:
        """Return True for points of one surface that are hidden or outside the mask."""
        count = len(positions)
        flags: Any = wp.zeros(count, dtype=wp.int32, device=self.device)
        spans = [(index, 0, count)] if count else []
        self.projection.mark_forbidden(
            spans, vectors(positions, self.device), vectors(normals, self.device), flags
        )
        forbidden: BoolArray = flags.numpy() == 1
        return forbidden

    def project(self, points: OrientedPoints) -> tuple[OrientedPoints, BoolArray]:
        """Project points onto their own surfaces, and return True for those where particles may lie."""
        count = len(points)
        order = np.argsort(points.surface_ids, kind="stable")
        sources = vectors(np.ascontiguousarray(points.positions[order]), self.device)
        reaches: Any = wp.zeros(count, dtype=wp.float32, device=self.device)
        positions: Any = wp.zeros(count, dtype=wp.vec3, device=self.device)
        normals: Any = wp.zeros(count, dtype=wp.vec3, device=self.device)
        flags: Any = wp.zeros(count, dtype=wp.int32, device=self.device)
        spans = spans_of(points.surface_ids[order])
        self.projection.project(sources, reaches, spans, positions, normals, flags)
        back = np.empty_like(order)
        back[order] = np.arange(count)
        projected = OrientedPoints(positions.numpy()[back], normals.numpy()[back], points.surface_ids)
        return projected, (flags.numpy() == 0)[back]

    def near(
        self, points: Float32Array, surface_ids: Int32Array
    ) -> tuple[Float32Array, Float32Array, Int64Array]:
        """Project points onto their own surfaces and those that may touch these.

        Returns
        -------
        positions, normals : float32[n, 3]
            The surface points where particles may lie.
        rows : int64[n]
            The row of each in `points`.
        """
        parts: list[tuple[OrientedPoints, Int64Array]] = [(OrientedPoints.empty(), np.zeros(0, np.int64))]
        for index in range(len(self.surfaces)):
            rows = np.flatnonzero(np.isin(surface_ids, [index, *self.projection.overlapping(index)]))
            if len(rows):
                ids = np.full(len(rows), index, np.int32)
                found, allowed = self.project(OrientedPoints(points[rows], points[rows], ids))
                parts.append((found[np.flatnonzero(allowed)], rows[allowed]))
        joined = OrientedPoints.joined([found for found, _ in parts])
        return joined.positions, joined.normals, np.concatenate([rows for _, rows in parts])

    def shaded(self, points: OrientedPoints) -> OrientedPoints:
        """Return the points of meshes whose smooth normals in pictures are not their own, with these."""
        normals = points.normals.copy()
        for index, surface in enumerate(self.surfaces):
            if isinstance(surface, MeshSurface):
                rows = np.flatnonzero(points.surface_ids == index)
                normals[rows] = surface.smooth_normals(points.positions[rows])
        rows = np.flatnonzero(np.einsum("ni,ni->n", normals, points.normals) < SAME_NORMAL)
        return OrientedPoints(points.positions[rows], normals[rows], points.surface_ids[rows])

    def one_sided(self, points: OrientedPoints) -> BoolArray:
        """Return True for points on parts of meshes that have one side only; decals there should spill."""
        result = np.zeros(len(points), np.bool_)
        for index, surface in enumerate(self.surfaces):
            if isinstance(surface, MeshSurface):
                rows = np.flatnonzero(points.surface_ids == index)
                result[rows] = surface.one_sided(points.positions[rows])
        return result

    def project_fixed(self, fixed: ArrayLike | None) -> OrientedPoints:
        """Project fixed particles onto the surfaces that they are closest to."""
        if fixed is None or real_array("fixed", fixed, InvalidScattering).size == 0:
            return OrientedPoints.empty()
        if not self.surfaces:
            raise InvalidScattering("fixed: expected a surface for them to lie on, got none")
        return on_nearest(self.surfaces, point_array(fixed, "fixed"))

    def sample(self, counts: Int64Array, stream: int) -> OrientedPoints:
        """Sample exact numbers of random visible points of each surface, stratified by area and density."""
        parts = [self._sample_one(index, int(count), stream) for index, count in enumerate(counts)]
        return OrientedPoints(
            np.concatenate([part[0] for part in parts]),
            np.concatenate([part[1] for part in parts]),
            np.repeat(np.arange(len(parts), dtype=np.int32), counts),
        )

    def _sample_one(self, index: int, count: int, stream: int) -> tuple[Float32Array, Float32Array]:
        surface, seed = self.surfaces[index], self._stream(index, stream)
        if count == 0:
            return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32)
        if self._is_whole(index):
            return surface.sample(count, seed)
        required = count
        if not self.uniform:
            at_peak = int(np.ceil(SAMPLES_AT_PEAK * count * self._peaks[index]))
            required = max(SAMPLES_PER_CHOICE * count, min(at_peak, MAX_PEAK_SAMPLES))
        visible_area = max(self.areas[index], surface.area / AREA_SAMPLES)
        samples = int(np.ceil(1.1 * required * surface.area / visible_area)) + 16
        for _ in range(MAX_SAMPLING_ROUNDS if self.areas[index] > 0 else 0):
            positions, normals = surface.sample(samples, seed)
            visible = np.flatnonzero(~self.forbidden(index, positions, normals))
            if len(visible) >= required:
                if not self.uniform:
                    visible = visible[_stratified(positions[visible], self.density(positions[visible]))]
                rows = visible[_choose_evenly(self.density(positions[visible]), count)]
                return positions[rows], normals[rows]
            samples *= 2
        raise InvalidScattering(
            f"expected visible area on surface {index}, got none in {max(samples, AREA_SAMPLES)} samples; "
            "move it"
        )

    def _measure(self, index: int) -> tuple[float, float, float]:
        """Return the visible area of a surface, and the density's integral and peak over mean there."""
        surface = self.surfaces[index]
        if self._is_whole(index):
            return surface.area, surface.area, 1.0
        positions, normals = surface.sample(AREA_SAMPLES, self._stream(index, 0))
        visible = np.flatnonzero(~self.forbidden(index, positions, normals))
        area = surface.area / len(positions)
        densities = self.density(positions[visible])
        peak = float(densities.max() / densities.mean()) if len(visible) else 1.0
        return area * len(visible), area * float(densities.sum()), peak

    def _is_whole(self, index: int) -> bool:
        """Return True if the density is uniform and no part of the surface can be forbidden."""
        alone = not self.projection.overlapping(index) and not self.projection.shells(index)
        return self.uniform and self._mask is None and alone

    def _outside_mask(self, positions: Float32Array) -> BoolArray:
        assert self._mask is not None
        return ~checked_values("mask", self._mask, positions, truths=True).astype(np.bool_)

    def _stream(self, index: int, stream: int) -> int:
        """Derive the seed of one surface's samples for one purpose."""
        words = np.random.SeedSequence([self._seed, stream, index]).generate_state(2, np.uint64)
        return int(words[0])


def on_nearest(surfaces: Sequence[Surface], points: Float32Array) -> OrientedPoints:
    """Project points (n, 3) onto those of the surfaces that they are closest to, the first at a tie."""
    candidates = [surface.project(points) for surface in surfaces]
    gaps = np.stack([np.linalg.norm(positions - points, axis=1) for positions, _ in candidates])
    nearest = gaps.argmin(axis=0)
    rows = np.arange(len(points))
    return OrientedPoints(
        np.stack([positions for positions, _ in candidates])[nearest, rows],
        np.stack([normals for _, normals in candidates])[nearest, rows],
        nearest.astype(np.int32),
    )


def particle_count(count: int | None, spacing: float | None, mass: float) -> int:
    """Return the count, or the number of particles that lie a spacing apart in a hexagonal tiling."""
    if (count is None) == (spacing is None):
        got = "none" if count is None else "both"
        raise InvalidScattering(f"expected a count or a spacing, got {got}; give one of them")
    if count is not None:
        return count_number("count", count, 0, MAX_PARTICLES, InvalidScattering)
    length = allowed_number(
        "spacing", spacing, "a length above 0", lambda value: value > 0, InvalidScattering
    )
    if length < np.sqrt(2.0 * mass / (np.sqrt(3.0) * MAX_PARTICLES)):
        raise InvalidScattering(
            f"spacing: {length:g} makes more than {MAX_PARTICLES:,} particles; take a larger one, or a count"
        )
    count = int(round(2.0 * mass / np.sqrt(3.0) / length / length))
    if count == 0 < mass:
        largest = np.sqrt(4.0 * mass / np.sqrt(3.0))
        _logger.warning(
            "spacing: %g is too large for a particle on this surface; take at most %.4g, or a count",
            length,
            largest,
        )
    return count


def apportion(masses: Float64Array, count: int) -> Int64Array:
    """Split a count in proportion to masses by largest remainders.

    The sum is exact, and ties go to the first. Raise `InvalidScattering` for a count above 0 and no mass.
    """
    total = float(masses.sum())
    if count == 0:
        return np.zeros(len(masses), np.int64)
    if not total > 0:
        raise InvalidScattering(
            f"expected visible area for {count} particles, got none; "
            "add a surface, move one, or let `mask` be True somewhere"
        )
    ideal = masses * (count / total)
    counts: Int64Array = np.floor(ideal).astype(np.int64)
    by_remainder = np.argsort(-(ideal - counts), kind="stable")
    counts[by_remainder[: count - int(counts.sum())]] += 1
    return counts


def remaining_counts(counts: Int64Array, fixed: OrientedPoints) -> Int64Array:
    """Subtract the fixed particles of each surface from its count; the sum stays exact."""
    remaining = counts - np.bincount(fixed.surface_ids, minlength=len(counts))
    while (remaining < 0).any():
        remaining[int(remaining.argmax())] -= 1
        remaining[int(remaining.argmin())] += 1
    return remaining


def crosses_density_step(before: Float32Array, after: Float32Array) -> BoolArray:
    """Return True where a particle that moves from one spacing to another leaves its level of density."""
    crosses: BoolArray = np.abs(np.log(after / before)) > 0.5 * np.log(DENSITY_STEP)
    return crosses


def _stratified(positions: Float32Array, densities: Float64Array) -> Int64Array:
    """Sort points by level of density, and along a space-filling curve within each level.

    Points at even steps of the density's running sum then represent each part of the surface.
    """
    levels = np.floor(np.log(densities) / np.log(DENSITY_STEP) + 0.5)
    return np.lexsort((curve_keys(positions), levels))


def _choose_evenly(weights: Float64Array, count: int) -> Int64Array:
    """Choose rows in proportion to their weights, at even steps of the weights' running sum."""
    total = np.cumsum(weights)
    levels = (np.arange(count) + 0.5) * (total[-1] / count)
    rows: Int64Array = np.minimum(np.searchsorted(total, levels, side="right"), len(weights) - 1)
    return rows


def checked_values(
    name: str,
    function: Callable[[Float32Array], ArrayLike],
    positions: Float32Array,
    *,
    truths: bool = False,
) -> Float64Array:
    """Return the checked values of the user's density, or with ``truths`` of a mask, at positions."""
    values = function_values(name, function, positions, error=InvalidScattering, truths=truths)
    if values.shape != (len(positions),):
        raise InvalidScattering(
            f"{name}: expected shape [{len(positions)}], got {list(values.shape)}; "
            "return one number for each point"
        )
    if not np.isfinite(values).all() or not (truths or (values > 0).all()):
        raise InvalidScattering(
            f"{name}: expected finite numbers, and densities above zero; bar regions by a mask"
        )
    if truths and (others := values[(values != 0.0) & (values != 1.0)]).size:
        raise InvalidScattering(
            f"{name}: expected True or False for each point, got {others[0]:g}; compare numbers, as in "
            "`points[:, 2] > 0`"
        )
    return values
