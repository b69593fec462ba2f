"""Objects of a scene as meshes with normals and base colours, ready to be unwrapped and coloured."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from blobtree import Node
from blobtree._typing import Float32Array, Int32Array, Int64Array
from blobtree.lazy import Lazy
from blobtree.meshing.creases import split_creases
from blobtree.meshing.polygonize import polygonize
from blobtree.nodes.numeric_parameters import nodes_with_paths
from blobtree.nodes.primitives import Leaf
from blobtree.progress import Progress
from blobtree.validation import describe
from decals.baking.flat_faces import without_flat_faces
from decals.errors import InvalidMesh, InvalidScene
from decals.images.texels import decode_srgb
from decals.rendering.mesh import split_mesh
from decals.scenes.objects import MeshObject, TreeObject
from decals.scenes.pose import PosedMesh
from decals.surfaces.base_color import WHITE, BaseColor, Color
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.normals import SplitMesh, split_at_colors, split_at_creases, vertex_normals
from decals.surfaces.topology import edge_twins, welded
from decals.surfaces.windings import MeshOrientation

BaseColors = Color | Callable[[Float32Array], Float32Array]
"""One sRGB colour of a surface, or a function from its points to their colours."""


@dataclass(frozen=True, eq=False)
class BakeMesh:
    """A triangle mesh of which every vertex and every face is used, without degenerate faces.

    Attributes
    ----------
    name : str
        Name of the object.
    vertices : float32[n, 3]
        Positions in the scene's units.
    faces : int32[m, 3]
        Corner indices, counter-clockwise seen from outside.
    normals : float32[n, 3]
        Unit normals, those with which the renderer draws the object.
    base_colors : Color or callable
        The sRGB colour without decals, or a function from points ``float32[k, 3]`` to ``float32[k, 3]``.
    base : BaseColor, optional
        Base colour whose rows are the vertices, in place of that function.
    places, facings : float32[n, 3]
        Positions and normals at which the decals are evaluated: those of the rest pose.
    """

    name: str
    vertices: Float32Array
    faces: Int32Array
    normals: Float32Array
    base_colors: BaseColors
    places: Float32Array
    facings: Float32Array
    base: BaseColor | None = None

    @Lazy
    def welded(self) -> Int64Array:
        """Return for each vertex the first vertex at the same position, ``int64[n]``."""
        return welded(self.vertices)

    @Lazy
    def twins(self) -> Int64Array:
        """Return the side of the neighbour behind each side of a face, see `edge_twins`, ``int64[3 m]``."""
        return edge_twins(self.welded[self.faces]).astype(np.int64)

    @Lazy
    def vertex_light(self) -> Float32Array:
        """Return the linear base colour of each vertex, ``float32[n, 3]``."""
        if self.base is None:
            return np.broadcast_to(self.base_light(self.places), self.vertices.shape)
        return self.base.at_vertices(self.faces, len(self.vertices)).astype(np.float32)

    def base_light(self, points: Float32Array) -> Float32Array:
        """Return the linear colours without decals at points, ``float32[k, 3]``, or one row if all are equal.

        Those of a `base` depend on faces.
        """
        colors = self.base_colors(points) if callable(self.base_colors) else [self.base_colors]
        return decode_srgb(np.asarray(colors, np.float64)).astype(np.float32)


def bake_mesh(
    item: object, *, resolution: int | None, creases: bool, report: Progress, own: bool = False
) -> BakeMesh:
    """Return an object of a scene as a mesh; a tree is polygonized.

    A posed mesh keeps all its vertices and faces. With ``own``, the base has the mesh's coordinates too, and
    vertices are split where these jump.

    Raises
    ------
    InvalidScene
        If the object is neither a MeshObject, nor a TreeObject, nor a PosedMesh.
    InvalidMesh
        If a tree has no surface at this resolution.
    InvalidResolution
        If polygonization refuses the resolution.
    """
    if isinstance(item, MeshObject):
        placed = _placed(item) if own else None
        if placed is None:
            split = split_mesh(item)
        else:
            split = split_at_creases(item.vertices, item.faces, item.crease_angle)
            split = split_at_colors(split, placed)
        surface = MeshSurface(item.vertices[split.rows], split.faces, orientation=MeshOrientation.KEEP)
        return _used_parts(item.name, surface, split.normals, _plain(item.color), split.color)
    if isinstance(item, TreeObject):
        return _tree_mesh(item.name, item.tree, resolution, creases, report)
    if isinstance(item, PosedMesh):
        normals, facings = (vertex_normals(at, item.faces) for at in (item.vertices, item.rest.vertices))
        colors = _plain(item.rest.color) if item.colors is None else _nearest(item)
        split = SplitMesh(np.arange(len(item.vertices)), item.faces, normals)
        placed = _placed(item.rest) if own else None
        if placed is None and isinstance(item.color, BaseColor):
            placed = item.color
        if placed is not None:
            split = split_at_colors(split, placed)
        rows, places = split.rows, item.rest.vertices[split.rows]
        posed = item.vertices[rows]
        return BakeMesh(
            item.name, posed, split.faces, split.normals, colors, places, facings[rows], split.color
        )
    raise InvalidScene(f"expected an object of a scene, got {describe(item)}; wrap it in a MeshObject")


def _tree_mesh(name: str, tree: Node, resolution: int | None, creases: bool, report: Progress) -> BakeMesh:
    mesh = polygonize(tree, resolution=resolution, creases=creases, progress=report)
    if len(mesh.faces) == 0:
        raise InvalidMesh(
            f"object {name!r}: expected a tree with a surface, got none in cells of this size; "
            "increase the resolution"
        )
    mesh = replace(mesh, faces=without_flat_faces(mesh.vertices, mesh.faces))
    shown = split_creases(tree, mesh)
    return _used_parts(
        name,
        MeshSurface(shown.vertices, shown.faces, orientation=MeshOrientation.KEEP),
        shown.normals,
        _tree_colors(tree),
    )


def _used_parts(
    name: str,
    surface: MeshSurface,
    normals: Float32Array,
    base_colors: BaseColors,
    base: BaseColor | None = None,
) -> BakeMesh:
    """Return the faces with area, and the vertices that they use."""
    rows, faces = np.unique(surface.faces[surface.sound], return_inverse=True)
    corners: Int32Array = faces.reshape(-1, 3).astype(np.int32)
    vertices, facings = surface.vertices[rows], normals[rows]
    if base is not None:
        base = base.of_part(surface.sound).of_rows(rows)
    return BakeMesh(name, vertices, corners, facings, base_colors, vertices, facings, base)


def _placed(item: MeshObject) -> BaseColor | None:
    """Return the colour of a mesh with the coordinates that the mesh has beside it; None if it has none."""
    color = item.color
    if item.coordinates is None or (isinstance(color, BaseColor) and color.coordinates is not None):
        return None
    if not isinstance(color, BaseColor):
        color = BaseColor(decode_srgb(np.array([color])), corners=np.zeros_like(item.faces))
    return color.with_coordinates(item.coordinates, item.faces)


def _plain(color: Color | BaseColor) -> Color:
    """Return a colour; white where a base colour has them."""
    return WHITE if isinstance(color, BaseColor) else color


def _tree_colors(tree: Node) -> BaseColors:
    """Return the colour of a tree whose primitives have one, else its function."""
    colors = {node.color for _, node in nodes_with_paths(tree) if isinstance(node, Leaf)}
    return tree.colors if len(colors) != 1 else colors.pop()


def _nearest(item: PosedMesh) -> Callable[[Float32Array], Float32Array]:
    """Return a function that gives points of the rest pose the colour of the nearest vertex."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    vertices, colors = cKDTree(item.rest.vertices), np.asarray(item.color, np.float32)
    return lambda points: colors[vertices.query(points)[1]]
