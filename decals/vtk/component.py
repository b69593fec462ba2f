"""``plotter.decals``: objects and decals in a pyvista plotter."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
import pyvista as pv

from blobtree import Node
from blobtree.colors import ColorLike
from blobtree.graphics import opens_window, vtk_warnings_hidden
from blobtree.validation import describe
from decals.errors import InvalidScene, NoGraphics
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.images.load import DEFAULT_IMAGE, AnyImage
from decals.model import NO_IMAGE, Decals
from decals.rendering import Environment, SceneLike
from decals.scenes.camera import Camera
from decals.scenes.cover import as_scene
from decals.scenes.objects import MeshObject, SceneObject, TreeObject, shape_color, spare_coordinates
from decals.scenes.scene import Scene, as_images
from decals.surfaces.base_color import BaseColor, BaseTexture
from decals.surfaces.convert import Model, as_shape
from decals.surfaces.normals import CREASE_ANGLE
from decals.surfaces.windings import MeshOrientation
from decals.validation import KnownAttributes, instance
from decals.vtk.adapters import Lights
from decals.vtk.extras import ACTORS
from decals.vtk.frame import WindowContext
from decals.vtk.subplot import PickResult, SubplotRenderer

UNUSED_CAMERA = Camera((0.0, 0.0, 1.0))
"""Camera of a scene without its own; the plotter has another."""


@pv.register_plotter_component("decals")
class DecalsComponent(KnownAttributes):
    """Objects and decals among the actors of a plotter: ``plotter.decals``.

    All methods apply to the active subplot.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        The plotter; pyvista passes it.

    Examples
    --------
    >>> import decals, pyvista
    >>> from blobtree import Point
    >>> plotter = pyvista.Plotter(off_screen=True, window_size=(80, 60))
    >>> blob = plotter.decals.add_implicit(Point((0, 0, 0), radius=1.0))
    >>> scattered = decals.scatter([blob.surface], count=30)
    >>> len(plotter.decals.add(scattered, images="scale"))
    30
    >>> plotter.show()
    """

    _elsewhere = "subplot"

    def __init__(self, plotter: pv.BasePlotter) -> None:
        self._plotter = plotter
        self._subplots: dict[int, SubplotRenderer] = {}
        self._context: WindowContext | None = None
        self._picking: Any = None

    # -- what is shown ----------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """Scene of the active subplot; assign one to replace objects, decals and images.

        Raises
        ------
        InvalidScene
            The subplot shows a document that is being edited.
        """
        scene = self.subplot.scene
        if scene is None:
            return Scene(objects=(), camera=UNUSED_CAMERA)
        if not isinstance(scene, Scene):
            raise InvalidScene(
                f"expected a Scene to add to, but the subplot shows a {type(scene).__name__}; "
                "edit the document, or assign another scene to the subplot"
            )
        return scene

    @scene.setter
    def scene(self, scene: SceneLike) -> None:
        self.subplot.scene = scene

    def add_implicit(
        self, tree: Node | TreeObject | str | os.PathLike[str], *, name: str | None = None
    ) -> TreeObject:
        """Add a BlobTree, which is ray traced.

        Parameters
        ----------
        tree
            A tree, the path of its JSON file, or an object of a scene.
        name
            Its name, unique in the subplot.
        """
        if isinstance(tree, TreeObject):
            item = tree
        else:
            label = self._name(name)
            shape = as_shape(tree, name=label, error=InvalidScene)
            if not isinstance(shape, Node):
                raise InvalidScene(f"{label}: expected a BlobTree, got a mesh; `add_mesh` adds it")
            item = TreeObject(label, shape)
        self._add_object(item)
        return item

    def add_mesh(
        self,
        mesh: Model | MeshObject,
        *,
        color: ColorLike | BaseColor | None = None,
        texture: AnyImage | BaseTexture | None = None,
        name: str | None = None,
        crease_angle: float = CREASE_ANGLE,
        orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
    ) -> MeshObject:
        """Add a mesh, lit like the other objects.

        To keep the look of an actor of pyvista, use `apply` instead.

        Parameters
        ----------
        mesh
            A pyvista dataset with a surface, any mesh with ``vertices`` and ``faces``, a tuple of such
            arrays, the path of a mesh file, or an object of a scene.
        color
            sRGB, each channel in [0, 1]; or the name of a colour. By default the colours or textures that the
            mesh has.
        texture
            Texture of a mesh with texture coordinates, such as a `pyvista.Texture`, in place of its colours.
        name
            Its name, unique in the subplot.
        crease_angle
            Angle between two faces, in degrees, from which their edge is drawn sharp.
        orientation
            Which way the faces wind; see `decals.MeshObject`.
        """
        if isinstance(mesh, MeshObject):
            item = mesh
        else:
            label = self._name(name)
            shape = as_shape(mesh, name=label, error=InvalidScene)
            if isinstance(shape, Node):
                raise InvalidScene(f"{label}: expected a mesh, got a BlobTree; `add_implicit` adds it")
            if color is None:
                color = shape_color(shape, texture, None)
            item = MeshObject(
                label,
                *shape.arrays,
                color,
                crease_angle=crease_angle,
                orientation=orientation,
                coordinates=spare_coordinates(shape, color),
            )
        self._add_object(item)
        return item

    def add(self, decals: Decals, *, images: AnyImage | Iterable[AnyImage] | None = None) -> Decals:
        """Add decals to all objects of the subplot.

        Parameters
        ----------
        decals
            The decals; their ``images`` are indices into the given images.
        images
            One image or several: names, paths, arrays, PIL images, textures or `DecalImage` objects. Without
            any, indices refer to the present images; a subplot that has none gets the default image, a scale.

        Returns
        -------
        Decals
            All decals of the subplot.
        """
        if not isinstance(decals, Decals):
            raise InvalidScene(
                f"expected Decals to add, got {type(decals).__name__}; decals.scatter makes some"
            )
        scene = self.scene
        if images is None:
            images = () if scene.images or decals.images.max(initial=NO_IMAGE) < 0 else DEFAULT_IMAGE
        added = as_images(images)
        if added:
            shifted = np.where(decals.images == NO_IMAGE, NO_IMAGE, decals.images + len(scene.images))
            decals = decals.replace(images=shifted)
        together = Decals.concatenate([scene.decals, decals])
        self.scene = scene.replace(decals=together, images=(*scene.images, *added))
        return together

    def apply(
        self,
        actor: pv.Actor,
        *,
        follow: bool = False,
        crease_angle: float = CREASE_ANGLE,
        labels: str | Iterable[str] | None = None,
        orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
    ) -> pv.Actor:
        """Show the subplot's decals on an actor of pyvista, whose lights, scalars and edges stay.

        Parameters
        ----------
        actor
            Result of ``plotter.add_mesh``.
        follow
            If True, decals have the actor's coordinates and move with it. If False, they have world
            coordinates.
        crease_angle
            Angle between two faces, in degrees, from which their edge is sharp for decals. Two subplots that
            show one actor share the angle of the first.
        labels
            Labels of the actor: decals with other `Decals.receivers` do not lie on it. By default all lie on
            it. A subplot with objects takes only receivers of its objects.
        orientation
            Which way the actor's faces wind for decals; see `decals.MeshObject`. VTK draws them as they are.
            Two subplots that show one actor share the orientation of the first.

        Raises
        ------
        InvalidScene
            VTK does not draw the actor as polygons, the crease angle is out of range, the labels are no
            texts, or the image mapping is WALKED, which needs an object of the scene.
        """
        self.subplot.apply(
            actor, follow=follow, crease_angle=crease_angle, labels=labels, orientation=orientation
        )
        return actor

    def remove(self, actor: pv.Actor) -> None:
        """Remove the decals from an actor.

        Parameters
        ----------
        actor
            An actor that `apply` has received in the active subplot.

        Raises
        ------
        InvalidScene
            The actor has no decals of the subplot.
        """
        self.subplot.remove(actor)

    def add_scene(self, scene: Scene | SceneObject | Model, *, camera: bool = False) -> Scene:
        """Replace the scene of the subplot.

        Parameters
        ----------
        scene
            The scene; or models that become one, as for `decals.render`.
        camera
            If True, the subplot gets the scene's camera. If False, it keeps the plotter's, as for any actor.
        """
        shown = as_scene(scene)
        instance("camera", camera, bool, InvalidScene, "True to use the scene's camera")
        self.scene = shown
        if camera:
            show_camera(self._plotter, shown)
        return shown

    def enable_picking(
        self, callback: Callable[[PickResult], object], *, left_clicking: bool = False
    ) -> None:
        """Call a function at each click on an object of any subplot.

        pyvista's pickers find VTK's own actors only. A click on the background, or on an actor in front of
        the objects, calls nothing. A second call replaces the first function.

        Parameters
        ----------
        callback
            Function of a `PickResult`: ``object_id`` is the index of the object in the scene, ``owner`` the
            number of the decal that shows there (−1 for none), ``position`` the point on the surface.
        left_clicking
            If True, clicks of the left button count, else those of the right button.

        Raises
        ------
        InvalidScene
            The callback is not a function, or the plotter has no interactor.

        Examples
        --------
        >>> import pyvista
        >>> from blobtree import Point
        >>> plotter = pyvista.Plotter()
        >>> ball = plotter.decals.add_implicit(Point((0, 0, 0), radius=1.0))
        >>> plotter.decals.enable_picking(lambda pick: print(pick.owner, pick.position))
        >>> plotter.show()  # doctest: +SKIP
        """
        if not callable(callback):
            raise InvalidScene(
                f"callback: expected a function of a PickResult, got {describe(callback)}; "
                "give a function such as print"
            )
        instance("left_clicking", left_clicking, bool, InvalidScene, "True for the left button")
        self._require_window()
        iren: Any = getattr(self._plotter, "iren", None)
        if iren is None:
            raise InvalidScene(
                "expected a plotter with an interactor; make pyvistaqt's with off_screen=False"
            )
        self.disable_picking()
        component = weakref.ref(self)

        def pick(interactor: Any, _event: str) -> None:
            alive = component()
            if alive is not None:
                x, y = interactor.GetEventPosition()
                alive._pick(x, y, callback)

        event = "LeftButtonPressEvent" if left_clicking else "RightButtonPressEvent"
        self._picking = iren.add_observer(event, pick)

    def disable_picking(self) -> None:
        """Undo `enable_picking`; without it this does nothing."""
        iren: Any = getattr(self._plotter, "iren", None)
        if self._picking is not None and iren is not None:
            iren.remove_observer(self._picking)
        self._picking = None

    def _pick(self, x: int, y: int, callback: Callable[[PickResult], object]) -> None:
        """Call a function with what is visible at a pixel of the window, if that is an object."""
        for subplot in self.subplots:
            if subplot.covers(x, y):
                result = subplot.at(x, y)
                if result is not None:
                    callback(result)
                return

    def clear(self) -> None:
        """Remove everything from the active subplot."""
        self.subplot.scene = None

    # -- how --------------------------------------------------------------------------------------------

    @property
    def subplot(self) -> SubplotRenderer:
        """Renderer of the active subplot."""
        self._require_window()
        renderer = self._plotter.renderer
        if id(renderer) not in self._subplots:
            if not self._subplots:
                ACTORS["watch"](self._plotter)
            self._subplots[id(renderer)] = SubplotRenderer(self._plotter, renderer, self._window_context)
        return self._subplots[id(renderer)]

    @property
    def lights(self) -> Lights:
        """Lights of the active subplot; see `Lights`."""
        return self.subplot.lights

    @lights.setter
    def lights(self, lights: Lights | str) -> None:
        self.subplot.lights = lights

    @property
    def environment(self) -> Environment | None:
        """Environment of the active subplot; see `decals.rendering.Environment`."""
        return self.subplot.environment

    @environment.setter
    def environment(self, environment: Environment | AnyImage | None) -> None:
        self.subplot.environment = environment

    @property
    def contact(self) -> AnyContact:
        """Contact mode of the active subplot; see `decals.Contact`."""
        return self.subplot.contact

    @contact.setter
    def contact(self, contact: AnyContact | str) -> None:
        self.subplot.contact = contact

    @property
    def stiffness(self) -> float:
        """Stiffness of elastic contact in the active subplot, from 1."""
        return self.subplot.stiffness

    @stiffness.setter
    def stiffness(self, stiffness: float) -> None:
        self.subplot.stiffness = stiffness

    @property
    def mapping(self) -> ImageMapping:
        """Image mapping of the active subplot; see `decals.ImageMapping`."""
        return self.subplot.mapping

    @mapping.setter
    def mapping(self, mapping: ImageMapping | str) -> None:
        self.subplot.mapping = mapping

    @property
    def subplots(self) -> tuple[SubplotRenderer, ...]:
        """Renderers of all subplots with objects or decals."""
        return tuple(self._subplots.values())

    def _require_window(self) -> None:
        if self._plotter.render_window is None:
            raise NoGraphics("the plotter was closed; make another")

    def _window_context(self) -> WindowContext:
        self._require_window()
        if self._context is not None and self._context.stale:
            self._context.release()
            self._context = None
        if self._context is None:
            self._context = WindowContext(self._plotter.render_window)
        return self._context

    def _add_object(self, item: SceneObject) -> None:
        self.scene = self.scene.replace(objects=(*self.scene.objects, item))

    def _name(self, name: str | None) -> str:
        if name is not None:
            return name  # checked with the object
        taken = {item.name for item in self.scene.objects}
        return next(name for n in range(1, len(taken) + 2) if (name := f"object {n}") not in taken)

    def __plotter_close__(self) -> None:
        """Release all resources while the window exists; pyvista calls it."""
        self.disable_picking()
        for subplot in self._subplots.values():
            subplot.release()
        self._subplots.clear()
        ACTORS["restore"](self._plotter)
        if self._context is not None and not self._context.stale:
            self._context.release()
        self._context = None


REMOTE = "server"
"""pyvista's backend that draws where Python runs. Browsers cannot draw decals."""
SERVING = ("trame_pyvista", "ipywidgets", "nest_asyncio2")
"""Packages that pyvista needs for this backend; the extra ``browser`` installs them."""


REFINE_MILLISECONDS = 100
"""Time after the first picture of a window until the one with all samples."""


def show_camera(plotter: Any, scene: Scene) -> None:
    """Let the active subplot of a plotter show what the camera of a scene sees."""
    view, camera = plotter.camera, scene.camera.at(plotter.renderer.GetTiledAspectRatio())
    view.position, view.focal_point = (
        np.add(point, scene.origin) for point in (camera.position, camera.target)
    )
    view.up = camera.up
    view.view_angle = camera.fov
    view.parallel_projection = False
    plotter.renderer.camera_set = True
    plotter.renderer.reset_camera_clipping_range()


def _show_one_sample_first(plotter: Any) -> None:
    """Draw the first picture of a window with one sample a pixel, so that it appears sooner."""
    subplot: SubplotRenderer = plotter.decals.subplot
    samples, subplot.samples = subplot.samples, 1

    def refine(_step: int) -> None:
        subplot.samples = samples
        plotter.render()

    plotter.add_timer_event(max_steps=1, duration=REFINE_MILLISECONDS, callback=refine)


def show(scene: Scene | SceneObject | Model | Sequence[SceneObject | Model], **options: Any) -> Any:
    """Show a scene in a window, or interactively in a notebook; `decals.edit` edits one.

    Parameters
    ----------
    scene
        The scene; or a model as `decals.cover` takes it, a list of such models, or the path of a model or a
        scene.
    options
        Arguments of pyvista's ``Plotter.show``.

    Returns
    -------
    object
        Result of ``Plotter.show``.

    Raises
    ------
    InvalidScene
        The argument is neither a `Scene` nor a model.
    NoGraphics
        There is no screen for the window.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=30, images=["eye"])
    >>> decals.show(scene)  # doctest: +SKIP
    """
    shown = as_scene(scene)
    in_window = opens_window(options)
    with vtk_warnings_hidden():
        plotter = pv.Plotter()
    component: DecalsComponent = plotter.decals
    component.add_scene(shown, camera=True)
    if in_window:
        _show_one_sample_first(plotter)
    if plotter.notebook and "jupyter_backend" not in options:
        options["jupyter_backend"] = REMOTE if all(map(find_spec, SERVING)) else "static"
    return plotter.show(**options)
