"""Base colours of a PLY file: colours of vertices and faces, and textures."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array
from decals.images.texels import decode_srgb
from decals.surfaces.base_color import CLAY, NO_TEXTURE, BaseColor, BaseTexture, linear_colors
from decals.surfaces.files.faults import Notes
from decals.surfaces.files.paint import TextureFiles
from decals.surfaces.triangulate import Polygons, Triangulation

_CHANNELS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_PLACES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))

Columns = Mapping[str, NDArray[Any]]
"""Numbers of an element's rows by property, in the types that the header names."""


@dataclass(frozen=True)
class PlyFaces:
    """Polygons of one element of a PLY file.

    Attributes
    ----------
    polygons
        The polygons.
    columns
        Numbers of each, by property.
    places
        Texture coordinates of all corners; None without any.
    """

    polygons: Polygons
    columns: Columns
    places: NDArray[Any] | None


class PlyColors:
    """The colours of the polygons of a PLY file.

    Parameters
    ----------
    path : Path
        The file.
    textures : list of str
        Files of the textures, by their numbers.
    vertices : mapping
        Numbers of the vertices.
    parts : list of PlyFaces
        The polygons, by element.
    """

    def __init__(self, path: Path, textures: list[str], vertices: Columns, parts: list[PlyFaces]) -> None:
        self._path = path
        self._files = textures
        self._vertices = vertices
        self._parts = parts

    def __call__(self, triangles: Triangulation) -> BaseColor | None:
        """Return the base colour of triangles; None if the file has none."""
        notes = Notes()
        color = self._color(triangles, notes)
        notes.report(self._path)
        return color

    def _color(self, triangles: Triangulation, notes: Notes) -> BaseColor | None:
        textures, of_polygon = self._textures(notes)
        places = self._corner_places()
        colors, of_faces = _light(self._vertices, "vertices"), self._face_light()
        coordinates = None if places is not None else _columns(self._vertices, _PLACES)
        textured = bool(textures) and (places is not None or coordinates is not None)
        if of_faces is not None and colors is None and not textured:
            return BaseColor.of_faces(of_faces[triangles.polygons])
        if of_faces is not None:
            others = "those of vertices" if colors is not None else "textures"
            notes.add("colours of faces are left out", f"{others} count")
        if places is not None:
            corners = np.concatenate([part.polygons.corners for part in self._parts])
            by_corner = None if colors is None else colors[corners]
            of_face = None if of_polygon is None else of_polygon[triangles.polygons]
            return BaseColor(by_corner, places, textures, of_face, triangles.places)
        if coordinates is not None or colors is not None:
            return BaseColor(colors, coordinates, textures[:1] if coordinates is not None else ())
        return None

    def _face_light(self) -> Float32Array | None:
        """Return the linear colours of polygons, clay for those without; None if no element has colours."""
        known = [_light(part.columns, "faces") for part in self._parts]
        if all(light is None for light in known):
            return None
        clay = decode_srgb(np.array(CLAY)).astype(np.float32)
        pairs = zip(known, self._parts, strict=True)
        return np.concatenate(
            [np.tile(clay, (len(part.polygons), 1)) if light is None else light for light, part in pairs]
        )

    def _corner_places(self) -> NDArray[Any] | None:
        """Return texture coordinates of all corners, zero for elements without; None if all are without."""
        if all(part.places is None for part in self._parts):
            return None
        return np.concatenate(
            [
                np.zeros((len(part.polygons.corners), 2)) if part.places is None else part.places
                for part in self._parts
            ]
        )

    def _textures(self, notes: Notes) -> tuple[list[BaseTexture], NDArray[np.int32] | None]:
        """Return the textures that can be read, and that of each polygon; None if all have the first."""
        files = TextureFiles(self._path.parent, notes)
        found = [files.texture(file) for file in self._files]
        textures = [texture for texture in found if texture is not None]
        placed = [part.places is not None for part in self._parts]
        numbered = any("texnumber" in part.columns for part in self._parts)
        if not textures or not (numbered or len(set(placed)) == 2):
            return textures, None
        index = {id(texture): place for place, texture in enumerate(textures)}
        places = np.array([*(index.get(id(texture), NO_TEXTURE) for texture in found), NO_TEXTURE], np.int32)
        numbers = np.concatenate([_texture_numbers(part, bare=any(placed)) for part in self._parts])
        known = (numbers >= 0) & (numbers < len(found))
        return textures, places[np.where(known, numbers, len(found)).astype(np.int64)]


def _texture_numbers(part: PlyFaces, *, bare: bool) -> NDArray[Any]:
    """Return the number of each polygon's texture: by default the first; -1 where it has no coordinates."""
    if bare and part.places is None:
        return np.full(len(part.polygons), NO_TEXTURE)
    return part.columns.get("texnumber", np.zeros(len(part.polygons), np.int64))


def _light(columns: Columns, what: str) -> Float32Array | None:
    """Return the linear colours of an element; None if it has none."""
    names = next((three for three in _CHANNELS if set(three) <= columns.keys()), None)
    if names is None:
        return None
    return linear_colors(np.stack([columns[name] for name in names], axis=1), name=f"colours of {what}")


def _columns(columns: Columns, choices: tuple[tuple[str, str], ...]) -> NDArray[Any] | None:
    names = next((pair for pair in choices if set(pair) <= columns.keys()), None)
    return None if names is None else np.stack([columns[name] for name in names], axis=1)
