"""Meshes from files and from pyvista datasets: PLY by our own reader, every other format by pyvista's.

VTK's readers of most formats crash or hang on some damaged files, so they run in a process of their own.
"""

import re
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Int32Array, Int64Array
from decals.errors import InvalidMesh
from decals.surfaces.base_color import checked_color
from decals.surfaces.dataset_colors import dataset_color, has_colors
from decals.surfaces.files.gltf import read_gltf
from decals.surfaces.files.threemf import read_3mf
from decals.surfaces.mesh_data import MeshData, joined
from decals.surfaces.ply import Polygons, read_ply
from decals.surfaces.vtk_process import can_isolate, read_isolated
from decals.validation import describe, is_file

if TYPE_CHECKING:  # its import takes longer than ours, and meshes of arrays do without
    import pyvista as pv

MeshArrays = tuple[Float32Array, Int32Array]
"""Vertices ``float32[n, 3]`` and triangles ``int32[m, 3]``."""

MIN_PRECISE_RATIO = 500.0
"""Least ratio of coordinates to the extent of a mesh at which float64 is kept."""

_SCENE_READERS = {".3mf": read_3mf, ".glb": read_gltf, ".gltf": read_gltf}
"""Our own readers of files that place meshes in space, by suffix."""

_ROBUST = (".obj", ".stl")
"""Suffixes of formats whose readers in VTK neither crash nor hang on damaged files; see `tests.fuzz`."""


def read_mesh(path: str | PathLike[str]) -> MeshArrays:
    """Read a mesh file of any format that pyvista reads, as triangles.

    Polygons and triangle strips are triangulated. Of volume meshes the boundary is taken. Vertices keep their
    order. Cells without area, such as lines, are left out.

    Parameters
    ----------
    path : str or path
        File of a format that pyvista knows by its suffix.

    Returns
    -------
    vertices : float32[n, 3]
        In the file's units.
    faces : int32[m, 3]
        Corner indices.

    Raises
    ------
    InvalidMesh
        If the file is missing, of an unknown kind, unreadable, or has no faces or wrong indices.

    Examples
    --------
    >>> import tempfile, pathlib, pyvista
    >>> from decals.surfaces import read_mesh
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "cube.stl"
    >>> pyvista.Cube().triangulate().save(path)
    >>> vertices, faces = read_mesh(path)
    >>> vertices.shape, faces.shape
    ((8, 3), (12, 3))
    """
    return read_mesh_data(path).arrays


def read_mesh_data(path: str | PathLike[str]) -> MeshData:
    """Read a mesh file with its colours; see `read_mesh`."""
    path = Path(path)
    if not is_file(path):
        raise InvalidMesh(f"expected a mesh file, found none at {str(path)!r}; check the path")
    if reader := _SCENE_READERS.get(path.suffix.lower()):
        return MeshData(*polygon_triangles(*reader(path), name=str(path)))
    if path.suffix.lower() == ".ply":
        return MeshData(*polygon_triangles(*read_ply(path), name=str(path)))
    from pyvista.core.utilities.reader import CLASS_READERS

    if path.suffix.lower() not in CLASS_READERS or path.suffix.lower() in _ROBUST or not can_isolate():
        return dataset_mesh(read_dataset(path), name=str(path))
    return MeshData(*read_isolated(path))


def dataset_triangles(dataset: "pv.DataSet | pv.MultiBlock", *, name: str) -> MeshArrays:
    """Return the vertices and triangles of a pyvista dataset's surface; see `dataset_mesh`."""
    return dataset_mesh(dataset, name=name).arrays


def dataset_mesh(dataset: "pv.DataSet | pv.MultiBlock", *, name: str) -> MeshData:
    """Return the triangles and the base colour of a pyvista dataset's surface.

    Messages call the dataset by ``name``.
    """
    import pyvista as pv

    if isinstance(dataset, pv.MultiBlock) and _is_empty(dataset):
        raise InvalidMesh(f"{name!r} has no block with faces; give a surface mesh")
    _check_cells(dataset, name)
    if isinstance(dataset, pv.MultiBlock) and has_colors(dataset):  # joined blocks keep what all of them have
        return joined([dataset_mesh(block, name=name) for block in dataset if not _is_empty(block)])
    surface = (
        dataset if isinstance(dataset, pv.PolyData) else dataset.extract_surface(algorithm="dataset_surface")
    )
    if surface.n_strips:
        surface = surface.triangulate()
    sizes = np.diff(surface.face_offsets)
    alike = len(sizes) and (sizes == sizes[0]).all()
    polygons = surface.regular_faces if alike else list(surface.irregular_faces)
    vertices, faces, origins = traced_triangles(surface.points, polygons, name=name)
    color = checked_color(lambda: dataset_color(surface, origins, name=name), name, len(vertices), len(faces))
    return MeshData(vertices, faces, color)


def precise_points(points: ArrayLike) -> Any:
    """Return points as float32; keep float64 of points so far from zero that float32 would round them."""
    given = np.asarray(points)
    if given.dtype == np.float64 and len(given):
        extent = np.ptp(given, axis=0).max()
        if np.isfinite(given).all() and np.abs(given).max() > MIN_PRECISE_RATIO * extent:
            return given
    return given.astype(np.float32)


def polygon_triangles(points: ArrayLike, polygons: Polygons, *, name: str) -> MeshArrays:
    """Divide polygons into triangles, concave ones too, after a check of their indices."""
    return traced_triangles(points, polygons, name=name)[:2]


def traced_triangles(
    points: ArrayLike, polygons: Polygons, *, name: str
) -> tuple[Float32Array, Int32Array, Int64Array]:
    """Return vertices and triangles as `polygon_triangles` does, and the polygon of each triangle."""
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinity, refused by surfaces
        vertices: Any = precise_points(points)
    if len(polygons) == 0:
        raise InvalidMesh(f"{name!r} has {len(vertices)} points but no faces; give a surface mesh")
    if isinstance(polygons, np.ndarray) and polygons.shape[1] == 3:
        _check_indices(polygons, len(vertices), name)
        return vertices, polygons.astype(np.int32), np.arange(len(polygons))
    corners = np.concatenate(list(polygons))
    _check_indices(corners, len(vertices), name)
    areal = [number for number, polygon in enumerate(polygons) if len(polygon) > 2]
    if not areal:
        raise InvalidMesh(f"{name!r} has no face of three or more corners; give a surface mesh")
    import pyvista as pv

    surface = pv.PolyData.from_irregular_faces(vertices, [polygons[number] for number in areal])
    surface.cell_data["polygon"] = np.array(areal)
    triangles = surface.triangulate()
    return vertices, triangles.regular_faces.astype(np.int32), np.asarray(triangles.cell_data["polygon"])


def _is_empty(dataset: Any) -> bool:
    """Return True if neither a dataset nor any of its blocks has cells."""
    import pyvista as pv

    if isinstance(dataset, pv.MultiBlock):
        return all(_is_empty(block) for block in dataset)
    return getattr(dataset, "n_cells", 0) == 0


def _check_cells(dataset: Any, name: str) -> None:
    """Refuse cells with offsets or corners out of range in a dataset or its blocks: filters trust them."""
    import pyvista as pv

    if isinstance(dataset, pv.MultiBlock):
        for block in dataset:
            _check_cells(block, name)
    elif isinstance(dataset, pv.PolyData | pv.UnstructuredGrid):
        grid = isinstance(dataset, pv.UnstructuredGrid)
        for cells in [dataset.GetCells()] if grid else [dataset.GetPolys(), dataset.GetStrips()]:
            offsets: Any = pv.convert_array(cells.GetOffsetsArray())
            corners: Any = pv.convert_array(cells.GetConnectivityArray())
            if len(offsets) and (
                offsets[0] != 0 or offsets[-1] != len(corners) or (np.diff(offsets) < 0).any()
            ):
                raise InvalidMesh(f"{name!r} has faces that do not follow each other; export it again")
            _check_indices(corners, dataset.n_points, name)


def _check_indices(corners: Any, count: int, name: str) -> None:
    """Refuse corner indices out of range: VTK's filters trust them and crash."""
    if len(corners) and (corners.min() < 0 or corners.max() >= count):
        bad = corners.min() if corners.min() < 0 else corners.max()
        raise InvalidMesh(f"{name!r} has {count} points but a face asks for number {bad}; export it again")


def read_dataset(path: Path) -> "pv.DataSet | pv.MultiBlock":
    """Read a file by pyvista in this process; InvalidMesh for errors that the reader reports."""
    import pyvista as pv

    from blobtree.vtk_errors import vtk_errors

    cause = None
    try:
        with vtk_errors() as errors:
            dataset = _read_legacy(path) if path.suffix.lower() == ".vtk" else pv.read(path)
    except Exception as error:  # readers and their plugins raise all sorts of exceptions
        errors, cause = [str(error)], error
    if errors:
        raise _unreadable(path, errors[0]) from cause
    # An image or a point set has no boundary that is a surface.
    if not isinstance(dataset, pv.PolyData | pv.UnstructuredGrid | pv.StructuredGrid | pv.MultiBlock):
        raise InvalidMesh(f"expected a surface mesh in {str(path)!r}, got {describe(dataset)}; convert it")
    return dataset


def _read_legacy(path: Path) -> "pv.DataSet | pv.MultiBlock":
    """Read a file of VTK's legacy format, with a line end added to it.

    VTK reports that a text file holds too few numbers only if white space follows the last one.
    """
    import pyvista as pv

    content = path.read_bytes() + b"\n"
    reader: Any = pv.get_reader(path)  # type: ignore[no-untyped-call]
    reader.reader.SetBinaryInputString(content, len(content))
    reader.reader.ReadFromInputStringOn()
    dataset: pv.DataSet | pv.MultiBlock = reader.read()
    return dataset


def _unreadable(path: Path, text: str) -> InvalidMesh:
    """Return the exception for a file that a reader of VTK or pyvista refused with a text."""
    line = (text.strip().splitlines() or [""])[0].rstrip('.!"')
    if "automatically read by pyvista" in line:
        return InvalidMesh(
            f"expected a mesh file, got {str(path)!r}: no reader is known for {path.suffix or 'its name'!r}; "
            "convert it to .ply, .obj or .stl"
        )
    if not line or re.match(r"Algorithm vtk|(VTKExecutionError: )?ERROR: In vtk", line):
        line = "it is damaged or of another format"
    return InvalidMesh(f"could not read {str(path)!r} as a mesh ({line}); export it again")
