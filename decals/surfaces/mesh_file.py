"""Meshes from files and from pyvista datasets: common formats by our own readers, the others by pyvista's.

VTK's readers crash or hang on some damaged files, so they run in a process of their own.
"""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from blobtree.files import no_file, read_file
from blobtree.validation import describe
from decals.child_process import can_isolate
from decals.errors import InvalidMesh
from decals.surfaces.base_color import checked_color
from decals.surfaces.dataset_colors import dataset_color, has_colors
from decals.surfaces.files.content import encoding_of, without_mark
from decals.surfaces.files.gltf import gltf_objects, read_gltf
from decals.surfaces.files.obj import PARTS, obj_parts, read_obj
from decals.surfaces.files.off import read_off
from decals.surfaces.files.paint import Paint
from decals.surfaces.files.ply import read_ply, strip_triangles
from decals.surfaces.files.stl import read_stl
from decals.surfaces.files.threemf import read_3mf, threemf_objects
from decals.surfaces.files.usd import SUFFIXES as USD_SUFFIXES
from decals.surfaces.files.usd import usd_objects
from decals.surfaces.mesh_data import MeshData, joined
from decals.surfaces.triangulate import (
    MeshArrays,
    Polygons,
    check_indices,
    polygon_triangles,
    traced_triangles,
)
from decals.surfaces.vtk_process import read_isolated, read_isolated_usd
from decals.validation import as_path

if TYPE_CHECKING:  # its import takes longer than ours, and meshes of arrays do without
    import pyvista as pv

_POLYGON_READERS: dict[str, Callable[[Path], tuple[Float64Array, Polygons, Paint | None]]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}
"""Our own readers of polygons, by suffix: they return points, polygons and their colours, if any."""


def _read_usd(path: Path) -> dict[str, MeshData]:
    """Read the meshes of a USD file by their names."""
    return read_isolated_usd(path) if can_isolate() else usd_objects(path)


_SCENE_READERS: dict[str, Callable[[Path], MeshData]] = {
    ".3mf": read_3mf,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    **dict.fromkeys(USD_SUFFIXES, lambda path: joined(list(_read_usd(path).values()))),
}
"""Those of files that place meshes in space: they return one mesh with its colours."""

_OBJECT_READERS: dict[str, Callable[[Path], dict[str, MeshData]]] = {
    ".3mf": threemf_objects,
    ".glb": gltf_objects,
    ".gltf": gltf_objects,
    **dict.fromkeys(USD_SUFFIXES, _read_usd),
}
"""Those of the objects in such files, by their names."""


def read_mesh(path: str | PathLike[str]) -> MeshArrays:
    """Read a mesh file as triangles.

    Polygons and triangle strips are triangulated. Of volume meshes the boundary is taken. Vertices keep their
    order. Cells without area, such as lines, are left out. The parts of glTF, 3MF and USD files become one
    mesh.

    Parameters
    ----------
    path : str or path
        OBJ, OFF, PLY, STL, glTF, GLB or 3MF file, a USD file (needs the extra ``usd``), or one of another
        format that pyvista knows by its suffix.

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
    MissingPackage
        If a USD file is read, and usd-core is not installed.

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


def read_objects(path: str | PathLike[str]) -> list[tuple[str, MeshArrays]]:
    """Read the objects of a mesh file: nodes of glTF, meshes of USD, objects of 3MF and OBJ.

    Other files are one object. Parameters and errors are those of `read_mesh`.
    """
    return next(read_parts(path))


def read_parts(path: str | PathLike[str]) -> Iterator[list[tuple[str, MeshArrays]]]:
    """Read the parts of a mesh file by name: first its objects, then the groups and the materials of OBJ.

    Each list has all triangles. Parameters and errors are those of `read_mesh`.
    """
    path = _existing(path)
    suffix = path.suffix.lower()
    if suffix in _OBJECT_READERS:
        parts = _OBJECT_READERS[suffix](path)
        yield [(name, polygon_triangles(*part.arrays, name=name)) for name, part in parts.items()]
    elif suffix == ".obj":
        points, polygons, _ = read_obj(path)
        vertices, faces, triangles = traced_triangles(points, polygons, name=str(path))
        for keyword in PARTS:
            yield [
                (name, (vertices, faces[own]))
                for name, rows in obj_parts(path, keyword)
                if (own := np.isin(triangles.polygons, rows)).any()
            ]
    else:
        yield [(path.name, read_mesh_data(path).arrays)]


def read_mesh_data(path: str | PathLike[str]) -> MeshData:
    """Read a mesh file with its colours; see `read_mesh`."""
    path = _existing(path)
    suffix = path.suffix.lower()
    if suffix in _SCENE_READERS:
        data = _SCENE_READERS[suffix](path)
        return MeshData(*polygon_triangles(*data.arrays, name=str(path)), data.color)
    if suffix in _POLYGON_READERS:
        points, polygons, paint = _POLYGON_READERS[suffix](path)
        vertices, faces, triangles = traced_triangles(points, polygons, name=str(path))
        if paint is None:
            return MeshData(vertices, faces)
        color = checked_color(lambda: paint(triangles), str(path), len(vertices), len(faces))
        return MeshData(vertices, faces, color)
    if can_isolate():
        return read_isolated(path)
    return dataset_mesh(read_dataset(path), name=str(path))


def _existing(path: str | PathLike[str]) -> Path:
    """Return the path of a file; raise `InvalidMesh` where no file is."""
    path = as_path(path, InvalidMesh)
    if reason := no_file(path):
        raise InvalidMesh(f"expected a mesh file, {reason}; check the path")
    return path


def block_triangles(blocks: "pv.MultiBlock") -> list[tuple[str, MeshArrays]]:
    """Return the names, the vertices and the triangles of blocks that have some."""
    found: list[tuple[str, MeshArrays]] = []
    for name, block in zip(blocks.keys(), blocks, strict=True):
        if not _is_empty(block):
            with suppress(InvalidMesh):  # of points or lines
                found.append((name, dataset_triangles(block, name=name)))
    return found


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
    if isinstance(dataset, pv.PointSet):  # its methods of surfaces raise errors of pyvista
        raise InvalidMesh(f"{name!r} has {dataset.n_points} points but no faces; give a surface mesh")
    _check_cells(dataset, name)
    if isinstance(dataset, pv.MultiBlock) and has_colors(dataset):  # joined blocks keep what all of them have
        return joined([dataset_mesh(block, name=name) for block in dataset if not _is_empty(block)])
    surface = (
        dataset if isinstance(dataset, pv.PolyData) else dataset.extract_surface(algorithm="dataset_surface")
    )
    polygons, cells = _surface_polygons(surface)
    vertices, faces, triangles = traced_triangles(surface.points, polygons, name=name)
    color = checked_color(
        lambda: dataset_color(surface, cells[triangles.polygons], name=name), name, len(vertices), len(faces)
    )
    return MeshData(vertices, faces, color)


def _surface_polygons(surface: "pv.PolyData") -> tuple[Polygons, Int64Array]:
    """Return the polygons of a surface and the triangles of its strips, and the cell of each of them."""
    polygons, strips = _cells(surface.GetPolys()), _cells(surface.GetStrips())
    triangles = [
        Polygons.of(strip_triangles(strip))
        for strip in np.split(strips.corners, np.cumsum(strips.sizes)[:-1])[: len(strips)]
    ]
    own = np.repeat(np.arange(len(strips)), [len(part) for part in triangles])
    cells = np.concatenate([np.arange(len(polygons)), len(polygons) + own])
    return Polygons.joined([polygons, *triangles]), cells


def _cells(cells: Any) -> Polygons:
    """Return cells of VTK as polygons."""
    import pyvista as pv

    corners, offsets = (
        pv.convert_array(array).astype(np.int64)
        for array in (cells.GetConnectivityArray(), cells.GetOffsetsArray())
    )
    return Polygons(corners, np.diff(offsets))


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
    elif isinstance(dataset, pv.StructuredGrid):
        if dataset.n_points != (expected := math.prod(dataset.dimensions)):
            raise InvalidMesh(
                f"{name!r} has {dataset.n_points} points but its dimensions {dataset.dimensions} ask for "
                f"{expected}; correct them"
            )
    elif isinstance(dataset, pv.PolyData | pv.UnstructuredGrid):
        grid = isinstance(dataset, pv.UnstructuredGrid)
        for cells in [dataset.GetCells()] if grid else [dataset.GetPolys(), dataset.GetStrips()]:
            offsets: Any = pv.convert_array(cells.GetOffsetsArray())
            corners: Any = pv.convert_array(cells.GetConnectivityArray())
            if len(offsets) and (
                offsets[0] != 0 or offsets[-1] != len(corners) or (np.diff(offsets) < 0).any()
            ):
                raise InvalidMesh(f"{name!r} has faces that do not follow each other; export it again")
            check_indices(corners, dataset.n_points, name)


def read_dataset(path: Path) -> "pv.DataSet | pv.MultiBlock":
    """Read a file by pyvista in this process; InvalidMesh for errors that the reader reports."""
    import pyvista as pv

    from blobtree.vtk_errors import vtk_errors

    _check_mark(path)
    if path.suffix.lower() == ".vts":
        _check_pieces(path)
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


def _check_mark(path: Path) -> None:
    """Refuse a text in UTF-16 or UTF-32 that VTK would misread."""
    with path.open("rb") as file:
        encoding = encoding_of(file.read(4))
    if encoding not in (None, "utf-8") and path.suffix.lower() != ".vtk":
        raise InvalidMesh(f"{str(path)!r} starts with the mark of {encoding}; VTK needs UTF-8, so convert it")


def _check_pieces(path: Path) -> None:
    """Refuse a structured grid whose pieces leave points out: VTK gives those what its memory holds."""
    head = read_file(path).partition(b"<AppendedData")[0]
    whole, pieces = _boxes(head, b"StructuredGrid", b"WholeExtent"), _boxes(head, b"Piece", b"Extent")
    if len(whole) != 1:
        raise InvalidMesh(f"expected one whole extent of six integers in {str(path)!r}; export it again")
    ends = np.concatenate([whole, pieces])
    cuts = [np.unique(ends[:, axis]) for axis in range(3)]
    covered = np.zeros([len(cut) - 1 for cut in cuts], bool)
    for box in pieces:
        covered[_slots(cuts, box)] = True
    inside = covered[_slots(cuts, whole[0])]
    if not inside.all() or inside.sum() < covered.sum():
        raise InvalidMesh(f"{str(path)!r} has pieces that do not fill its whole extent; export it again")


def _boxes(head: bytes, element: bytes, attribute: bytes) -> Int64Array:
    """Return the extents ``int64[n, 3, 2]`` of XML elements, each with the number behind its last point."""
    pattern = rb"<%s\s(?:[^>]*\s)?%s\s*=\s*[\"']\s*(-?\d{1,9}(?:\s+-?\d{1,9}){5})\s*[\"']" % (
        element,
        attribute,
    )
    extents = [[int(word) for word in match.split()] for match in re.findall(pattern, head)]
    boxes = np.array(extents, np.int64).reshape(-1, 3, 2)
    boxes[..., 1] += 1
    return boxes


def _slots(cuts: Sequence[Int64Array], box: Int64Array) -> tuple[slice, ...]:
    """Return the part of the grid between cuts of each axis that a box takes."""
    return tuple(slice(*np.searchsorted(cut, ends)) for cut, ends in zip(cuts, box, strict=True))


def _read_legacy(path: Path) -> "pv.DataSet | pv.MultiBlock":
    """Read a file of VTK's legacy format, with a line end added to it.

    VTK reports that a text file holds too few numbers only if white space follows the last one.
    """
    import pyvista as pv

    content = without_mark(read_file(path)) + b"\n"
    reader: Any = pv.get_reader(path)  # type: ignore[no-untyped-call]
    reader.reader.SetBinaryInputString(content, len(content))
    reader.reader.ReadFromInputStringOn()
    dataset: pv.DataSet | pv.MultiBlock = reader.read()
    return dataset


def _unreadable(path: Path, text: str) -> InvalidMesh:
    """Return the exception for a file that a reader of VTK or pyvista refused with a text."""
    line = (text.strip().splitlines() or [""])[0].rstrip('.!"')
    if "automatically read by pyvista" in line:
        kind = repr(path.suffix) if path.suffix else "a name without an end"
        return InvalidMesh(
            f"expected a mesh file, got {str(path)!r}: no reader is known for {kind}; "
            "convert it to .ply, .obj or .stl"
        )
    if not line or re.match(r"Algorithm vtk|(VTKExecutionError: )?ERROR: In vtk", line):
        line = "it is damaged or of another format"
    return InvalidMesh(f"could not read {str(path)!r} as a mesh ({line}); export it again")
