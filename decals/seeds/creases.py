"""Sharp edges and open rims of a mesh: lines that decals keep off, or along which they lie."""

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from decals.checks import instance
from decals.errors import InvalidSeeding
from decals.seeds.placing import MOST_SEEDS
from decals.seeds.population import Mask
from decals.surfaces.edges import edges_of
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Floats, as_points
from decals.wishes import number

Wide = NDArray[np.float64]

PITCHES = 4000
"""Samples along all lines together, at least, by which the nearest segment is looked for."""

CANDIDATES = 8
"""Nearest samples whose segments are measured."""

TURN = 45.0
"""Angle, in degrees, by which a line turns at a corner, so that it ends there."""


class Creases:
    """The creases and rims of a mesh.

    Parameters
    ----------
    surface
        The mesh. Vertices at the same place count as one.
    angle
        Least angle between the normals of two faces, in degrees, at which their edge is a crease.
    rims
        Whether edges of one face alone count as well.

    Attributes
    ----------
    segments
        The lines, ``float64[k, 2, 3]``.

    Raises
    ------
    InvalidSeeding
        If the angle is not above 0 and below 180 degrees.
    """

    def __init__(self, surface: MeshSurface, *, angle: float = 40.0, rims: bool = True) -> None:
        instance(
            "surface",
            surface,
            MeshSurface,
            InvalidSeeding,
            "a tree has none that a mesh shows: polygonize it first",
        )
        number("angle", angle, "degrees above 0 and below 180", lambda value: 0.0 < value < 180.0)
        self._vertices, self._edges = _sharp_edges(surface, angle, rims)
        self.segments: Wide = self._vertices[self._edges]

    def __repr__(self) -> str:
        return f"Creases({len(self.segments)} segments, {self.length:.6g} long)"

    @property
    def length(self) -> float:
        """Length of all lines together."""
        return float(np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1).sum())

    def distance(self, points: ArrayLike) -> Wide:
        """Distance of each point to the nearest line, ``float64[n]``; infinity where there is no line."""
        wide = as_points(points).astype(np.float64)
        if len(self.segments) == 0 or len(wide) == 0:
            return np.full(len(wide), np.inf)
        samples = self._samples
        columns = np.arange(1, min(CANDIDATES, len(samples.owners)) + 1)
        _, rows = samples.tree.query(wide, k=columns)
        near = self.segments[samples.owners[rows]]
        found: Wide = _to_segments(wide[:, None], near[:, :, 0], near[:, :, 1]).min(axis=1)
        return found

    def mask(self, *, apart: float) -> Mask:
        """Places at least so far from all lines: half a spacing keeps decals that touch on their side."""
        number("apart", apart, "a length from 0 upward", lambda value: value >= 0)
        return lambda points: self.distance(points) >= apart

    def points(self, spacing: float) -> Floats:
        """Places evenly along the lines, ``float32[k, 3]``, as far apart as is nearest to the spacing.

        Corners, where lines meet, end or turn sharply, are among them. Give them to `decals.seed` as its
        ``fixed`` places: decals line up along the creases, and the others keep away from them.
        """
        number("spacing", spacing, "a length above 0", lambda value: value > 0)
        if spacing < self.length / MOST_SEEDS:
            raise InvalidSeeding(
                f"spacing: {spacing:g} makes more than {MOST_SEEDS:,} places; take a larger one"
            )
        lines = _lines(self._vertices, self._edges)
        places = [_along(self._vertices[line], spacing) for line in lines]
        if not places:
            return np.zeros((0, 3), np.float32)
        return np.unique(np.concatenate(places).astype(np.float32), axis=0)

    @cached_property
    def _samples(self) -> "_Samples":
        ends = self.segments[:, 1] - self.segments[:, 0]
        lengths = np.linalg.norm(ends, axis=1)
        counts = 1 + np.ceil(lengths * (PITCHES / self.length)).astype(np.int64)
        owners = np.repeat(np.arange(len(counts)), counts)
        inner = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
        along = inner / np.maximum(counts[owners] - 1, 1)
        return _Samples(cKDTree(self.segments[owners, 0] + along[:, None] * ends[owners]), owners)


@dataclass(frozen=True)
class _Samples:
    """Points along segments, and the segment of each."""

    tree: cKDTree
    owners: NDArray[np.int64]


def _sharp_edges(surface: MeshSurface, angle: float, rims: bool) -> tuple[Wide, NDArray[np.int64]]:
    """Welded vertices, and the edges whose faces' normals part, or that have one face or more than two."""
    edges = edges_of(surface)
    cosines = np.einsum("ni,ni->n", edges.normals[:, 0], edges.normals[:, 1])
    sharp = (edges.counts == 2) & (cosines < np.cos(np.radians(angle)))
    sharp |= edges.counts > 2
    if rims:
        sharp |= edges.counts == 1
    return edges.vertices, edges.ends[sharp]


def _to_segments(points: Wide, starts: Wide, ends: Wide) -> Wide:
    """Distance of points to segments."""
    ways = ends - starts
    squares = np.maximum((ways**2).sum(axis=-1), 1e-300)
    along = np.clip(((points - starts) * ways).sum(axis=-1) / squares, 0.0, 1.0)
    found: Wide = np.linalg.norm(points - (starts + along[..., None] * ways), axis=-1)
    return found


def _lines(vertices: Wide, edges: NDArray[np.int64]) -> list[list[int]]:
    """Chains of vertices from corner to corner, and loops without corner."""
    around: dict[int, list[int]] = defaultdict(list)
    for start, end in edges.tolist():
        around[start].append(end)
        around[end].append(start)
    corners = {vertex for vertex, others in around.items() if _is_corner(vertices, vertex, others)}
    left = {tuple(edge) for edge in edges.tolist()}
    lines: list[list[int]] = []
    for start in [*sorted(corners), *sorted(around)]:
        lines.extend(
            _walk(start, other, around, corners, left)
            for other in sorted(around[start])
            if _edge(start, other) in left
        )
    return lines


def _walk(
    start: int, after: int, around: dict[int, list[int]], corners: set[int], left: set[tuple[int, ...]]
) -> list[int]:
    """Follow a line until it ends at a corner or where it began; its edges are taken."""
    line = [start, after]
    left.discard(_edge(start, after))
    while line[-1] not in corners and line[-1] != start:
        one, other = around[line[-1]]
        line.append(other if one == line[-2] else one)
        left.discard(_edge(line[-1], line[-2]))
    return line


def _is_corner(vertices: Wide, vertex: int, others: list[int]) -> bool:
    """Whether lines meet, end or turn sharply at a vertex."""
    if len(others) != 2:
        return True
    ways = vertices[others] - vertices[vertex]
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return bool(-ways[0] @ ways[1] < np.cos(np.radians(TURN)))


def _along(line: Wide, spacing: float) -> Wide:
    """Points at even steps along a polyline, its ends among them."""
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    steps = max(int(round(reached[-1] / spacing)), 1)
    wanted = np.linspace(0.0, reached[-1], steps + 1)
    return np.stack([np.interp(wanted, reached, line[:, axis]) for axis in range(3)], axis=1)


def _edge(one: int, other: int) -> tuple[int, ...]:
    return (min(one, other), max(one, other))
