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

FORKING = ("vtk", "vtp", "vts", "vtu")
"""Formats that VTK reads: the product forks a process for each file, which takes ten times as long."""

OWN_FILES = 4
"""Files of each format of our own readers for one file of each format in `FORKING`."""

TURNS = [name for turn in range(OWN_FILES) for name in FORMATS if turn == 0 or name not in FORKING]
"""Formats in the order in which a campaign reads files of them, again and again."""
