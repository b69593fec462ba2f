"""Seams of textures: where one edge of a surface lies at two places, and colours that agree there.

A program mixes four texels at each place. Along a seam the texels of both sides lie differently on the
surface, so a sharp line that crosses the seam has a step there. `match_seams` changes the texels along seams
so that the colours on both sides agree, and as little as that takes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import warp as wp
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

from blobtree._typing import BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array
from blobtree.device import array_on, launch
from decals.baking.meshes import BakeMesh
from decals.baking.seam_kernels import decode_listed, linearize, mark_levels, mark_runs, settle
from decals.baking.seam_system import CPU, SeamSystem
from decals.baking.unwrapped import Unwrapped
from decals.sorting import distinct_numbers, groups, stable_order
from decals.surfaces.topology import welded

STEP = 0.1
"""Largest distance in texels between points of a seam."""

COARSE = 4
"""The least squares begin with one of so many points, and take those that differ besides."""

SAME_PLACE = 1e-3
"""Distance in texels up to which two corners lie at one place."""

TOLERANCE = 2.0
"""Difference of the two sides, of 255, that is aimed at; rounding adds to it."""

SETTLED, LARGEST = 1.5, 2.5
"""Differences of 255: points that differ by more than the second are moved to the first, one by one."""

ROUNDS = 6
"""Steps of the least squares."""

SQUARES_FROM = 10.0
"""Difference of 255 from which on a point takes part in the least squares; smaller ones are settled."""

RINGS = 2
"""Rings of points, linked by common texels, that are changed with the points that differ."""

ATTEMPTS, SWEEPS = 20, 100
"""Times that single corrections begin, and most rounds of them."""


@dataclass(frozen=True, eq=False)
class Seams:
    """Edges of a surface that lie at two places on textures.

    Attributes
    ----------
    meshes : int64[k]
        Number of the mesh of each edge.
    faces : int64[k, 2]
        Its two faces.
    tiles : int64[k, 2]
        The textures on which they lie.
    ends : float64[k, 2, 2, 2]
        For each face, the places of both ends in texels; the first ends are the same point of the surface.
    corners : int64[k, 2, 3]
        Corners of these faces among the unwrapped vertices: both ends, and the third one.
    length : float
        Length of all seams on the surface.
    """

    meshes: Int64Array
    faces: Int64Array
    tiles: Int64Array
    ends: Float64Array
    corners: Int64Array
    length: float

    @classmethod
    def of(cls, meshes: Sequence[BakeMesh], unwrapped: Sequence[Unwrapped]) -> "Seams":
        """Return the seams of unwrapped meshes."""
        parts = [_cut_edges(mesh, part) for mesh, part in zip(meshes, unwrapped, strict=True)]
        numbers = np.repeat(np.arange(len(parts)), [len(faces) for faces, *_ in parts])
        faces, tiles, ends, corners, lengths = (np.concatenate(rows) for rows in zip(*parts, strict=True))
        return cls(numbers, faces, tiles, ends, corners, float(lengths.sum()))

    def points(self) -> tuple[Int64Array, Float64Array]:
        """Return the seam of points along all seams, and their places on both sides, ``float64[n, 2, 2]``."""
        texels = np.linalg.norm(self.ends[:, :, 1] - self.ends[:, :, 0], axis=2).max(axis=1, initial=0.0)
        counts = np.ceil(texels / STEP).astype(np.int64) + 1
        seams = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(seams)) - np.repeat(np.cumsum(counts) - counts, counts)
        share = (number / np.maximum(counts - 1, 1)[seams])[:, None, None]
        begin, end = np.moveaxis(self.ends[seams], 2, 0)
        return seams, begin * (1.0 - share) + end * share


def _cut_edges(
    mesh: BakeMesh, part: Unwrapped
) -> tuple[Int64Array, Int64Array, Float64Array, Int64Array, Float64Array]:
    """Return faces, tiles, ends, corners and lengths of the edges that lie at two places; see `Seams`."""
    corners = part.faces.astype(np.int64)
    numbers = welded(mesh.vertices)[part.rows[corners]]
    begin, end, one, other = (
        of.reshape(-1) for rows in (corners, numbers) for of in (rows, np.roll(rows, -1, axis=1))
    )
    turned = one > other
    sides = np.stack([np.where(turned, end, begin), np.where(turned, begin, end)], axis=1)
    keys = np.minimum(one, other) * len(mesh.vertices) + np.maximum(one, other)
    order = stable_order(keys)
    ordered = keys[order]
    first = np.flatnonzero((ordered[1:] == ordered[:-1]) & (one != other)[order[1:]])
    pairs = np.stack([order[first], order[first + 1]], axis=1)
    faces = pairs // 3
    tiles = part.tile_of_face[faces].astype(np.int64)
    ends = part.places[sides[pairs]].astype(np.float64)
    apart = np.abs(ends[:, 0] - ends[:, 1]).reshape(-1, 4).T > SAME_PLACE
    cut = apart.any(axis=0) | (tiles[:, 0] != tiles[:, 1])
    a, b = np.moveaxis(mesh.vertices[part.rows[sides[pairs[cut, 0]]]].astype(np.float64), 1, 0)
    thirds = np.roll(corners, -2, axis=1).reshape(-1)[pairs[cut]]
    each = np.concatenate([sides[pairs[cut]], thirds[:, :, None]], axis=2)
    return faces[cut], tiles[cut], ends[cut], each, np.linalg.norm(b - a, axis=1)


def bilinear_texels(places: Float64Array, tiles: Int64Array, size: int) -> Int64Array:
    """Return the four texels that are mixed at places, ``int64[n, 4]``."""
    corner = np.floor(places - 0.5)
    columns = np.clip(corner[:, :1] + [0, 1, 0, 1], 0, size - 1).astype(np.int64)
    rows = np.clip(corner[:, 1:] + [0, 0, 1, 1], 0, size - 1).astype(np.int64)
    texels: Int64Array = (tiles[:, None] * size + rows) * size + columns
    return texels


def _bilinear_weights(places: Float64Array) -> Float64Array:
    """Return the weights of these texels, ``float64[n, 4]``."""
    x, y = (places - 0.5 - np.floor(places - 0.5)).T
    return np.stack([(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y], axis=1)


class Mixed(NamedTuple):
    """The texels that programs mix at points of seams. Points in turn whose texels are the same are a run.

    Attributes
    ----------
    texels : int64[k]
        Indices into all textures, in order.
    starts : int64[r]
        The first point of each run.
    mixed : int32[r, 8]
        Rows of ``texels`` at each run: four on each side.
    weights : float64[n, 8]
        Their weights at each point.
    """

    texels: Int64Array
    starts: Int64Array
    mixed: Int32Array
    weights: Float64Array

    @classmethod
    def of(cls, places: Float64Array, tiles: Int64Array, size: int) -> "Mixed":
        """Return the texels of points at places ``float64[n, 2, 2]`` on textures ``int64[n, 2]``."""
        keys = np.concatenate([np.floor(places - 0.5).reshape(-1, 4), tiles], axis=1)
        starts = np.flatnonzero(np.append(True, (keys[1:] != keys[:-1]).any(axis=1)))
        at, on = places[starts], tiles[starts]
        index = np.hstack([bilinear_texels(at[:, side], on[:, side], size) for side in (0, 1)])
        rows, number, _ = groups(index.reshape(-1))
        weights = np.hstack([_bilinear_weights(places[:, side]) for side in (0, 1)])
        return cls(index.reshape(-1)[rows], starts, number.reshape(index.shape).astype(np.int32), weights)


def match_seams(
    texels: UInt8Array,
    mixed: Mixed,
    smooth: BoolArray,
    srgb: Sequence[bool],
    report: Callable[[float], None],
) -> UInt8Array:
    """Return texels along seams whose two sides agree.

    Parameters
    ----------
    texels : uint8[k, channels]
        The texels of ``mixed`` as they are.
    mixed : Mixed
        Points of the seams.
    smooth : bool[n, channels]
        True where the surface itself has no step.
    srgb : sequence of bool
        True for channels that hold sRGB, which programs decode before they mix texels.
    report : callable
        Called often with the fraction done.
    """
    report(0.0)
    levels = _Match(texels, mixed, smooth, srgb, report).solved()
    matched: UInt8Array = np.rint(255.0 * levels).astype(np.uint8)
    return matched


class _Match:
    """Levels of texels, from 0 to 1, that become alike on both sides of seams, each channel by itself.

    A row is a point and a channel, ``point * channels + channel``; a level is a texel and a channel.

    Parameters
    ----------
    texels : uint8[n, channels]
        The texels.
    mixed : Mixed
        Points of the seams.
    smooth : bool[m, channels]
        True for the rows that are matched.
    srgb : sequence of bool
        True for channels that are decoded before they are mixed.
    report : callable
        Called often with the fraction done; an error that it raises ends the work.
    """

    def __init__(
        self,
        texels: UInt8Array,
        mixed: Mixed,
        smooth: BoolArray,
        srgb: Sequence[bool],
        report: Callable[[float], None],
    ) -> None:
        self._shape, self._channels, self._report = texels.shape, len(srgb), report
        self._first = (texels / 255.0).reshape(-1)
        self._smooth, self._index = smooth, mixed.mixed
        self._starts = starts = mixed.starts
        self._ends = np.append(starts[1:], len(smooth))
        self._run_of = np.repeat(np.arange(len(starts)), self._ends - starts)
        self._valid = np.logical_or.reduceat(smooth, starts, axis=0).reshape(-1).view(np.uint8)
        self._srgb = array_on(CPU, np.asarray(srgb), wp.uint8)
        self._runs = [array_on(CPU, each, wp.int32) for each in (self._run_of, self._index)]
        self._weights = mixed.weights
        self._levels, self._light = self._first.copy(), np.empty_like(self._first)
        self._decode(np.arange(len(self._first)))

    def solved(self) -> Float64Array:
        """Return levels ``float64[n, channels]`` that differ as little from the texels as the seams need."""
        rows = np.flatnonzero(self._smooth)
        chosen, _ = self._around(rows[np.abs(self._gaps(rows)) > SQUARES_FROM / 255.0])
        if len(chosen):
            self._least_squares(chosen)
        self._settle(rows)
        return self._levels.reshape(self._shape)

    def _gaps(self, rows: Int64Array, slopes: Float64Array | None = None) -> Float64Array:
        """Return the differences of both sides at rows, and write their derivatives, ``float64[k, 8]``."""
        gaps = np.empty(len(rows))
        known = np.empty((0, 8)) if slopes is None else slopes
        inputs = [
            array_on(CPU, rows, wp.int32),
            *self._runs,
            array_on(CPU, self._weights, wp.float64),
            self._srgb,
        ]
        states = [array_on(CPU, state, wp.float64) for state in (self._levels, self._light)]
        outputs = [array_on(CPU, values, wp.float64) for values in (gaps, known)]
        launch(linearize, len(rows), [*inputs, *states], outputs, CPU)
        return gaps

    def _decode(self, numbers: Int64Array) -> None:
        """Make the light of some levels that of these."""
        inputs = [array_on(CPU, numbers, wp.int32), self._srgb, array_on(CPU, self._levels, wp.float64)]
        launch(decode_listed, len(numbers), inputs, [array_on(CPU, self._light, wp.float64)], CPU)

    def _around(self, wrong: Int64Array) -> tuple[Int64Array, Int64Array]:
        """Return some rows with those in `RINGS` rings around them, and with one ring more."""
        chosen = np.zeros(len(self._valid), np.uint8)
        chosen[self._run_of[wrong // self._channels] * self._channels + wrong % self._channels] = 1
        index, valid = self._runs[1], array_on(CPU, self._valid, wp.uint8)
        marks = array_on(CPU, np.zeros(len(self._first), np.uint8), wp.uint8)
        runs = array_on(CPU, chosen, wp.uint8)
        found = []
        for ring in range(RINGS + 1):
            launch(mark_levels, len(chosen), [runs, index, self._channels], [marks], CPU)
            launch(mark_runs, len(chosen), [marks, valid, index, self._channels], [runs], CPU)
            if ring >= RINGS - 1:
                found.append(self._rows_of(np.flatnonzero(runs.numpy())))
        inner, outer = found
        return inner, outer

    def _rows_of(self, runs: Int64Array) -> Int64Array:
        """Return the rows of runs, in order; a run and a channel are numbered as a row is."""
        run, channel = np.divmod(runs, self._channels)
        counts = self._ends[run] - self._starts[run]
        within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        points = np.repeat(self._starts[run], counts) + within
        rows = points * self._channels + np.repeat(channel, counts)
        return np.sort(rows[self._smooth.reshape(-1)[rows]])

    def _levels_of(self, rows: Int64Array) -> Int64Array:
        """Return the levels that are mixed at rows, ``int64[k, 8]``."""
        point, channel = np.divmod(rows, self._channels)
        return self._index[self._run_of[point]] * np.int64(self._channels) + channel[:, None]

    def _linked(self, rows: Int64Array) -> tuple[Int64Array, Int32Array, csr_array, Int64Array]:
        """Return the levels of rows, their columns there, links of levels, and the component of each level.

        Levels of one row are in one component. Its number is larger in a later channel.
        """
        listed = self._levels_of(rows)
        used = distinct_numbers(listed, len(self._first))
        number = np.empty(len(self._first), np.int32)
        number[used] = np.arange(len(used))
        columns = number[listed]
        run = self._run_of[rows // self._channels] * self._channels + rows % self._channels
        first = np.full(len(self._valid), -1)
        first[run[::-1]] = np.arange(len(run) - 1, -1, -1)
        first = first[first >= 0]  # one row of each run
        links = np.repeat(columns[first, 0], 7), columns[first, 1:].reshape(-1)
        both = np.concatenate(links), np.concatenate(links[::-1])
        graph = coo_array((np.ones(len(both[0]), np.int8), both), (len(used), len(used))).tocsr()
        count, label = connected_components(graph, connection="weak")
        return used, columns, graph, label + count * (used % self._channels)

    def _least_squares(self, rows: Int64Array) -> None:
        """Minimise the change of texels and the weighted differences, with more weight where these stay."""
        number = (np.cumsum(self._smooth, axis=0) - 1).reshape(-1)
        used, columns, graph, label = self._linked(rows)
        order = stable_order(label[columns[:, 0]])
        near = reverse_cuthill_mckee(graph, symmetric_mode=True)
        ranked = near[stable_order(label[near])]
        place = np.empty(len(used), np.int32)
        place[ranked] = np.arange(len(used))
        rows, used, columns = rows[order], used[ranked], place[columns[order]]
        begins = np.flatnonzero(np.diff(label[ranked], prepend=-1, append=-1))
        starts = np.flatnonzero(np.diff(label[ranked][columns[:, 0]], prepend=-1, append=-1))
        channel = used[begins[:-1]] % self._channels
        system = SeamSystem(self._first[used], columns, number[rows] % COARSE == 0, starts, begins)
        for step in range(ROUNDS):
            tick = partial(self._report, 0.9 * step / ROUNDS)
            tick()
            gaps = self._gaps(rows, system.slopes)
            off = np.abs(gaps) * 255.0 / TOLERANCE
            worst = np.zeros(self._channels)
            np.maximum.at(worst, channel, np.maximum.reduceat(off, starts[:-1]))
            active = (worst > LARGEST / TOLERANCE)[channel]
            if not active.any():
                return
            if step:
                system.strengthen(off)
            self._levels[used] = system.stepped(self._levels[used], gaps, active, tick)
            self._decode(used)

    def _settle(self, rows: Int64Array) -> None:
        """Move points that still differ one by one, see `settle`."""
        for attempt in range(ATTEMPTS):
            self._report(0.9 + 0.1 * attempt / ATTEMPTS)
            wrong = rows[np.abs(self._gaps(rows)) > LARGEST / 255.0]
            if not len(wrong):
                return
            chosen, rows = self._around(wrong)
            touched, columns, _, label = self._linked(chosen)
            component = label[columns[:, 0]]
            order = stable_order(component)
            bounds = np.flatnonzero(np.diff(component[order], prepend=-1, append=-1))
            points, channel = np.divmod(chosen[order], self._channels)
            kinds = wp.int32, wp.int32, wp.float32, wp.uint8
            listed = bounds, columns[order], self._weights[points], self._srgb.numpy()[channel]
            inputs = [array_on(CPU, *each) for each in zip(listed, kinds, strict=True)]
            states = self._levels[touched], self._light[touched]
            levels, light = (array_on(CPU, state, wp.float32) for state in states)
            counts = len(touched), len(chosen)
            changed, seen = (wp.zeros(count, dtype=wp.int32, device=CPU) for count in counts)
            inputs += [SWEEPS, SETTLED / 255.0, LARGEST / 255.0]
            launch(settle, len(bounds) - 1, inputs, [levels, light, changed, seen], CPU)
            self._levels[touched] = levels.numpy()
            self._decode(touched)
