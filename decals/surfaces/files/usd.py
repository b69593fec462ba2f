"""Reader of USD files by OpenUSD, which is foreign code: `decals.surfaces.vtk_child` runs it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from decals.surfaces.files.faults import Notes, Unreadable, reading
from decals.surfaces.files.pieces import Budget, Piece, placed
from decals.surfaces.mesh_data import MeshData
from decals.surfaces.triangulate import Polygons, polygon_triangles
from decals.validation import optional_package

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
"""Ends of the names of USD files."""


def usd_objects(path: Path) -> dict[str, MeshData]:
    """Return the visible meshes of a USD file by their paths, without colours.

    Each lies where the file places it at its first time. Meshes of subdivision surfaces are read as they are.
    Spheres, curves and copies of point instancers are left out, and the log names them.

    Raises
    ------
    InvalidMesh
        The file is damaged, has no mesh, or refers to files outside of its folder.
    MissingPackage
        usd-core is not installed.
    """
    usd, geometry, tf = (optional_package(f"pxr.{name}", "usd") for name in ("Usd", "UsdGeom", "Tf"))
    found: dict[str, MeshData] = {}
    with reading(path, "USD") as notes:
        try:
            stage = usd.Stage.Open(str(path))
        except tf.ErrorException as error:
            raise Unreadable("it is damaged or of another format") from error
        _check_layers(stage, path)
        for lost in stage.GetCompositionErrors():
            notes.add("left out what cannot be found, or refers to itself", " ".join(str(lost).split()))
        budget = Budget()
        budget.grow(path.stat().st_size)
        first = usd.TimeCode.EarliestTime()
        places = geometry.XformCache(first)
        for prim in _meshes(usd, geometry, stage, first, notes):
            name = str(prim.GetPath())
            points, polygons = _polygons(geometry.Mesh(prim), first)
            if not len(polygons):
                continue
            vertices, faces = polygon_triangles(points, polygons, name=f"{path}, {name}")
            budget.read(len(vertices), len(faces), name)
            piece = Piece(vertices.astype(np.float64), faces.astype(np.int64))
            matrix = np.array(places.GetLocalToWorldTransform(prim)).T[None]
            whole = placed(piece, matrix)
            found[name] = MeshData(*polygon_triangles(whole.points, whole.faces, name=name))
        if not found:
            raise Unreadable("it has no mesh", "give a surface mesh")
    return found


def _check_layers(stage: Any, path: Path) -> None:
    """Refuse a stage that refers to files outside of its folder."""
    folder = path.resolve().parent
    for layer in stage.GetUsedLayers():
        place = layer.realPath.partition("[")[0]  # files in an archive stand in brackets
        if place and not Path(place).resolve().is_relative_to(folder):
            raise Unreadable(f"it refers to {place!r}, outside of its folder", "move that file beside it")


def _meshes(usd: Any, geometry: Any, stage: Any, time: Any, notes: Notes) -> Iterator[Any]:
    """Yield the meshes of a stage that are seen; note other shapes that are."""
    prims = iter(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(geometry.PointInstancer):
            prims.PruneChildren()  # what is copied is not seen itself
        elif not prim.IsA(geometry.Gprim):
            continue
        shape = geometry.Imageable(prim)
        hidden = shape.ComputeVisibility(time) == geometry.Tokens.invisible
        if hidden or shape.ComputePurpose() not in (geometry.Tokens.default_, geometry.Tokens.render):
            continue
        if prim.IsA(geometry.Mesh):
            yield prim
        else:
            notes.add(f"left out, as {prim.GetTypeName()} is no mesh", str(prim.GetPath()))


def _polygons(mesh: Any, time: Any) -> tuple[Any, Polygons]:
    """Return the points and the polygons of a mesh, counter-clockwise seen from outside, without holes."""
    points, sizes, corners, holes = (
        np.array(attribute.Get(time) or [])
        for attribute in (
            mesh.GetPointsAttr(),
            mesh.GetFaceVertexCountsAttr(),
            mesh.GetFaceVertexIndicesAttr(),
            mesh.GetHoleIndicesAttr(),
        )
    )
    sizes, corners = sizes.astype(np.int64), corners.astype(np.int64)
    if (sizes < 0).any() or sizes.sum() != len(corners):
        raise Unreadable(f"{str(mesh.GetPath())!r} has {len(corners)} corners, its faces {sizes.sum()}")
    faces = np.repeat(np.arange(len(sizes)), sizes)
    if mesh.GetOrientationAttr().Get(time) == "leftHanded":
        starts = np.cumsum(sizes) - sizes
        corners = corners[(2 * starts + sizes - 1)[faces] - np.arange(len(corners))]
    kept = ~np.isin(np.arange(len(sizes)), holes)
    return points.astype(np.float64).reshape(-1, 3), Polygons(corners[kept[faces]], sizes[kept])
