"""Decals in VTK's shaders of actors, whose lights, scalars and edges stay."""

from __future__ import annotations

import weakref
from contextlib import AbstractContextManager
from typing import Any, Protocol

import numpy as np
from vtkmodules.util.vtkConstants import VTK_OBJECT
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from blobtree._typing import Float64Array
from blobtree.validation import describe
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.hosts.code import Code, code_of
from decals.index.editor import DecalEditor
from decals.receivers import EVERYTHING, codes_of, surface_mask
from decals.rendering import Drawing, Renderer, SceneLike
from decals.rendering.decal_data import DecalData
from decals.rendering.decal_library import Form
from decals.rendering.image_array import ImageArray
from decals.rendering.viewpoint import Projection
from decals.scenes.cover import as_scene
from decals.scenes.origin import WORLD
from decals.scenes.scene import Scene
from decals.shaders import compose
from decals.surfaces.normals import CREASE_ANGLE
from decals.surfaces.windings import MeshOrientation
from decals.vtk.actor_object import actor_object
from decals.vtk.adapters import matrix_of, vtk_projection
from decals.vtk.mapper import NORMALS, ShaderAdditions, ShaderTag, SmoothNormals, polygon_mapper

POSITION, NORMAL, MODEL = "decalPositionVSOutput", "decalNormalVSOutput", "decalModel"
"""Names of the shader variables: varyings, and the matrix from the actor to the decals."""

EYE = "decalEye"
"""Name of the uniform with the eye and 1; in a parallel projection, with the way to the eye and 0."""

PREFIX = "decal_"
"""Beginning of the names of the decals' code."""

NO_SHIFT_SCALE = 0
"""VTK's option to upload vertices without shift and scale."""

DECLARATIONS, BODY, COLOR = "//VTK::TCoord::Dec", "//VTK::TCoord::Impl", "//VTK::Color::Impl"
"""Tags of VTK's shader templates: declarations, the body of main, and the point where colours are known."""

VERTEX_DECLARATION = f"""in vec3 decalNormalMC;
uniform mat4 {MODEL};
out vec3 {POSITION};
out vec3 {NORMAL};
"""
VERTEX = f"""  {POSITION} = ({MODEL} * vertexMC).xyz;
  {NORMAL} = transpose(inverse(mat3({MODEL}))) * decalNormalMC;
"""
GEOMETRY_DECLARATION = "".join(
    f"in vec3 {name}[];\nout vec3 {name.replace('VSOutput', 'GSOutput')};\n" for name in (POSITION, NORMAL)
)
GEOMETRY = "".join(
    f"    {name.replace('VSOutput', 'GSOutput')} = {name}[i];\n" for name in (POSITION, NORMAL)
)
FRAGMENT_DECLARATION = f"in vec3 {POSITION};\nin vec3 {NORMAL};\nuniform vec4 {EYE};\n"
PAINT = f"""
  vec4 decals = decal_color({POSITION}, {NORMAL}, {EYE}.w * {POSITION} - {EYE}.xyz);
  diffuseColor = decal_over(diffuseColor, diffuseIntensity, decals);
  ambientColor = decal_over(ambientColor, ambientIntensity, decals);
"""


class InjectionTarget(Protocol):
    """What injected decals read of a subplot."""

    @property
    def vtk_renderer(self) -> Any: ...  # noqa: D102
    @property
    def scene(self) -> SceneLike | None: ...  # noqa: D102
    @property
    def renderer(self) -> Renderer: ...  # noqa: D102
    @property
    def applied(self) -> InjectedDecals: ...  # noqa: D102
    @property
    def drawing(self) -> Drawing: ...  # noqa: D102
    def world_matrix(self) -> Float64Array: ...  # noqa: D102
    def current(self) -> AbstractContextManager[None]: ...  # noqa: D102
    def current_if_present(self) -> AbstractContextManager[None]: ...  # noqa: D102


class Injection:
    """The decals of a subplot in the shader of one actor.

    Parameters
    ----------
    subplot
        The subplot.
    actor
        An actor of polygons.
    follow
        If True, decals are in the actor's coordinates and move with it.
    labels
        Labels of the actor, for receivers of decals; None if all decals lie on it.
    crease_angle
        Angle in degrees from which edges are sharp.
    orientation
        Which way the faces wind for decals.
    paint
        GLSL that changes VTK's colours. Default: PAINT; tests use others.
    """

    def __init__(
        self,
        subplot: InjectionTarget,
        actor: Any,
        *,
        follow: bool = False,
        labels: tuple[str, ...] | None = None,
        crease_angle: float = CREASE_ANGLE,
        orientation: MeshOrientation = MeshOrientation.OUTWARD,
        paint: str = PAINT,
    ) -> None:
        self.actor, self._follow, self._labels, self._paint = actor, follow, labels, paint
        self._mapper = polygon_mapper(actor)
        self._shape: dict[str, Any] = {"crease_angle": crease_angle, "orientation": orientation}
        self._normals = SmoothNormals(**self._shape)
        self._add_normals()
        self._mapper.SetVBOShiftScaleMethod(NO_SHIFT_SCALE)
        self._subplot = weakref.ref(subplot)
        self._additions = ShaderAdditions(actor)
        self._code: Code | None = None
        injection = weakref.ref(self)

        def bind(_caller: object, _event: str, program: Any) -> None:
            alive = injection()
            if alive is not None:
                alive.bind(program)

        bind.CallDataType = VTK_OBJECT  # type: ignore[attr-defined]  # VTK reads it
        self._tag = self._mapper.AddObserver(vtkCommand.UpdateShaderEvent, bind)

    # -- once a frame -----------------------------------------------------------------------------------

    def begin_frame(self) -> None:
        """Update mesh and shader before VTK draws the frame."""
        source = self._source()
        if source is None:
            self._erase()
            return
        self._add_normals()  # the mapper's input may have been replaced
        subplot, data, _ = source
        form = Form(subplot.drawing.contact, data.layered, data.limited, data.nested)
        self._code = code_of(form, "330 core", "fragment", PREFIX)  # computed once for each form
        self._additions.write(_additions(self._code.text, self._paint))

    def _add_normals(self) -> None:
        """Add smooth normals to the mesh, unless the injection of another subplot has added them."""
        if self._normals.insert_before(self.actor.GetMapper()):
            self._mapper.MapDataArrayToVertexAttribute(
                "decalNormalMC", NORMALS, vtkDataObject.FIELD_ASSOCIATION_POINTS, -1
            )

    def end_frame(self) -> None:
        """Restore the shader if other renderers draw the actor too."""
        if self.actor.GetNumberOfConsumers() > 1:
            self._erase()

    def _erase(self) -> None:
        """Restore the shader."""
        self._additions.erase()
        self._code = None

    # -- whenever VTK draws the actor -------------------------------------------------------------------

    def bind(self, program: Any) -> None:
        """Give decals, images and the eye to VTK's program."""
        code = self._code
        source = self._source() if code is not None else None
        if code is None or source is None or not source[0].applied.in_frame:
            return  # another renderer draws the actor
        subplot, data, images = source
        world = self._world_matrix(subplot)
        program.SetUniform4f(EYE, _eye(vtk_projection(subplot.vtk_renderer, world)))
        model = np.linalg.inv(world) @ matrix_of(self.actor)
        program.SetUniformMatrix(MODEL, _vtk_matrix(model))
        units = subplot.applied.texture_units()
        uniforms = data.bind(units[1 : 1 + data.texture_count])
        images.use(units[0])
        rules = subplot.drawing
        uniforms |= {"decal_images": units[0], "decal_mapping": int(rules.mapping)}
        uniforms["surface_receivers"] = self._mask(subplot)
        names = code.textures | code.uniforms
        for name in uniforms.keys() & names.keys():
            program.SetUniformi(names[name], uniforms[name])
        program.SetUniformf(names["decal_stiffness"], rules.stiffness)
        subplot.vtk_renderer.GetRenderWindow().GetState().ResetGLActiveTexture()

    def _source(self) -> tuple[InjectionTarget, DecalData, ImageArray] | None:
        """Return the subplot, its decals and its images, or None if there are no decals."""
        subplot = self._subplot()
        if subplot is None or subplot.scene is None:
            return None
        data, images = subplot.renderer.uploads(subplot.scene)
        return None if data is None or images is None else (subplot, data, images)

    def _mask(self, subplot: InjectionTarget) -> int:
        """Return the mask of the actor; without labels, all decals lie on it."""
        if self._labels is None or subplot.scene is None:
            return EVERYTHING
        return surface_mask(self._labels, subplot.scene.decals.receiver_table)

    def _world_matrix(self, subplot: InjectionTarget) -> Float64Array:
        """Return the matrix from the decals' space to the world."""
        return matrix_of(self.actor) if self._follow else subplot.world_matrix()

    def as_scene(self) -> tuple[Scene, Float64Array] | None:
        """Return the actor as an object under its decals, and the matrix from it to the world.

        None without polygons or without decals.
        """
        subplot = self._subplot()
        if subplot is None or subplot.scene is None:
            return None
        scene, world = subplot.scene, self._world_matrix(subplot)
        model = np.linalg.inv(world) @ matrix_of(self.actor)
        item = actor_object(self.actor, self._mapper, model, origin=WORLD, **self._shape)
        if item is None:
            return None
        rows = scene.decals.decals if isinstance(scene.decals, DecalEditor) else scene.decals
        bits = codes_of(rows.receivers, rows.receiver_table)
        rows = rows[np.flatnonzero(self._mask(subplot) >> bits & 1)].replace(receivers=None)
        return as_scene(item).replace(decals=rows, images=scene.images, drawing=subplot.drawing), world

    def release(self) -> None:
        """Restore the actor."""
        self._erase()
        self._mapper.RemoveObserver(self._tag)
        if self._normals.remove_from(self.actor.GetMapper()):
            self._mapper.RemoveVertexAttributeMapping("decalNormalMC")


def _eye(projection: Projection) -> tuple[float, ...]:
    """Return the uniform `EYE` of a projection."""
    rays = projection.rays(1, 1)
    return (*(-rays.corner if rays.parallel else rays.origin).tolist(), float(not rays.parallel))


def _additions(decals: str, paint: str) -> dict[ShaderTag, str]:
    """Return our code for each tag of VTK's shader templates."""
    over = compose("injected_decals.glsl", version=None).text
    return {
        ("Vertex", DECLARATIONS): VERTEX_DECLARATION,
        ("Vertex", BODY): VERTEX,
        ("Geometry", DECLARATIONS): GEOMETRY_DECLARATION,
        ("Geometry", BODY): GEOMETRY,
        ("Fragment", DECLARATIONS): FRAGMENT_DECLARATION + decals + over,
        ("Fragment", COLOR): paint,
    }


def _vtk_matrix(matrix: Float64Array) -> vtkMatrix4x4:
    """Return a matrix in the layout that VTK uploads: columns first."""
    result = vtkMatrix4x4()
    result.DeepCopy(matrix.T.ravel().tolist())
    return result


NOT_WALKED = (
    "mapping: expected 'corrected' or 'chord' with decals applied to actors, got 'walked', "
    "which walks over the objects of the scene; add the mesh with plotter.decals.add_mesh instead"
)

INJECTED_TEXTURES = 6
"""Texture units of an injected shader: images, records, limits, and the three arrays of the index."""


class InjectedDecals:
    """The injections of one subplot, and the texture units that they share.

    Parameters
    ----------
    subplot
        The subplot.

    Attributes
    ----------
    injections
        The actors with decals.
    in_frame
        True while VTK draws a frame of the subplot that has some.
    refusal
        Message about a mapping that cannot be drawn.
    """

    refusal = NOT_WALKED

    def __init__(self, subplot: InjectionTarget) -> None:
        self._subplot = subplot
        self.injections: list[Injection] = []
        self._units: list[int] = []
        self.in_frame = False

    def apply(
        self,
        actor: Any,
        *,
        follow: bool,
        crease_angle: float,
        labels: tuple[str, ...] | None = None,
        orientation: MeshOrientation = MeshOrientation.OUTWARD,
    ) -> None:
        """Show the decals on an actor."""
        if self._subplot.drawing.walked:
            raise InvalidScene(NOT_WALKED)
        self._release(self._of(actor))
        self.injections.append(
            Injection(
                self._subplot,
                actor,
                follow=follow,
                labels=labels,
                crease_angle=crease_angle,
                orientation=orientation,
            )
        )

    def check_mapping(self, mapping: ImageMapping) -> None:
        """Raise InvalidScene if there are actors that cannot be drawn in a mapping."""
        if mapping is ImageMapping.WALKED and self.injections:
            raise InvalidScene(NOT_WALKED)

    def remove(self, actor: Any) -> None:
        """Remove the decals from an actor.

        Raises
        ------
        InvalidScene
            The actor has no decals of the subplot.
        """
        injections = self._of(actor)
        if not injections:
            raise InvalidScene(
                f"expected an actor with decals of this subplot, got {describe(actor)} without; "
                "give an actor that `apply` has received in the active subplot"
            )
        self._release(injections)

    def _of(self, actor: Any) -> list[Injection]:
        return [item for item in self.injections if item.actor is actor]

    def clear(self) -> None:
        """Remove the decals from all actors."""
        self._release(self.injections)

    def _release(self, injections: list[Injection]) -> None:
        if not injections:
            return
        with self._subplot.current_if_present():
            for injection in injections:
                injection.release()
        self.injections = [item for item in self.injections if item not in injections]

    def texture_units(self) -> list[int]:
        """Return the texture units of an injected shader, reserved until the end of the frame."""
        if not self._units:
            self._units = [self._manager.Allocate() for _ in range(INJECTED_TEXTURES)]
        return self._units

    @property
    def _manager(self) -> Any:
        return self._subplot.vtk_renderer.GetRenderWindow().GetTextureUnitManager()

    def begin_frame(self) -> None:
        """Update meshes and shaders before VTK draws a frame."""
        self.in_frame = True
        with self._subplot.current():
            for injection in self.injections:
                injection.begin_frame()

    def end_frame(self) -> None:
        """Release the texture units after VTK has drawn a frame."""
        self.in_frame = False
        for unit in self._units:
            self._manager.Free(unit)
        self._units = []
        for injection in self.injections:
            injection.end_frame()
