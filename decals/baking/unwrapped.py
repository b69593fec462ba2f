"""`Unwrapped`: a mesh on the textures of a bake."""

from dataclasses import dataclass

from blobtree._typing import Float32Array, Int32Array, Int64Array


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """A mesh on textures; a vertex on the border of charts has a copy for each chart.

    Attributes
    ----------
    rows : int64[k]
        Vertex of the mesh from which each vertex was copied.
    faces : int32[m, 3]
        Corner indices of the faces, in the order of the mesh.
    places : float32[k, 2]
        Positions on a texture in texels: x to the right, y down from the upper left corner.
    tile_of_face : int32[m]
        Number of the texture of each face.
    """

    rows: Int64Array
    faces: Int32Array
    places: Float32Array
    tile_of_face: Int32Array
