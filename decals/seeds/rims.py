"""Open rims of surfaces as walls, beyond which every particle has an image that pushes it back.

Without images nothing pushes from beyond a rim: particles end up on the very rim, half their room outside,
and the surface inside has too few. With them the outermost row lies half a spacing inside, and each particle
has as much room as any other.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from decals.model import FACING_LIMIT
from decals.seeds.rim_kernels import WALLS, find_walls
from decals.surfaces.edges import edges_of
from decals.surfaces.ground import Scalars, Vectors
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Flags, Surface

Wide = NDArray[np.float64]

BEYOND = 0.5
"""How far beyond a rim it is looked, in spacings, whether the surface ends there."""

CLOSE = 0.7
"""A surface goes on beyond a rim if some surface is that near to where it was looked, in that distance; or if
another one is that near to the rim itself."""

PIECES = 100_000
"""Pieces at most into which rims are cut for that, besides one for each edge."""


class Walls(NamedTuple):
    """Up to `WALLS` planes for each of some places, on a device; a normal of zero is none."""

    number: int
    """`WALLS`, or 0 where no surface has a rim; then the arrays are empty."""
    points: Vectors
    normals: Vectors

    @staticmethod
    def none(device: str) -> "Walls":
        """No walls at all."""
        return Walls(0, *(wp.zeros(0, dtype=wp.vec3, device=device) for _ in range(2)))


class Rims:
    """Where open meshes among some surfaces end.

    An edge of one face is no end where another part of any surface goes on within half a spacing: at
    cracks and seams, where patches abut, and at holes too small to matter.

    Parameters
    ----------
    surfaces
        All of them.
    spacing
        A typical distance of particles.
    device
        Warp device.
    """

    def __init__(self, surfaces: Sequence[Surface], spacing: float, device: str) -> None:
        self.device = device
        pieces = [_open_edges(n, surface, spacing) for n, surface in enumerate(surfaces)]
        found = _joined([piece for piece in pieces if len(piece.owners)])
        found = found.chosen(_ends(found, surfaces, spacing))
        self.count = len(found.owners)
        self.segments: Wide = np.stack([found.starts, found.stops], axis=1)
        if self.count == 0:
            return
        low, high = np.minimum(found.starts, found.stops), np.maximum(found.starts, found.stops)
        self._boxes = self._vectors(low), self._vectors(high)
        self._tree = wp.Bvh(*self._boxes)
        self._arrays = [
            self._vectors(rows) for rows in (found.starts, found.stops, found.inward, found.normals)
        ]
        self._arrays.append(wp.array(found.owners, dtype=wp.int32, device=device))

    def walls(
        self,
        places: Vectors,
        normals: Vectors,
        sizes: Scalars,
        owners: Scalars,
        wanted: Scalars,
        *,
        reach: float,
    ) -> Walls:
        """Rims within so many spacings of places on the surfaces `owners`, where they are wanted (1)."""
        if self.count == 0:
            return Walls.none(self.device)
        found = [wp.zeros(WALLS * len(places), dtype=wp.vec3, device=self.device) for _ in range(2)]
        inputs = [self._tree.id, *self._arrays, reach, FACING_LIMIT]
        inputs += [places, normals, sizes, owners, wanted]
        launch(find_walls, len(places), inputs, found, device=self.device)
        return Walls(WALLS, *found)

    def _vectors(self, rows: Wide) -> Any:
        return wp.array(rows.astype(np.float32), dtype=wp.vec3, device=self.device)


class _Pieces(NamedTuple):
    """Straight pieces of rims: ends, the way into the face and its normal, and the surface's number."""

    starts: Wide
    stops: Wide
    inward: Wide
    normals: Wide
    owners: NDArray[np.int32]

    def chosen(self, rows: Any) -> "_Pieces":
        return _Pieces(*(array[rows] for array in self))


def _joined(parts: Sequence[_Pieces]) -> _Pieces:
    none = np.zeros((0, 3))
    columns = zip(_Pieces(none, none, none, none, np.zeros(0, np.int32)), *parts, strict=True)
    return _Pieces(*(np.concatenate(column) for column in columns))


def _open_edges(number: int, surface: Surface, spacing: float) -> _Pieces:
    """Edges of one face, cut into pieces no longer than a spacing."""
    if not isinstance(surface, MeshSurface) or surface.closed:
        return _joined([])
    edges = edges_of(surface)
    rim = edges.counts == 1
    ends, normals = edges.vertices[edges.ends[rim]], edges.normals[rim, 0]
    ways = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(ways, axis=1)
    inward = np.cross(normals, ways / lengths[:, None])
    toward = edges.vertices[edges.apexes[rim]] - ends[:, 0]
    inward *= np.where(np.einsum("ni,ni->n", inward, toward) < 0, -1.0, 1.0)[:, None]
    pitch = max(spacing, float(lengths.sum()) / PIECES)
    counts = np.maximum(np.ceil(lengths / pitch), 1).astype(np.int64)
    rows = np.repeat(np.arange(len(counts)), counts)
    step = (np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[rows]
    starts = ends[rows, 0] + step[:, None] * ways[rows]
    stops = starts + ways[rows] / counts[rows, None]
    return _Pieces(starts, stops, inward[rows], normals[rows], np.full(len(rows), number, np.int32))


def _ends(pieces: _Pieces, surfaces: Sequence[Surface], spacing: float) -> Flags:
    """Whether no surface goes on beyond each piece."""
    step = BEYOND * spacing
    middles = 0.5 * (pieces.starts + pieces.stops)
    ends = np.ones(len(middles), np.bool_)
    for number, surface in enumerate(surfaces):
        low, high = (corner.astype(np.float64) for corner in surface.bounds)
        near = ((middles > low - 2.0 * step) & (middles < high + 2.0 * step)).all(axis=1)
        rows = np.flatnonzero(ends & near)
        if len(rows):
            beyond = middles[rows] - step * pieces.inward[rows]
            ends[rows] &= ~_meets(surface, beyond, pieces.normals[rows], CLOSE * step)
            other = rows[pieces.owners[rows] != number]
            ends[other] &= ~_meets(surface, middles[other], pieces.normals[other], CLOSE * step)
    return ends


def _meets(surface: Surface, places: Wide, normals: Wide, distance: float) -> Flags:
    """Whether a surface is near to places and faces the same way."""
    found, facing = surface.project(places.astype(np.float32))
    alike = np.einsum("ni,ni->n", facing, normals) > FACING_LIMIT
    met: Flags = alike & (np.linalg.norm(found - places, axis=1) < distance)
    return met
