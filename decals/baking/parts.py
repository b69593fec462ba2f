"""`Baked`: what a file of a scene holds, whatever its format."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Float64Array, Int32Array, UInt8Array
from blobtree.lazy import Lazy
from decals.baking.instances import Instances
from decals.baking.materials import Maps
from decals.images.texels import encode_srgb
from decals.scenes.origin import WORLD, Origin
from decals.scenes.recipe import Recipe
from decals.surfaces.mesh_check import MeshCheck, check_mesh

METRES = {
    "micron": 1e-6,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "inch": 0.0254,
    "foot": 0.3048,
    "meter": 1.0,
}
"""Units of length and their metres, named as 3MF names them."""

UP = ("y", "z")
"""Axes that may point upward."""


TILE_ROW = 10
"""Tiles of a row."""


def udim(tile: int) -> int:
    """Return the name of a tile: 1001 for the first."""
    return 1001 + tile


@dataclass(frozen=True, eq=False)
class Part:
    """A named mesh of a file.

    Attributes
    ----------
    name : str
        Name of the object, unique in its file.
    vertices, normals : float32[n, 3]
    faces : int32[m, 3]
    uv : float32[n, 2], optional
        Texture coordinates, v upward; those of tile t are (t % 10, t // 10) more, as UDIM has it.
    tile_of_face : int32[m], optional
        Number of the tile of each face, if there are several.
    colors : float64[n, 3], optional
        Linear colours.
    tangents : float32[n, 4], optional
        Tangents along u, and the signs of the bitangents.
    attributes : mapping of str to array
        Further values of the vertices, ``[n]`` or ``[n, k]``.
    """

    name: str
    vertices: Float32Array
    faces: Int32Array
    normals: Float32Array
    uv: Float32Array | None = None
    colors: Float64Array | None = None
    tangents: Float32Array | None = None
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    tile_of_face: Int32Array | None = None

    def on_tiles(self) -> Iterator[tuple[int, "Part"]]:
        """Yield each tile and its part, with texture coordinates within [0, 1]."""
        if self.tile_of_face is None:
            yield 0, self
            return
        for tile in np.unique(self.tile_of_face).tolist():
            rows, faces = np.unique(self.faces[self.tile_of_face == tile], return_inverse=True)
            columns: dict[str, Any] = {
                name: None if (values := getattr(self, name)) is None else values[rows]
                for name in ("vertices", "normals", "uv", "colors", "tangents")
            }
            columns["uv"] = columns["uv"] - np.array([tile % TILE_ROW, tile // TILE_ROW], np.float32)
            attributes = {name: values[rows] for name, values in self.attributes.items()}
            corners = faces.reshape(-1, 3).astype(np.int32)
            name = f"{self.name}.{udim(tile)}"
            yield tile, Part(name, faces=corners, attributes=attributes, **columns)

    @Lazy
    def check(self) -> MeshCheck:
        """Return whether the mesh is closed and sound."""
        return check_mesh(self.vertices, self.faces, self.name)

    @property
    def color_bytes(self) -> UInt8Array | None:
        """Colours as sRGB bytes, ``uint8[n, 3]``; rounded from float32, as those of pictures."""
        if self.colors is None:
            return None
        levels: UInt8Array = np.rint(encode_srgb(self.colors).astype(np.float32) * 255.0).astype(np.uint8)
        return levels


@dataclass(frozen=True, eq=False)
class Baked:
    """What a file holds: parts that share one material, and where they are.

    Attributes
    ----------
    parts : sequence of Part
        All with ``uv`` if there are textures, all with ``colors`` or all without.
    tiles : sequence of Maps
        Textures of each tile, first row at the top; none without textures.
    origin : (x, y, z)
        Point that all vertices are relative to, in float64.
    unit : str, optional
        Unit of lengths, a name of `METRES`.
    up : str, optional
        The axis that points upward, "y" or "z".
    recipe : Recipe, optional
        How the decals were made.
    made : mapping of str
        How the file is made, in formats that keep it.
    instances : sequence of Instances
        Decals that are copies of a square.
    """

    parts: Sequence[Part]
    tiles: Sequence[Maps] = ()
    origin: Origin = WORLD
    unit: str | None = None
    up: str | None = None
    recipe: Recipe | None = None
    made: Mapping[str, Any] = field(default_factory=dict)
    instances: Sequence[Instances] = ()

    @property
    def maps(self) -> Maps | None:
        """Textures of the first tile, which is the only one in most formats."""
        return self.tiles[0] if self.tiles else None

    def placement(self, up: str, *, metres: bool) -> Float64Array:
        """Return the map of vertices to the coordinates of a format, ``float64[4, 4]``.

        Parameters
        ----------
        up
            Axis that points upward in the format.
        metres
            True if the format's lengths are metres.
        """
        matrix = np.eye(4)
        if self.up is not None and self.up != up:
            quarter = 1.0 if up == "z" else -1.0
            matrix[1:3, 1:3] = [[0.0, -quarter], [quarter, 0.0]]
        if metres and self.unit is not None:
            matrix[:3, :3] *= METRES[self.unit]
        matrix[:3, 3] = matrix[:3, :3] @ self.origin
        return matrix

    def merged(self) -> Part:
        """Return all parts as one, with vertices in the coordinates of the models.

        The vertices are float64 if the parts have an origin of their own.
        """
        starts = np.cumsum([0, *(len(part.vertices) for part in self.parts[:-1])])
        faces = [part.faces + start for part, start in zip(self.parts, starts, strict=True)]
        vertices: Any = np.concatenate([part.vertices for part in self.parts])
        if self.origin != WORLD:
            vertices = vertices.astype(np.float64) + self.origin
        columns: dict[str, Any] = {}
        for name in ("normals", "uv", "colors"):
            values = [getattr(part, name) for part in self.parts]
            columns[name] = None if values[0] is None else np.concatenate(values)
        attributes = {
            name: np.concatenate([part.attributes[name] for part in self.parts])
            for name in self.parts[0].attributes
        }
        corners = np.concatenate(faces).astype(np.int32)
        return Part("scene", vertices, corners, **columns, attributes=attributes)
