"""Neighbour queries: on the device among the particles of a state, and on the host among oriented points."""

from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.device import launch
from blobtree.lazy import Lazy
from blobtree.progress import check_cancelled
from decals.model import FACING_LIMIT
from decals.scattering.domain import OrientedPoints
from decals.scattering.particle_state import ParticleState
from decals.scattering.repulsion import make_grid, neighbor_search, particle_struct
from decals.scattering.search_kernels import (
    DIRECTIONS,
    MirrorPlanes,
    Particles,
    mark_local_maxima,
    mark_near,
    measure_cells,
    nearest_distances,
    nearest_particles,
    ring_distances,
)
from decals.surfaces.surface import Scalars, tangent_axes, vectors

CLOSE_DISTANCE = 0.89
"""Distance of two particles, in spacings, below which they are too close."""

MIN_PARALLEL_QUERIES = 4000
"""Number of points from which a search uses more than one thread."""

NEIGHBOR_COUNTS = (4, 16, 64, 256)
"""Number of nearest points that a search examines, in turn, until enough of them face the same way."""

ROWS_AT_ONCE = 16_384
"""Points that are searched for at once: NumPy keeps the interpreter's lock meanwhile, and a window waits."""

NEIGHBOR_REACH = 2.0
"""Largest distance of neighbours, in spacings."""


class NeighborQuery:
    """Nearest distances to the particles of a state, on its device.

    Parameters
    ----------
    state
        The particles.
    reach
        Largest distance, in spacings.
    """

    def __init__(self, state: ParticleState, reach: float) -> None:
        self._state, self._reach = state, reach
        self._grid = make_grid(state.count, state.device)
        self.refresh()

    def refresh(self) -> None:
        """Update the search grid and the sheets of particles that moved."""
        self._state.number_sheets()
        self._grid.build(self._state.positions, self._reach * self._state.spacing)

    def nearest(
        self, points: Particles, own: Scalars, mirrors: MirrorPlanes, *, enough: float = 0.0
    ) -> Scalars:
        """Return the distance of each point to the nearest particle that faces the same way, in spacings.

        Parameters
        ----------
        points
            Positions, normals and spacings, on the device.
        own
            Particle of each point that does not count, ``int32[n]``; -1 for none.
        mirrors
            Mirror planes of the points; a point's own image counts as a particle.
        enough
            The search ends at the first distance below this one.

        Returns
        -------
        float32[n] on the device, at most the reach.
        """
        nearest = self._empty(len(own))
        inputs = [self._search(), self._state.particles, enough, own, points, mirrors]
        launch(nearest_distances, len(own), inputs, [nearest], device=self._state.device)
        return nearest

    def rings(self, points: Particles, own: Scalars, mirrors: MirrorPlanes) -> tuple[Scalars, Scalars]:
        """Return the distance of each point to the nearest particle, and the mean of the six nearest.

        Parameters are those of `nearest`; each of the six distances is at most the reach.
        """
        nearest, rings = self._empty(len(own)), self._empty(len(own))
        inputs = [self._search(), self._state.particles, own, points, mirrors]
        launch(ring_distances, len(own), inputs, [nearest, rings], device=self._state.device)
        return nearest, rings

    def owners(self, positions: Float32Array, normals: Float32Array) -> tuple[Float32Array, Int64Array]:
        """Return distance and index of the particle nearest to each point; -1 for none within the reach.

        All spacings count as the typical one of the state.
        """
        state = self._state
        points = particle_struct(vectors(positions, state.device), vectors(normals, state.device))
        distances = self._empty(len(positions))
        owners: Any = wp.empty(len(positions), dtype=wp.int32, device=state.device)
        search = self._search_by_length()
        inputs = [search, state.particles, points]
        launch(nearest_particles, len(positions), inputs, [distances, owners], device=state.device)
        return distances.numpy() / np.float32(state.spacing), owners.numpy().astype(np.int64)

    def apart(self, points: OrientedPoints, own: Int64Array) -> Float32Array:
        """Return the distance of each point to the nearest particle but its own, in spacings, ``float32[n]``.

        Images behind mirror planes count, the own one too.
        """
        state = self._state
        sizes: Any = wp.array(state.host_sizes[own], dtype=wp.float32, device=state.device)
        positions, normals = (vectors(rows, state.device) for rows in (points.positions, points.normals))
        particles = particle_struct(positions, normals, sizes, state.sheets_of(points))
        surface_ids = index_array(points.surface_ids, state.device)
        mirrors = state.mirror_planes(
            particles, surface_ids, state.device_movable[index_array(own, state.device)].contiguous()
        )
        distances: Float32Array = self.nearest(particles, index_array(own, state.device), mirrors).numpy()
        return distances

    def cells(self, rows: Int64Array, *, outlines: bool = True) -> tuple[Float32Array, Float32Array]:
        """Return how far the cells of some particles reach, in spacings, and points on their borders.

        Cells are those of `measure_cells` and end at half the reach. The points are ``float32[k, 24, 3]``,
        in the tangent planes, or empty without `outlines`. All spacings count as the typical one.
        """
        state = self._state
        radii = self._empty(len(rows))
        points: Any = wp.empty(DIRECTIONS * len(rows) if outlines else 0, dtype=wp.vec3, device=state.device)
        search = self._search_by_length()
        inputs = [search, state.particles, index_array(rows, state.device)]
        launch(measure_cells, len(rows), inputs, [radii, points], device=state.device)
        return radii.numpy() / np.float32(state.spacing), points.numpy().reshape(-1, DIRECTIONS, 3)

    def near(self, positions: Float32Array) -> Int64Array:
        """Return the particles within the reach of any of some positions; all spacings count as typical."""
        state = self._state
        flags: Any = wp.zeros(state.count, dtype=wp.int32, device=state.device)
        inputs = [self._search_by_length(), state.particles, vectors(positions, state.device)]
        launch(mark_near, len(positions), inputs, [flags], device=state.device)
        return np.flatnonzero(flags.numpy())

    def nearest_of(self, rows: Int64Array) -> Float32Array:
        """Return `nearest` for some particles of the state, ``float32[k]``."""
        state = self._state
        own = index_array(rows, state.device)
        columns = [
            state.positions,
            state.normals,
            state.sizes,
            state.device_surface_ids,
            state.device_movable,
            state.particles.sheets,
        ]
        if len(rows) < state.count:
            columns = [None if array is None else array[own].contiguous() for array in columns]
        positions, normals, sizes, surface_ids, movable, sheets = columns
        points = particle_struct(positions, normals, sizes, sheets)
        mirrors = state.mirror_planes(points, surface_ids, movable)
        nearest: Float32Array = self.nearest(points, own, mirrors).numpy()
        return nearest

    def _search(self) -> Any:
        return neighbor_search(self._grid, self._reach, varied=self._state.varied)

    def _search_by_length(self) -> Any:
        return neighbor_search(self._grid, self._reach * self._state.spacing, varied=False)

    def _empty(self, count: int) -> Any:
        return wp.empty(count, dtype=wp.float32, device=self._state.device)


def local_maxima(
    points: Float32Array, values: Float32Array, radii: Float32Array, *, device: str
) -> BoolArray:
    """Return True for points with the largest value within their radius, ``bool[n]``; of equals the first."""
    if len(points) == 0:
        return np.zeros(0, np.bool_)
    positions = vectors(np.ascontiguousarray(points), device)
    grid = make_grid(len(points), device)
    grid.build(positions, float(np.median(radii)))
    columns: list[Any] = [
        wp.array(np.ascontiguousarray(rows, dtype=np.float32), dtype=wp.float32, device=device)
        for rows in (values, radii)
    ]
    flags: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    launch(mark_local_maxima, len(points), [grid.id, positions, *columns], [flags], device=device)
    maxima: BoolArray = flags.numpy() == 1
    return maxima


def index_array(rows: NDArray[np.integer], device: str) -> Scalars:
    """Return indices as an ``int32`` array of a device."""
    return wp.array(rows.astype(np.int32), dtype=wp.int32, device=device)


class FacingTree:
    """Search among oriented points for neighbours on the same side of a wall.

    An oriented point q faces another p if the dot product of their normals is above `FACING_LIMIT`, the
    rule by which a decal at p colours q. Points of the tree with a finite height in `heights`,
    ``float64[n]``, face only their own sheet: their `sheet_products` are at most its square.
    """

    def __init__(
        self, positions: Float32Array, normals: Float32Array, heights: Float64Array | None = None
    ) -> None:
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        self._tree = cKDTree(positions)
        self._normals, self._heights = normals, heights

    def nearest(
        self,
        points: Float32Array,
        normals: Float32Array,
        *,
        count: int = 1,
        skip_self: bool = False,
        reach: float = np.inf,
    ) -> tuple[Float64Array, Int64Array]:
        """Return distances and indices of the `count` nearest facing points, ``[n, count]`` each.

        Rows fill up with infinity and -1 where fewer than `count` of the last of `NEIGHBOR_COUNTS` nearest
        points face the point. With `skip_self` the points are the tree's own, and are not their own
        neighbours. Points farther than the reach do not count.
        """
        distances, indices, _ = self.nearest_and_doubts(
            points, normals, count=count, skip_self=skip_self, reach=reach
        )
        return distances, indices

    def nearest_and_doubts(
        self,
        points: Float32Array,
        normals: Float32Array,
        *,
        count: int = 1,
        skip_self: bool = False,
        reach: float = np.inf,
    ) -> tuple[Float64Array, Int64Array, Float32Array]:
        """Return what `nearest` does, and how little decides which of the examined points face each, ``[n]``.

        That is the least difference of a cosine between the normals from `FACING_LIMIT`. It is 0 where a
        point nearer than the nearest facing one would face it, but keeps to another sheet.
        """
        distances = np.full((len(points), count), np.inf)
        indices = np.full((len(points), count), -1, np.int64)
        doubts = np.full(len(points), np.inf, np.float32)
        more = np.ones(len(points), np.bool_)
        open_rows = np.arange(len(points))
        for width in self._widths(count + skip_self):
            if len(open_rows) == 0:
                break
            columns = slice(0, min(count, width))
            for first in range(0, len(open_rows), ROWS_AT_ONCE):
                check_cancelled("searching for neighbours")
                rows = open_rows[first : first + ROWS_AT_ONCE]
                own = rows if skip_self else None
                found = self._nearest_among(points[rows], normals[rows], width, own, reach)
                distances[rows, columns], indices[rows, columns] = (array[:, columns] for array in found[:2])
                doubts[rows], more[rows] = np.minimum(doubts[rows], found[2]), found[3]
            open_rows = open_rows[more[open_rows] & ~np.isfinite(distances[open_rows, -1])]
        return distances, indices, doubts

    def around(self, count: int) -> tuple[Float64Array, Int64Array]:
        """Return distances and indices of the `count` points nearest to each point, itself first.

        They may face away; there are fewer columns if the tree has fewer points.
        """
        total = int(self._tree.n)
        columns = np.arange(1, min(count, total) + 1)
        if total == 0:
            return np.zeros((0, 0)), np.zeros((0, 0), np.int64)
        distances, indices = self._tree.query(self._tree.data, k=columns, workers=_workers(total))
        return distances, indices

    def _widths(self, least: int) -> list[int]:
        """Return growing numbers of neighbours, at most the number of points."""
        total = int(self._tree.n)
        if total == 0:
            return []
        alone = [1] if least == 1 else []  # most often the nearest point faces
        widths = alone + [min(max(width, least + 3), total) for width in NEIGHBOR_COUNTS]
        return widths[:1] + [wide for narrow, wide in pairwise(widths) if wide > narrow]

    def _nearest_among(
        self,
        points: Float32Array,
        normals: Float32Array,
        width: int,
        own: Int64Array | None,
        reach: float,
    ) -> tuple[Float64Array, Int64Array, Float32Array, BoolArray]:
        """Sort the facing ones to the front of the `width` nearest points, and return how little decides.

        The last result is True for points with more neighbours within the reach.
        """
        columns, bound = np.arange(1, width + 1), np.nextafter(reach, np.inf)
        distances, indices = (
            array.reshape(len(points), width)
            for array in self._tree.query(
                points, k=columns, distance_upper_bound=bound, workers=_workers(len(points))
            )
        )
        within = np.isfinite(distances)
        indices = np.where(within, indices, 0)
        cosines = np.einsum("nki,ni->nk", self._normals[indices], normals)
        facing = within & (cosines > FACING_LIMIT)
        margins = np.abs(cosines - FACING_LIMIT)
        if self._heights is not None:
            offsets = points[:, None] - self._tree.data[indices]
            products = sheet_products(offsets, self._normals[indices], normals)
            beyond = facing & (products > self._heights[indices] ** 2)
            facing &= ~beyond
            nearer = distances <= np.where(facing, distances, np.inf).min(axis=1, keepdims=True)
            margins[beyond & nearer] = 0.0
        if own is not None:
            facing &= indices != own[:, None]
        order = np.argsort(~facing, axis=1, kind="stable")
        facing = np.take_along_axis(facing, order, axis=1)
        distances = np.where(facing, np.take_along_axis(distances, order, axis=1), np.inf)
        indices = np.where(facing, np.take_along_axis(indices, order, axis=1), -1)
        doubts = np.where(within, margins, np.inf).min(axis=1)
        return distances, indices, doubts, within[:, -1]


def sheet_products(offsets: Float64Array, centers: Float32Array, points: Float32Array) -> Float64Array:
    """Return products of two heights: of points over the planes of centres, and of these under the points'.

    A product above 0 says that one of the two is above the other and the other is below it. That is so of
    two sheets that lie over each other or cross, and of bumps of one sheet, but not of one bend.

    Parameters
    ----------
    offsets : float64[n, k, 3]
        From centres to points.
    centers : float32[n, k, 3]
        Normals at the centres.
    points : float32[n, 3]
        Normals at the points.
    """
    products: Float64Array = np.einsum("nki,nki->nk", offsets, centers) * np.einsum(
        "nki,ni->nk", offsets, points
    )
    return products


class NearestFacing:
    """Finds the nearest facing centre of each of many fixed points, again while some centres change.

    Parameters
    ----------
    positions, normals
        The fixed points, ``float32[m, 3]`` each.
    """

    def __init__(self, positions: Float32Array, normals: Float32Array) -> None:
        self._positions, self._normals = positions, normals
        self._centers = self._center_normals = np.zeros((0, 3), np.float32)
        self._heights = np.zeros(0)
        self._distances, self._indices = np.zeros(0), np.zeros(0, np.int64)

    @Lazy
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        return cKDTree(self._positions)

    def copy(self) -> "NearestFacing":
        """Return one for the same points that knows the same centres, and changes on its own."""
        other = copy(self)
        other._distances, other._indices = self._distances.copy(), self._indices.copy()
        return other

    def of(
        self, centers: Float32Array, normals: Float32Array, heights: Float64Array | None = None
    ) -> tuple[Float64Array, Int64Array]:
        """Return distance and index of the nearest facing centre of each point; infinity and -1 for none."""
        limits = np.full(len(centers), np.inf) if heights is None else heights
        rows = self._outdated(centers, normals, limits)
        tree = FacingTree(centers, normals, heights)
        found, which = tree.nearest(self._positions[rows], self._normals[rows])
        self._distances[rows], self._indices[rows] = found[:, 0], which[:, 0]
        self._centers, self._center_normals, self._heights = centers.copy(), normals.copy(), limits.copy()
        return self._distances.copy(), self._indices.copy()

    def _outdated(self, centers: Float32Array, normals: Float32Array, heights: Float64Array) -> Int64Array:
        """Return the points whose nearest centre changed, or is farther than a changed one may be."""
        count = len(self._positions)
        if len(centers) != len(self._centers):
            self._distances, self._indices = np.full(count, np.inf), np.full(count, -1, np.int64)
            return np.arange(count)
        changed = ((centers != self._centers) | (normals != self._center_normals)).any(axis=1)
        changed |= heights != self._heights
        owned = self._indices >= 0
        outdated = ~owned | (owned & changed[self._indices])
        if changed.any():
            reach = 2.0 * float(np.median(self._distances[owned])) if owned.any() else 0.0
            outdated |= self._distances > reach
            near = self._tree.query_ball_point(centers[changed], reach, workers=_workers(int(changed.sum())))
            outdated[np.concatenate([np.asarray(rows, np.int64) for rows in near])] = True
        return np.flatnonzero(outdated)


def _workers(points: int) -> int:
    return -1 if points >= MIN_PARALLEL_QUERIES else 1


@dataclass(frozen=True)
class Spacing:
    """Measures of how evenly particles lie.

    Distances are straight, in units of the spacing that the density asks for, between particles within two
    spacings that face the same way: their normals' cosine is above `FACING_LIMIT`, the rule of decals.
    A particle alone on its side of a thin part has no such neighbour and is left out.

    Attributes
    ----------
    ideal
        Distance of neighbours if the visible area were one hexagonal tiling, sqrt(2 A / (sqrt(3) N)).
    mean
        Mean distance to the nearest neighbour.
    rho
        Least distance over the ideal one; 1 is the unreachable best (Lagae and Dutré 2008).
    cv
        Coefficient of variation of the distance to the nearest neighbour.
    cv6
        Coefficient of variation of the mean distance to six neighbours.
    ringed
        Share of the particles with six neighbours; the others lie at boundaries, tips and thin parts.
    bond_order
        Mean bond order of these particles, see `bond_orders`; NaN without any, or without their directions.
        A high rho with a high bond order is a lattice, not blue noise.
    """

    ideal: float
    mean: float
    rho: float
    cv: float
    cv6: float
    ringed: float = 1.0
    bond_order: float = float("nan")

    @property
    def least(self) -> float:
        """Least distance to a neighbour, in the units of `mean`."""
        return self.rho * self.ideal


def spacing_of_distances(
    distances: Float64Array, spacing: float, bonds: Float64Array | None = None
) -> Spacing:
    """Measure the distances of each particle to its six nearest neighbours, ``[n, 6]``, ascending.

    `bonds` are the `bond_orders` of the particles.
    """
    near = np.where(distances <= NEIGHBOR_REACH * spacing, distances, np.inf)
    nearest, six = near[:, 0], near.mean(axis=1)
    bonds = np.zeros(0) if bonds is None else bonds[np.isfinite(six)]
    nearest, six = nearest[np.isfinite(nearest)], six[np.isfinite(six)]
    if len(nearest) == 0:
        return Spacing(spacing, np.inf, np.inf, 0.0, 0.0, 0.0)
    return Spacing(
        ideal=spacing,
        mean=float(nearest.mean()),
        rho=float(nearest.min()) / spacing,
        cv=_variation(nearest),
        cv6=_variation(six),
        ringed=len(six) / len(distances),
        bond_order=float(bonds.mean()) if len(bonds) else float("nan"),
    )


def bond_orders(positions: Float32Array, normals: Float32Array, neighbors: Int64Array) -> Float64Array:
    """Return the bond order of each oriented point, ``float64[n]``; NaN with fewer than six neighbours.

    It is |ψ₆| = |Σ exp(6iθ)|/6 over the directions θ to six neighbours in the tangent plane (Nelson and
    Halperin 1979): 1 in a hexagonal lattice, about 0.37 at random.

    Parameters
    ----------
    positions, normals
        The points, ``float32[n, 3]`` each.
    neighbors
        The six nearest neighbours of each, ``int64[n, 6]``; -1 for none.
    """
    wide = positions.astype(np.float64)
    first, second = tangent_axes(normals.astype(np.float64))
    offsets = wide[neighbors] - wide[:, None]
    x, y = (np.einsum("nki,ni->nk", offsets, axis) for axis in (first, second))
    orders = np.abs(np.exp(6j * np.arctan2(y, x)).mean(axis=1))
    return np.where((neighbors >= 0).all(axis=1), orders, np.nan)


def spacing_of_points(
    positions: Float32Array, normals: Float32Array, sizes: Float32Array, spacing: float
) -> Spacing:
    """Measure oriented points; `sizes` are the spacings asked for at each, and `spacing` a typical one."""
    tree = FacingTree(positions, normals)
    distances, indices = tree.nearest(positions, normals, count=6, skip_self=True)
    wide = sizes.astype(np.float64)
    distances /= 0.5 * (wide[:, None] + np.where(indices >= 0, wide[indices], 1.0))
    return spacing_of_distances(spacing * distances, spacing, bond_orders(positions, normals, indices))


def ideal_spacing(area: float, count: int) -> float:
    """Return the distance of neighbours in a hexagonal tiling of an area."""
    return float(np.sqrt(2.0 * area / (np.sqrt(3.0) * max(count, 1))))


def _variation(values: Float64Array) -> float:
    return float(values.std() / values.mean()) if len(values) and values.mean() > 0 else 0.0
