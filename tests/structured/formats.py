"""The formats of which files are generated."""

from tests.structured.model import Format
from tests.structured.placed_files import gltf, threemf
from tests.structured.polygon_files import obj, off, ply, stl
from tests.structured.vtk_files import vtk, vtp, vts, vtu

FORMATS: dict[str, Format] = {
    "3mf": threemf,
    "gltf": gltf,
    "obj": obj,
    "off": off,
    "ply": ply,
    "stl": stl,
    "vtk": vtk,
    "vtp": vtp,
    "vts": vts,
    "vtu": vtu,
}
"""Function that makes a file from a random generator, by the name of the format."""
