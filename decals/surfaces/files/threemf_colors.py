"""Base colours of a 3MF file: base materials, colour groups and textures. A fault in them is a warning."""

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals.errors import InvalidImage, InvalidMesh
from decals.images.load import picture_pixels
from decals.images.texels import decode_srgb
from decals.surfaces.base_color import CLAY, NO_TEXTURE, WHITE, BaseColor, BaseTexture, Wrap, linear_colors
from decals.surfaces.files.faults import Notes, Unreadable
from decals.surfaces.files.threemf_model import NONE, Model, Palette, Picture
from decals.surfaces.files.threemf_package import Package

MAX_TEXELS = 1 << 27
"""Most pixels of all textures of a file."""

_TILES = {"wrap": Wrap.REPEAT, "mirror": Wrap.MIRROR, "clamp": Wrap.CLAMP, "none": Wrap.CLAMP}


class Colors:
    """Decodes the palettes of a file's models, and its textures once each."""

    def __init__(self, package: Package, notes: Notes) -> None:
        self._package = package
        self._notes = notes
        self._textures: dict[Picture, BaseTexture | None] = {}
        self._texels = 0

    def of(self, model: Model, properties: Int64Array, place: str) -> BaseColor | None:
        """Return the base colour of triangles, ``[m, 4]``, that name a palette and an index at each corner.

        The first row is clay: it is that of corners whose colour is missing.
        """
        rows, coordinates = [decode_srgb(np.array([CLAY]))], [np.zeros((1, 2))]
        corners = np.zeros((len(properties), 3), np.int64)
        of_face = np.full(len(properties), NO_TEXTURE)
        textures: list[BaseTexture] = []
        for number in np.unique(properties[:, 0]).tolist():
            palette = self._palette(model, number, place)
            if palette is None:
                continue
            faces, colors = properties[:, 0] == number, self._light(palette, f"palette {number}")
            start, indices = sum(map(len, rows)), properties[faces, 1:]
            inside = (indices >= 0) & (indices < len(colors))
            if not inside.all():
                self._notes.add("colours that palettes do not have are left out", place)
            corners[faces] = np.where(inside, indices + start, 0)
            rows.append(colors)
            coordinates.append(_coordinates(palette, len(colors)))
            texture = self._texture(model, palette)
            if texture is not None:
                of_face[faces] = np.where(inside.all(axis=1), len(textures), NO_TEXTURE)
                textures.append(texture)
        if len(rows) == 1:
            return None
        places = np.concatenate(coordinates) if textures else None
        try:
            return BaseColor(np.concatenate(rows), places, textures, of_face if textures else None, corners)
        except InvalidMesh as fault:
            self._notes.add("colours are left out", f"{place} ({fault})")
            return None

    def _palette(self, model: Model, number: int, place: str) -> Palette | None:
        """Return a palette that is read; None for triangles without one."""
        palette = model.palettes.get(number)
        if palette is not None and (palette.colors or palette.texture is not None):
            return palette
        if number != NONE:
            self._notes.add("colours of other kinds are left out", f"palette {number} of {place}")
        return None

    def _light(self, palette: Palette, name: str) -> Float32Array:
        """Return the linear colours of a palette."""
        if palette.texture is not None:
            return np.tile(np.array(WHITE, np.float32), (len(palette.coordinates) // 2, 1))
        return linear_colors(np.array([self._bytes(text, name) for text in palette.colors], np.uint8))

    def _bytes(self, text: str, name: str) -> list[int]:
        """Return red, green and blue of a colour such as #FF8000 or #FF8000FF, whose alpha is ignored."""
        try:
            found = bytes.fromhex(text.removeprefix("#"))
        except ValueError:
            found = b""
        if len(found) not in (3, 4):
            self._notes.add("colours that are no colours become white", f"{name} ({text[:20]!r})")
            return [255, 255, 255]
        return list(found[:3])

    def _texture(self, model: Model, palette: Palette) -> BaseTexture | None:
        """Return the texture of a palette; None if it has none or a damaged one."""
        if palette.texture is None:
            return None
        picture = model.pictures.get(palette.texture)
        if picture is None:
            self._notes.add("textures are left out", f"texture {palette.texture} is missing")
            return None
        if picture not in self._textures:
            try:
                self._textures[picture] = self._read(picture)
            except (Unreadable, InvalidImage) as fault:
                self._notes.add("textures are left out", str(fault))
                self._textures[picture] = None
        return self._textures[picture]

    def _read(self, picture: Picture) -> BaseTexture:
        pixels = picture_pixels(b"".join(self._package.chunks(picture.part)), picture.part)
        self._texels += pixels.shape[0] * pixels.shape[1]
        if self._texels > MAX_TEXELS:
            raise Unreadable(f"its textures have more than {MAX_TEXELS:,} pixels with {picture.part!r}")
        first, second = (_TILES.get(tile, Wrap.REPEAT) for tile in picture.tiles)
        return BaseTexture(pixels, (first, second))


def _coordinates(palette: Palette, count: int) -> Float64Array:
    """Return the places in the texture of a palette's entries; zeros without a texture."""
    if palette.texture is None:
        return np.zeros((count, 2))
    return np.array(palette.coordinates).reshape(-1, 2)
