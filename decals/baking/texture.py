"""Textures of unwrapped meshes: colours of the surface below each texel, seams that match, and gutters."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import (
    BoolArray,
    Float32Array,
    FloatArray,
    Int32Array,
    Int64Array,
    UInt8Array,
)
from blobtree.device import array_on, known_device, launch, on_host
from blobtree.progress import Progress
from decals.baking.beyond import Beyond
from decals.baking.meshes import BakeMesh
from decals.baking.seam_system import CPU
from decals.baking.seams import Mixed, Seams, match_seams
from decals.baking.texel_kernels import (
    compensate,
    cover_rows,
    encode_levels,
    fill_gutters,
    fill_own,
    list_marked,
    mark_free,
    mark_listed,
    mark_range,
    mark_uneven,
    mean_samples,
    nearest_in_rows,
    points_beyond,
    read_listed,
    sample_points,
    share_alike,
    sum_parts,
    surface_points,
    write_listed,
    write_texels,
)
from decals.baking.unwrapped import Unwrapped
from decals.images.texels import decode_srgb
from decals.sorting import groups, ranges

BLOCK_SAMPLES, CARD_BLOCK_SAMPLES = 1 << 20, 1 << 23
"""Samples that a processor or a card looks up at once; they bound the memory besides that of the texture."""

BAND = 8
"""Rows of texels that share one list of faces: longer lists, but fewer of them."""

CARD_ROW_PARTS = 32
"""Parts of a row of samples that threads of a card cover; a processor covers whole rows."""

PART_ROWS = 1024
"""Colours that are summed at once."""

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

CHART, BEYOND = 1, 2
"""Marks of texels: in a chart, and beyond a seam of it."""

ColorFunction = Callable[
    [int, Float32Array, Float32Array, Float32Array | None, Float32Array | None], Float32Array
]
"""Function of the number of a mesh, points of its surface, unit normals, tangents and linear base colours.

It returns linear colours ``float32[n, 3]``, or with tangents the values of all channels."""

DeviceColorFunction = Callable[[int, Any, Any, Any], Any]
"""Function of the number of a mesh, points, unit normals and base colours (one, or one for each point).

It takes and returns arrays of Warp on a device."""


def color_bytes(colors: Float32Array) -> UInt8Array:
    """Return linear colours as sRGB bytes."""
    levels: UInt8Array = _encoded(array_on(CPU, colors.reshape(-1), wp.float32)).numpy()
    return levels.reshape(colors.shape)


def _encoded(light: Any) -> Any:
    """Return linear light as sRGB bytes on the same device."""
    levels: Any = wp.empty(len(light), dtype=wp.uint8, device=light.device)
    launch(encode_levels, len(light), [light], [levels], str(light.device))
    return levels


@dataclass(frozen=True, eq=False)
class Channels:
    """What a texel holds.

    Attributes
    ----------
    color_at : callable
        Values of the surface, see `ColorFunction`.
    count : int
        Number of channels.
    encode : callable
        Bytes ``uint8[n, count]`` of means of these values.
    tangents : sequence of float32[n, 4], optional
        Tangents at the unwrapped vertices of each mesh, if the values need them.
    srgb : sequence of bool
        True for channels that are sRGB; the others are linear.
    on_device : callable, optional
        The values without tangents, see `DeviceColorFunction`; they are encoded by `color_bytes`.
    """

    color_at: ColorFunction
    count: int = 3
    encode: Callable[[Float32Array], UInt8Array] = color_bytes
    tangents: Sequence[Float32Array] | None = None
    srgb: Sequence[bool] = (True, True, True)
    on_device: DeviceColorFunction | None = None

    def levels(self, values: Any) -> Any:
        """Return values on a device as bytes there, one after another."""
        if self.encode is color_bytes:
            return _encoded(values)
        rows = self.encode(values.numpy().reshape(-1, self.count))
        return array_on(str(values.device), rows.reshape(-1), wp.uint8)


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
) -> list[UInt8Array]:
    """Return textures ``uint8[size, size, channels]``, by default sRGB, first row at the top.

    A texel is the colour at its centre; where neighbours differ, the mean of those of its ``samples`` ×
    ``samples`` points that lie in charts. Beyond a seam, texels show the surface on its other side, see
    `decals.baking.beyond`. Other texels outside all charts take the colour of the closest one within the
    gutter, and the mean colour of the charts beyond it, so that smaller mip levels mix in no foreign colour.
    """
    device = known_device()
    tiles = 1 + max(int(part.tile_of_face.max(initial=0)) for part in unwrapped)
    with ThreadPoolExecutor() as pool:  # looks at edges while centres are coloured
        later = pool.submit(_SeamPoints.of, meshes, unwrapped, size)
        pages = [_Page(size, channels, device) for _ in range(tiles)]
        sheets = {
            (tile, number): Sheet(number, mesh, part, tile, channels, device)
            for number, (mesh, part) in enumerate(zip(meshes, unwrapped, strict=True))
            for tile in np.unique(part.tile_of_face).tolist()
        }
        borders = [pool.submit(sheet.border_points) for sheet in sheets.values()]
        for done, ((tile, number), sheet) in enumerate(sheets.items()):
            beyond = partial(_beyond, later, number, tile, size)
            tell = partial(_report_part, report, done, len(sheets))
            pages[tile].color(sheet, beyond, borders[done].result, samples, tell)
    points = later.result()
    if len(points.seams.faces):
        report("matching seams", 0.0)
        smooth = _smooth_points(points, list(sheets.values()), channels)
        mixed = points.mixed
        bounds = np.searchsorted(mixed.texels, np.arange(tiles + 1) * size**2)
        own = [slice(*bounds[tile : tile + 2]) for tile in range(tiles)]
        before = [page.texels(mixed.texels[of] % size**2) for page, of in zip(pages, own, strict=True)]
        share = partial(report, "matching seams")
        matched = match_seams(np.concatenate(before), mixed, smooth, channels.srgb, share, device)
        for page, of in zip(pages, own, strict=True):
            page.replace(mixed.texels[of] % size**2, matched[of])
    for page in pages:
        page.finish(gutter_width(size))
    return [page.image() for page in pages]


def _report_part(report: Progress, done: int, count: int, share: float) -> None:
    report("colouring texels", (done + share) / count)


class _SeamPoints(NamedTuple):
    """Points along all seams, and the texels that are mixed there.

    Attributes
    ----------
    seams : Seams
    numbers : int64[n]
        The seam of each point.
    mixed : Mixed
        The points and their texels.
    closest, sides : int64[k]
        For each texel, the closest of the seams that mix it, and on which side of it the texel is.
    """

    seams: Seams
    numbers: Int64Array
    mixed: Mixed
    closest: Int64Array
    sides: Int64Array

    @classmethod
    def of(cls, meshes: Sequence[BakeMesh], unwrapped: Sequence[Unwrapped], size: int) -> "_SeamPoints":
        """Return the points of the seams of unwrapped meshes."""
        seams = Seams.of(meshes, unwrapped)
        numbers, places = seams.points()
        mixed = Mixed.of(places, seams.tiles[numbers], size)
        points, sides = mixed.closest(size)
        return cls(seams, numbers, mixed, numbers[points], sides)


def _beyond(points: "Future[_SeamPoints]", number: int, tile: int, size: int) -> Beyond:
    """Return the texels beyond seams of a mesh on a tile, once the points are there."""
    seams, _, mixed, closest, sides = points.result()
    return Beyond.of(seams, mixed.texels, closest, sides, number, tile, size)


def _smooth_points(points: _SeamPoints, sheets: Sequence["Sheet"], channels: Channels) -> BoolArray:
    """Return True where the surface has no step, for points of seams and channels, ``bool[n, channels]``."""
    seams, numbers, (*_, places) = points.seams, points.numbers, points.mixed
    smooth = np.zeros((len(numbers), channels.count), np.bool_)
    for number, sheet in {sheet.number: sheet for sheet in sheets}.items():
        own = slice(*np.searchsorted(seams.meshes[numbers], [number, number + 1]))
        one, other = (sheet.surface(seams.faces[numbers[own], side], places[own, side]) for side in (0, 1))
        # at one point with one normal, rounding may not decide on which side of a rim it is
        inputs, outputs = [one.points, one.units, ALIKE], [other.points, other.units]
        launch(share_alike, len(one.points), inputs, outputs, sheet.device)
        levels = [
            channels.levels(sheet.colors(at)).numpy().reshape(-1, channels.count).astype(np.int16)
            for at in (one, other)
        ]
        smooth[own] = np.abs(levels[0] - levels[1]) <= SEAM_STEP
    return smooth


class Located(NamedTuple):
    """Points of the surface on a device.

    Attributes
    ----------
    faces : int32[n]
        Faces of the mesh; at −1, the point is of no use.
    points, units : vec3[n]
        Positions and unit normals.
    weights : vec3[n]
        Barycentric weights in these faces.
    """

    faces: Any
    points: Any
    units: Any
    weights: Any


class Sheet:
    """The charts of one mesh on one tile."""

    def __init__(
        self,
        number: int,
        mesh: BakeMesh,
        part: Unwrapped,
        tile: int,
        channels: Channels | None = None,
        device: str = CPU,
    ) -> None:
        self.number, self._mesh, self._part, self._channels = number, mesh, part, channels
        self.device = device
        self._chosen = np.flatnonzero(part.tile_of_face == tile)
        self._arrays: list[Any] = [
            array_on(device, values, kind)
            for values, kind in (
                (part.faces, wp.vec3i),
                (part.places, wp.vec2),
                (mesh.places[part.rows], wp.vec3),
                (mesh.facings[part.rows], wp.vec3),
            )
        ]
        self._lists: tuple[int, list[Any]] = (0, [])

    def cover(self, size: int, margin: float) -> tuple[Int32Array, int]:
        """Return the face at the centre of each texel, −1 without, and how many centres lie in two faces.

        Faces are widened by ``margin`` texels.
        """
        found, overlaps = self.faces_at(0, size, size, 1, margin=margin)
        return found.numpy().reshape(size, size), int(overlaps.numpy().sum())

    def faces_at(
        self, top: int, bottom: int, size: int, steps: int, wanted: Any = None, margin: float = ROUNDING
    ) -> tuple[Any, Any]:
        """Return the face at each sample of rows of texels, and how many samples of each thread lie in two.

        Parameters
        ----------
        top, bottom : int
            The rows, without the last.
        size : int
            Texels of a row.
        steps : int
            Samples along each axis of a texel.
        wanted : array of uint8, optional
            0 for texels of the texture that are left out.
        margin : float
            Distance in samples by which faces are widened.
        """
        rows = (bottom - top) * steps
        found: Any = wp.full(rows * size * steps, -1, dtype=wp.int32, device=self.device)
        parts = 1 if wp.get_device(self.device).is_cpu else CARD_ROW_PARTS
        overlaps: Any = wp.empty(rows * parts, dtype=wp.int32, device=self.device)
        use: Any = wp.empty(0, dtype=wp.uint8, device=self.device) if wanted is None else wanted
        lists = self._faces_of_bands(size)
        inputs = [*lists, *self._arrays[:2], BAND, parts, top, steps, size * steps, margin, use]
        launch(cover_rows, rows * parts, inputs, [found, overlaps], self.device)
        return found, overlaps

    def _faces_of_bands(self, size: int) -> list[Any]:
        """Return the faces at each band of rows of texels, in their order."""
        if self._lists[0] != size:
            from scipy.sparse import csr_array  # imported where it is used: it takes a fifth of a second

            bands = -(-size // BAND)
            faces, heights = self._part.faces[self._chosen], self._part.places[:, 1] / np.float32(BAND)
            corners = [heights[faces[:, k]] for k in range(3)]
            first, last = (
                np.clip(np.floor(reduce(of, corners)), 0, bands - 1).astype(np.int64)
                for of in (np.minimum, np.maximum)
            )
            counts = last - first + 1
            ends, rows = np.append(0, np.cumsum(counts)), ranges(first, counts)
            each = np.ones(len(rows), np.bool_), rows, ends
            lists = csr_array(each, (len(counts), bands)).tocsc()
            listed = self._chosen[lists.indices]
            self._lists = size, [array_on(self.device, of, wp.int32) for of in (lists.indptr, listed)]
        return self._lists[1]

    def surface(self, faces: FloatArray | Int64Array, places: FloatArray) -> Located:
        """Return the points of the surface at places in faces of the mesh."""
        numbers = array_on(self.device, faces, wp.int32)
        outputs: list[Any] = [wp.empty(len(faces), dtype=wp.vec3, device=self.device) for _ in range(3)]
        inputs = [array_on(self.device, places, wp.vec2), numbers, *self._arrays]
        launch(surface_points, len(faces), inputs, outputs, self.device)
        return Located(numbers, *outputs)

    def samples(self, texels: Any, found: Any, top: int, size: int, steps: int) -> Located:
        """Return the points at the samples of texels, whose faces were found from a row of texels on."""
        count = len(texels) * steps**2
        kinds = wp.int32, wp.vec3, wp.vec3, wp.vec3
        outputs: list[Any] = [wp.empty(count, dtype=kind, device=self.device) for kind in kinds]
        inputs = [texels, found, top, size, steps, *self._arrays]
        launch(sample_points, count, inputs, outputs, self.device)
        return Located(*outputs)

    def samples_beyond(self, beyond: Beyond, size: int, steps: int) -> tuple[Located, Float32Array | None]:
        """Return the points at the samples of texels beyond seams, and the tangents at these texels."""
        count = len(beyond.texels) * steps**2
        kinds = wp.int32, wp.vec3, wp.vec3, wp.vec3, wp.vec3
        outputs: list[Any] = [wp.empty(count, dtype=kind, device=self.device) for kind in kinds]
        sides = zip(beyond, (wp.int32, wp.vec3i, wp.vec3i, wp.int32), strict=True)
        inputs = [*(array_on(self.device, values, kind) for values, kind in sides), size, steps]
        launch(points_beyond, count, [*inputs, *self._arrays], outputs, self.device)
        *located, along = outputs
        corners = np.repeat(beyond.here, steps**2, axis=0)
        return Located(*located), self._mean_tangents(corners, along.numpy())

    def colors(self, at: Located, tangents: Float32Array | None = None) -> Any:
        """Return the values of the surface at points, one channel after another, on the device.

        The tangents are those at the points, if values need any and they are not those of their faces.
        """
        channels = self._channels
        assert channels is not None  # only sheets with channels have colours
        if channels.on_device is not None:
            return channels.on_device(self.number, at.points, at.units, self._base_light(at))
        light: Float32Array | None = None
        if tangents is None and channels.tangents is not None:
            tangents = self._mean_tangents(self._part.faces[at.faces.numpy()], at.weights.numpy())
        if self._mesh.base is not None:
            light = self._textured_light(at)
        values = channels.color_at(self.number, at.points.numpy(), at.units.numpy(), tangents, light)
        return array_on(self.device, values.reshape(-1), wp.float32)

    def _mean_tangents(self, corners: NDArray[np.integer], weights: Float32Array) -> Float32Array | None:
        """Return the tangents at points by those of unwrapped vertices, if the values need them."""
        assert self._channels is not None
        if self._channels.tangents is None:
            return None
        tangents: Float32Array = np.einsum(
            "nc,nca->na", weights, self._channels.tangents[self.number][corners]
        )
        return tangents

    def _base_light(self, at: Located) -> Any:
        """Return linear base colours on the device: one, or one for each point."""
        if self._mesh.base is not None:
            light = self._textured_light(at)
        elif callable(self._mesh.base_colors):
            light = self._mesh.base_light(at.points.numpy())
        else:
            light = self._mesh.base_light(np.zeros((1, 3), np.float32))
        return array_on(self.device, light, wp.vec3)

    def _textured_light(self, at: Located) -> Float32Array:
        """Return linear base colours of textures and corners, ``float32[n, 3]``."""
        assert self._mesh.base is not None
        faces = np.maximum(at.faces.numpy(), 0)
        corners = self._part.rows[self._part.faces[faces]]
        light = self._mesh.base.light_of(corners, faces, at.weights.numpy().astype(np.float64))
        return np.asarray(light, np.float32)

    def border_points(self) -> tuple[Int64Array, Float32Array]:
        """Return faces and places ``float32[n, 2]`` of points along the borders of charts."""
        faces, places = self._part.faces[self._chosen], self._part.places
        starts, stops = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
        keys = np.minimum(starts, stops) * np.int64(len(places)) + np.maximum(starts, stops)
        first, _, counts = groups(keys)
        rows = first[counts == 1]
        begin, end = places[starts[rows]], places[stops[rows]]
        steps = np.ceil(np.linalg.norm(end - begin, axis=1) / BORDER_STEP).astype(np.int64) + 1
        edges = np.repeat(np.arange(len(rows)), steps)
        number = ranges(np.zeros_like(steps), steps)
        share = (number / np.maximum(steps - 1, 1)[edges])[:, None].astype(np.float32)
        return self._chosen[rows[edges] // 3], begin[edges] * (1 - share) + end[edges] * share


class _Page:
    """One texture while it is made, on a device."""

    def __init__(self, size: int, channels: Channels, device: str) -> None:
        self._size, self._channels, self._device = size, channels, device
        self._texels = size * size
        self._image = self._zeros(self._texels * channels.count, wp.uint8)
        self._filled = self._zeros(self._texels, wp.uint8)
        self._sum, self._count = np.zeros(channels.count), 0
        self._block = BLOCK_SAMPLES if wp.get_device(device).is_cpu else CARD_BLOCK_SAMPLES

    def image(self) -> UInt8Array:
        """Return the texture, ``uint8[size, size, channels]``."""
        return on_host(self._image).reshape(self._size, self._size, -1)

    def texels(self, listed: Int64Array) -> UInt8Array:
        """Return some texels, ``uint8[n, channels]``."""
        levels = self._empty(len(listed) * self._channels.count, wp.uint8)
        inputs = [array_on(self._device, listed, wp.int32), self._image, self._channels.count]
        launch(read_listed, len(listed), inputs, [levels], self._device)
        values: UInt8Array = levels.numpy()
        return values.reshape(-1, self._channels.count)

    def replace(self, listed: Int64Array, levels: UInt8Array) -> None:
        """Give some texels other colours, which they keep when gutters are filled."""
        inputs = [
            array_on(self._device, *each) for each in ((listed, wp.int32), (levels.reshape(-1), wp.uint8))
        ]
        outputs = [self._image, self._filled]
        launch(write_listed, len(listed), [*inputs, self._channels.count], outputs, self._device)

    def color(
        self,
        sheet: Sheet,
        beyond: Callable[[], Beyond],
        border: Callable[[], tuple[Int64Array, Float32Array]],
        samples: int,
        report: Callable[[float], None],
    ) -> None:
        """Colour the texels of the charts of a mesh.

        ``beyond`` and ``border`` return the texels beyond seams and the points of `Sheet.border_points`.
        """
        own = self._zeros(self._texels, wp.uint8)
        for top, bottom in self._blocks(1):
            report(0.5 * top / self._size)
            self._color_centers(sheet, own, top, bottom)
        self._color_beyond(sheet, beyond(), own, samples)
        if samples > 1:
            uneven = self._empty(self._texels, wp.uint8)
            inputs = [own, self._filled, self._image, self._size, self._channels.count, FINE_STEP]
            launch(mark_uneven, self._texels, inputs, [uneven], self._device)
            for top, bottom in self._blocks(samples):
                report(0.5 + 0.5 * top / self._size)
                self._refine(sheet, own, uneven, top, bottom, samples)
        self._color_borders(sheet, *border(), own)
        if samples > 1:
            self._compensate(uneven, own)
        launch(fill_own, self._texels, [own], [self._filled], self._device)

    def _zeros(self, count: int, kind: Any) -> Any:
        return wp.zeros(count, dtype=kind, device=self._device)

    def _empty(self, count: int, kind: Any) -> Any:
        """Return an array for a kernel that writes all of it."""
        return wp.empty(count, dtype=kind, device=self._device)

    def _blocks(self, steps: int) -> Iterator[tuple[int, int]]:
        rows = max(1, self._block // (self._size * steps**2))
        for top in range(0, self._size, rows):
            yield top, min(top + rows, self._size)

    def _chosen(self, kernel: Any, count: int, inputs: list[Any], begin: int = 0) -> Any:
        """Return the numbers that a kernel marks, from ``begin`` on, in order."""
        marks, ends = (self._empty(count, wp.int32) for _ in range(2))
        launch(kernel, count, inputs, [marks], self._device)
        wp.utils.array_scan(marks, ends, inclusive=True)
        numbers = self._empty(int(ends[-1:].numpy()[0]) if count else 0, wp.int32)
        launch(list_marked, count, [marks, ends, begin], [numbers], self._device)
        return numbers

    def _bare(self, texels: Int64Array, own: Any) -> Int32Array:
        """Return which of some texels are neither own ones nor filled."""
        listed = array_on(self._device, texels, wp.int32)
        rows: Int32Array = self._chosen(mark_listed, len(texels), [listed, own, self._filled]).numpy()
        return rows

    def _write(self, texels: Any, values: Any, own: Any, mark: int, counts: Any = None) -> None:
        """Write values to texels, and mark them as own ones."""
        if counts is None:
            counts = self._empty(0, wp.int32)
        inputs = [texels, self._channels.levels(values), counts, mark, self._channels.count]
        launch(write_texels, len(texels), inputs, [self._image, own], self._device)

    def _color_centers(self, sheet: Sheet, own: Any, top: int, bottom: int) -> None:
        found, _ = sheet.faces_at(top, bottom, self._size, 1)
        begin = top * self._size
        texels = self._chosen(mark_free, len(found), [found, self._filled, begin], begin)
        if not len(texels):
            return
        values = sheet.colors(sheet.samples(texels, found, top, self._size, 1))
        self._write(texels, values, own, CHART)
        sums: Any = self._empty(-(-len(texels) // PART_ROWS) * self._channels.count, wp.float64)
        inputs = [values, self._channels.count, PART_ROWS]
        launch(sum_parts, len(sums) // self._channels.count, inputs, [sums], self._device)
        self._sum += sums.numpy().reshape(-1, self._channels.count).sum(axis=0)
        self._count += len(texels)

    def _means(self, values: Any, faces: Any, samples: int) -> tuple[Any, Any]:
        """Return the means of the samples of texels that have a face, and how many these are."""
        count = len(faces) // samples**2
        means = self._empty(count * self._channels.count, wp.float32)
        counts = self._empty(count, wp.int32)
        inputs = [values, faces, samples**2, self._channels.count]
        launch(mean_samples, count, inputs, [means, counts], self._device)
        return means, counts

    def _refine(self, sheet: Sheet, own: Any, uneven: Any, top: int, bottom: int, samples: int) -> None:
        """Take the mean of several samples at texels whose neighbours differ."""
        begin, count = top * self._size, (bottom - top) * self._size
        texels = self._chosen(mark_range, count, [uneven, begin], begin)
        if not len(texels):
            return
        found, _ = sheet.faces_at(top, bottom, self._size, samples, uneven)
        at = sheet.samples(texels, found, top, self._size, samples)
        means, counts = self._means(sheet.colors(at), at.faces, samples)
        self._write(texels, means, own, CHART, counts)

    def _color_beyond(self, sheet: Sheet, beyond: Beyond, own: Any, samples: int) -> None:
        """Colour the texels beyond seams."""
        chosen = self._bare(beyond.texels, own)
        if not len(chosen):
            return
        for rows in np.array_split(chosen, -(-len(chosen) * samples**2 // self._block)):
            bare = beyond.chosen(rows)
            at, tangents = sheet.samples_beyond(bare, self._size, samples)
            means, counts = self._means(sheet.colors(at, tangents), at.faces, samples)
            self._write(array_on(self._device, bare.texels, wp.int32), means, own, BEYOND, counts)

    def _color_borders(self, sheet: Sheet, faces: Int64Array, places: Float32Array, own: Any) -> None:
        """Colour the texels of charts that no sample lies in, by points of their borders."""
        columns, lines = np.clip(places.astype(np.int64), 0, self._size - 1).T
        texels = lines * self._size + columns
        bare = self._bare(texels, own)
        texels, first = np.unique(texels[bare], return_index=True)
        if len(texels):
            chosen = bare[first]
            values = sheet.colors(sheet.surface(faces[chosen], places[chosen]))
            self._write(array_on(self._device, texels, wp.int32), values, own, CHART)

    def _compensate(self, uneven: Any, own: Any) -> None:
        """Sharpen texels whose neighbours differ, as much as programs blur them."""
        light = array_on(self._device, decode_srgb(np.arange(256) / 255.0), wp.float32)
        srgb = array_on(self._device, np.asarray(self._channels.srgb), wp.uint8)
        sharper = wp.clone(self._image)
        inputs = [uneven, own, self._image, light, srgb, self._size, SHARPENING, MAX_OVERSHOOT]
        launch(compensate, self._texels, inputs, [sharper], self._device)
        self._image = sharper

    def finish(self, reach: int) -> None:
        """Give empty texels the colour of the nearest one within reach, and the others the mean colour."""
        columns: Any = wp.empty(self._texels, dtype=wp.int32, device=self._device)
        launch(nearest_in_rows, self._size, [self._filled, self._size, reach], [columns], self._device)
        mean = (self._sum / max(self._count, 1)).astype(np.float32)
        rest = self._channels.levels(array_on(self._device, mean, wp.float32))
        inputs = [self._filled, columns, self._size, reach, rest]
        launch(fill_gutters, self._texels, inputs, [self._image], self._device)
