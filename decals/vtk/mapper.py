"""The mapper with which VTK really draws an actor of polygons, and the normals that decals want there."""

from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkRenderingCore import vtkDataSetMapper, vtkProp, vtkRenderer
from vtkmodules.vtkRenderingOpenGL2 import vtkGenericOpenGLRenderWindow

from decals.errors import InvalidScene
from decals.render.mesh import vertex_normals

DRAWS_POLYGONS = "vtkOpenGLPolyDataMapper"
"""What VTK's factory makes of a vtkPolyDataMapper; its subclasses draw points, composites and more."""
NORMALS = "decal normals"
"""Point data that what is drawn under decals gets: smooth unit normals, as our renderer has them."""


def polygon_mapper(actor: Any) -> Any:
    """Give the vtkPolyDataMapper that draws an actor.

    Raises
    ------
    InvalidScene
        It is drawn by another kind of mapper.
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
    if mapper is None or mapper.GetClassName() != DRAWS_POLYGONS:
        raise InvalidScene(
            f"decals go onto actors that a vtkPolyDataMapper draws, got {type(actor.GetMapper()).__name__}; "
            "add the blocks of a composite, or the surface of other data, as meshes of their own"
        )
    return mapper


def _prepare(mapper: Any, actor: Any) -> None:
    """Let a vtkDataSetMapper make its inner mapper, as when it is first drawn: in a window that gives up."""
    window, renderer = vtkGenericOpenGLRenderWindow(), vtkRenderer()
    window.AddRenderer(renderer)
    window.SetAbortRender(1)
    mapper.Render(renderer, actor)


_Filter: Any = VTKPythonAlgorithmBase
"""VTK's Python side has no types."""


class SmoothNormals(_Filter):  # type: ignore[misc]
    """A filter before a mapper that adds point data NORMALS; whatever comes from upstream stays alive."""

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, inputType="vtkDataSet", nOutputPorts=1, outputType="vtkDataSet")

    def insert_before(self, mapper: Any) -> bool:
        """Stand between a mapper and what it draws; False where one of us stands there already."""
        connection = mapper.GetInputConnection(0, 0)
        if connection is None or isinstance(connection.GetProducer(), SmoothNormals):
            return False
        self.SetInputConnection(connection)
        mapper.SetInputConnection(self.GetOutputPort())
        return True

    def leave(self, mapper: Any) -> bool:
        """Let the mapper draw what it drew before; whether it was we who stood there."""
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
            outputs.GetInformationObject(0).Set(vtkDataObject.DATA_OBJECT(), given.NewInstance())
        return 1

    def RequestData(self, _request: Any, inputs: Any, outputs: Any) -> int:  # noqa: N802
        """Copy, and add the normals."""
        out = self.GetOutputData(outputs, 0)
        out.ShallowCopy(self.GetInputData(inputs, 0, 0))
        normals: Any = smooth_normals(pv.wrap(out))
        array = pv.convert_array(normals, name=NORMALS)
        out.GetPointData().AddArray(array)
        return 1


def smooth_normals(dataset: pv.DataSet) -> NDArray[np.float32]:
    """Normals ``float32[n, 3]`` at the points of a dataset, as our renderer has them; zero inside a solid."""
    normals = np.zeros((dataset.n_points, 3), np.float32)
    surface, where = _surface(dataset)
    triangles = np.ascontiguousarray(surface.triangulate().regular_faces, np.int32)
    if len(triangles):
        normals[where] = vertex_normals(np.asarray(surface.points, np.float32), triangles)
    return normals


def _surface(dataset: pv.DataSet) -> tuple[pv.PolyData, Any]:
    """Outer faces, and which points of the dataset theirs are."""
    if isinstance(dataset, pv.PolyData):
        return dataset, slice(None)
    surface = dataset.extract_surface(algorithm="dataset_surface", pass_pointid=True)
    return surface, np.asarray(surface.point_data["vtkOriginalPointIds"])
