"""Meshes from files: PLY by our own reader, everything else by pyvista's."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonCore import vtkLogger

from decals.errors import InvalidMesh
from decals.paths import is_file
from decals.scenes.ply import Polygons, read_ply

MeshArrays = tuple[NDArray[np.float32], NDArray[np.int32]]

_SOLIDS = (pv.UnstructuredGrid, pv.StructuredGrid, pv.MultiBlock)
"""What has a boundary that is a surface; an image or a point set has none."""


def read_mesh(path: str | PathLike[str]) -> MeshArrays:
    """Read a mesh file of any format that pyvista knows as triangles.

    Polygons and triangle strips are triangulated and volume meshes give their boundary; points stay as they
    are. What has no area, such as lines, is no part of a surface.

    Returns
    -------
    vertices : float32[n, 3]
    faces : int32[m, 3]

    Raises
    ------
    InvalidMesh
        If the file is missing, of an unknown kind, unreadable, or holds no faces or wrong indices.
    """
    path = Path(path)
    if not is_file(path):
        raise InvalidMesh(f"expected a mesh file, found none at {str(path)!r}; check the path")
    if path.suffix.lower() == ".ply":
        return triangles(*read_ply(path), name=str(path))
    return surface_triangles(_read_surface(path), name=str(path))


def surface_triangles(surface: pv.PolyData, *, name: str) -> MeshArrays:
    """Vertices and triangles of a pyvista surface; ``name`` is what messages call it."""
    _check_indices(surface.face_connectivity, surface.n_points, name)
    if surface.n_strips:
        surface = surface.triangulate()
    sizes = np.diff(surface.face_offsets)
    if len(sizes) and (sizes == sizes[0]).all():
        return triangles(surface.points, surface.regular_faces, name=name)
    return triangles(surface.points, list(surface.irregular_faces), name=name)


def triangles(points: ArrayLike, polygons: Polygons, *, name: str) -> MeshArrays:
    """Cut polygons into triangles, concave ones too, after a check of their indices."""
    vertices: NDArray[Any] = np.asarray(points, np.float32)
    if len(polygons) == 0:
        raise InvalidMesh(f"{name!r} has {len(vertices)} points but no faces; give a surface mesh")
    if isinstance(polygons, np.ndarray) and polygons.shape[1] == 3:
        _check_indices(polygons, len(vertices), name)
        return vertices, polygons.astype(np.int32)
    corners = np.concatenate(list(polygons))
    _check_indices(corners, len(vertices), name)
    surface = pv.PolyData.from_irregular_faces(vertices, [p for p in polygons if len(p) > 2])
    return vertices, surface.triangulate().regular_faces.astype(np.int32)


def _check_indices(corners: NDArray[Any], count: int, name: str) -> None:
    """VTK's filters trust the indices and crash on wrong ones, so look first."""
    if len(corners) and (corners.min() < 0 or corners.max() >= count):
        bad = corners.min() if corners.min() < 0 else corners.max()
        raise InvalidMesh(f"{name!r} has {count} points but a face asks for number {bad}; export it again")


def _read_surface(path: Path) -> pv.PolyData:
    try:
        with _vtk_complaints() as complaints:
            data = pv.read(path)
    except Exception as error:  # readers and their plugins raise all sorts of things
        raise InvalidMesh(f"could not read {str(path)!r} as a mesh ({_reason(str(error))})") from error
    if complaints:
        raise InvalidMesh(f"could not read {str(path)!r} as a mesh ({_reason(complaints[0])})")
    if isinstance(data, pv.PolyData):
        return data
    if not isinstance(data, _SOLIDS):
        raise InvalidMesh(f"expected a surface mesh, {str(path)!r} holds a {type(data).__name__}; convert it")
    return data.extract_surface(algorithm="dataset_surface")


def _reason(text: str) -> str:
    line = (text.strip().splitlines() or [""])[0].rstrip(".")
    return "it is damaged or of another format" if not line or line.startswith("Algorithm vtk") else line


@contextmanager
def _vtk_complaints() -> Iterator[list[str]]:
    """Collect what VTK reports as errors, instead of letting it print."""
    found: list[str] = []
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    root_level = logging.root.manager.disable
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    logging.disable(logging.CRITICAL)  # pyvista's readers send VTK's errors there as well
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            with pv.VtkErrorCatcher(send_to_logging=False) as catcher:
                yield found
        found.extend(event.alert for event in catcher.error_events)
        # An error inside one of pyvista's readers comes as a warning that quotes it.
        found.extend(str(w.message).partition('"')[2] for w in caught if "raised an error" in str(w.message))
    finally:
        logging.disable(root_level)
        vtkLogger.SetStderrVerbosity(verbosity)
