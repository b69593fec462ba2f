"""Meshes as pyvista objects; these functions import pyvista late."""

import errno
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int32Array
from blobtree.errors import MissingPackage
from blobtree.files import replacing, write_atomically

if TYPE_CHECKING:
    import pyvista as pv

STL_HEADER, STL_FACE = 84, 50
"""Bytes of the header and of a triangle of a binary STL file."""

PLY_SIZES = {"uchar": 1, "float": 4, "int": 4}
"""Bytes of the types in PLY files that VTK writes."""


class ColoredMesh(Protocol):
    """Mesh of these functions, a `blobtree.Mesh`."""

    @property
    def vertices(self) -> Float32Array: ...  # noqa: D102
    @property
    def faces(self) -> Int32Array: ...  # noqa: D102
    @property
    def normals(self) -> Float32Array: ...  # noqa: D102
    @property
    def colors(self) -> Float32Array: ...  # noqa: D102
    @property
    def sheet_counts(self) -> NDArray[np.uint8] | None: ...  # noqa: D102


def to_polydata(mesh: ColoredMesh) -> "pv.PolyData":
    """Return a mesh as `pyvista.PolyData` with active normals, "RGB" (uint8) and any "sheet_counts"."""
    require_pyvista()
    import pyvista as pv

    if len(mesh.vertices) == 0:  # pyvista refuses empty arrays
        return pv.PolyData()
    surface = polydata_of(mesh.vertices, mesh.faces)
    surface.point_data["RGB"] = np.rint(np.clip(mesh.colors, 0.0, 1.0) * 255.0).astype(np.uint8)
    normals: NDArray[Any] = mesh.normals
    surface.point_data.active_normals = normals
    if mesh.sheet_counts is not None:
        surface.point_data["sheet_counts"] = mesh.sheet_counts
    return surface


def to_image_data(
    name: str, values: Float32Array, origin: tuple[float, float, float], spacing: float
) -> "pv.ImageData":
    """Return values ``float32[nx, ny, nz]`` at the points of a grid as `pyvista.ImageData`."""
    require_pyvista()
    import pyvista as pv

    grid = pv.ImageData(dimensions=values.shape, spacing=3 * (spacing,), origin=origin)
    grid.point_data[name] = values.ravel(order="F")
    return grid


MESH_SUFFIXES = (".ply", ".obj", ".stl", ".vtp")
"""Formats of `write_polydata`."""


def write_polydata(path: str | os.PathLike[str], surface: "pv.PolyData") -> None:
    """Write a surface of triangles to a file, whole or not at all.

    Parameters
    ----------
    path : str or path-like
        The file; its suffix is the format: ply (with "RGB", if the surface has it), obj, stl or vtp.
    surface : pyvista.PolyData
        The surface.

    Raises
    ------
    UnusableFile
        The file cannot be written in full; an existing file stays as it was.
    """
    if Path(path).suffix.lower() == ".vtp":
        write_atomically(path, xml_bytes(surface))
        return
    from blobtree.vtk_errors import vtk_errors

    copy = surface.copy(deep=False)  # pyvista adds normals to the surface that it saves
    with replacing(path) as temporary:
        texture = "RGB" if temporary.suffix.lower() == ".ply" and "RGB" in copy.point_data else None
        with vtk_errors() as errors:
            copy.save(temporary, texture=texture)
        if errors or not _is_whole(temporary, copy):
            raise OSError(errno.ENOSPC, "the file could not be written in full")


def _is_whole(path: Path, surface: "pv.PolyData") -> bool:
    """Return True if a file has the length and the end that its format gives the surface.

    VTK's writers do not report every failure of the disk.
    """
    content = path.read_bytes()
    match path.suffix.lower():
        case ".stl":
            return len(content) == STL_HEADER + STL_FACE * surface.n_cells
        case ".obj":
            lines = content.count(b"\nf ") + content.startswith(b"f ")
            return content.endswith(b"\n") and lines == surface.n_cells
        case _:
            header, found, body = content.partition(b"end_header\n")
            return bool(found) and len(body) == _ply_length(header.decode("ascii"), surface)


def xml_bytes(dataset: "pv.PolyData | pv.ImageData") -> bytes:
    """Return a VTP or VTI file; on a full disk, VTK's own writing to the file kills the process."""
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLPolyDataWriter

    writer = vtkXMLPolyDataWriter() if dataset.IsA("vtkPolyData") else vtkXMLImageDataWriter()
    writer.SetInputData(dataset)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return writer.GetOutputString().encode("ascii")


def _ply_length(header: str, surface: "pv.PolyData") -> int:
    """Return the bytes of the rows that the header of a binary PLY file announces."""
    sizes = [
        PLY_SIZES[line.split()[1]] for line in header.splitlines() if re.match(r"property (?!list)", line)
    ]
    (count, index) = re.findall(r"property list (\w+) (\w+)", header)[0]
    return surface.n_points * sum(sizes) + surface.n_cells * (PLY_SIZES[count] + 3 * PLY_SIZES[index])


def require_pyvista() -> None:
    """Raise `MissingPackage` unless pyvista is installed."""
    try:
        import pyvista  # noqa: F401  (tests the installation)
    except ImportError as error:
        raise MissingPackage(
            "this needs pyvista, which is not installed; run: pip install pyvista"
        ) from error


def polydata_of(points: NDArray[Any], faces: NDArray[Any]) -> "pv.PolyData":
    """Return polygons of equal numbers of corners."""
    import pyvista as pv

    surface: pv.PolyData = pv.PolyData.from_regular_faces(points, faces)
    return surface
