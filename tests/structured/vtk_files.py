"""VTK's own files, legacy and XML, of surfaces and grids; some have broken references or counts."""

import random
import re
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkStructuredGridWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import (
    vtkXMLPolyDataWriter,
    vtkXMLStructuredGridWriter,
    vtkXMLUnstructuredGridWriter,
)

from tests.structured.model import PolygonMesh, StructuredFile, random_mesh
from tests.structured.text import ODD_WORDS, damaged

BROKEN = 0.5
"""Share of broken files."""

_WRITERS: dict[str, tuple[type[Any], type[Any]]] = {
    "polydata": (vtkPolyDataWriter, vtkXMLPolyDataWriter),
    "grid": (vtkUnstructuredGridWriter, vtkXMLUnstructuredGridWriter),
    "structured": (vtkStructuredGridWriter, vtkXMLStructuredGridWriter),
}


def vtp(chance: random.Random) -> StructuredFile:
    """Return an XML file of a surface."""
    mesh = random_mesh(chance)
    return _finished(".vtp", _xml("polydata", _surface(mesh), chance), mesh, chance)


def vtu(chance: random.Random) -> StructuredFile:
    """Return an XML file of an unstructured grid of polygons."""
    mesh = random_mesh(chance)
    return _finished(".vtu", _xml("grid", _surface(mesh).cast_to_unstructured_grid(), chance), mesh, chance)


def vts(chance: random.Random) -> StructuredFile:
    """Return an XML file of a structured grid."""
    mesh, grid = _structured(chance)
    return _finished(".vts", _xml("structured", grid, chance), mesh, chance)


def vtk(chance: random.Random) -> StructuredFile:
    """Return a legacy file of a surface or a grid."""
    kind = chance.choice(list(_WRITERS))
    mesh, dataset = _structured(chance) if kind == "structured" else (random_mesh(chance), None)
    surface = dataset or _surface(mesh)
    writer = _WRITERS[kind][0]()
    writer.SetInputData(surface.cast_to_unstructured_grid() if kind == "grid" else surface)
    writer.SetFileType(chance.choice([1, 2]))
    writer.SetFileVersion(chance.choice([42, 51]))
    writer.WriteToOutputStringOn()
    writer.Write()
    return _finished(".vtk", _bytes(writer.GetOutputStdString()), mesh, chance)


def _surface(mesh: PolygonMesh) -> pv.PolyData:
    loops = [np.array(loop) for loop in mesh.polygons]
    surface: pv.PolyData = pv.PolyData.from_irregular_faces(mesh.points, loops)
    return surface


def _structured(chance: random.Random) -> tuple[PolygonMesh, pv.StructuredGrid]:
    """Return a flat grid of quadrilaterals, scaled and moved."""
    columns, rows = chance.randint(2, 5), chance.randint(2, 5)
    x, y = np.meshgrid(
        np.arange(columns) * chance.uniform(0.1, 9.0), np.arange(rows) + chance.uniform(-9.0, 9.0)
    )
    points = np.stack([x.ravel(), y.ravel(), x.ravel() * chance.uniform(-1.0, 1.0)], axis=1)
    grid = pv.StructuredGrid()
    grid.points = points
    grid.dimensions = (columns, rows, 1)
    corners = [row * columns + column for row in range(rows - 1) for column in range(columns - 1)]
    return PolygonMesh(points, [[a, a + 1, a + columns + 1, a + columns] for a in corners]), grid


def _xml(kind: str, dataset: Any, chance: random.Random) -> bytes:
    writer = _WRITERS[kind][1]()
    writer.SetInputData(dataset)
    writer.SetDataMode(chance.choice([0, 1, 2]))
    writer.SetCompressorType(chance.choice([0, 1, 2]))
    writer.SetHeaderType(chance.choice([32, 64]))
    writer.SetEncodeAppendedData(chance.choice([0, 1]))
    writer.SetByteOrder(chance.choice([0, 1]))
    writer.WriteToOutputStringOn()
    writer.Write()
    return _bytes(writer.GetOutputString())


def _bytes(text: str | bytes) -> bytes:
    """Return what a writer has written: VTK gives text as str if it can be decoded."""
    return text.encode() if isinstance(text, str) else text


def _finished(suffix: str, content: bytes, mesh: PolygonMesh, chance: random.Random) -> StructuredFile:
    """Return a file as it is, or with a broken count, offset or reference, or with damage of other kinds."""
    if chance.random() >= BROKEN:
        return StructuredFile(suffix, content, mesh)
    numbers = list(re.finditer(rb"(?<=[\s\"])-?\d+(?=[\s\"])", content))
    if numbers and chance.random() < 0.6:
        found = chance.choice(numbers)
        word = chance.choice([*ODD_WORDS[:6], b"%d" % (int(found[0]) + chance.choice([-2, -1, 1, 2]))])
        return StructuredFile(suffix, content[: found.start()] + word + content[found.end() :], None)
    return StructuredFile(suffix, damaged(content, chance), None)
