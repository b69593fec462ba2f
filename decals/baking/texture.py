"""Textures of unwrapped meshes: colours of the surface below each texel, seams that match, and gutters."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from blobtree._typing import (
    BoolArray,
    Float32Array,
    Float64Array,
    FloatArray,
    Int32Array,
    Int64Array,
    UInt8Array,
)
from blobtree.device import launch, start_warp
from blobtree.progress import Progress
from decals.baking.meshes import BakeMesh
from decals.baking.seams import Seams, match_seams
from decals.baking.texel_kernels import (
    compensate,
    cover_rows,
    encode_levels,
    mark_uneven,
    nearest_in_rows,
    nearest_texels,
    surface_points,
)
from decals.baking.unwrapped import Unwrapped
from decals.images.texels import decode_srgb

BLOCK_SAMPLES = 1 << 20
"""Samples that are looked up at once, which bounds the memory besides that of the texture."""

MIN_GUTTER = 4
GUTTER_SHARE = 1 / 256
"""Width of the gutters: so many texels, or this part of the texture if that is more."""

ROUNDING = 1e-3
"""Distance in samples below which a sample counts as inside a face."""

FINE_STEP = 3
"""Difference of two neighbours, of 255, above which a texel takes several samples."""

SHARPENING = 0.1
"""Part of the difference from its neighbours that a texel gains, as programs blur by mixing four texels."""

MAX_OVERSHOOT = 8.0
"""Levels of 255 by which that may leave the range of the texels around, at most."""

SEAM_STEP = 1
"""Difference of both sides of a seam, of 255, up to which the surface itself counts as smooth there."""

ALIKE = 1.0 - 1e-5
"""Cosine between the normals of both sides of a seam from which on they are one."""

BORDER_STEP = 0.5
"""Distance in texels of points along the borders of charts."""

CPU = "cpu"
"""Device of everything but the colours: texels lie in the memory of the host."""

WARP_TYPES: dict[type, Any] = {np.uint8: wp.uint8, np.int32: wp.int32, np.float32: wp.float32}

ColorFunction = Callable[
    [int, Float32Array, Float32Array, Float32Array | None, Float32Array | None], Float32Array
]
"""Linear colours ``float32[n, 3]`` of the surface of the mesh with a number, at points with unit normals; or
other values, of as many channels, which need the tangents there. At last base colours, linear."""


def color_bytes(colors: Float32Array) -> UInt8Array:
    """Return linear colours as sRGB bytes."""
    light = np.ascontiguousarray(colors, np.float32)
    levels = np.empty(light.shape, np.uint8)
    launch(encode_levels, light.size, [flat(light)], [flat(levels)], CPU)
    return levels


@dataclass(frozen=True, eq=False)
class Channels:
    """What a texel holds.

    Attributes
    ----------
    count : int
        Number of channels.
    color_at : callable
        Values of the surface, see `ColorFunction`.
    encode : callable
        Bytes ``uint8[n, count]`` of means of these values.
    tangents : sequence of float32[n, 4], optional
        Tangents at the unwrapped vertices of each mesh, if the values need them.
    srgb : sequence of bool
        True for channels that are sRGB; the others are linear.
    """

    color_at: ColorFunction
    count: int = 3
    encode: Callable[[Float32Array], UInt8Array] = color_bytes
    tangents: Sequence[Float32Array] | None = None
    srgb: Sequence[bool] = (True, True, True)


def gutter_width(size: int) -> int:
    """Return the width of the gutters of a texture, in texels."""
    return max(MIN_GUTTER, round(GUTTER_SHARE * size))


def bake_texture(
    meshes: Sequence[BakeMesh],
    unwrapped: Sequence[Unwrapped],
    size: int,
    samples: int,
    channels: Channels,
    report: Progress,
) -> UInt8Array:
    """Return textures ``uint8[tiles, size, size, channels]``, by default sRGB, first row at the top.

    A texel is the colour at its centre; where neighbours differ, the mean of those of its ``samples`` ×
    ``samples`` points that lie in charts. Texels outside all charts take the colour of the closest one within
    the gutter, and the mean colour of the charts beyond it, so that smaller mip levels mix in no foreign
    colour.
    """
    start_warp()
    tiles = 1 + max(int(part.tile_of_face.max(initial=0)) for part in unwrapped)
    image = np.zeros((tiles, size, size, channels.count), np.uint8)
    gutter = gutter_width(size)
    pages = [_Page(of, channels) for of in image]
    sheets = {
        (tile, number): Sheet(number, mesh, part, tile, channels)
        for number, (mesh, part) in enumerate(zip(meshes, unwrapped, strict=True))
        for tile in np.unique(part.tile_of_face).tolist()
    }
    for done, ((tile, _), sheet) in enumerate(sheets.items()):
        pages[tile].color(sheet, samples, partial(_report_part, report, done, len(sheets)))
    for page in pages:
        page.finish(gutter)
    seams = Seams.of(meshes, unwrapped)
    if len(seams.faces):
        report("matching seams", 0.0)
        rows, places = seams.points()
        smooth = _smooth_points(seams, rows, places, sheets, channels)
        changed = match_seams(
            image, places, seams.tiles[rows], smooth, channels.srgb, partial(report, "matching seams")
        )
        for tile, page in enumerate(pages):
            page.keep(changed[changed // size**2 == tile] % size**2)
            page.finish(gutter)
    return image


def _report_part(report: Progress, done: int, count: int, share: float) -> None:
    report("colouring texels", (done + share) / count)


def _smooth_points(
    seams: Seams,
    rows: Int64Array,
    places: Float64Array,
    sheets: Mapping[tuple[int, int], "Sheet"],
    channels: Channels,
) -> BoolArray:
    """Return True where the surface has no step, for points of seams and channels, ``bool[n, channels]``."""
    parts = [
        (side, own, sheet, sheet.surface(sheet.numbers_of(seams.faces[rows[own], side]), places[own, side]))
        for side in (0, 1)
        for (tile, number), sheet in sheets.items()
        for own in [np.flatnonzero((seams.tiles[rows, side] == tile) & (seams.meshes[rows] == number))]
    ]
    points, units = np.zeros((2, 2, len(rows), 3), np.float32)
    for side, own, _, at in parts:
        points[side, own], units[side, own] = at.points, at.units
    # at one point with one normal, rounding may not decide on which side of a rim it is
    alike = np.einsum("na,na->n", *units) > ALIKE
    points[1, alike], units[1, alike] = points[0, alike], units[0, alike]
    levels = np.zeros((2, len(rows), channels.count), np.int16)
    for side, own, sheet, at in parts:
        shared = at._replace(points=points[side, own], units=units[side, own])
        levels[side, own] = channels.encode(sheet.colors(shared))
    smooth: BoolArray = np.abs(levels[0] - levels[1]) <= SEAM_STEP
    return smooth


class Located(NamedTuple):
    """Points of the surface: their faces in a `Sheet`, positions, unit normals and barycentric weights."""

    faces: Int32Array
    points: Float32Array
    units: Float32Array
    weights: Float32Array


class Sheet:
    """The charts of one mesh on one tile."""

    def __init__(
        self, number: int, mesh: BakeMesh, part: Unwrapped, tile: int, channels: Channels | None = None
    ) -> None:
        self._number, self._mesh = number, mesh
        self._color_at = None if channels is None else channels.color_at
        self._chosen = np.flatnonzero(part.tile_of_face == tile)
        self.faces, self.places = part.faces[self._chosen], part.places
        self._rows = part.rows
        every = None if channels is None else channels.tangents
        self._tangents = None if every is None else every[number]
        self._arrays: list[Any] = [
            wp.array(np.ascontiguousarray(values), dtype=kind, device=CPU)
            for values, kind in (
                (self.faces, wp.vec3i),
                (part.places, wp.vec2),
                (mesh.places[part.rows], wp.vec3),
                (mesh.facings[part.rows], wp.vec3),
            )
        ]
        heights = part.places[:, 1][self.faces]
        self._low, self._high = heights.min(axis=1), heights.max(axis=1)

    def cover(
        self,
        top: int,
        bottom: int,
        size: int,
        steps: int,
        wanted: UInt8Array | None = None,
        margin: float = ROUNDING,
    ) -> tuple[Int32Array, int]:
        """Return the face at each sample of rows of texels, -1 without, and how many lie in two.

        Parameters
        ----------
        top, bottom : int
            The rows, without the last.
        size : int
            Texels of a row.
        steps : int
            Samples along each axis of a texel.
        wanted : uint8[bottom - top, size], optional
            0 for texels that are left out.
        margin : float
            Distance in samples by which faces are widened.

        Returns
        -------
        int32[(bottom - top) * steps, size * steps], int
        """
        rows = (bottom - top) * steps
        starts, listed = self._faces_of_rows(top, rows, steps)
        found: Any = wp.full(rows * size * steps, -1, dtype=wp.int32, device=CPU)
        overlaps = wp.zeros(rows, dtype=wp.int32, device=CPU)
        lists: list[Any] = [wp.array(values, dtype=wp.int32, device=CPU) for values in (starts, listed)]
        texels: Any = np.zeros(0, np.uint8) if wanted is None else wanted.reshape(-1)
        use: Any = wp.array(texels, dtype=wp.uint8, device=CPU)
        inputs = [*lists, *self._arrays[:2], top, steps, size * steps, margin, use]
        launch(cover_rows, rows, inputs, [found, overlaps], CPU)
        return found.numpy().reshape(rows, -1), int(overlaps.numpy().sum())

    def _faces_of_rows(self, top: int, rows: int, steps: int) -> tuple[Int32Array, Int32Array]:
        """Return the faces at each row of samples, in their order."""
        first = np.clip(np.ceil((self._low - top) * steps - 0.5), 0, rows).astype(np.int64)
        last = np.clip(np.floor((self._high - top) * steps - 0.5), -1, rows - 1).astype(np.int64)
        counts = np.maximum(last - first + 1, 0)
        used = np.flatnonzero(counts)
        counts = counts[used]
        ends = np.cumsum(counts)
        within = np.arange(int(counts.sum())) - np.repeat(ends - counts, counts)
        row = np.repeat(first[used], counts) + within
        kind = np.uint16 if rows <= 1 << 16 else np.int32  # the shorter ones are sorted by their digits
        order = np.argsort(row.astype(kind), kind="stable")
        starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=rows))])
        return starts.astype(np.int32), np.repeat(used, counts)[order].astype(np.int32)

    def values(self, faces: Int32Array, places: FloatArray) -> Float32Array:
        """Return the values of the surface at places in faces of this sheet, ``float32[n, channels]``."""
        return self.colors(self.surface(faces, places))

    def surface(self, faces: Int32Array, places: FloatArray) -> Located:
        """Return the points of the surface at places in faces of this sheet."""
        inputs: list[Any] = [
            wp.array(places.astype(np.float32, copy=False), dtype=wp.vec2, device=CPU),
            wp.array(faces, dtype=wp.int32, device=CPU),
        ]
        outputs: list[Any] = [wp.empty(len(faces), dtype=wp.vec3, device=CPU) for _ in range(3)]
        launch(surface_points, len(faces), [*inputs, *self._arrays], outputs, CPU)
        points, units, weights = (array.numpy() for array in outputs)
        return Located(faces, points, units, weights)

    def colors(self, at: Located) -> Float32Array:
        """Return the values of the surface at points, ``float32[n, channels]``."""
        base = self._mesh.base
        corners = None if base is None and self._tangents is None else self.faces[at.faces]
        along: Float32Array | None = None
        light: Float32Array | None = None
        if self._tangents is not None:
            along = np.einsum("nc,nca->na", at.weights, self._tangents[corners])
        if base is not None:
            wide = at.weights.astype(np.float64)
            light = base.light_of(self._rows[corners], self._chosen[at.faces], wide).astype(np.float32)
        assert self._color_at is not None  # else the sheet has no channels
        return self._color_at(self._number, at.points, at.units, along, light)

    def numbers_of(self, faces: Int64Array) -> Int32Array:
        """Return the numbers that faces of the mesh have in this sheet."""
        return np.searchsorted(self._chosen, faces).astype(np.int32)

    def border_points(self) -> tuple[Int32Array, Float32Array]:
        """Return faces and places ``float32[n, 2]`` of points along the borders of charts."""
        sides = np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2).reshape(-1, 2)
        keys = np.sort(sides, axis=1).astype(np.int64) @ [len(self.places), 1]
        _, first, counts = np.unique(keys, return_index=True, return_counts=True)
        rows = first[counts == 1]
        begin, end = self.places[sides[rows, 0]], self.places[sides[rows, 1]]
        steps = np.ceil(np.linalg.norm(end - begin, axis=1) / BORDER_STEP).astype(np.int64) + 1
        edges = np.repeat(np.arange(len(rows)), steps)
        number = np.arange(len(edges)) - np.repeat(np.cumsum(steps) - steps, steps)
        share = (number / np.maximum(steps - 1, 1)[edges])[:, None].astype(np.float32)
        return (rows[edges] // 3).astype(np.int32), begin[edges] * (1 - share) + end[edges] * share


class _Page:
    """One texture while it is made."""

    def __init__(self, image: UInt8Array, channels: Channels) -> None:
        self._image, self._size = image, len(image)
        self._encode, self._srgb = channels.encode, channels.srgb
        self._filled: UInt8Array = np.zeros(image.shape[:2], np.uint8)
        self._sum, self._count = np.zeros(image.shape[2]), 0

    def color(self, sheet: Sheet, samples: int, report: Callable[[float], None]) -> None:
        """Colour the texels of the charts of a mesh."""
        own = np.zeros(self._filled.shape, np.uint8)
        for top, bottom in self._blocks(1):
            report(0.5 * top / self._size)
            self._color_centers(sheet, own, top, bottom)
        if samples > 1:
            sizes = self._size, self._image.shape[2], FINE_STEP
            uneven = self._launch_rows(mark_uneven, np.uint8, [own, self._image, *sizes])
            uneven &= self._filled == 0
            for top, bottom in self._blocks(samples):
                report(0.5 + 0.5 * top / self._size)
                self._refine(sheet, own, uneven, top, bottom, samples)
        self._color_borders(sheet, own)
        if samples > 1:
            self._compensate(uneven, own)
        self._filled |= own

    def _blocks(self, steps: int) -> Iterator[tuple[int, int]]:
        rows = max(1, BLOCK_SAMPLES // (self._size * steps**2))
        for top in range(0, self._size, rows):
            yield top, min(top + rows, self._size)

    def _color_centers(self, sheet: Sheet, own: UInt8Array, top: int, bottom: int) -> None:
        found, _ = sheet.cover(top, bottom, self._size, 1)
        rows, columns = np.nonzero((found >= 0) & (self._filled[top:bottom] == 0))
        if not len(rows):
            return
        places = np.stack([columns, rows + top], axis=1).astype(np.float32) + np.float32(0.5)
        values = sheet.values(found[rows, columns], places)
        self._image[rows + top, columns] = self._encode(values)
        own[rows + top, columns] = 1
        self._sum, self._count = self._sum + values.sum(axis=0, dtype=np.float64), self._count + len(rows)

    def _refine(
        self, sheet: Sheet, own: UInt8Array, uneven: UInt8Array, top: int, bottom: int, samples: int
    ) -> None:
        """Take the mean of several samples at texels whose neighbours differ."""
        texels = uneven[top:bottom]
        if not texels.any():
            return
        found, _ = sheet.cover(top, bottom, self._size, samples, texels)
        rows, columns = np.nonzero(texels)
        faces = found.reshape(bottom - top, samples, self._size, samples)[rows, :, columns]
        number, i, k = np.nonzero(faces >= 0)
        if not len(number):
            return
        within = (np.stack([k, i], axis=1).astype(np.float32) + np.float32(0.5)) / np.float32(samples)
        corners = np.stack([columns, rows + top], axis=1).astype(np.float32)
        values = sheet.values(faces[number, i, k], corners[number] + within)
        starts = np.flatnonzero(np.diff(number, prepend=-1))
        counts = np.diff(starts, append=len(number)).astype(np.float32)
        sums: Any = np.add.reduceat(values, starts, axis=0)
        means: Float32Array = sums / counts[:, None]
        rows, columns = rows[number[starts]] + top, columns[number[starts]]
        self._image[rows, columns] = self._encode(means)
        own[rows, columns] = 1

    def _color_borders(self, sheet: Sheet, own: UInt8Array) -> None:
        """Colour the texels of charts that no sample lies in, by points of their borders."""
        faces, places = sheet.border_points()
        columns, rows = np.clip(places.astype(np.int64), 0, self._size - 1).T
        bare = np.flatnonzero((own[rows, columns] == 0) & (self._filled[rows, columns] == 0))
        _, first = np.unique(rows[bare] * self._size + columns[bare], return_index=True)
        chosen = bare[first]
        if len(chosen):
            values = sheet.values(faces[chosen], places[chosen])
            self._image[rows[chosen], columns[chosen]] = self._encode(values)
            own[rows[chosen], columns[chosen]] = 1

    def _compensate(self, uneven: UInt8Array, own: UInt8Array) -> None:
        """Sharpen texels whose neighbours differ, as much as programs blur them."""
        light = decode_srgb(np.arange(256) / 255.0).astype(np.float32)
        srgb = np.asarray(self._srgb, np.uint8)
        sharper = self._image.copy()
        inputs = [*map(flat, (uneven, own, self._image, light, srgb)), self._size, SHARPENING, MAX_OVERSHOOT]
        launch(compensate, self._size, inputs, [flat(sharper)], CPU)
        self._image[...] = sharper

    def keep(self, texels: Int64Array) -> None:
        """Let texels keep their colours when gutters are filled."""
        self._filled.reshape(-1)[texels] = 1

    def finish(self, reach: int) -> None:
        """Give empty texels the colour of the nearest one within reach, and the others the mean colour."""
        size = self._size
        columns = self._launch_rows(nearest_in_rows, np.int32, [self._filled, size, reach])
        nearest = self._launch_rows(nearest_texels, np.int32, [self._filled, columns, size, reach])
        nearest = nearest.reshape(-1)
        texels = self._image.reshape(size * size, -1)
        near = np.flatnonzero(nearest >= 0)
        texels[near] = texels[nearest[near]]
        if self._count:
            mean = self._encode((self._sum[None] / self._count).astype(np.float32))
            texels[np.flatnonzero((nearest < 0) & (self._filled.reshape(-1) == 0))] = mean

    def _launch_rows(self, kernel: Any, kind: Any, inputs: list[Any]) -> Any:
        """Return the result of a kernel for each texel, which runs once for each row."""
        result = np.empty(self._filled.shape, kind)
        arrays = [flat(each) if isinstance(each, np.ndarray) else each for each in inputs]
        launch(kernel, self._size, arrays, [flat(result)], CPU)
        return result


def flat(values: Any) -> Any:
    """Return a contiguous array of numbers as one of Warp that shares its memory."""
    return wp.array(values.reshape(-1), dtype=WARP_TYPES[values.dtype.type], device=CPU, copy=False)
