"""Colours of polygons, which become those of their triangles; and texture files beside a model."""

from collections.abc import Callable
from pathlib import Path

from decals.errors import InvalidImage
from decals.images.load import picture_pixels
from decals.surfaces.base_color import BaseColor, BaseTexture, Wrap
from decals.surfaces.files.faults import Notes, Unreadable
from decals.surfaces.files.uris import read_uri
from decals.surfaces.triangulate import Triangulation

Paint = Callable[[Triangulation], BaseColor | None]
"""Returns the base colour of triangles of a file's polygons; None if the file has no colours."""

MAX_TEXELS = 1 << 27
"""Most pixels of all textures of a file."""


class TextureFiles:
    """Texture files in the folder of a model, each read when it is first used; a fault becomes a note."""

    def __init__(self, folder: Path, notes: Notes) -> None:
        self._folder = folder
        self._notes = notes
        self._textures: dict[tuple[str, Wrap], BaseTexture | None] = {}
        self._texels = 0

    def texture(self, file: str, wrap: Wrap = Wrap.REPEAT) -> BaseTexture | None:
        """Return a texture; None if its file cannot be read."""
        key = file, wrap
        if key not in self._textures:
            try:
                self._textures[key] = self._read(file, wrap)
            except (Unreadable, InvalidImage) as fault:
                self._notes.add("textures are left out", str(fault))
                self._textures[key] = None
        return self._textures[key]

    def _read(self, file: str, wrap: Wrap) -> BaseTexture:
        pixels = picture_pixels(read_uri(file, self._folder, "a texture"), file)
        self._texels += pixels.shape[0] * pixels.shape[1]
        if self._texels > MAX_TEXELS:
            raise Unreadable(f"its textures have more than {MAX_TEXELS:,} pixels with {file!r}")
        return BaseTexture(pixels, wrap)
