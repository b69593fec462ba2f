"""PLY, STL and VTP files: all parts as one mesh."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blobtree.pyvista_views import xml_bytes
from decals.baking.parts import Baked, Part
from decals.baking.pictures import png_bytes
from decals.surfaces.windings import Triangles

if TYPE_CHECKING:
    import pyvista as pv

STL_HEADER = b"Implicit Decals"
STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_PLY_TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int"}


def ply_files(baked: Baked, stem: str) -> dict[str, bytes]:
    """Return a binary PLY file with normals, colours and attributes, and its texture if it has one.

    Attributes keep their names; those of several columns have a number behind it.
    """
    mesh, picture = baked.merged(), f"{stem}_color.png"
    columns = _columns(("x", "y", "z"), mesh.vertices) | _columns(("nx", "ny", "nz"), mesh.normals)
    colors = mesh.color_bytes
    columns |= {} if colors is None else _columns(("red", "green", "blue"), colors)
    columns |= {} if mesh.uv is None else _columns(("s", "t"), mesh.uv)
    for name, values in mesh.attributes.items():
        wide = values.reshape(len(values), -1)
        names = [f"{name}_{number}" for number in range(wide.shape[1])] if wide.shape[1] > 1 else [name]
        columns |= _columns(names, wide)
    rows = np.zeros(
        len(mesh.vertices), [(name, f"<{column.dtype.str[1:]}") for name, column in columns.items()]
    )
    for name, column in columns.items():
        rows[name] = column
    faces = np.zeros(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = ["ply", "format binary_little_endian 1.0", "comment Implicit Decals"]
    header += [] if baked.maps is None else [f"comment TextureFile {picture}"]
    header += [f"element vertex {len(rows)}"]
    header += [f"property {_PLY_TYPES[column.dtype.str[1:]]} {name}" for name, column in columns.items()]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    files = {"": "\n".join(header).encode() + rows.tobytes() + faces.tobytes()}
    return files if baked.maps is None else files | {picture: png_bytes(baked.maps.color)}


def _columns(names: Any, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    return dict(zip(names, values.T, strict=True))


def stl_bytes(baked: Baked) -> bytes:
    """Return a binary STL file, which has float32 positions alone."""
    mesh = baked.merged()
    triangles = Triangles.of(mesh.vertices, mesh.faces)
    rows = np.zeros(len(mesh.faces), STL_FACE)
    rows["corners"] = triangles.corners
    rows["normal"] = triangles.crosses / np.maximum(triangles.doubled_areas, 1e-300)[:, None]
    return STL_HEADER.ljust(80, b"\0") + np.uint32(len(rows)).tobytes() + rows.tobytes()


def vtp_file(baked: Baked) -> bytes:
    """Return a VTP file with normals, colours, attributes and the number of the object of each face."""
    mesh = baked.merged()
    surface = as_polydata(mesh)
    counts = [len(part.faces) for part in baked.parts]
    surface.cell_data["object"] = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    surface.GetFieldData().AddArray(_names(baked))
    return xml_bytes(surface)


def _names(baked: Baked) -> Any:
    """Return the names of the parts as an array of VTK; pyvista refuses letters besides ASCII."""
    from vtkmodules.vtkCommonCore import vtkStringArray

    names = vtkStringArray()
    names.SetName("object_names")
    for part in baked.parts:
        names.InsertNextValue(part.name)
    return names


def as_polydata(part: Part) -> "pv.PolyData":
    """Return a part as `pyvista.PolyData` with normals, and with what else it has."""
    import pyvista as pv

    arrays: tuple[Any, Any] = part.vertices, part.faces
    surface: pv.PolyData = pv.PolyData.from_regular_faces(*arrays)
    normals: Any = part.normals
    surface.point_data.active_normals = normals
    if part.color_bytes is not None:
        surface.point_data["RGB"] = part.color_bytes
    if part.uv is not None:
        coordinates: Any = part.uv
        surface.active_texture_coordinates = coordinates
    for name, values in part.attributes.items():
        surface.point_data[name] = values
    return surface
