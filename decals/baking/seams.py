"""Seams of textures: where one edge of a surface lies at two places, and colours that agree there.

A program mixes four texels at each place. Along a seam the texels of both sides lie differently on the
surface, so a sharp line that crosses the seam has a step there. `match_seams` changes the texels along seams
so that the colours on both sides agree, and as little as that takes.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from blobtree._typing import BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array
from blobtree.device import array_on, launch
from decals.baking.meshes import BakeMesh
from decals.baking.seam_kernels import settle
from decals.baking.unwrapped import Unwrapped
from decals.images.texels import decode_srgb, encode_srgb
from decals.surfaces.topology import welded

CPU = "cpu"
"""Device on which seams are settled and layouts are checked; textures are made on the default device."""

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

FIRST_WEIGHT, MAX_WEIGHT, MAX_GROWTH = 3.0, 300.0, 4.0
"""Weight of a point of a seam beside that of a texel, its limit, and its growth in a step at most."""

BOUND_WEIGHT, BOUND_DECAY = 30.0, 0.5
"""Weight of the bound on a texel that a step would darken below 0 or lighten above 1, and its decay."""

MAX_CHANGE = 0.25
"""Largest change of a texel in a step."""

SQUARES_FROM = 10.0
"""Difference of 255 from which on a point takes part in the least squares; smaller ones are settled."""

RINGS = 2
"""Rings of points, linked by common texels, that are changed with the points that differ."""

REPORT_SECONDS = 0.1
"""Seconds between reports; a cancelled match ends after the step that is running."""

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
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    points = np.stack([numbers, np.roll(numbers, -1, axis=1)], axis=2).reshape(-1, 2)
    turned = points[:, 0] > points[:, 1]
    sides[turned], points[turned] = sides[turned][:, ::-1], points[turned][:, ::-1]
    keys = points @ [len(mesh.vertices), 1]
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(
        (keys[order][1:] == keys[order][:-1]) & (points[order][1:, 0] != points[order][1:, 1])
    )
    pairs = np.stack([order[first], order[first + 1]], axis=1)
    faces = pairs // 3
    tiles = part.tile_of_face[faces].astype(np.int64)
    ends = part.places[sides[pairs]].astype(np.float64)
    cut = (np.abs(ends[:, 0] - ends[:, 1]).max(axis=(1, 2)) > SAME_PLACE) | (tiles[:, 0] != tiles[:, 1])
    a, b = np.moveaxis(mesh.vertices[part.rows[sides[pairs[cut, 0]]]].astype(np.float64), 1, 0)
    thirds = np.roll(corners, -2, axis=1).reshape(-1)[pairs[cut]]
    each = np.concatenate([sides[pairs[cut]], thirds[:, :, None]], axis=2)
    return faces[cut], tiles[cut], ends[cut], each, np.linalg.norm(b - a, axis=1)


def bilinear_texels(places: Float64Array, tiles: Int64Array, size: int) -> tuple[Int64Array, Float64Array]:
    """Return the four texels that are mixed at places, ``int64[n, 4]``, and their weights."""
    corner = np.floor(places - 0.5)
    share = places - 0.5 - corner
    columns = np.clip(corner[:, :1] + [0, 1, 0, 1], 0, size - 1).astype(np.int64)
    rows = np.clip(corner[:, 1:] + [0, 0, 1, 1], 0, size - 1).astype(np.int64)
    along = np.stack([1.0 - share[:, 0], share[:, 0]], axis=1)[:, [0, 1, 0, 1]]
    down = np.stack([1.0 - share[:, 1], share[:, 1]], axis=1)[:, [0, 0, 1, 1]]
    return (tiles[:, None] * size + rows) * size + columns, along * down


def match_seams(
    image: UInt8Array,
    places: Float64Array,
    tiles: Int64Array,
    smooth: BoolArray,
    srgb: Sequence[bool],
    report: Callable[[float], None],
) -> Int64Array:
    """Change the texels along seams so that both sides agree.

    Parameters
    ----------
    image : uint8[tiles, size, size, channels]
        The textures, which are changed.
    places : float64[n, 2, 2]
        Points of seams, on both sides.
    tiles : int64[n, 2]
        Their textures.
    smooth : bool[n, channels]
        True where the surface itself has no step.
    srgb : sequence of bool
        True for channels that hold sRGB, which programs decode before they mix texels.
    report : callable
        Called often with the fraction done.

    Returns
    -------
    int64[k]
        The texels that are mixed along seams, as indices into all textures.
    """
    size, channels = image.shape[1], image.shape[3]
    texels = image.reshape(-1, channels)
    found = [bilinear_texels(places[:, side], tiles[:, side], size) for side in (0, 1)]
    index, weights = (np.stack(each) for each in zip(*found, strict=True))
    used = _distinct(index, len(texels))
    number = np.empty(len(texels), np.int32)
    number[used] = np.arange(len(used))
    index = number[index]
    works = []
    for channel in range(channels):
        rows = np.flatnonzero(smooth[:, channel])
        levels = texels[used, channel] / 255.0
        works.append(_Match(levels, index[:, rows], weights[:, rows], srgb[channel]))
    with ThreadPoolExecutor() as pool:
        running = [pool.submit(work.solve) for work in works]
        try:
            report(0.0)
            while wait(running, REPORT_SECONDS).not_done:
                report(sum(work.share for work in works) / channels)
        except BaseException:
            for work in works:
                work.stopped = True
            raise
    for channel, (work, task) in enumerate(zip(works, running, strict=True)):
        task.result()  # an error of it is raised here
        texels[used, channel] = np.rint(255.0 * work.levels)
    return used


def _distinct(numbers: Int64Array, count: int) -> Int64Array:
    """Return the distinct ones of numbers below a count, in order."""
    marked = np.zeros(count, np.bool_)
    marked[numbers.reshape(-1)] = True
    return np.flatnonzero(marked)


class _Match:
    """Levels of one channel, from 0 to 1, that become alike on both sides of seams.

    Parameters
    ----------
    levels : float64[n]
        The texels.
    index : int32[2, m, 4]
        The texels that are mixed at points of seams, on both sides.
    weights : float64[2, m, 4]
        Their weights.
    srgb : bool
        True if texels are decoded before they are mixed.

    Attributes
    ----------
    share : float
        The part of the work that is done.
    stopped : bool
        True to end the work soon.
    """

    share = 0.0
    stopped = False

    def __init__(self, levels: Float64Array, index: Int32Array, weights: Float64Array, srgb: bool) -> None:
        self.levels, self._first = levels, levels.copy()
        self._index, self._weights, self._srgb = index, weights, srgb

    def solve(self) -> None:
        """Change the levels as little as the seams need."""
        rows = self._rows_around(np.abs(self._gaps()[0]) > SQUARES_FROM / 255.0)
        if len(rows):
            self._least_squares(rows)
        self._settle()

    def _gaps(self, rows: Int64Array | slice = slice(None)) -> tuple[Float64Array, Float64Array]:
        """Return the differences of both sides at points, and the levels on both, ``float64[2, k]``."""
        light = self._decoded(self.levels)[self._index[:, rows]]
        mixed = self._encoded((light * self._weights[:, rows]).sum(axis=2))
        return mixed[0] - mixed[1], mixed

    def _rows_around(self, wrong: BoolArray) -> Int64Array:
        """Return the rows of some points and of the points around them."""
        chosen: BoolArray = wrong
        for _ in range(RINGS):
            marked = np.zeros(len(self.levels), np.bool_)
            marked[self._index[:, chosen]] = True
            chosen = np.asarray(marked[self._index].any(axis=(0, 2)))
        return np.flatnonzero(chosen)

    def _least_squares(self, rows: Int64Array) -> None:
        """Minimise the change of texels and the weighted differences, with more weight where these stay."""
        used, columns = np.unique(self._index[:, rows], return_inverse=True)
        first = self._first[used]
        held, aims = np.ones(len(used)), first.copy()
        columns = columns.reshape(2, -1, 4)
        force = np.full(len(rows), FIRST_WEIGHT)
        chosen = rows % COARSE == 0
        for number in range(ROUNDS):
            self.share = 0.9 * number / ROUNDS
            if self.stopped:
                return
            gaps, mixed = self._gaps(rows)
            off = np.abs(gaps) * 255.0 / TOLERANCE
            if off.max() <= LARGEST / TOLERANCE:
                return
            if number:
                chosen |= off > 1.0
                grown = np.minimum(force * np.clip(off, 1.0, MAX_GROWTH), MAX_WEIGHT)
                force = np.where(off > 1.0, grown, force)
            levels = self.levels[used]
            of = np.flatnonzero(chosen)
            slopes = self._slopes(levels)[columns[:, of]] * self._weights[:, rows[of]]
            slopes /= self._slopes(mixed[:, of])[:, :, None]
            points, shape = np.repeat(np.arange(len(of)), 4), (len(of), len(used))
            sides = [
                csr_array((slope.reshape(-1), (points, column.reshape(-1))), shape)
                for slope, column in zip(slopes, columns[:, of], strict=True)
            ]
            change = sides[0] - sides[1]
            weighted = change.multiply(force[of, None] ** 2).T.tocsr()
            matrix = (weighted @ change + diags_array(held)).tocsc()
            solution = _solved(matrix, held * aims + weighted @ (change @ levels - gaps[of]))
            outside = (solution < 0.0) | (solution > 1.0)
            held = np.where(outside, BOUND_WEIGHT, 1.0 + (held - 1.0) * BOUND_DECAY)
            aims = np.where(outside, np.clip(solution, 0.0, 1.0), np.where(held > 1.5, aims, first))
            step = np.clip(solution - levels, -MAX_CHANGE, MAX_CHANGE)
            self.levels[used] = np.clip(levels + step, 0.0, 1.0)

    def _settle(self) -> None:
        """Move points that still differ one by one, see `settle`."""
        for _ in range(ATTEMPTS):
            wrong = np.abs(self._gaps()[0]) > LARGEST / 255.0
            if self.stopped or not wrong.any():
                return
            rows = self._rows_around(wrong)
            index, weights = (np.hstack([*each[:, rows]]) for each in (self._index, self._weights))
            inputs = [array_on(CPU, index, wp.int32), array_on(CPU, weights, wp.float32), self._srgb]
            inputs += [SWEEPS, SETTLED / 255.0, LARGEST / 255.0]
            states = self.levels, self._decoded(self.levels)
            levels, light = (array_on(CPU, state, wp.float32) for state in states)
            counts = len(self.levels), len(rows)
            changed, seen = (wp.zeros(count, dtype=wp.int32, device=CPU) for count in counts)
            launch(settle, 1, inputs, [levels, light, changed, seen], CPU)
            self.levels = levels.numpy().astype(np.float64)

    def _decoded(self, levels: Float64Array) -> Float64Array:
        return np.asarray(decode_srgb(levels), np.float64) if self._srgb else levels

    def _encoded(self, light: Float64Array) -> Float64Array:
        return np.asarray(encode_srgb(light), np.float64) if self._srgb else light

    def _slopes(self, levels: Float64Array) -> Float64Array:
        """Return the derivative of light by levels."""
        if not self._srgb:
            return np.ones(levels.shape)
        return np.where(levels <= 0.04045, 1.0 / 12.92, 2.4 / 1.055 * ((levels + 0.055) / 1.055) ** 1.4)


def _solved(matrix: csc_array, right: Float64Array) -> Float64Array:
    """Return the solution of a symmetric system; its unknowns lie along lines, so few others fill in."""
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    solution: Float64Array = factors.solve(right)
    return solution
