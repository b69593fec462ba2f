"""VTK's polygon mappers: code added to their shaders, and normals added to their meshes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import reference, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPointSet
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkRenderingCore import vtkDataSetMapper, vtkProp, vtkRenderer
from vtkmodules.vtkRenderingOpenGL2 import vtkGenericOpenGLRenderWindow

from decals.errors import InvalidScene
from decals.surfaces.normals import CREASE_ANGLE, split_at_creases, vertex_normals
from decals.surfaces.windings import MeshOrientation, turned_faces

ShaderTag = tuple[str, str]
"""A shader stage (Vertex, Geometry or Fragment), and a tag of VTK's template for it."""


@dataclass(frozen=True)
class Replacement:
    """Text in place of a tag, at its first occurrence or everywhere."""

    text: str
    everywhere: bool = False


class ShaderAdditions:
    """Code after tags of VTK's shader templates; tags and the replacements of others stay.

    Parameters
    ----------
    actor
        A vtkActor.
    """

    def __init__(self, actor: Any) -> None:
        self._actor = actor
        self._ours: dict[ShaderTag, Replacement] = {}
        self._theirs: dict[ShaderTag, Replacement | None] = {}

    def write(self, code: Mapping[ShaderTag, str]) -> None:
        """Set the added code; replacements that others made since stay."""
        for tag, text in code.items():
            present = self._read(tag)
            if present is None or present != self._ours.get(tag):
                self._theirs[tag] = present
            theirs = self._theirs[tag] or Replacement(tag[1])
            replacement = Replacement(f"{theirs.text}\n{text}", theirs.everywhere)
            if present != replacement:
                self._write(tag, replacement)
            self._ours[tag] = replacement

    def erase(self) -> None:
        """Remove the added code; replacements of others stay."""
        for tag, ours in self._ours.items():
            if self._read(tag) == ours:
                self._write(tag, self._theirs[tag])
        self._ours.clear()
        self._theirs.clear()

    def _read(self, tag: ShaderTag) -> Replacement | None:
        """Return the present replacement of a tag, or None."""
        shader = self._actor.GetShaderProperty()
        for number in range(shader.GetNumberOfShaderReplacements()):
            name, first, text, everywhere = (reference(value) for value in ("", False, "", False))
            shader.GetNthShaderReplacement(number, name, first, text, everywhere)
            if first and (shader.GetNthShaderReplacementTypeAsString(number), str(name)) == tag:
                return Replacement(str(text), bool(everywhere))
        return None

    def _write(self, tag: ShaderTag, replacement: Replacement | None) -> None:
        (stage, name), shader = tag, self._actor.GetShaderProperty()
        getattr(shader, f"Clear{stage}ShaderReplacement")(name, True)
        if replacement is not None:
            add = getattr(shader, f"Add{stage}ShaderReplacement")
            add(name, True, replacement.text, replacement.everywhere)


POLYGON_MAPPER = "vtkOpenGLPolyDataMapper"
"""Class of VTK's polygon mappers; its subclasses draw points, composites and more."""
NORMALS = "decal normals"
"""Name of the point data with unit normals, smooth between creases, as the renderer computes them."""

CELLS = "cells of triangles"
"""Name of the cell data with the cell that each triangle is a part of."""

KEPT_NORMALS = "normals before the split at creases"
"""Name of the point data with a mesh's own normals, while VTK splits it."""


def polygon_mapper(actor: Any) -> Any:
    """Return the vtkPolyDataMapper that draws an actor.

    Raises
    ------
    InvalidScene
        Another kind of mapper draws the actor.
    """
    if not isinstance(actor, vtkProp) or not hasattr(actor, "GetMapper"):
        raise InvalidScene(
            f"expected an actor to lay decals on, got {type(actor).__name__}; "
            "give what plotter.add_mesh returned"
        )
    mapper = actor.GetMapper()
    if isinstance(mapper, vtkDataSetMapper):
        if mapper.GetPolyDataMapper() is None:
            _prepare(mapper, actor)
        mapper = mapper.GetPolyDataMapper()
    if mapper is None or mapper.GetClassName() != POLYGON_MAPPER:
        raise InvalidScene(
            f"decals go onto actors that a vtkPolyDataMapper draws, got {type(actor.GetMapper()).__name__}; "
            "add the blocks of a composite, or the surface of other data, as meshes of their own"
        )
    return mapper


def _prepare(mapper: Any, actor: Any) -> None:
    """Make a vtkDataSetMapper create its inner mapper, by a rendering that is aborted."""
    window, renderer = vtkGenericOpenGLRenderWindow(), vtkRenderer()
    window.AddRenderer(renderer)
    window.SetAbortRender(1)
    mapper.Render(renderer, actor)


_Filter: Any = VTKPythonAlgorithmBase
"""VTK's Python algorithms have no types."""


class SmoothNormals(_Filter):  # type: ignore[misc]
    """A filter before a mapper that adds the point data NORMALS; the pipeline before it stays.

    Points of polygons at a crease are split, as the renderer splits them.

    The output has its own points. VTK uploads an array of points once for all mappers of a window, shifted
    and scaled as its first mapper asks, but decals need the unchanged points.

    Parameters
    ----------
    crease_angle
        Angle in degrees from which edges are sharp.
    orientation
        Which way the faces wind for the normals; the mesh keeps its own winding.
    """

    def __init__(
        self,
        crease_angle: float = CREASE_ANGLE,
        orientation: MeshOrientation = MeshOrientation.OUTWARD,
    ) -> None:
        super().__init__(nInputPorts=1, inputType="vtkDataSet", nOutputPorts=1, outputType="vtkDataSet")
        self._crease_angle, self._orientation = crease_angle, orientation
        self._output: pv.DataSet | None = None

    def insert_before(self, mapper: Any) -> bool:
        """Insert the filter before a mapper, or return False if such a filter is there already."""
        connection = mapper.GetInputConnection(0, 0)
        if connection is None or isinstance(connection.GetProducer(), SmoothNormals):
            return False
        self.SetInputConnection(connection)
        mapper.SetInputConnection(self.GetOutputPort())
        return True

    def remove_from(self, mapper: Any) -> bool:
        """Remove the filter before a mapper, or return False if it is not there."""
        connection = mapper.GetInputConnection(0, 0)
        if connection is None or connection.GetProducer() is not self:
            return False
        mapper.SetInputConnection(self.GetInputConnection(0, 0))
        return True

    def RequestDataObject(self, _request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Put out the type of data that comes in."""
        given = self.GetInputData(inputs, 0, 0)
        made = outputs.GetInformationObject(0).Get(vtkDataObject.DATA_OBJECT())
        if given is not None and (made is None or made.GetClassName() != given.GetClassName()):
            self._output = pv.wrap(given.NewInstance())  # kept, as pyvista's pickers return it
            outputs.GetInformationObject(0).Set(vtkDataObject.DATA_OBJECT(), self._output)
        return 1

    def RequestData(self, _request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Copy the input, split polygons at creases, and add the normals."""
        out, given = pv.wrap(self.GetOutputData(outputs, 0)), pv.wrap(self.GetInputData(inputs, 0, 0))
        turned = turned_cells(given, self._orientation)
        out.ShallowCopy(split_polygons(given, self._crease_angle, turned))
        if isinstance(out, vtkPointSet) and out.GetPoints() is not None:
            points = vtkPoints()
            points.DeepCopy(out.GetPoints())
            out.SetPoints(points)
        normals: Any = smooth_normals(out, turned)
        array = pv.convert_array(normals, name=NORMALS)
        out.GetPointData().AddArray(array)
        return 1


def turned_cells(dataset: pv.DataSet, orientation: MeshOrientation) -> NDArray[np.bool_]:
    """Return the cells of a dataset's surface to turn for an orientation, ``bool[n]``; see `wind`."""
    surface, _ = surface_of(dataset)
    turned = np.zeros(surface.n_cells, np.bool_)
    triangles, cells = triangles_of(surface)
    if len(triangles):
        turned[cells[turned_faces(np.asarray(surface.points, np.float32), triangles, orientation)]] = True
    return turned


def split_polygons(
    dataset: pv.DataSet, crease_angle: float = CREASE_ANGLE, turned: NDArray[np.bool_] | None = None
) -> pv.DataSet:
    """Return polygons with a point for each side of a crease; any other dataset as it is.

    Some polygons may wind in the opposite direction of the others; they are ``turned``.
    """
    if not isinstance(dataset, pv.PolyData) or dataset.GetNumberOfPolys() == 0:
        return dataset
    mixed = turned is not None and turned.any() and not turned.all() and not dataset.n_strips
    alike = _with_turned_polygons(dataset, turned) if turned is not None and mixed else dataset
    triangles, _ = triangles_of(alike)
    split = split_at_creases(np.asarray(dataset.points, np.float32), triangles, crease_angle)
    if len(split.rows) == dataset.n_points:
        return dataset
    copy = alike.copy(deep=False)
    normals = copy.GetPointData().GetNormals()
    if normals is not None:  # VTK's filter would replace them
        kept = normals.NewInstance()
        kept.ShallowCopy(normals)
        kept.SetName(KEPT_NORMALS)
        copy.GetPointData().RemoveArray(normals.GetName())
        copy.GetPointData().AddArray(kept)
    sides = vtkPolyDataNormals()
    sides.SetInputData(copy)
    sides.SetFeatureAngle(crease_angle)
    sides.SplittingOn()
    sides.ConsistencyOff()
    sides.Update()
    out = pv.PolyData(sides.GetOutput())
    out.GetPointData().RemoveArray("Normals")
    if normals is not None:
        kept = out.GetPointData().GetArray(KEPT_NORMALS)
        kept.SetName(normals.GetName())
        out.GetPointData().SetNormals(kept)
    return _with_turned_polygons(out, turned) if turned is not None and mixed else out


def _with_turned_polygons(surface: pv.PolyData, turned: NDArray[np.bool_]) -> pv.PolyData:
    """Return polygons of which some wind in the opposite direction."""
    offsets, corners = np.asarray(surface.face_offsets), np.array(surface.face_connectivity)
    first = surface.n_verts + surface.n_lines
    for polygon in np.flatnonzero(turned[first : first + len(offsets) - 1]):
        start, end = offsets[polygon : polygon + 2]
        corners[start:end] = corners[start:end][::-1]
    copy = surface.copy(deep=False)
    cells = pv.CellArray.from_arrays(offsets, corners)
    copy.SetPolys(cells)
    return copy


def smooth_normals(dataset: pv.DataSet, turned: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
    """Return smooth normals at the points of a dataset, float32, shape (n, 3); zero inside a solid.

    Cells that are ``turned`` wind in the opposite direction for that.
    """
    normals = np.zeros((dataset.n_points, 3), np.float32)
    surface, where = surface_of(dataset)
    triangles, cells = triangles_of(surface)
    if len(triangles):
        if turned is not None:
            triangles = np.where(turned[cells][:, None], triangles[:, ::-1], triangles)
        normals[where] = vertex_normals(np.asarray(surface.points, np.float32), triangles)
    return normals


def triangles_of(surface: pv.PolyData) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the triangles of the polygons of a surface, and the cell of each."""
    numbered = pv.PolyData()
    numbered.CopyStructure(surface)
    numbered.cell_data[CELLS] = np.arange(surface.n_cells)
    triangulated = numbered.triangulate()
    triangles = np.ascontiguousarray(triangulated.regular_faces, np.int32)
    cells = np.asarray(triangulated.cell_data[CELLS])
    return triangles, cells[len(cells) - len(triangles) :]


def surface_of(dataset: pv.DataSet) -> tuple[pv.PolyData, Any]:
    """Return the outer faces, and the indices of their points in the dataset."""
    if isinstance(dataset, pv.PolyData):
        return dataset, slice(None)
    surface = dataset.extract_surface(algorithm="dataset_surface", pass_pointid=True)
    return surface, np.asarray(surface.point_data["vtkOriginalPointIds"])
