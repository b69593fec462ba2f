"""Scenes to export, made at random, and their files read back by other libraries."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

import decals
from blobtree import Point, Segment, Torus
from decals import DecalMaterial, Decals, MeshObject, Scene, TreeObject
from decals.images.texels import encode_srgb
from decals.surfaces.mesh_file import read_mesh_data
from tests.decals.baking.glb import Array, gradient
from tests.decals.meshes import box, icosphere

NAMES = ("ball", "Kürbis 🎃", "a/b", "two words", "<&\"'>", "0", "ゆ")
"""Names of objects: any text is one."""


def random_object(rng: np.random.Generator, name: str) -> MeshObject | TreeObject:
    """A mesh or a tree of a size from 1e-3 to 1e3, somewhere near zero."""
    scale = float(10 ** rng.uniform(-3, 3))
    color = tuple(rng.uniform(0, 1, 3).tolist())
    match rng.integers(0, 5):
        case 0:
            vertices, faces = icosphere(2)
            return MeshObject(name, scale * vertices, faces, color)
        case 1:
            cube = box((1.2, 1.0, 0.7), (0.3, 0, 0))
            return MeshObject(name, scale * cube.vertices, cube.faces, color)
        case 2:  # an open sheet
            grid: Any = pv.Plane(i_resolution=4, j_resolution=3).triangulate()
            return MeshObject(name, scale * np.asarray(grid.points), grid.regular_faces, color)
        case 3:
            ball = Point((0, 0, 0), radius=scale, color=color)
            return TreeObject(name, ball + Segment((0, 0, 0), (2 * scale, 0, 0), radius=0.4 * scale))
        case _:
            return TreeObject(name, Torus((0, 0, 0), (0, 0, 1), scale, radius=0.3 * scale, color=color))


@cache
def random_scene(seed: int) -> Scene:
    """A scene of one to three objects under 0, 1 or some decals, with layers, and at times a material."""
    rng = np.random.default_rng(seed)
    names = rng.permutation(NAMES)[: rng.integers(1, 4)].tolist()
    objects = [random_object(rng, name) for name in names]
    scale = float(np.ptp(np.stack(objects[0].bounds), axis=0).max())
    objects = [_scaled(item, scale, rng) for item in objects]
    count = int(rng.choice([0, 1, 12]))
    images: list[Any] = [gradient(seed), gradient(seed + 1)]
    if rng.random() < 0.4:
        images[1] = DecalMaterial("stone", images[1][..., :3] / 255, roughness=0.3, metallic=0.8)
    points, normals = (
        np.concatenate(parts)
        for parts in zip(*(item.surface.sample(count, seed=seed) for item in objects), strict=True)
    )
    there = (
        Decals(
            points,
            normals,
            rng.normal(size=points.shape),
            scale * rng.uniform(0.1, 0.3, len(points)),
            images=rng.integers(-1, 2, len(points)),
            tints=rng.uniform(0.2, 1, (len(points), 3)),
            layers=rng.integers(0, 2, len(points)),
        )
        if count
        else Decals.empty()
    )
    return Scene(objects=objects, camera=decals.Camera((0, 0, 5 * scale)), decals=there, images=images)


def _scaled(item: MeshObject | TreeObject, scale: float, rng: np.random.Generator) -> MeshObject | TreeObject:
    """The same with the size of the first object, moved away from it."""
    own = float(np.ptp(np.stack(item.bounds), axis=0).max())
    move = rng.uniform(-2, 2, 3) * scale
    if isinstance(item, TreeObject):
        return TreeObject(item.name, item.tree.scale(scale / own).translate(move))
    return MeshObject(item.name, item.vertices * (scale / own) + move, item.faces, item.color)


@dataclass(frozen=True, eq=False)
class ReadBack:
    """All objects of a file as one mesh: corners of faces, with their sRGB colours from 0 to 1 if known."""

    triangles: Array
    """float64[m, 3, 3]"""
    colors: Array | None = None
    """float64[m, 3, 3]"""

    @property
    def ordered(self) -> "ReadBack":
        """The same with the faces in an order that depends on their corners alone, rounded to float32."""
        rounded = self.triangles.astype(np.float32)
        order = np.lexsort(rounded.reshape(len(rounded), -1).T)
        return ReadBack(rounded[order], None if self.colors is None else self.colors[order])


def read_by_trimesh(path: Path) -> ReadBack:
    """The file as trimesh reads it, in the order of the file."""
    import trimesh

    loaded: Any = trimesh.load(path, process=False, maintain_order=True)
    meshes = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
    corners = [np.asarray(mesh.vertices, float)[mesh.faces] for mesh in meshes]
    colors = [_trimesh_colors(mesh) for mesh in meshes]
    return ReadBack(
        np.concatenate(corners),
        None if colors[0] is None else np.concatenate([color for color in colors if color is not None]),
    )


def _trimesh_colors(mesh: Any) -> Array | None:
    if mesh.visual.kind == "vertex":
        colors: Array = np.asarray(mesh.visual.vertex_colors, float)[mesh.faces][..., :3] / 255
        return colors
    return None


def read_by_pyvista(path: Path) -> ReadBack:
    """The file as VTK reads it."""
    data: Any = pv.read(path)
    if isinstance(data, pv.MultiBlock):
        data = data.combine().extract_surface(algorithm="dataset_surface")
    faces = data.regular_faces
    rgb = np.asarray(data.point_data["RGB"], float)[faces] / 255 if "RGB" in data.point_data else None
    return ReadBack(np.asarray(data.points, float)[faces], rgb)


def read_by_lib3mf(path: Path) -> ReadBack:
    """A 3MF file as the library of the 3MF Consortium reads it, which names every fault."""
    lib3mf: Any = __import__("lib3mf")
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromBuffer(path.read_bytes())
    assert reader.GetWarningCount() == 0
    triangles, colors = [], []
    items = model.GetBuildItems()
    while items.MoveNext():
        mesh = items.GetCurrent().GetObjectResource()
        vertices = np.array([list(vertex.Coordinates) for vertex in mesh.GetVertices()])
        faces = np.array([list(triangle.Indices) for triangle in mesh.GetTriangleIndices()])
        triangles.append(vertices[faces])
        rows = mesh.GetAllTriangleProperties()
        group = model.GetColorGroupByID(rows[0].ResourceID)
        shade = {key: group.GetColor(key) for row in rows for key in row.PropertyIDs}
        corners = [[shade[key] for key in row.PropertyIDs] for row in rows]
        colors.append(np.array([[[c.Red, c.Green, c.Blue] for c in row] for row in corners]) / 255)
    return ReadBack(np.concatenate(triangles), np.concatenate(colors))


def read_by_openusd(path: Path) -> ReadBack:
    """A USDZ file as OpenUSD reads it."""
    usd, geometry = import_module("pxr.Usd"), import_module("pxr.UsdGeom")
    stage = usd.Stage.Open(str(path))
    triangles, colors = [], []
    for prim in stage.Traverse():
        if prim.IsA(geometry.Mesh):
            mesh = geometry.Mesh(prim)
            faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
            triangles.append(np.array(mesh.GetPointsAttr().Get(), float)[faces])
            shades = geometry.PrimvarsAPI(prim).GetPrimvar("displayColor").Get()
            colors.append(np.asarray(encode_srgb(np.array(shades, float)))[faces])
    return ReadBack(np.concatenate(triangles), np.concatenate(colors))


def read_by_tinyusdz(path: Path) -> ReadBack:
    """A USDZ file as tinyusdz reads it, which shares nothing with OpenUSD that writes it."""
    usd = import_module("tinyusdz")
    triangles, colors = [], []
    for prim in usd.traverse(usd.load(str(path))):
        if prim.type_name == "Mesh":
            names = "points", "faceVertexIndices", "primvars:displayColor"
            points, indices, shades = (np.array(prim.get_attribute(name).value) for name in names)
            triangles.append(points.astype(float)[indices.reshape(-1, 3)])
            colors.append(np.asarray(encode_srgb(shades.astype(float)))[indices.reshape(-1, 3)])
    return ReadBack(np.concatenate(triangles), np.concatenate(colors))


FORMATS = {
    ".glb": ("decals", "trimesh", "pyvista"),
    ".gltf": ("decals", "trimesh", "pyvista"),
    ".obj": ("decals", "trimesh", "pyvista"),
    ".ply": ("decals", "trimesh", "pyvista"),
    ".stl": ("decals", "trimesh", "pyvista"),
    ".vtp": ("decals", "pyvista"),
    ".3mf": ("decals", "lib3mf"),
    ".usdz": ("pxr", "tinyusdz"),
}
"""The readers of each format."""

WITHOUT_COLORS = {("trimesh", ".glb"), ("trimesh", ".gltf"), ("trimesh", ".obj")}
"""Readers that do not return the colours of vertices as they are in a format."""


def read_by_decals(path: Path) -> ReadBack:
    """The file as this package reads it."""
    data = read_mesh_data(path)
    triangles = np.asarray(data.vertices, float)[data.faces]
    if data.color is None:
        return ReadBack(triangles)
    numbers = np.repeat(np.arange(len(data.faces)), 3)
    light = data.color.light_at(data.faces, numbers, np.tile(np.eye(3), (len(data.faces), 1)))
    return ReadBack(triangles, np.asarray(encode_srgb(light)).reshape(-1, 3, 3))


READERS: dict[str, Callable[[Path], ReadBack]] = {
    "decals": read_by_decals,
    "trimesh": read_by_trimesh,
    "pyvista": read_by_pyvista,
    "lib3mf": read_by_lib3mf,
    "pxr": read_by_openusd,
    "tinyusdz": read_by_tinyusdz,
}
"""Readers of files by the packages that they need."""
