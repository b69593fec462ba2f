"""Textures and uniforms of a page, as ``viewer/graphics.mjs`` takes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.hosts.textures import SRGB, ShaderTexture
from decals.rendering.base_textures import texels_within
from decals.rendering.context import MAX_ANISOTROPY
from decals.rendering.data_texture import ROW_TEXELS, padded_rows, texel_rows
from decals.surfaces.base_color import BaseTexture, Wrap

Arrays = dict[str, NDArray[Any]]
"""Arrays of a page by their names."""

MAX_SIDE = 4096
"""Most texels of a side of a base texture: as many as data textures have, without which no page is shown."""

CLAMP = "CLAMP_TO_EDGE"
SMOOTH = "LINEAR_MIPMAP_LINEAR", "LINEAR"
WRAPS = {Wrap.REPEAT: "REPEAT", Wrap.CLAMP: CLAMP, Wrap.MIRROR: CLAMP}
"""WebGL's words; shaders mirror the coordinates themselves."""

DATA_FORMATS = {(np.dtype(np.float32), 2): "RGBA32F", (np.dtype(np.int32), 1): "R32I"}
"""Formats of data textures, by the type of their arrays and their dimensions."""


@dataclass(frozen=True, eq=False)
class PageTexture:
    """A texture of a page: what WebGL needs to make it, and its levels of texels."""

    description: Mapping[str, Any]
    levels: Sequence[NDArray[Any]]

    def arrays(self, name: str) -> Arrays:
        """Return the levels as arrays of a page."""
        return {f"{name} {number}": level for number, level in enumerate(self.levels)}

    def record(self) -> dict[str, Any]:
        """Return what the header says of the texture."""
        return {**self.description, "levels": len(self.levels)}


def data_texture(array: NDArray[Any]) -> PageTexture:
    """Return an array of numbers as a texture that shaders read by its texels."""
    rows = texel_rows(len(array))
    description = {"format": DATA_FORMATS[array.dtype, array.ndim], "size": (ROW_TEXELS, rows)}
    return PageTexture(description, [padded_rows(array, rows)])


def decal_texture(texture: ShaderTexture) -> PageTexture:
    """Return the images of decals, or their maps."""
    form = "SRGB8_ALPHA8" if texture.format == SRGB else texture.format.upper()
    description = {"kind": "2D_ARRAY", "format": form, "size": texture.size, "filter": SMOOTH}
    levels = [level.reshape(-1, 4) for level in texture.levels()]
    return PageTexture({**description, "anisotropy": MAX_ANISOTROPY}, levels)


def base_texture(image: BaseTexture) -> PageTexture:
    """Return a texture of a mesh, of which the browser makes the smaller levels as OpenGL does."""
    texels = texels_within(image.pixels, MAX_SIDE)
    height, width = texels.shape[:2]
    wrap = [WRAPS[mode] for mode in image.wrap]
    description = {"format": "SRGB8_ALPHA8", "size": (width, height), "filter": SMOOTH, "wrap": wrap}
    return PageTexture({**description, "mips": True, "anisotropy": MAX_ANISOTROPY}, [texels.reshape(-1, 4)])


def panorama_texture(texels: NDArray[np.float16], wrap: str) -> PageTexture:
    """Return light from all directions, ``float16[h, w, 3]``, that goes on at its sides as ``wrap`` says."""
    height, width = texels.shape[:2]
    filters = {"filter": ("LINEAR", "LINEAR"), "wrap": (wrap, CLAMP)}
    return PageTexture({"format": "RGB16F", "size": (width, height), **filters}, [texels.reshape(-1, 3)])


def uniform(value: Any) -> list[Any]:
    """Return the ending of WebGL's function for a uniform of a number or a vector, and its arguments."""
    numbers = list(value) if isinstance(value, tuple | list) else [value]
    kind = "f" if any(isinstance(number, float) for number in numbers) else "i"
    return [f"{len(numbers)}{kind}", *(float(x) if kind == "f" else int(x) for x in numbers)]


def matrix_uniform(matrix: NDArray[Any]) -> list[Any]:
    """Return the same for a square matrix."""
    return [f"Matrix{len(matrix)}fv", False, matrix.T.ravel().tolist()]
