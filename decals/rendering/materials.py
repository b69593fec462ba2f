"""Maps and heights of materials on the GPU, beside the images of decals."""

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np

from blobtree._typing import Float32Array, Float64Array
from decals.images.load import HasPixels
from decals.images.texels import resized_texels, unit_levels
from decals.index.editor import DecalEditor
from decals.rendering.context import Context
from decals.rendering.decal_data import DecalData
from decals.rendering.effect import Effect, SceneUploads
from decals.rendering.lights import Lighting
from decals.rendering.options import Drawing, SceneLike, relief_ranges, relief_texels
from decals.rendering.pixel_pass import Program, set_uniform
from decals.shaders import constants


class MaterialArray:
    """Maps of the materials among images, two layers for each; those of other images are zero.

    Texels are multiplied by the alpha of the base colour, so that filtering ignores transparent ones. They
    are (x and y of the normal, roughness, metalness), and (emission in linear light, occlusion). One array
    for both keeps the decal pass within the 16 texture units that every driver has.
    """

    def __init__(self, context: Context, images: Sequence[HasPixels], shape: tuple[int, int]) -> None:
        self.texture = context.gl.texture_array((shape[1], shape[0], 2 * len(images)), 4, dtype="f2")
        layers = (texels for image in images for texels in map_texels(image, shape))
        for layer, texels in enumerate(layers):
            region = (0, 0, layer, shape[1], shape[0], 1)
            self.texture.write(texels[::-1].astype(np.float16).tobytes(), viewport=region)
        self.texture.repeat_x = self.texture.repeat_y = False
        self.texture.build_mipmaps()
        self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.texture.anisotropy = context.anisotropy

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()


STEPS_PER_RADIUS = constants("offset_foot.glsl")["STEPS_PER_RADIUS"]
"""Steps of a ray over the radius of the smallest decal with relief."""

SLOPE_CELLS = 24
"""Most cells along each side of an image for which slopes are known."""

CONE_LENGTHS = (1 / 12, 1 / 6, 1 / 2, 2.0)
"""Distances over an image, in radii, up to which cones contain its heights."""

RIM_DEPTHS = 48
"""Rings of equal width from the rim of an image to its centre, of which the highest points are known."""

RIM_KNOTS = int(constants("relief.glsl")["RIM_KNOTS"])
"""Distances from the rim for which slopes to neighbours are known."""

STRETCH = 2.0
"""Assumed greatest movement of images by contact and mapping, over that of the surface."""


def slope_bounds(texels: Float32Array, count: int) -> Float64Array:
    """Return the slopes of cones that contain heights of an image.

    A cone stands on any point of a cell, at its height: no height of the image up to a distance of
    `CONE_LENGTHS` lies above it (cone step mapping, Dummer 2006). Heights and distances are in radii, so the
    image is two wide.

    Parameters
    ----------
    texels
        Heights, float32[h, w], which are interpolated.
    count
        Number of cells along each side.

    Returns
    -------
    float64[count, count, 4]
        For each cell the slopes up to each distance. The first row belongs to the first of the texels.
    """
    padded = np.pad(texels.astype(np.float64), 1, mode="edge")
    down, right = (np.abs(np.diff(padded, axis=axis)) * texels.shape[axis] / 2.0 for axis in (0, 1))
    steep = np.hypot(
        np.maximum(down[:-1, 1:-1], down[1:, 1:-1]), np.maximum(right[1:-1, :-1], right[1:-1, 1:])
    )

    def cells(values: Float64Array, reduce: "np.ufunc") -> Float64Array:
        """Reduce the texels that interpolation in each cell reads."""
        for axis in (0, 1):
            side = values.shape[axis]
            edges = np.arange(count + 1) * side / count
            first = np.clip(np.floor(edges[:-1] - 0.5), 0, side - 1).astype(int)
            last = np.clip(np.ceil(edges[1:] - 0.5), 0, side - 1).astype(int)
            values = np.stack(
                [
                    reduce.reduce(values.take(range(a, b + 1), axis), axis=axis)
                    for a, b in zip(first, last, strict=True)
                ],
                axis=axis,
            )
        return values

    cell = 2.0 / count
    reach = min(int(CONE_LENGTHS[-1] / cell) + 1, count - 1)  # cells farther apart are out of all cones
    highest = np.pad(cells(texels.astype(np.float64), np.maximum), reach, constant_values=-np.inf)
    lowest = cells(texels.astype(np.float64), np.minimum)
    between = [cells(steep, np.maximum)]  # steepest place up to so many cells away, so on the way there
    for _ in range(reach):
        wider = np.lib.stride_tricks.sliding_window_view(np.pad(between[-1], 1, mode="edge"), (3, 3))
        between.append(wider.max(axis=(2, 3)))
    bounds = np.zeros((count, count, len(CONE_LENGTHS)))
    for shift in np.ndindex(2 * reach + 1, 2 * reach + 1):
        apart = np.abs(np.array(shift) - reach)
        gap = float(np.hypot(*np.maximum(apart - 1, 0))) * cell
        limit = between[int(apart.max())]
        other = highest[shift[0] : shift[0] + count, shift[1] : shift[1] + count]
        slope = np.minimum((other - lowest) / gap, limit) if gap else np.where(np.isinf(other), 0.0, limit)
        within = np.array(CONE_LENGTHS) > gap
        bounds[..., within] = np.maximum(bounds[..., within], slope[..., None])
    return bounds


def rim_heights(texels: Float32Array) -> Float64Array:
    """Return the greatest height in each of `RIM_DEPTHS` rings of an image, from the rim to the centre."""
    y, x = (np.arange(count) + 0.5 for count in texels.shape)
    rows, columns = texels.shape
    inner = 1.0 - np.hypot(2.0 * x / columns - 1.0, (2.0 * y / rows - 1.0)[:, None])
    margin = float(np.hypot(2.0 / rows, 2.0 / columns))  # a texel reaches so far by interpolation
    first = np.clip(np.floor((inner - margin) * RIM_DEPTHS), 0, RIM_DEPTHS - 1).astype(int)
    heights = np.zeros(RIM_DEPTHS)
    np.maximum.at(heights, first.ravel(), texels.ravel().astype(np.float64))  # 16 times faster in one type
    return heights


class ReliefArray:
    """Heights of images on the GPU: layer i holds those of image i. Further layers hold slopes of cones.

    The four slopes of a cell are two texels, the cells of an image follow each other row by row, and so do
    images. One array for both keeps the decal pass within the 16 texture units that every driver has.
    """

    def __init__(self, context: Context, images: Sequence[HasPixels], shape: tuple[int, int]) -> None:
        self.count = len(images)
        self.cells = min(max(min(shape) // 2, 1), SLOPE_CELLS)
        self.steepest, self.ranges = 0.0, relief_ranges(images)
        self.rim_heights = np.zeros(RIM_DEPTHS)
        slopes = np.zeros((self.count, self.cells, self.cells, len(CONE_LENGTHS)), np.float32)
        shape = shape[0], max(shape[1], 2)
        columns = shape[1] // 2  # pairs of texels
        slope_layers = -(-self.count * self.cells**2 // (columns * shape[0]))
        layers = self.count + slope_layers
        self.texture = context.gl.texture_array((shape[1], shape[0], layers), 2, dtype="f4")
        known: dict[int, Float64Array] = {}
        for layer, image in enumerate(images):
            texels = np.zeros((*image.pixels.shape[:2], 2), np.float32)
            texels[..., 1] = unit_levels(image.pixels[..., 3])
            heights = relief_texels(image)
            if heights is not None:
                texels[..., 0] = heights
                if id(image) not in known:
                    known[id(image)] = slope_bounds(heights, self.cells)
                    self.rim_heights = np.maximum(self.rim_heights, rim_heights(heights))
                slopes[layer] = known[id(image)][::-1]
            self._write(layer, resized_texels(texels, shape)[::-1])
        self.steepest = float(slopes.max(initial=0.0))
        packed = np.zeros((slope_layers * shape[0] * columns, len(CONE_LENGTHS)), np.float32)
        packed[: self.count * self.cells**2] = slopes.reshape(-1, len(CONE_LENGTHS))
        for layer, texels in enumerate(packed.reshape(slope_layers, shape[0], 2 * columns, 2), self.count):
            self._write(layer, texels)
        self.texture.repeat_x = self.texture.repeat_y = False
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)

    def _write(self, layer: int, texels: Float32Array) -> None:
        height, width = texels.shape[:2]
        self.texture.write(texels.tobytes(), viewport=(0, 0, layer, width, height, 1))

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()


def rim_slopes(heights: Float64Array, steepest: float, sizes: float) -> Float64Array:
    """Return the slopes of cones that contain the heights of neighbours of a decal.

    They stand on its own image at height 0, at `RIM_KNOTS` distances from the rim and one after them. Beyond
    the rim lies the rim of a neighbour.

    Parameters
    ----------
    heights
        Greatest heights of all images, see `rim_heights`.
    steepest
        Greatest slope of all images.
    sizes
        Greatest radius of a decal over the least one.

    Returns
    -------
    float64[RIM_KNOTS + 1, 4]
        Slopes up to each of `CONE_LENGTHS`; the unit of lengths is the least radius.
    """
    rims = CONE_LENGTHS[-1] * np.linspace(0.0, 1.0, RIM_KNOTS + 1)[:, None, None] ** 2
    depths = np.maximum(np.arange(RIM_DEPTHS) / RIM_DEPTHS, heights / max(steepest, 1e-30))
    ways = np.array(CONE_LENGTHS)[:, None] - rims
    largest = np.minimum(ways / np.maximum(depths, 1e-30), sizes)  # decal of which a ring is in the cone
    rises = np.where(largest >= 1.0, largest * heights, 0.0)
    slopes: Float64Array = (rises / np.maximum(rims + largest * depths, 1e-30)).max(axis=2)
    return slopes


class Relief:
    """The relief of a scene's decals, for the decal pass.

    Parameters
    ----------
    array
        Heights of the scene's images.
    scene
        A scene with relief.
    stepped
        True if decals may begin within the images of others, and not at their rims.
    """

    def __init__(self, array: ReliefArray, scene: SceneLike, *, stepped: bool) -> None:
        self.texture, self._array = array.texture, array
        rows = scene.decals.decals if isinstance(scene.decals, DecalEditor) else scene.decals
        heights_of = array.ranges[rows.images] * rows.radii[:, None]
        raised = heights_of.any(axis=1)
        self._range, self._radius, sizes = (0.0, 0.0), 1.0, 1.0
        if raised.any():
            self._range = float(heights_of[:, 0].min()), float(heights_of[:, 1].max())
            self._radius = float(rows.radii[raised].min())
            sizes = float(rows.radii[raised].max()) / self._radius
        rising = array.steepest * np.arange(1, RIM_DEPTHS + 1) / RIM_DEPTHS
        heights = np.minimum(rising, array.ranges[:, 1].max()) if stepped else array.rim_heights
        self._rim_slopes = rim_slopes(heights, array.steepest, sizes)

    @property
    def reach(self) -> float:
        """Greatest distance, in model units, by which the surface moves in or out."""
        return max(self._range[1], -self._range[0])

    def use(self, program: Program, lights: Lighting | None) -> None:
        """Set the uniforms of a program but for the samplers."""
        lengths = self._radius / STRETCH * np.array(CONE_LENGTHS)
        set_uniform(program, "relief_images", self._array.count)
        set_uniform(program, "relief_cells", self._array.cells)
        set_uniform(program, "relief_stretch", STRETCH)
        set_uniform(program, "cone_lengths", tuple(lengths.tolist()))
        set_uniform(program, "rim_slopes", [tuple(row) for row in self._rim_slopes.tolist()])
        set_uniform(program, "relief_range", self._range)
        set_uniform(program, "relief_step", self._radius / STEPS_PER_RADIUS)
        set_uniform(program, "relief_light", _first_light(lights))


def _first_light(lights: Lighting | None) -> tuple[float, ...]:
    """Return the light that casts shadows, in the scene's coordinates; see ``shaders/relief.glsl``."""
    if lights is None or not lights.lights:
        return (0.0, 0.0, 0.0, 0.0)
    first, inverse = lights.lights[0], np.linalg.inv(lights.matrix)
    if first.position is None:
        return (*(-inverse[:3, :3] @ first.direction).tolist(), 1.0)
    return (*(inverse[:3, :3] @ first.position + inverse[:3, 3]).tolist(), 2.0)


def map_texels(image: HasPixels, shape: tuple[int, int]) -> Iterator[Float32Array]:
    """Yield the two layers of an image, the upper row first."""
    if not hasattr(image, "surface_texels"):
        for _ in range(2):
            yield np.zeros((*shape, 4), np.float32)
        return
    alpha = unit_levels(image.pixels[..., 3:])
    for texels in image.surface_texels():
        yield resized_texels(texels * alpha, shape)


class MaterialEffect(Effect):
    """The maps of a scene's images."""

    def of(self, scene: SceneLike, drawing: Drawing) -> MaterialArray:
        """Return the maps."""
        images = self._uploads.images(scene)
        assert images is not None
        shape = images.height, images.width
        maps: MaterialArray = self._cache.get(
            lambda: MaterialArray(self._uploads.context, scene.images, shape), images, *scene.images
        )
        return maps


class HeightEffect(Effect):
    """The relief of a scene's decals."""

    def __init__(self, uploads: SceneUploads) -> None:
        super().__init__(uploads)
        self._relief: tuple[ReliefArray, DecalData, int, Relief] | None = None

    def of(self, scene: SceneLike, drawing: Drawing) -> Relief:
        """Return the relief."""
        images = self._uploads.images(scene)
        assert images is not None
        heights, widths = zip(*(image.pixels.shape[:2] for image in scene.images), strict=True)
        shape = min(max(heights), images.height), min(max(widths), images.width)  # no texel is averaged
        array = self._cache.get(
            lambda: ReliefArray(self._uploads.context, scene.images, shape), images, *scene.images
        )
        decals = self._uploads.decals(scene)
        assert decals is not None
        kept, stepped = self._relief, decals.layered or decals.nested or decals.limited
        if kept is None or kept[:2] != (array, decals) or kept[2] != decals.version:
            self._relief = kept = array, decals, decals.version, Relief(array, scene, stepped=stepped)
        return kept[3]
