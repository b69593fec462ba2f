"""Textures of base colours on the GPU, which all objects of a context share."""

from weakref import WeakKeyDictionary

import moderngl
import numpy as np
from PIL import Image

from blobtree._typing import UInt8Array
from decals.rendering.context import Context
from decals.surfaces.base_color import BaseTexture, Wrap

_SRGB8_ALPHA8 = 0x8C43
"""OpenGL's format of sRGB bytes, which look-ups decode before they filter."""


class SharedTexture:
    """A base texture on the GPU, until its last user releases it."""

    def __init__(self, context: Context, image: BaseTexture) -> None:
        self._users = 0
        texels = texels_within(image.pixels, context.max_texture_size)
        height, width = texels.shape[:2]
        self.texture = context.gl.texture((width, height), 4, texels.tobytes(), internal_format=_SRGB8_ALPHA8)
        self.texture.repeat_x, self.texture.repeat_y = (mode is Wrap.REPEAT for mode in image.wrap)
        self.mirrored = tuple(mode is Wrap.MIRROR for mode in image.wrap)
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        if max(width, height) > 1:
            self.texture.build_mipmaps()
            self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.texture.anisotropy = context.anisotropy

    def keep(self) -> "SharedTexture":
        """Count one more user."""
        self._users += 1
        return self

    def release(self) -> None:
        """Count one user less; release the memory after the last."""
        self._users -= 1
        if self._users == 0:
            self.texture.release()

    @property
    def released(self) -> bool:
        """True if no user is left."""
        return self._users == 0


_known: WeakKeyDictionary[Context, WeakKeyDictionary[BaseTexture, SharedTexture]] = WeakKeyDictionary()


def shared_texture(context: Context, image: BaseTexture) -> SharedTexture:
    """Return a base texture on the GPU for one more user, who releases it."""
    textures = _known.setdefault(context, WeakKeyDictionary())
    shared = textures.get(image)
    if shared is None or shared.released:
        shared = textures[image] = SharedTexture(context, image)
    return shared.keep()


WHITE_TEXTURE = BaseTexture(np.full((1, 1, 3), 255, np.uint8))
"""Texture of faces without one."""


def texels_within(pixels: UInt8Array, limit: int) -> UInt8Array:
    """Return an image as opaque texels, the lowest row first, with sides of a limit at most."""
    height, width = pixels.shape[:2]
    if max(height, width) > limit:
        scale = limit / max(height, width)
        width, height = max(1, int(width * scale)), max(1, int(height * scale))
        pixels = np.asarray(Image.fromarray(pixels).resize((width, height), Image.Resampling.BOX))
    return np.dstack([pixels[::-1], np.full((height, width), 255, np.uint8)])
