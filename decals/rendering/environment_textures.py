"""Environments on the GPU: their textures, which the light pass reads."""

from functools import partial

import moderngl
import numpy as np

from decals.rendering.context import Context
from decals.rendering.effect import Effect
from decals.rendering.environment import Panorama
from decals.rendering.options import Drawing, SceneLike
from decals.rendering.prefiltering import picture_texels, prefiltered
from decals.rendering.warmup import IMAGES, WarmupTask


class EnvironmentTextures:
    """A panorama on the GPU: prefiltered, and, if it is visible, as it is."""

    def __init__(self, context: Context, panorama: Panorama, visible: bool) -> None:
        arrays = {"environment_levels": prefiltered(panorama)}
        if visible:
            arrays["environment_picture"] = picture_texels(panorama.light, context.max_texture_size)
        self.textures: dict[str, moderngl.Texture] = {}
        for name, texels in arrays.items():
            size = texels.shape[1], texels.shape[0]
            texture = context.gl.texture(size, 3, np.ascontiguousarray(texels), alignment=1, dtype="f2")
            texture.repeat_x, texture.repeat_y = name == "environment_picture", False
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self.textures[name] = texture

    def release(self) -> None:
        """Release the memory."""
        for texture in self.textures.values():
            texture.release()


class EnvironmentEffect(Effect):
    """The textures of the environment that lights a scene."""

    def of(self, scene: SceneLike, drawing: Drawing) -> EnvironmentTextures:
        """Return the textures."""
        assert drawing.environment is not None
        panorama, visible = drawing.environment.picture, drawing.environment.visible
        textures: EnvironmentTextures = self._cache.get(
            lambda: EnvironmentTextures(self._uploads.context, panorama, visible), panorama, visible
        )
        return textures

    def tasks(self, scene: SceneLike, drawing: Drawing) -> list[WarmupTask]:
        """Return the prefiltering, which needs no graphics, and the upload."""
        assert drawing.environment is not None
        filtering = partial(prefiltered, drawing.environment.picture)
        return [
            WarmupTask(IMAGES, filtering, threaded=True),
            WarmupTask(IMAGES, partial(self.of, scene, drawing)),
        ]
