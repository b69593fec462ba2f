"""Maps of materials on the GPU, beside the images of decals: layer i holds the maps of image i."""

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np
from PIL import Image

from blobtree._typing import Float32Array
from decals.rendering.context import Context
from decals.rendering.options import ImageLike, SceneLike


class MaterialArrays:
    """Maps of the materials among images; layers of other images are zero.

    Texels are multiplied by the alpha of the base colour, so that filtering ignores transparent ones. They
    are (x and y of the normal, roughness, metalness), and (emission in linear light, occlusion).

    Attributes
    ----------
    textures : dict
        The two arrays by the names of their samplers.
    """

    def __init__(self, context: Context, images: Sequence[ImageLike], shape: tuple[int, int]) -> None:
        self.textures = {
            name: context.gl.texture_array((shape[1], shape[0], len(images)), 4, dtype="f2")
            for name in ("decal_normals", "decal_emissions")
        }
        for layer, image in enumerate(images):
            for texture, texels in zip(self.textures.values(), _texels(image, shape), strict=True):
                region = (0, 0, layer, shape[1], shape[0], 1)
                texture.write(texels[::-1].astype(np.float16).tobytes(), viewport=region)
        for texture in self.textures.values():
            texture.repeat_x = texture.repeat_y = False
            texture.build_mipmaps()
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            texture.anisotropy = context.anisotropy

    def release(self) -> None:
        """Release the memory."""
        for texture in self.textures.values():
            texture.release()


def has_materials(scene: SceneLike) -> bool:
    """Return True if a scene has decals, and an image with maps of its surface."""
    return len(scene.decals) > 0 and any(hasattr(image, "surface_texels") for image in scene.images)


def _texels(image: ImageLike, shape: tuple[int, int]) -> Iterator[Float32Array]:
    """Yield the two layers of an image, the upper row first."""
    if not hasattr(image, "surface_texels"):
        for _ in range(2):
            yield np.zeros((*shape, 4), np.float32)
        return
    alpha = image.pixels[..., 3:] / np.float32(255)
    for texels in image.surface_texels():
        yield _resized(texels * alpha, shape)


def _resized(texels: Float32Array, shape: tuple[int, int]) -> Float32Array:
    """Return texels in another shape; the filter has no overshoot, so no value leaves its range."""
    if texels.shape[:2] == shape:
        return texels
    channels = [
        np.asarray(
            Image.fromarray(np.ascontiguousarray(channel)).resize(shape[::-1], Image.Resampling.BILINEAR)
        )
        for channel in np.moveaxis(texels, -1, 0)
    ]
    return np.stack(channels, axis=-1)
