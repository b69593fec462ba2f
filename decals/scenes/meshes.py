"""Objects of a scene as one mesh, for files of other programs."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from blobtree._typing import Float32Array, Int32Array
from blobtree.meshing.mesh import Mesh
from blobtree.meshing.polygonize import MAX_TRIANGLES
from blobtree.progress import Progress
from blobtree.pyvista_views import to_polydata
from decals.errors import InvalidMesh, InvalidScene
from decals.images.texels import encode_srgb
from decals.scenes.objects import MeshObject, SceneObject, TreeObject, shown_objects
from decals.surfaces.base_color import BaseColor
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.normals import SplitMesh, split_at_colors, split_at_creases, vertex_normals

if TYPE_CHECKING:
    import pyvista as pv


def as_polydata(
    objects: Iterable[SceneObject],
    *,
    resolution: int | None = None,
    cell_size: float | None = None,
    chord_error: float | None = None,
    max_triangles: int = MAX_TRIANGLES,
    adaptive: bool = True,
    creases: bool = False,
    split_normals: bool = False,
    progress: Progress | None = None,
) -> "pv.PolyData":
    """Return the visible surfaces of objects as one mesh with normals and "RGB" colours.

    Trees are polygonized.

    Parameters
    ----------
    objects
        Objects of a scene.
    resolution, cell_size, chord_error, max_triangles, adaptive, creases, split_normals
        See `blobtree.polygonize`.
    progress
        Called with a stage and the fraction done.

    Raises
    ------
    InvalidScene
        There is no object.
    InvalidMesh
        A tree has no surface in cells of this size.
    """
    parts = []
    for item in shown_objects(objects):
        if isinstance(item, MeshObject):
            parts.append(_mesh_polydata(item, split_normals))
            continue
        part = item.tree.to_pyvista(
            resolution=resolution,
            cell_size=cell_size,
            chord_error=chord_error,
            max_triangles=max_triangles,
            adaptive=adaptive,
            creases=creases,
            split_normals=split_normals,
            progress=progress,
        )
        if part.n_points == 0:
            raise InvalidMesh(
                f"object {item.name!r} has no surface in cells of this size: its parts may be smaller than a "
                "cell, or the tree may be empty; increase the resolution"
            )
        parts.append(part)
    if not parts:
        raise InvalidScene("expected at least one object to write as a mesh, got none; add one")
    first, *others = parts
    merged: pv.PolyData = first.append_polydata(*others) if others else first
    return merged


def _mesh_polydata(item: MeshObject, split_normals: bool) -> "pv.PolyData":
    split = (
        split_at_creases(item.vertices, item.faces, item.crease_angle)
        if split_normals
        else SplitMesh(np.arange(len(item.vertices)), item.faces, vertex_normals(item.vertices, item.faces))
    )
    if isinstance(item.color, BaseColor):
        split = split_at_colors(split, item.color)
    vertices = item.vertices[split.rows]
    if split.color is None:
        colors = np.tile(np.asarray(item.color, np.float32), (len(vertices), 1))
    else:
        colors = encode_srgb(split.color.at_vertices(split.faces, len(vertices))).astype(np.float32)
    return to_polydata(Mesh(vertices, split.faces, split.normals, colors))


@dataclass(frozen=True, eq=False)
class MeshedTree:
    """A tree that is drawn as a mesh with the colours of its vertices; decals lie on it as on the tree.

    Attributes
    ----------
    item : TreeObject
        The tree.
    vertices, faces, color : float32[n, 3], int32[m, 3], float32[n, 3]
        The mesh; colours are sRGB.
    """

    item: TreeObject
    vertices: Float32Array = field(repr=False)
    faces: Int32Array = field(repr=False)
    color: Float32Array = field(repr=False)

    @classmethod
    def of(cls, item: TreeObject, mesh: "pv.PolyData") -> "MeshedTree":
        """Return a tree that is drawn as its mesh with "RGB" colours."""
        colors = np.asarray(mesh["RGB"], np.float32) / 255.0
        return cls(item, np.asarray(mesh.points, np.float32), mesh.regular_faces.astype(np.int32), colors)

    @property
    def name(self) -> str:
        """Name of the object."""
        return self.item.name

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels besides the name."""
        return self.item.labels

    @property
    def named_only(self) -> bool:
        """True if only decals lie on the object that name it."""
        return self.item.named_only

    @property
    def surface(self) -> ImplicitSurface:
        """Surface of the tree, over which decals walk."""
        return self.item.surface


def meshed(objects: Iterable[SceneObject], meshes: Iterable["pv.PolyData"]) -> list[SceneObject | MeshedTree]:
    """Return objects of a scene with meshes in place of trees; `as_polydata` makes those of each object."""
    pairs = zip(objects, meshes, strict=True)
    return [MeshedTree.of(item, mesh) if isinstance(item, TreeObject) else item for item, mesh in pairs]
