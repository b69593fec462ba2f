"""Sharp edges and open boundaries of a mesh: lines that decals keep off, or lie along."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.validation import point_array, truth
from decals.errors import InvalidScattering
from decals.scattering.domain import MAX_PARTICLES
from decals.sorting import ranges
from decals.surfaces.convert import Model, as_mesh_surface
from decals.surfaces.mesh import MeshSurface, edges_of
from decals.surfaces.surface import Surface
from decals.validation import allowed_number

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

MIN_LINE_SAMPLES = 4000
"""Least number of samples along all lines, by which the nearest segment is searched."""

CANDIDATE_SAMPLES = 8
"""Number of nearest samples whose segments are measured."""

CORNER_ANGLE = 45.0
"""Angle in degrees by which a line turns at a corner; lines end at corners."""


class Creases:
    """The creases and boundaries of a mesh.

    Parameters
    ----------
    surface : Model
        The mesh. Vertices at the same position count as one.
    angle : float, default: 40.0
        Least angle between the normals of two faces, in degrees, at which their edge is a crease.
    boundary : bool, default: True
        True to include edges of a single face.

    Attributes
    ----------
    segments
        The lines, ``float64[k, 2, 3]``.

    Raises
    ------
    InvalidScattering
        If the surface is no mesh, or the angle is not above 0 and below 180 degrees.

    Examples
    --------
    >>> import decals
    >>> square = decals.surfaces.MeshSurface(
    ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
    ... )
    >>> creases = decals.scattering.Creases(square)
    >>> creases
    Creases(4 segments, 4 long)
    >>> inner = decals.scatter(square, spacing=0.2, mask=creases.mask(apart=0.1))
    >>> bool((creases.distance(inner.positions) >= 0.1).all())
    True
    >>> len(creases.points(0.25))
    16
    """

    def __init__(self, surface: Model | Surface, *, angle: float = 40.0, boundary: bool = True) -> None:
        mesh = as_mesh_surface(surface, "polygonize a tree first", name="surface", error=InvalidScattering)
        allowed_number(
            "angle",
            angle,
            "degrees above 0 and below 180",
            lambda value: 0.0 < value < 180.0,
            InvalidScattering,
        )
        ends = truth("boundary", boundary, InvalidScattering)
        self._vertices, self._edges = _sharp_edges(mesh, angle, ends)
        self.segments: Float64Array = self._vertices[self._edges]

    def __repr__(self) -> str:
        return f"Creases({len(self.segments)} segments, {self.length:.6g} long)"

    @property
    def length(self) -> float:
        """Length of all lines together."""
        return float(np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1).sum())

    def distance(self, points: ArrayLike) -> Float64Array:
        """Return the distance of each point to the nearest line, ``float64[n]``; infinity without lines."""
        wide = point_array(points).astype(np.float64)
        if len(self.segments) == 0 or len(wide) == 0:
            return np.full(len(wide), np.inf)
        samples = self._samples
        columns = np.arange(1, min(CANDIDATE_SAMPLES, len(samples.owners)) + 1)
        _, rows = samples.tree.query(wide, k=columns)
        near = self.segments[samples.owners[rows]]
        distances = _distances_to_segments(wide[:, None], near[:, :, 0], near[:, :, 1])
        nearest: Float64Array = distances.min(axis=1)
        return nearest

    def mask(self, *, apart: float) -> Callable[[Float32Array], BoolArray]:
        """Return a mask, for `scatter` and `Relaxation`, of the points at least `apart` from all lines.

        With half a spacing, decals with `Sizing.TOUCHING` stay on their side of a crease.
        """
        allowed_number("apart", apart, "a length from 0 upward", lambda value: value >= 0, InvalidScattering)

        def mask(points: Float32Array) -> BoolArray:
            far: BoolArray = self.distance(points) >= apart
            return far

        return mask

    def points(self, spacing: float) -> Float32Array:
        """Return points along the lines, ``float32[k, 3]``, at the even distance nearest to the spacing.

        Corners, where lines meet, end or turn sharply, are among them. Pass them to `scatter` as `fixed`:
        decals line up along the creases, and the others keep away from them.
        """
        allowed_number("spacing", spacing, "a length above 0", lambda value: value > 0, InvalidScattering)
        if spacing < self.length / MAX_PARTICLES:
            raise InvalidScattering(
                f"spacing: {spacing:g} makes more than {MAX_PARTICLES:,} points; take a larger one"
            )
        lines = _lines(self._vertices, self._edges)
        points = [_points_along(self._vertices[line], spacing) for line in lines]
        if not points:
            return np.zeros((0, 3), np.float32)
        return np.unique(np.concatenate(points).astype(np.float32), axis=0)

    @cached_property
    def _samples(self) -> "_Samples":
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        offsets = self.segments[:, 1] - self.segments[:, 0]
        lengths = np.linalg.norm(offsets, axis=1)
        counts = 1 + np.ceil(lengths * (MIN_LINE_SAMPLES / self.length)).astype(np.int64)
        owners = np.repeat(np.arange(len(counts)), counts)
        inner = ranges(np.zeros_like(counts), counts)
        along = inner / np.maximum(counts[owners] - 1, 1)
        return _Samples(cKDTree(self.segments[owners, 0] + along[:, None] * offsets[owners]), owners)


@dataclass(frozen=True)
class _Samples:
    """Points along segments, and the segment of each."""

    tree: "cKDTree"
    owners: Int64Array


def _sharp_edges(surface: MeshSurface, angle: float, boundary: bool) -> tuple[Float64Array, Int64Array]:
    """Return welded vertices, and the edges of faces at an angle, of one face, or of more than two."""
    edges = edges_of(surface)
    cosines = np.einsum("ni,ni->n", edges.normals[:, 0], edges.normals[:, 1])
    sharp = (edges.counts == 2) & (cosines < np.cos(np.radians(angle)))
    sharp |= edges.counts > 2
    if boundary:
        sharp |= edges.counts == 1
    return edges.vertices, edges.ends[sharp]


def _distances_to_segments(points: Float64Array, starts: Float64Array, ends: Float64Array) -> Float64Array:
    """Return the distances of points to segments."""
    offsets = ends - starts
    squares = np.maximum((offsets**2).sum(axis=-1), 1e-300)
    along = np.clip(((points - starts) * offsets).sum(axis=-1) / squares, 0.0, 1.0)
    distances: Float64Array = np.linalg.norm(points - (starts + along[..., None] * offsets), axis=-1)
    return distances


def _lines(vertices: Float64Array, edges: Int64Array) -> list[list[int]]:
    """Return chains of vertices from corner to corner, and loops without corner."""
    neighbors: dict[int, list[int]] = defaultdict(list)
    for start, end in edges.tolist():
        neighbors[start].append(end)
        neighbors[end].append(start)
    corners = {vertex for vertex, others in neighbors.items() if _is_corner(vertices, vertex, others)}
    remaining = {tuple(edge) for edge in edges.tolist()}
    lines: list[list[int]] = []
    for start in [*sorted(corners), *sorted(neighbors)]:
        lines.extend(
            _walk(start, other, neighbors, corners, remaining)
            for other in sorted(neighbors[start])
            if _edge(start, other) in remaining
        )
    return lines


def _walk(
    start: int,
    second: int,
    neighbors: dict[int, list[int]],
    corners: set[int],
    remaining: set[tuple[int, ...]],
) -> list[int]:
    """Return a line up to a corner or its own start, and remove its edges from the remaining ones."""
    line = [start, second]
    remaining.discard(_edge(start, second))
    while line[-1] not in corners and line[-1] != start:
        first, other = neighbors[line[-1]]
        line.append(other if first == line[-2] else first)
        remaining.discard(_edge(line[-1], line[-2]))
    return line


def _is_corner(vertices: Float64Array, vertex: int, others: list[int]) -> bool:
    """Return True if lines meet, end or turn sharply at a vertex."""
    if len(others) != 2:
        return True
    directions = vertices[others] - vertices[vertex]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return bool(-directions[0] @ directions[1] < np.cos(np.radians(CORNER_ANGLE)))


def _points_along(line: Float64Array, spacing: float) -> Float64Array:
    """Return points at even steps along a polyline, its ends among them."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    steps = max(int(round(lengths[-1] / spacing)), 1)
    stations = np.linspace(0.0, lengths[-1], steps + 1)
    return np.stack([np.interp(stations, lengths, line[:, axis]) for axis in range(3)], axis=1)


def _edge(first: int, second: int) -> tuple[int, ...]:
    return (min(first, second), max(first, second))
