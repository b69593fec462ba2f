"""Maps and heights of materials on the GPU, beside the images of decals."""

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np

from blobtree._typing import Float32Array, Float64Array
from decals.images.texels import resized_texels, unit_levels
from decals.index.editor import DecalEditor
from decals.rendering.context import Context
from decals.rendering.lights import Lighting
from decals.rendering.options import ImageLike, SceneLike, relief_ranges, relief_texels
from decals.rendering.pixel_pass import Program, set_uniform


class MaterialArray:
    """Maps of the materials among images, two layers for each; those of other images are zero.

    Texels are multiplied by the alpha of the base colour, so that filtering ignores transparent ones. They
    are (x and y of the normal, roughness, metalness), and (emission in linear light, occlusion). One array
    for both keeps the decal pass within the 16 texture units that every driver has.
    """

    def __init__(self, context: Context, images: Sequence[ImageLike], shape: tuple[int, int]) -> None:
        self.texture = context.gl.texture_array((shape[1], shape[0], 2 * len(images)), 4, dtype="f2")
        layers = (texels for image in images for texels in _texels(image, shape))
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


STEPS_PER_RADIUS = 16
"""Steps of a ray over the radius of the smallest decal with relief."""

RELIEF_LOOKUPS = 64
"""Most points at which heights are looked up for a pixel, see ``shaders/relief.glsl``."""


SLOPE_CELLS = 24
"""Cells along each side of an image for which a slope is known."""

STRETCH = 2.0
"""Assumed greatest movement of images by contact and mapping, over that of the surface."""


def slope_bounds(texels: Float32Array) -> Float64Array:
    """Return the slopes of cones that contain all heights of an image.

    A cone stands on any point of a cell, at its height: no height of the image lies above it (cone step
    mapping, Dummer 2006). Heights and distances are in radii, so the image is two wide.

    Parameters
    ----------
    texels
        Heights, float32[h, w], which are interpolated.

    Returns
    -------
    float64[SLOPE_CELLS, SLOPE_CELLS]
        The first row belongs to the first of the texels.
    """
    count = SLOPE_CELLS
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

    highest = cells(texels.astype(np.float64), np.maximum).reshape(-1)
    lowest = cells(texels.astype(np.float64), np.minimum).reshape(-1)
    places = np.indices((count, count)).reshape(2, -1)
    apart = np.abs(places[:, :, None] - places[:, None, :])
    gaps = np.hypot(*np.maximum(apart - 1, 0) * (2.0 / count))
    slopes = np.where(gaps > 0.0, (highest - lowest[:, None]) / np.where(gaps > 0.0, gaps, 1.0), np.inf)
    between = [cells(steep, np.maximum)]  # steepest place up to so many cells away, so on the way there
    for _ in range(count - 1):
        wider = np.lib.stride_tricks.sliding_window_view(np.pad(between[-1], 1, mode="edge"), (3, 3))
        between.append(wider.max(axis=(2, 3)))
    limits = np.stack(between).reshape(count, -1)[apart.max(axis=0), np.arange(count**2)[:, None]]
    bounds: Float64Array = np.minimum(slopes, limits).max(axis=1).reshape(count, count)
    return bounds


class ReliefArray:
    """Heights of images on the GPU: layer i holds those of image i, and slopes that bound them."""

    def __init__(self, context: Context, images: Sequence[ImageLike], shape: tuple[int, int]) -> None:
        self.texture = context.gl.texture_array((shape[1], shape[0], len(images)), 2, dtype="f4")
        side = SLOPE_CELLS
        self.slopes = context.gl.texture_array((side, side, len(images)), 1, dtype="f4")
        self.steepest, self.ranges = 0.0, relief_ranges(images)
        known: dict[int, Float64Array] = {}
        for layer, image in enumerate(images):
            texels = np.zeros((*image.pixels.shape[:2], 2), np.float32)
            texels[..., 1] = unit_levels(image.pixels[..., 3])
            heights = relief_texels(image)
            bounds: Float64Array = np.zeros((side, side))
            if heights is not None:
                texels[..., 0] = heights
                if id(image) not in known:
                    known[id(image)] = slope_bounds(heights)
                bounds = known[id(image)]
            self.steepest = max(self.steepest, float(bounds.max()))
            self.slopes.write(
                bounds[::-1].astype(np.float32).tobytes(), viewport=(0, 0, layer, side, side, 1)
            )
            region = (0, 0, layer, shape[1], shape[0], 1)
            self.texture.write(resized_texels(texels, shape)[::-1].tobytes(), viewport=region)
        for texture, kind in ((self.texture, moderngl.LINEAR), (self.slopes, moderngl.NEAREST)):
            texture.repeat_x = texture.repeat_y = False
            texture.filter = (kind, kind)

    def release(self) -> None:
        """Release the memory."""
        self.texture.release()
        self.slopes.release()


class Relief:
    """The relief of a scene's decals, for the decal pass.

    Parameters
    ----------
    array
        Heights of the scene's images.
    scene
        A scene with relief.
    """

    def __init__(self, array: ReliefArray, scene: SceneLike) -> None:
        self.texture, self.slopes, self._steepest = array.texture, array.slopes, array.steepest
        rows = scene.decals.decals if isinstance(scene.decals, DecalEditor) else scene.decals
        heights_of = array.ranges[rows.images] * rows.radii[:, None]
        raised = heights_of.any(axis=1)
        self._range = (
            (float(heights_of[:, 0].min()), float(heights_of[:, 1].max())) if raised.any() else (0, 0)
        )
        self._step = float(rows.radii[raised].min()) / STEPS_PER_RADIUS if raised.any() else 1.0

    @property
    def reach(self) -> float:
        """Greatest distance, in model units, by which the surface moves in or out."""
        return max(self._range[1], -self._range[0])

    def use(self, program: Program, lights: Lighting | None) -> None:
        """Set the uniforms of a program but for the samplers."""
        set_uniform(program, "relief_steepest", self._steepest)
        set_uniform(program, "relief_stretch", STRETCH)
        set_uniform(program, "relief_range", self._range)
        set_uniform(program, "relief_step", self._step)
        set_uniform(program, "relief_light", _first_light(lights))


def _first_light(lights: Lighting | None) -> tuple[float, ...]:
    """Return the light that casts shadows, in the scene's coordinates; see ``shaders/relief.glsl``."""
    if lights is None or not lights.lights:
        return (0.0, 0.0, 0.0, 0.0)
    first, inverse = lights.lights[0], np.linalg.inv(lights.matrix)
    if first.position is None:
        return (*(-inverse[:3, :3] @ first.direction).tolist(), 1.0)
    return (*(inverse[:3, :3] @ first.position + inverse[:3, 3]).tolist(), 2.0)


def has_relief(scene: SceneLike) -> bool:
    """Return True if decals of a scene have relief that is drawn: posed objects are drawn without it."""
    posed = any(hasattr(item, "rest") for item in scene.objects)
    return has_materials(scene) and not posed and any(getattr(image, "relief", 0.0) for image in scene.images)


def has_materials(scene: SceneLike) -> bool:
    """Return True if a scene has decals, and an image with maps of its surface."""
    return len(scene.decals) > 0 and any(hasattr(image, "surface_texels") for image in scene.images)


def _texels(image: ImageLike, shape: tuple[int, int]) -> Iterator[Float32Array]:
    """Yield the two layers of an image, the upper row first."""
    if not hasattr(image, "surface_texels"):
        for _ in range(2):
            yield np.zeros((*shape, 4), np.float32)
        return
    alpha = unit_levels(image.pixels[..., 3:])
    for texels in image.surface_texels():
        yield resized_texels(texels * alpha, shape)
