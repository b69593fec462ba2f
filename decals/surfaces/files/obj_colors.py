"""Base colours of an OBJ file: colours behind the coordinates of vertices, and its materials."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, Int64Array
from blobtree.files import is_file
from decals.images.texels import decode_srgb
from decals.surfaces.base_color import CLAY, WHITE, BaseColor, linear_colors
from decals.surfaces.files.content import Line, finite_numbers
from decals.surfaces.files.faults import Notes, Unreadable
from decals.surfaces.files.mtl import Material, read_materials
from decals.surfaces.files.paint import TextureFiles
from decals.surfaces.files.uris import read_uri
from decals.surfaces.triangulate import Triangulation


class ObjColors:
    """The colours of the polygons of an OBJ file.

    Parameters
    ----------
    path : Path
        The file.
    lines : dict
        Its lines by keyword.
    vertices, places : int64[k]
        Vertex and texture coordinate of each corner of each polygon; negative for none.
    """

    def __init__(
        self, path: Path, lines: dict[bytes, list[Line]], vertices: Int64Array, places: Int64Array
    ) -> None:
        self._path = path
        self._lines = lines
        self._vertices = vertices
        self._places = places

    def __call__(self, triangles: Triangulation) -> BaseColor | None:
        """Return the base colour of triangles; None if the file has none."""
        notes = Notes()
        materials, of_polygon = self._materials(notes)
        clay = decode_srgb(np.array(CLAY, np.float64))
        colors = self._vertex_colors(WHITE if materials else clay, notes)
        notes.report(self._path)
        coordinates, mapped = self._coordinates(), self._places >= 0
        if colors is None and coordinates is None and not materials:
            return None
        count = 0 if coordinates is None else len(coordinates)
        keys = self._vertices * (count + 1) + (0 if coordinates is None else np.maximum(self._places, -1) + 1)
        distinct, rows = np.unique(keys, return_inverse=True)
        if coordinates is not None:
            padded = np.concatenate([np.zeros((1, 2)), coordinates])
            coordinates = padded[distinct % (count + 1)]
        if colors is not None:
            colors = colors[distinct // (count + 1)]
        corners = rows.reshape(-1)[triangles.places].astype(np.int32)
        if not materials:
            return BaseColor(colors, coordinates, corners=corners)
        plain = Material(np.array(WHITE if colors is not None else clay, np.float64))
        known = [*materials, plain]
        # Faces without coordinates have the factor of their material alone.
        bare = [Material(material.factor) for material in known]
        of_face = of_polygon[triangles.polygons] % len(known)
        of_face = of_face + len(known) * ~mapped[triangles.places].all(axis=1)
        return BaseColor.of_materials(
            [material.factor for material in known + bare],
            [material.texture for material in known + bare],
            of_face.astype(np.int32),
            corners,
            coordinates=coordinates,
            colors=colors,
        )

    def _vertex_colors(self, others: ArrayLike, notes: Notes) -> Float32Array | None:
        """Return the colours of vertices, which follow their coordinates; None if no vertex has one.

        Vertices without a colour get another one.
        """
        words = [line.text.split() for line in self._lines[b"v"]]
        first = {6: 3, 7: _first_of_seven(words, notes), 8: 4}
        colored = np.array([len(of_line) in first for of_line in words], np.bool_)
        if longest := max((len(of_line) for of_line in words if len(of_line) > max(first)), default=0):
            notes.add("colours of vertices are left out", f"lines of {longest} numbers")
        if not colored.any():
            return None
        starts = ((of_line, first[len(of_line)]) for of_line in words if len(of_line) in first)
        given = (word for of_line, start in starts for word in of_line[start : start + 3])
        numbers = finite_numbers(given).reshape(-1, 3)
        colors = np.tile(np.asarray(others, np.float32), (len(words), 1))
        colors[colored] = linear_colors(numbers, name="colours of vertices")
        return colors

    def _coordinates(self) -> Float64Array | None:
        """Return the texture coordinates of the file; None if no corner has any."""
        lines = self._lines[b"vt"]
        if not lines or (self._places < 0).all():
            return None
        words = [[*line.text.split(), b"0", b"0"][:2] for line in lines]
        return finite_numbers(word for of_line in words for word in of_line).reshape(-1, 2)

    def _materials(self, notes: Notes) -> tuple[list[Material], Int64Array]:
        """Return the materials that polygons use, and the one of each polygon; -1 for none."""
        uses, faces = self._lines[b"usemtl"], self._lines[b"f"]
        known = self._library(notes) if uses else {}
        names = [_name(line, known.__contains__) for line in uses]
        for name in names:
            if name and name not in known and known:
                notes.add("materials are missing", repr(_text(name)))
        used = sorted({name for name in names if name in known})
        numbers = np.array([*(used.index(name) if name in known else -1 for name in names), -1], np.int64)
        before = np.searchsorted([line.number for line in uses], [line.number for line in faces]) - 1
        return [known[name] for name in used], numbers[before]

    def _library(self, notes: Notes) -> dict[bytes, Material]:
        """Return the materials of all material files that the file names."""
        found: dict[bytes, Material] = {}
        folder = self._path.parent
        textures = TextureFiles(folder, notes)
        for line in self._lines[b"mtllib"]:
            file = _name(line, lambda name: is_file(folder / _text(name)))
            names = [file] if is_file(folder / _text(file)) else file.split()
            for name in map(_text, names):
                try:
                    content = read_uri(name, folder, "a material file")
                    found |= read_materials(content, textures, notes, name)
                except (Unreadable, ValueError) as fault:
                    notes.add("materials are left out", str(fault))
        return found


def _first_of_seven(words: list[list[bytes]], notes: Notes) -> int:
    """Return the place of red where vertices have seven numbers.

    They are x y z w r g b if all w are 1 and blue varies, else x y z r g b and a seventh, as SpeedTree and
    TreeIt write.
    """
    fourths, sevenths = ({float(line[place]) for line in words if len(line) == 7} for place in (3, 6))
    if not fourths:
        return 3
    weighted = fourths == {1.0} and sevenths != {1.0}
    notes.add("vertices have 7 numbers", f"read as x y z {'w r g b' if weighted else 'r g b a'}")
    return 4 if weighted else 3


def _name(line: Line, exists: Callable[[bytes], bool]) -> bytes:
    """Return the name in a line; what follows a "#" is a part of it only if the whole name exists."""
    whole = line.text.strip()
    return whole if exists(whole) else whole.partition(b"#")[0].strip()


def _text(name: bytes) -> str:
    return name.decode("utf-8", "replace")
