"""`MeshData`: the arrays of a mesh as files and other libraries have them, with its base colour."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float32Array, Int32Array
from blobtree.identity import Value
from decals.images.texels import decode_srgb
from decals.surfaces.base_color import CLAY, NO_TEXTURE, BaseColor, BaseTexture


@dataclass(frozen=True, eq=False)
class MeshData(Value):
    """The arrays of a mesh on their way from a file or another library to an object.

    Attributes
    ----------
    vertices : float32[n, 3]
        Positions; float64 where float32 would round them.
    faces : int32[m, 3]
        Corner indices.
    color : BaseColor, optional
        The colours that the mesh has.
    """

    vertices: Float32Array
    faces: Int32Array
    color: BaseColor | None = None

    @property
    def arrays(self) -> tuple[Float32Array, Int32Array]:
        """Vertices and faces."""
        return self.vertices, self.faces


def joined(parts: Sequence[MeshData]) -> MeshData:
    """Return several meshes as one.

    Those without colours become clay if others have some. Those without texture coordinates get (0, 0) if
    others have some, with textures or without.
    """
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    vertices: Float32Array = np.concatenate([part.vertices for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)])
    return MeshData(vertices, faces.astype(np.int32), _joined_color(parts))


def _joined_color(parts: Sequence[MeshData]) -> BaseColor | None:
    """Return the base colours of several meshes as one; None if no mesh has any."""
    if len(parts) == 1 or all(part.color is None for part in parts):
        return parts[0].color
    bases = [_clay(len(part.vertices)) if part.color is None else part.color for part in parts]
    textures = tuple({id(texture): texture for base in bases for texture in base.textures}.values())
    starts = np.cumsum([0, *(len(base) for base in bases[:-1])])
    rows = [base.rows_of(part.faces) + start for part, base, start in zip(parts, bases, starts, strict=True)]
    numbers = [
        _texture_numbers(base, len(part.faces), textures) for part, base in zip(parts, bases, strict=True)
    ]
    return BaseColor(
        _joined_rows([base.colors for base in bases], 1.0, [(len(base), 3) for base in bases]),
        _joined_rows([base.coordinates for base in bases], 0.0, [(len(base), 2) for base in bases]),
        textures,
        np.concatenate(numbers) if textures else None,
        None if all(base.corners is None for base in bases) else np.concatenate(rows),
    )


def _clay(count: int) -> BaseColor:
    """Return the base colour of a mesh of some vertices without any."""
    return BaseColor(np.tile(decode_srgb(np.array(CLAY)), (count, 1)))


def _joined_rows(
    parts: Sequence[Float32Array | None], value: float, shapes: Sequence[tuple[int, int]]
) -> Float32Array | None:
    """Return rows of several parts, of which some have one value; None if no part has rows."""
    if all(part is None for part in parts):
        return None
    pairs = zip(parts, shapes, strict=True)
    return np.concatenate(
        [np.full(shape, value, np.float32) if rows is None else rows for rows, shape in pairs]
    )


def _texture_numbers(base: BaseColor, count: int, textures: Sequence[BaseTexture]) -> Int32Array:
    """Return the texture of each of some faces, by its place among all textures."""
    places = {id(texture): place for place, texture in enumerate(textures)}
    numbers = np.array([*(places[id(texture)] for texture in base.textures), NO_TEXTURE], np.int32)
    of_face = base.texture_of_face
    return np.full(count, numbers[0], np.int32) if of_face is None else numbers[of_face]
