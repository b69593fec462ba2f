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
PLAIN = "NEAREST", "NEAREST"
SMOOTH = "LINEAR_MIPMAP_LINEAR", "LINEAR"
WRAPS = {Wrap.REPEAT: "REPEAT", Wrap.CLAMP: CLAMP, Wrap.MIRROR: CLAMP}
"""WebGL's words; shaders mirror the coordinates themselves."""

FORMATS = {
    "RGBA32F": ("RGBA", "FLOAT"),
    "RGBA16F": ("RGBA", "HALF_FLOAT"),
    "RGB16F": ("RGB", "HALF_FLOAT"),
    "SRGB8_ALPHA8": ("RGBA", "UNSIGNED_BYTE"),
    "RGBA32I": ("RGBA_INTEGER", "INT"),
    "R32I": ("RED_INTEGER", "INT"),
}
"""WebGL's formats of textures, and what their texels are in memory."""

TARGETS = {
    "g_position": "RGBA32F",
    "g_normal": "RGBA32F",
    "g_color": "RGBA16F",
    "picked": "RGBA32F",
    "decal_records": "RGBA32F",
    "decal_limits": "RGBA32F",
    "decal_index_levels": "RGBA32F",
    "decal_index_table": "RGBA32I",
    "decal_index_ids": "R32I",
}
"""Formats of the textures that the viewer makes."""


@dataclass(frozen=True, eq=False)
class PageTexture:
    """A texture of a page: what WebGL needs to make it, and its levels of texels."""

    description: Mapping[str, Any]
    levels: Sequence[NDArray[Any]]

    def arrays(self, name: str) -> Arrays:
        """Return the levels as arrays of a page."""
        return {f"{name} {number}": level for number, level in enumerate(self.levels)}

    def record(self, name: str) -> dict[str, Any]:
        """Return what the header says of the texture."""
        return {**self.description, "levels": list(self.arrays(name))}


def described(
    form: str,
    *,
    target: str = "TEXTURE_2D",
    filters: tuple[str, str] = PLAIN,
    wraps: Sequence[str] = (CLAMP, CLAMP),
    **more: Any,
) -> dict[str, Any]:
    """Return the description of a texture in a format, with WebGL's words."""
    names = ("MIN_FILTER", "MAG_FILTER", "WRAP_S", "WRAP_T")
    options = {f"TEXTURE_{name}": word for name, word in zip(names, (*filters, *wraps), strict=True)}
    return {"target": target, "format": (form, *FORMATS[form]), "options": options, **more}


def targets() -> dict[str, Any]:
    """Return descriptions of the textures that the viewer makes."""
    return {name: described(form) for name, form in TARGETS.items()}


def data_texture(array: NDArray[Any]) -> PageTexture:
    """Return an array of numbers, ``float32[n, 4]`` or ``int32[n]``, as a texture."""
    rows = texel_rows(len(array))
    description = described("RGBA32F" if array.ndim == 2 else "R32I", size=(ROW_TEXELS, rows))
    return PageTexture(description, [padded_rows(array, rows)])


def decal_texture(texture: ShaderTexture) -> PageTexture:
    """Return the images of decals, or their maps."""
    form = "SRGB8_ALPHA8" if texture.format == SRGB else texture.format.upper()
    more: dict[str, Any] = {"size": texture.size, "anisotropy": MAX_ANISOTROPY}
    levels = [level.reshape(-1, 4) for level in texture.levels()]
    return PageTexture(described(form, target="TEXTURE_2D_ARRAY", filters=SMOOTH, **more), levels)


def base_texture(image: BaseTexture) -> PageTexture:
    """Return a texture of a mesh, of which the browser makes the smaller levels as OpenGL does."""
    texels = texels_within(image.pixels, MAX_SIDE)
    height, width = texels.shape[:2]
    wraps = [WRAPS[mode] for mode in image.wrap]
    more: dict[str, Any] = {"size": (width, height), "mips": True, "anisotropy": MAX_ANISOTROPY}
    return PageTexture(
        described("SRGB8_ALPHA8", filters=SMOOTH, wraps=wraps, **more), [texels.reshape(-1, 4)]
    )


def panorama_texture(texels: NDArray[np.float16], wrap: str) -> PageTexture:
    """Return light from all directions, ``float16[h, w, 3]``, that goes on at its sides as ``wrap`` says."""
    height, width = texels.shape[:2]
    description = described("RGB16F", filters=("LINEAR", "LINEAR"), wraps=(wrap, CLAMP), size=(width, height))
    return PageTexture(description, [texels.reshape(-1, 3)])


def uniform(value: Any) -> list[Any]:
    """Return the ending of WebGL's function for a uniform of a number or a vector, and its arguments."""
    numbers = list(value) if isinstance(value, tuple | list) else [value]
    kind = "f" if any(isinstance(number, float) for number in numbers) else "i"
    return [f"{len(numbers)}{kind}", *(float(x) if kind == "f" else int(x) for x in numbers)]


def matrix_uniform(matrix: NDArray[Any]) -> list[Any]:
    """Return the same for a square matrix."""
    return [f"Matrix{len(matrix)}fv", False, matrix.T.ravel().tolist()]
