"""Base colours of a PLY file: colours of vertices and faces, and textures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int64Array
from decals.surfaces.base_color import NO_TEXTURE, BaseColor, BaseTexture, linear_colors
from decals.surfaces.files.faults import Notes
from decals.surfaces.files.paint import TextureFiles
from decals.surfaces.triangulate import Polygons, Triangulation

_CHANNELS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_PLACES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))

Columns = Mapping[str, NDArray[Any]]
"""Numbers of an element's rows by property, in the types that the header names."""


class PlyColors:
    """The colours of the polygons of a PLY file.

    Parameters
    ----------
    path : Path
        The file.
    textures : list of str
        Files of the textures, by their numbers.
    vertices, faces : mapping
        Numbers of the vertices, and of the faces; none if there are strips.
    polygons : Polygons
        The faces.
    corners : tuple of arrays, optional
        Lengths and entries of the faces' lists of texture coordinates.
    """

    def __init__(
        self,
        path: Path,
        textures: list[str],
        vertices: Columns,
        faces: Columns,
        polygons: Polygons,
        corners: tuple[Int64Array, NDArray[Any]] | None,
    ) -> None:
        self._path = path
        self._files = textures
        self._vertices = vertices
        self._faces = faces
        self._polygons = polygons
        self._corners = corners

    def __call__(self, triangles: Triangulation) -> BaseColor | None:
        """Return the base colour of triangles; None if the file has none."""
        textures, of_polygon = self._textures()
        places = self._corner_places()
        colors, of_faces = _light(self._vertices, "vertices"), _light(self._faces, "faces")
        if of_faces is not None and colors is None and not textures:
            return BaseColor.of_faces(of_faces[triangles.polygons])
        if places is not None:
            by_corner = None if colors is None else colors[self._polygons.corners]
            of_face = None if of_polygon is None else of_polygon[triangles.polygons]
            return BaseColor(by_corner, places, textures, of_face, triangles.places)
        coordinates = _columns(self._vertices, _PLACES)
        if coordinates is not None or colors is not None:
            return BaseColor(colors, coordinates, textures[:1] if coordinates is not None else ())
        return None if of_faces is None else BaseColor.of_faces(of_faces[triangles.polygons])

    def _corner_places(self) -> NDArray[Any] | None:
        """Return texture coordinates of all corners; None if the faces have no such list of their length."""
        if self._corners is None or not (self._corners[0] == 2 * self._polygons.sizes).all():
            return None
        return self._corners[1].reshape(-1, 2)

    def _textures(self) -> tuple[list[BaseTexture], NDArray[np.int32] | None]:
        """Return the textures that can be read, and that of each polygon; None if all have the first."""
        notes = Notes()
        files = TextureFiles(self._path.parent, notes)
        found = [files.texture(file) for file in self._files]
        notes.report(self._path)
        textures = [texture for texture in found if texture is not None]
        numbers = self._faces.get("texnumber")
        if not textures or numbers is None:
            return textures, None
        index = {id(texture): place for place, texture in enumerate(textures)}
        places = np.array([*(index.get(id(texture), NO_TEXTURE) for texture in found), NO_TEXTURE], np.int32)
        known = (numbers >= 0) & (numbers < len(found))
        return textures, places[np.where(known, numbers, len(found)).astype(np.int64)]


def _light(columns: Columns, what: str) -> Float32Array | None:
    """Return the linear colours of an element; None if it has none."""
    names = next((three for three in _CHANNELS if set(three) <= columns.keys()), None)
    if names is None:
        return None
    return linear_colors(np.stack([columns[name] for name in names], axis=1), name=f"colours of {what}")


def _columns(columns: Columns, choices: tuple[tuple[str, str], ...]) -> NDArray[Any] | None:
    names = next((pair for pair in choices if set(pair) <= columns.keys()), None)
    return None if names is None else np.stack([columns[name] for name in names], axis=1)
