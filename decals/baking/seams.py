"""Seams of textures: where one edge of a surface lies at two places, and colours that agree there.

A program mixes four texels at each place. Along a seam the texels of both sides lie differently on the
surface, so a sharp line that crosses the seam has a step there. `match_seams` changes the texels along seams
so that the colours on both sides agree, and as little as that takes.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from threading import Event
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array
from blobtree.device import array_on, launch
from blobtree.progress import check_cancelled, reporting
from decals.baking.meshes import BakeMesh
from decals.baking.seam_kernels import (
    POINT_BITS,
    change_levels,
    find_closest,
    join_levels,
    linearize,
    settle,
)
from decals.baking.seam_system import CPU, SeamSystem
from decals.baking.unwrapped import Unwrapped
from decals.sorting import distinct_numbers, groups, ranges, stable_order

STEP = 0.15
"""Largest distance in texels between points of a seam; more lie where the texels that are mixed change."""

COARSE = 4
"""The least squares begin with one of so many points. Each step adds the points that still differ."""

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

ATTEMPTS, SWEEPS = 5, 400
"""Times that single corrections begin, and most rounds of them at first; each time has twice as many."""

REPORT_SECONDS = 0.1
"""Seconds between reports."""


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
        """Return the seam of points along all seams, and their places on both sides, ``float64[n, 2, 2]``.

        Between two of them the same texels are mixed, so the colours are smooth there.
        """
        begin, end = self.ends[:, :, 0].reshape(-1, 4), self.ends[:, :, 1].reshape(-1, 4)
        numbers, shares = _crossings(begin - 0.5, end - 0.5)
        away = np.sqrt(((end - begin) ** 2).reshape(-1, 2, 2).sum(axis=2)).max(axis=1)
        parts = np.diff(shares, append=0.0)
        parts[np.diff(numbers, append=len(begin)) > 0] = 0.0  # behind the last point of a seam
        counts = np.maximum(np.ceil(parts * away[numbers] / STEP), 1.0).astype(np.int64)
        rows = np.repeat(np.arange(len(numbers)), counts)
        within = ranges(np.zeros_like(counts), counts) / counts[rows]
        seams, share = numbers[rows], (shares[rows] + within * parts[rows])[:, None]
        places = begin[seams] + (end - begin)[seams] * share
        return seams, places.reshape(-1, 2, 2)


def _crossings(begin: Float64Array, end: Float64Array) -> tuple[Int64Array, Float64Array]:
    """Return rows and shares of lines ``float64[k, 4]`` where one of the coordinates is whole, and both ends.

    They are sorted by row, and in each row by share.
    """
    rows = np.arange(len(begin))
    numbers, shares = [rows, rows], [np.zeros(len(rows)), np.ones(len(rows))]
    for a, b in zip(begin.T, end.T, strict=True):
        first = np.ceil(np.minimum(a, b)).astype(np.int64)
        counts = np.floor(np.maximum(a, b)).astype(np.int64) - first + 1
        counts[a == b] = 0
        of = np.repeat(rows, counts)
        numbers.append(of)
        shares.append(np.clip((ranges(first, counts) - a[of]) / (b - a)[of], 0.0, 1.0))
    number, share = np.concatenate(numbers), np.concatenate(shares)
    order = np.argsort(2.0 * number + share)
    return number[order], share[order]


def _cut_edges(
    mesh: BakeMesh, part: Unwrapped
) -> tuple[Int64Array, Int64Array, Float64Array, Int64Array, Float64Array]:
    """Return faces, tiles, ends, corners and lengths of the edges that lie at two places; see `Seams`."""
    corners, tile = part.faces.astype(np.int64), part.tile_of_face
    begin, end = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)
    one = np.flatnonzero(mesh.twins > np.arange(len(begin)))
    other = mesh.twins[one]
    apart = (begin[one] != end[other]) | (end[one] != begin[other]) | (tile[one // 3] != tile[other // 3])
    pairs = np.stack([one[apart], other[apart]], axis=1)
    welded = mesh.welded[part.rows]
    pairs = np.concatenate([pairs, _pairs_of_several(mesh.twins, welded[begin], welded[end])])
    sides = np.stack([begin[pairs], end[pairs]], axis=2)
    turned = welded[sides[..., 0]] > welded[sides[..., 1]]
    sides[turned] = sides[turned][:, ::-1]
    faces = pairs // 3
    tiles = tile[faces].astype(np.int64)
    ends = part.places[sides].astype(np.float64)
    apart = np.abs(ends[:, 0] - ends[:, 1]).reshape(-1, 4).T > SAME_PLACE
    cut = apart.any(axis=0) | (tiles[:, 0] != tiles[:, 1])
    a, b = np.moveaxis(mesh.vertices[part.rows[sides[cut, 0]]].astype(np.float64), 1, 0)
    thirds = np.roll(corners, -2, axis=1).reshape(-1)[pairs[cut]]
    each = np.concatenate([sides[cut], thirds[:, :, None]], axis=2)
    return faces[cut], tiles[cut], ends[cut], each, np.linalg.norm(b - a, axis=1)


def _pairs_of_several(twins: Int64Array, begin: Int64Array, end: Int64Array) -> Int64Array:
    """Return pairs of sides without a twin that have the same welded ends, ``int64[k, 2]``.

    Three or more faces meet there, or two that wind against each other.
    """
    rest = np.flatnonzero((twins < 0) & (begin != end))
    low, high = np.sort([begin[rest], end[rest]], axis=0)
    keys = low * len(twins) + high
    order = stable_order(keys)
    first = np.flatnonzero(np.diff(keys[order]) == 0)
    return np.stack([rest[order[first]], rest[order[first + 1]]], axis=1)


def bilinear_texels(places: Float64Array, tiles: Int64Array, size: int) -> Int64Array:
    """Return the four texels that are mixed at places, ``int64[n, 4]``; at edges, two are the same."""
    corner = np.floor(places - 0.5)
    columns = np.clip(corner[:, :1] + [0, 1, 0, 1], 0, size - 1).astype(np.int64)
    rows = np.clip(corner[:, 1:] + [0, 0, 1, 1], 0, size - 1).astype(np.int64)
    texels: Int64Array = (tiles[:, None] * size + rows) * size + columns
    return texels


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
    places : float64[n, 2, 2]
        The places of each point on both sides.
    """

    texels: Int64Array
    starts: Int64Array
    mixed: Int32Array
    places: Float64Array

    @classmethod
    def of(cls, places: Float64Array, tiles: Int64Array, size: int) -> "Mixed":
        """Return the texels of points at places ``float64[n, 2, 2]`` on textures ``int64[n, 2]``."""
        x, y = np.moveaxis(np.floor(places - 0.5).astype(np.int64) + 1, 2, 0)
        one, other = ((tiles * (size + 2) + y) * (size + 2) + x).T
        starts = np.flatnonzero(np.append(True, (np.diff(one) != 0) | (np.diff(other) != 0))[: len(places)])
        at, on = places[starts], tiles[starts]
        index = np.hstack([bilinear_texels(at[:, side], on[:, side], size) for side in (0, 1)])
        rows, number, _ = groups(index.reshape(-1))
        return cls(index.reshape(-1)[rows], starts, number.reshape(index.shape).astype(np.int32), places)

    def closest(self, size: int) -> tuple[Int64Array, Int64Array]:
        """Return for each texel the closest of the points that mix it, and on which side of its seam."""
        keys = np.empty(self.mixed.shape, np.int64)
        points = np.append(self.starts, len(self.places))
        inputs = [
            array_on(CPU, points, wp.int32),
            array_on(CPU, self.mixed, wp.int32),
            array_on(CPU, self.texels, wp.int64),
            array_on(CPU, self.places, wp.vec2d),
            size,
        ]
        launch(find_closest, len(self.mixed), inputs, [array_on(CPU, keys, wp.int64)], CPU)
        best = np.full(len(self.texels), np.iinfo(np.int64).max)
        np.minimum.at(best, self.mixed, keys)
        return best & ((1 << POINT_BITS) - 1), (best >> POINT_BITS) & 1


def match_seams(
    texels: UInt8Array,
    mixed: Mixed,
    smooth: BoolArray,
    srgb: Sequence[bool],
    report: Callable[[float], None],
    device: str = CPU,
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
        Called often with the fraction done; an error that it raises ends the work.
    device : str
        Where differences and equations are computed.
    """
    report(0.0)
    runs = _Runs.of(mixed, len(texels), device)
    done, ended = np.zeros(len(srgb)), Event()

    def matched(channel: int) -> UInt8Array:
        def tell(share: float) -> None:
            done[channel] = share
            check_cancelled("matching seams")

        with reporting(cancel=ended.is_set):  # launches look after it too
            levels = _Match(texels[:, channel], runs, smooth[:, channel], srgb[channel], tell).solved()
        return np.rint(255.0 * levels).astype(np.uint8)

    with ThreadPoolExecutor() as pool:  # channels have no level in common
        running = [pool.submit(matched, channel) for channel in range(len(srgb))]
        try:
            while wait(running, REPORT_SECONDS).not_done:
                report(float(done.mean()))
        finally:
            ended.set()
    return np.stack([task.result() for task in running], axis=1)


class _Runs(NamedTuple):
    """What all channels of seams have in common: runs of points that mix the same texels, see `Mixed`.

    Attributes
    ----------
    mixed : int32[r, 8]
        The texels that each run mixes.
    starts, counts : int64[r]
        The first point of each run, and how many it has.
    at_texel : csc_array
        The runs that mix each texel, as its columns.
    device : str
        Where differences and equations are computed.
    there, here : list of arrays
        The first point of each run and the end, and the places of the points, on this device and the CPU.
    mixed_there : array of int32[r, 8]
        The texels on this device.
    """

    mixed: Int32Array
    starts: Int64Array
    counts: Int64Array
    at_texel: Any
    device: str
    there: list[Any]
    here: list[Any]
    mixed_there: Any

    @classmethod
    def of(cls, mixed: Mixed, texels: int, device: str) -> "_Runs":
        """Return the runs of points, of which so many texels are mixed."""
        from scipy.sparse import csr_array  # imported where it is used: it takes a fifth of a second

        starts, index = np.append(mixed.starts, len(mixed.places)), mixed.mixed
        each = np.ones(index.size, np.bool_), index.reshape(-1), np.arange(0, index.size + 1, 8)
        there, here = (
            [array_on(on, starts, wp.int32), array_on(on, mixed.places, wp.vec2d)] for on in (device, CPU)
        )
        return cls(
            index,
            mixed.starts,
            np.diff(starts),
            csr_array(each, (len(index), texels)).tocsc(),
            device,
            there,
            here,
            array_on(device, index, wp.int32),
        )


class _Match:
    """Levels of texels in one channel, from 0 to 1, that become alike on both sides of seams.

    Parameters
    ----------
    texels : uint8[n]
        The texels.
    runs : _Runs
        Points of the seams.
    smooth : bool[m]
        True for the points where both sides are matched.
    srgb : bool
        True if levels are decoded before they are mixed.
    report : callable
        Called often with the fraction done; an error that it raises ends the work.
    """

    def __init__(
        self,
        texels: UInt8Array,
        runs: _Runs,
        smooth: BoolArray,
        srgb: bool,
        report: Callable[[float], None],
    ) -> None:
        self._runs, self._smooth, self._srgb, self._report = runs, smooth, srgb, report
        self._device = runs.device
        self._valid = np.logical_or.reduceat(smooth, runs.starts)
        self._smooth_there, self._smooth_here = (array_on(on, smooth, wp.uint8) for on in (self._device, CPU))
        self._first = texels / 255.0
        self._levels = self._first.copy()
        self._states = [wp.empty(len(texels), dtype=wp.float64, device=self._device) for _ in range(2)]
        self._change(np.arange(len(texels)), self._first)

    def solved(self) -> Float64Array:
        """Return levels ``float64[n]`` that differ as little from the texels as the seams need."""
        runs = np.flatnonzero(self._valid)
        chosen, _ = self._around(self._wrong(runs, SQUARES_FROM))
        if len(chosen):
            self._least_squares(chosen)
        self._settle(runs)
        return self._levels

    def _rows_of(self, runs: Int64Array) -> Int64Array:
        """Return the first row of each run, and the end; a row is a point of a run."""
        return np.append(0, np.cumsum(self._runs.counts[runs]))

    def _gaps(self, runs: Any, rows: Any, count: int, slopes: Any = None) -> Any:
        """Return the differences of both sides at rows on the device, and write their derivatives."""
        gaps: Any = wp.empty(int(count), dtype=wp.float64, device=self._device)
        known = wp.empty((0, 8), dtype=wp.float64, device=self._device) if slopes is None else slopes
        shared = [self._runs.mixed_there, *self._runs.there, self._smooth_there, self._srgb]
        launch(linearize, len(runs), [runs, rows, *shared, *self._states], [gaps, known], self._device)
        return gaps

    def _wrong(self, runs: Int64Array, most: float) -> Int64Array:
        """Return the runs where both sides differ by more than so much of 255."""
        rows = self._rows_of(runs)
        there, ends = (array_on(self._device, each, wp.int32) for each in (runs, rows))
        gaps = np.abs(self._gaps(there, ends, rows[-1]).numpy())
        return runs[np.maximum.reduceat(gaps, rows[:-1]) > most / 255.0] if len(gaps) else runs

    def _change(self, texels: Int64Array, values: Float64Array) -> None:
        """Change the levels of some texels."""
        self._levels[texels] = values
        listed = [array_on(self._device, *each) for each in ((texels, wp.int32), (values, wp.float64))]
        launch(change_levels, len(texels), [*listed, self._srgb], self._states, self._device)

    def _around(self, runs: Int64Array) -> tuple[Int64Array, Int64Array]:
        """Return some runs with those in `RINGS` rings around them, and with one ring more."""
        inner = runs
        for _ in range(RINGS + 1):
            inner, runs = runs, self._beside(runs)
        return inner, runs

    def _beside(self, runs: Int64Array) -> Int64Array:
        """Return the runs that have a texel in common with some runs, and these, in order."""
        texels = distinct_numbers(self._runs.mixed[runs], len(self._first))
        starts, at_texel = self._runs.at_texel.indptr, self._runs.at_texel.indices
        listed = at_texel[ranges(starts[texels], starts[texels + 1] - starts[texels])]
        beside = distinct_numbers(listed, len(self._valid))
        return beside[self._valid[beside]]

    def _linked(self, runs: Int64Array) -> tuple[Int64Array, Int32Array, Int32Array]:
        """Return the texels of runs, their columns there, and the first texel of the component of each.

        Texels of one run are in one component.
        """
        listed = self._runs.mixed[runs]
        used = distinct_numbers(listed, len(self._first))
        number = np.empty(len(self._first), np.int32)
        number[used] = np.arange(len(used))
        columns = number[listed]
        label = np.arange(len(used), dtype=np.int32)
        launch(join_levels, 1, [array_on(CPU, columns, wp.int32)], [array_on(CPU, label, wp.int32)], CPU)
        return used, columns, label

    def _least_squares(self, runs: Int64Array) -> None:
        """Minimise the change of texels and the weighted differences, with more weight where these stay."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        used, columns, label = self._linked(runs)
        links = np.repeat(columns[:, 0], 7), columns[:, 1:].reshape(-1)
        both = np.concatenate(links), np.concatenate(links[::-1])
        graph = coo_array((np.ones(len(both[0]), np.int8), both), (len(used), len(used))).tocsr()
        order = stable_order(label[columns[:, 0]])
        near = reverse_cuthill_mckee(graph, symmetric_mode=True)
        ranked = near[stable_order(label[near])]
        place = np.empty(len(used), np.int32)
        place[ranked] = np.arange(len(used))
        runs, used, columns = runs[order], used[ranked], place[columns[order]]
        levels = np.flatnonzero(np.diff(label[ranked], prepend=-1, append=-1))
        parts = np.flatnonzero(np.diff(label[ranked][columns[:, 0]], prepend=-1, append=-1))
        rows = self._rows_of(runs)
        coarse = self._coarse(runs)
        system = SeamSystem(self._first[used], columns, coarse, rows, parts, levels, self._device)
        there, ends = (array_on(self._device, each, wp.int32) for each in (runs, rows))
        for step in range(ROUNDS):
            tick = partial(self._report, 0.9 * step / ROUNDS)
            tick()
            gaps = self._gaps(there, ends, rows[-1], system.slopes)
            off = np.abs(gaps.numpy()) * 255.0 / TOLERANCE
            if off.max() <= LARGEST / TOLERANCE:
                return
            if step:
                system.strengthen(off)
            self._change(used, system.stepped(self._levels[used], gaps, tick))

    def _coarse(self, runs: Int64Array) -> BoolArray:
        """Return True for one of `COARSE` smooth points, for the rows of runs."""
        rows = ranges(self._runs.starts[runs], self._runs.counts[runs])
        number = np.cumsum(self._smooth) - 1
        coarse: BoolArray = self._smooth[rows] & (number[rows] % COARSE == 0)
        return coarse

    def _settle(self, runs: Int64Array) -> None:
        """Move points that still differ one by one, see `settle`."""
        for attempt in range(ATTEMPTS):
            self._report(0.9 + 0.1 * attempt / ATTEMPTS)
            wrong = self._wrong(runs, LARGEST)
            if not len(wrong):
                return
            chosen, runs = self._around(wrong)
            touched, columns, label = self._linked(chosen)
            component = label[columns[:, 0]]
            order = stable_order(component)
            bounds = np.flatnonzero(np.diff(component[order], prepend=-1, append=-1))
            inputs = [array_on(CPU, each, wp.int32) for each in (bounds, chosen[order], columns[order])]
            levels = array_on(CPU, self._levels[touched], wp.float32)
            light = wp.empty_like(levels)
            counts = len(touched), len(chosen)
            changed, seen = (wp.zeros(count, dtype=wp.int32, device=CPU) for count in counts)
            inputs += [*self._runs.here, self._smooth_here, self._srgb]
            inputs += [SWEEPS << attempt, SETTLED / 255.0, LARGEST / 255.0]
            launch(settle, len(bounds) - 1, inputs, [levels, light, changed, seen], CPU)
            self._change(touched, levels.numpy().astype(np.float64))
