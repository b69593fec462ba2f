"""Our decals in VTK's own shader of an actor: its lights, scalars and edges stay."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.util.vtkConstants import VTK_OBJECT
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from decals.field.contact import Contact
from decals.render.decal_data import DecalData, library
from decals.render.parts import Rectangle
from decals.render.textures import ImageArray
from decals.render.tile import Picture
from decals.scenes.viewpoint import Floats
from decals.vtk.camera import matrix_of, vtk_projection
from decals.vtk.mapper import NORMALS, SmoothNormals, polygon_mapper
from decals.vtk.replacements import Additions, Place
from implicit_decals.shaders import compose

if TYPE_CHECKING:
    from decals.vtk.stage import Stage

POSITION, NORMAL, PLACE = "decalPositionVSOutput", "decalNormalVSOutput", "decalModel"
NO_SHIFT_SCALE = 0
UNIT_BOX = np.zeros(3), np.ones(3)

DECLARATIONS, BODY, COLOR = "//VTK::TCoord::Dec", "//VTK::TCoord::Impl", "//VTK::Color::Impl"
"""Tags behind which our code stands: where functions are declared, in main, and where colours are known."""

VERTEX_DECLARATION = f"""in vec3 decalNormalMC;
uniform mat4 {PLACE};
out vec3 {POSITION};
out vec3 {NORMAL};
"""
VERTEX = f"""  {POSITION} = ({PLACE} * vertexMC).xyz;
  {NORMAL} = transpose(inverse(mat3({PLACE}))) * decalNormalMC;
"""
GEOMETRY_DECLARATION = "".join(
    f"in vec3 {name}[];\nout vec3 {name.replace('VSOutput', 'GSOutput')};\n" for name in (POSITION, NORMAL)
)
GEOMETRY = "".join(
    f"    {name.replace('VSOutput', 'GSOutput')} = {name}[i];\n" for name in (POSITION, NORMAL)
)
FRAGMENT_DECLARATION = f"in vec3 {POSITION};\nin vec3 {NORMAL};\n"
PAINT = f"""
  vec4 decals = injected_decals({POSITION}, {NORMAL});
  diffuseColor = decal_over(diffuseColor, diffuseIntensity, decals);
  ambientColor = decal_over(ambientColor, ambientIntensity, decals);
"""


class Injection:
    """Decals on one of pyvista's actors; several may share a stage's coat.

    Parameters
    ----------
    stage
        Whose decals.
    actor
        An actor of polygons.
    follow
        Whether the decals are given in the actor's own coordinates and move with it.
    paint
        GLSL that changes VTK's colours, in place of PAINT: for tests.
    """

    def __init__(self, stage: Stage, actor: Any, *, follow: bool = False, paint: str = PAINT) -> None:
        self.actor, self._follow, self._paint = actor, follow, paint
        self._mapper = polygon_mapper(actor)
        self._normals = SmoothNormals()
        self._give_normals()
        self._mapper.SetVBOShiftScaleMethod(NO_SHIFT_SCALE)
        self._stage = weakref.ref(stage)
        self._additions = Additions(actor)
        self._known: tuple[Contact, bool] | None = None
        self._code: dict[Place, str] = {}
        self._written = False
        me = weakref.ref(self)

        def bind(_caller: object, _event: str, program: Any) -> None:
            alive = me()
            if alive is not None:
                alive.bind(program)

        bind.CallDataType = VTK_OBJECT  # type: ignore[attr-defined]  # as VTK asks for
        self._tag = self._mapper.AddObserver(vtkCommand.UpdateShaderEvent, bind)

    # -- once a frame -----------------------------------------------------------------------------------

    def prepare(self) -> None:
        """Bring mesh and shader up to date, before VTK draws the frame."""
        found = self._found()
        if found is None:
            self._erase()
            return
        self._give_normals()  # somebody may have given it other data
        stage, data, _ = found
        wanted = stage.contact, data.layered
        if wanted != self._known:
            self._known, self._code = wanted, _code(library(stage.contact, layered=data.layered), self._paint)
        self._additions.write(self._code)
        self._written = True

    def _give_normals(self) -> None:
        """Let the mesh have smooth normals, unless the injection of another stage gives them."""
        if self._normals.insert_before(self.actor.GetMapper()):
            self._mapper.MapDataArrayToVertexAttribute(
                "decalNormalMC", NORMALS, vtkDataObject.FIELD_ASSOCIATION_POINTS, -1
            )

    def finish(self) -> None:
        """Leave the shader to others, where other renderers draw the actor too."""
        if self.actor.GetNumberOfConsumers() > 1:
            self._erase()

    def _erase(self) -> None:
        """Leave the shader as it was."""
        self._additions.erase()
        self._written = False

    # -- whenever VTK draws the actor -------------------------------------------------------------------

    def bind(self, program: Any) -> None:
        """Give VTK's program what ours would have: decals, images, camera."""
        found = self._found() if self._written else None
        if found is None or not found[0].drawing:  # another renderer may draw the actor too
            return
        stage, data, images = found
        place = self._frame(stage)
        self._use_camera(stage, place)
        model = np.linalg.inv(place) @ matrix_of(self.actor)
        program.SetUniformMatrix(PLACE, _vtk_matrix(model))
        units = stage.applied.texture_units()
        numbers = data.bind(units[1:])
        images.use(units[0])
        numbers |= {"decal_images": units[0], "decal_mapping": int(stage.mapping)}
        for name, number in numbers.items():
            program.SetUniformi(name, number)
        stage.vtk_renderer.GetRenderWindow().GetState().ResetGLActiveTexture()

    def _found(self) -> tuple[Stage, DecalData, ImageArray] | None:
        """The stage and its decals, if there are any."""
        stage = self._stage()
        if stage is None or stage.scene is None:
            return None
        data, images = stage.renderer.uploads(stage.scene)
        return None if data is None or images is None else (stage, data, images)

    def _frame(self, stage: Stage) -> Floats:
        """Decals' space to world."""
        return matrix_of(self.actor) if self._follow else stage.frame()

    def _use_camera(self, stage: Stage, frame: Floats) -> None:
        """Fill the camera's block for the frame that VTK is drawing, which may be larger than the window."""
        x, y, width, height = stage.viewport()
        view = vtk_projection(stage.vtk_renderer, frame)
        whole = Picture.of(view, (width, height), UNIT_BOX)
        stage.camera.use(whole.part(Rectangle(-x, -y, width, height)))

    def release(self) -> None:
        """Leave the actor as it was."""
        self._erase()
        self._mapper.RemoveObserver(self._tag)
        if self._normals.leave(self.actor.GetMapper()):
            self._mapper.RemoveVertexAttributeMapping("decalNormalMC")


def _code(functions: str, paint: str) -> dict[Place, str]:
    """Our code for each stage of a shader, behind VTK's own."""
    text = compose("inject.glsl", slots={"functions": functions}, version=None).text
    return {
        ("Vertex", DECLARATIONS): VERTEX_DECLARATION,
        ("Vertex", BODY): VERTEX,
        ("Geometry", DECLARATIONS): GEOMETRY_DECLARATION,
        ("Geometry", BODY): GEOMETRY,
        ("Fragment", DECLARATIONS): FRAGMENT_DECLARATION + text,
        ("Fragment", COLOR): paint,
    }


def _vtk_matrix(matrix: Floats) -> vtkMatrix4x4:
    """Lay out a matrix as VTK hands it to OpenGL: columns first."""
    made = vtkMatrix4x4()
    made.DeepCopy(matrix.T.ravel().tolist())
    return made
