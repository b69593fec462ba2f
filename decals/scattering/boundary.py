"""Open boundaries of surfaces as mirror planes, behind which every particle has an image that repels it.

Without images nothing repels particles from outside: they end up on the boundary itself, half of their area
outside the surface, and the surface inside gets too few particles. With images the outermost row lies half a
spacing inside, and each particle has the same area.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float64Array, Int32Array
from blobtree.device import launch
from decals.model import FACING_LIMIT
from decals.scattering.boundary_kernels import PLANES_PER_POINT, BoundarySegments, find_mirror_planes
from decals.scattering.repulsion import mirror_planes, no_mirror_planes
from decals.scattering.search_kernels import MirrorPlanes, Particles
from decals.sorting import ranges
from decals.surfaces.mesh import MeshSurface, edges_of
from decals.surfaces.surface import Scalars, Surface

PROBE_DISTANCE = 0.5
"""Distance beyond an open edge, in spacings, at which a continuation of the surface is looked for."""

CONTINUATION_DISTANCE = 0.7
"""Largest distance of a continuation from the probed point, in probe distances. Another surface that near to
the edge itself continues it as well."""

MAX_PIECES = 100_000
"""Largest number of pieces that boundaries are cut into, besides one for each edge."""


class Boundary:
    """The open boundaries of the meshes among some surfaces.

    An edge of a single face is no boundary where another part of any surface continues within half a spacing:
    at cracks, seams, abutting patches, and holes too small to matter.

    Parameters
    ----------
    surfaces
        All surfaces.
    spacing
        A typical distance of particles, in model units.
    device
        Warp device.
    """

    def __init__(self, surfaces: Sequence[Surface], spacing: float, device: str) -> None:
        self.device = device
        open_edges = [_open_edges(index, surface, spacing) for index, surface in enumerate(surfaces)]
        pieces = _joined([part for part in open_edges if len(part.surface_ids)])
        pieces = pieces.at(_is_boundary(pieces, surfaces, spacing))
        self.count = len(pieces.surface_ids)
        self.endpoints: Float64Array = np.stack([pieces.starts, pieces.ends], axis=1)
        """Straight pieces of the boundaries, ``float64[count, 2, 3]``."""
        if self.count == 0:
            return
        lower, upper = np.minimum(pieces.starts, pieces.ends), np.maximum(pieces.starts, pieces.ends)
        self._boxes = self._vectors(lower), self._vectors(upper)
        self._tree = wp.Bvh(*self._boxes)
        self._segments: Any = BoundarySegments()
        self._segments.tree = self._tree.id
        self._segments.starts = self._vectors(pieces.starts)
        self._segments.ends = self._vectors(pieces.ends)
        self._segments.inward = self._vectors(pieces.inward)
        self._segments.normals = self._vectors(pieces.normals)
        self._segments.surface_ids = wp.array(pieces.surface_ids, dtype=wp.int32, device=device)

    def mirror_planes(
        self, points: Particles, surface_ids: Scalars, enabled: Scalars, *, reach: float
    ) -> MirrorPlanes:
        """Return the planes of the boundaries within `reach` spacings of points.

        Parameters
        ----------
        points
            Points on the surfaces of the given ids, on the device.
        surface_ids
            Index of the surface of each point, ``int32[n]``.
        enabled
            1 for the points that get planes, ``int32[n]``.
        reach
            Largest distance, in the spacings of the points.
        """
        if self.count == 0:
            return no_mirror_planes(self.device)
        count = len(surface_ids)
        mirrors = mirror_planes(PLANES_PER_POINT, count, self.device)
        inputs = [self._segments, reach, FACING_LIMIT, points, surface_ids, enabled]
        launch(find_mirror_planes, count, inputs, [mirrors], device=self.device)
        return mirrors

    def _vectors(self, rows: Float64Array) -> Any:
        return wp.array(rows.astype(np.float32), dtype=wp.vec3, device=self.device)


class _Pieces(NamedTuple):
    """Straight pieces of boundaries: ends, direction into the face, its normal, index of the surface."""

    starts: Float64Array
    ends: Float64Array
    inward: Float64Array
    normals: Float64Array
    surface_ids: Int32Array

    def at(self, rows: Any) -> "_Pieces":
        return _Pieces(*(array[rows] for array in self))


def _joined(parts: Sequence[_Pieces]) -> _Pieces:
    empty = np.zeros((0, 3))
    columns = zip(_Pieces(empty, empty, empty, empty, np.zeros(0, np.int32)), *parts, strict=True)
    return _Pieces(*(np.concatenate(column) for column in columns))


def _open_edges(index: int, surface: Surface, spacing: float) -> _Pieces:
    """Return the edges of a single face, cut into pieces no longer than a spacing."""
    if not isinstance(surface, MeshSurface) or surface.closed:
        return _joined([])
    edges = edges_of(surface)
    is_open = edges.counts == 1
    ends, normals = edges.vertices[edges.ends[is_open]], edges.normals[is_open, 0]
    offsets = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(offsets, axis=1)
    inward = np.cross(normals, offsets / lengths[:, None])
    toward_apex = edges.vertices[edges.apexes[is_open]] - ends[:, 0]
    inward *= np.where(np.einsum("ni,ni->n", inward, toward_apex) < 0, -1.0, 1.0)[:, None]
    max_length = max(spacing, float(lengths.sum()) / MAX_PIECES)
    counts = np.maximum(np.ceil(lengths / max_length), 1).astype(np.int64)
    rows = np.repeat(np.arange(len(counts)), counts)
    fractions = ranges(np.zeros_like(counts), counts) / counts[rows]
    starts = ends[rows, 0] + fractions[:, None] * offsets[rows]
    stops = starts + offsets[rows] / counts[rows, None]
    return _Pieces(starts, stops, inward[rows], normals[rows], np.full(len(rows), index, np.int32))


def _is_boundary(pieces: _Pieces, surfaces: Sequence[Surface], spacing: float) -> BoolArray:
    """Return True for each piece beyond which no surface continues."""
    step = PROBE_DISTANCE * spacing
    middles = 0.5 * (pieces.starts + pieces.ends)
    flags = np.ones(len(middles), np.bool_)
    for index, surface in enumerate(surfaces):
        lower, upper = (corner.astype(np.float64) for corner in surface.bounds)
        near = ((middles > lower - 2.0 * step) & (middles < upper + 2.0 * step)).all(axis=1)
        rows = np.flatnonzero(flags & near)
        if len(rows):
            probes = middles[rows] - step * pieces.inward[rows]
            flags[rows] &= ~_is_near(surface, probes, pieces.normals[rows], CONTINUATION_DISTANCE * step)
            others = rows[pieces.surface_ids[rows] != index]
            flags[others] &= ~_is_near(
                surface, middles[others], pieces.normals[others], CONTINUATION_DISTANCE * step
            )
    return flags


def _is_near(surface: Surface, points: Float64Array, normals: Float64Array, distance: float) -> BoolArray:
    """Return True for each point within a distance of a surface that faces the same way."""
    positions, surface_normals = surface.project(points.astype(np.float32))
    facing = np.einsum("ni,ni->n", surface_normals, normals) > FACING_LIMIT
    near: BoolArray = facing & (np.linalg.norm(positions - points, axis=1) < distance)
    return near
