"""``plotter.decals``: our objects and decals in a pyvista plotter."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from blobtree import Node
from decals.checks import instance, shown
from decals.errors import InvalidScene, NoGraphics
from decals.model import PLAIN, Decals
from decals.render import SceneLike
from decals.scenes.camera import Camera
from decals.scenes.scene import CLAY, Color, DecalImage, MeshObject, Scene, SceneObject, TreeObject
from decals.vtk.context import WindowContext
from decals.vtk.lights import Lights
from decals.vtk.modes import restore_exports, warn_of_exports
from decals.vtk.stage import Stage

Image = str | os.PathLike[str] | DecalImage | NDArray[np.uint8]
"""The name of a generated image, a path, an image, or ``uint8[h, w, 4]``."""

NOWHERE = Camera((0.0, 0.0, 1.0))
"""A scene wants a camera; in a plotter nobody asks for it."""


@pv.register_plotter_component("decals")
class Component:
    """What a plotter shows through our renderer, among its own actors.

    ::

        plotter = pyvista.Plotter()
        plotter.decals.add_implicit(tree)
        plotter.decals.add_mesh(mesh)
        plotter.decals.add(decals, images=["scale"])

    As elsewhere in pyvista, everything goes into the subplot that is active.

    Parameters
    ----------
    plotter
        The plotter; pyvista gives it.
    """

    def __init__(self, plotter: pv.BasePlotter) -> None:
        self._plotter = plotter
        self._stages: dict[int, Stage] = {}
        self._context: WindowContext | None = None

    # -- what is shown ----------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """Objects, decals and images of the active subplot; set it to exchange all of them.

        Raises
        ------
        InvalidScene
            The subplot shows something that changes in place, such as what an `EditWindow` edits.
        """
        scene = self.stage.scene
        if scene is None:
            return Scene(objects=(), camera=NOWHERE)
        if not isinstance(scene, Scene):
            raise InvalidScene(
                f"expected a Scene to add to, but the subplot shows a {type(scene).__name__}; "
                "change that itself, or give the stage another scene"
            )
        return scene

    @scene.setter
    def scene(self, scene: SceneLike) -> None:
        self.stage.scene = scene

    def add_implicit(self, tree: Node | TreeObject, *, name: str | None = None) -> TreeObject:
        """Show a BlobTree, traced exactly.

        Parameters
        ----------
        tree
            A tree, or an object of a scene.
        name
            What to call it; unique in the subplot.
        """
        thing = tree if isinstance(tree, TreeObject) else TreeObject(self._name(name), tree)
        self._add_object(thing)
        return thing

    def add_mesh(
        self, mesh: pv.DataSet | MeshObject, *, color: Color | str = CLAY, name: str | None = None
    ) -> MeshObject:
        """Show a mesh under the decals, lit as our other objects are.

        To keep pyvista's own look of an actor, give it to `apply` instead.

        Parameters
        ----------
        mesh
            Any dataset with a surface, or an object of a scene.
        color
            sRGB, each channel in [0, 1], or a name that pyvista knows.
        name
            What to call it; unique in the subplot.
        """
        if not isinstance(mesh, MeshObject):
            mesh = MeshObject(self._name(name), *triangles(mesh), _color(color))
        self._add_object(mesh)
        return mesh

    def add(self, decals: Decals, *, images: Sequence[Image] = ()) -> Decals:
        """Lay decals over all objects of the subplot.

        Parameters
        ----------
        decals
            Decals whose ``images`` count the given ones.
        images
            Their images. Without any, they count those that are there already.

        Returns
        -------
        Decals
            Those of the whole subplot, as they are now.
        """
        if not isinstance(decals, Decals):
            raise InvalidScene(f"expected Decals to add, got {type(decals).__name__}; decals.seed makes some")
        scene = self.scene
        if isinstance(images, str):
            raise InvalidScene(f"expected a list of images, got the text {images!r}; write [{images!r}]")
        if not isinstance(images, Sequence):
            raise InvalidScene(f"expected a list of images, got {shown(images)}; put it into one")
        added = tuple(_image(image, number) for number, image in enumerate(images))
        if added:
            shifted = np.where(decals.images == PLAIN, PLAIN, decals.images + len(scene.images))
            decals = decals.replace(images=shifted)
        together = Decals.concatenate([scene.decals, decals])
        self.scene = scene.replace(decals=together, images=(*scene.images, *added))
        return together

    def apply(self, actor: pv.Actor, *, follow: bool = False) -> pv.Actor:
        """Lay the subplot's decals onto an actor of pyvista's own, whose lights, scalars and edges stay.

        The same functions that colour our objects run in VTK's shader of the actor.

        Parameters
        ----------
        actor
            What ``plotter.add_mesh`` returns.
        follow
            Whether the decals are given in the actor's own coordinates and move with it; otherwise they lie
            where they are in the world, across all actors and objects there.

        Raises
        ------
        InvalidScene
            The actor is not drawn as polygons.
        """
        self.stage.apply(actor, follow=follow)
        return actor

    def remove(self, actor: pv.Actor) -> None:
        """Take the decals off an actor again."""
        self.stage.remove(actor)

    def add_scene(self, scene: Scene, *, camera: bool = True) -> Scene:
        """Show a scene in place of what there was; with ``camera``, from where its own camera stands."""
        instance("scene", scene, Scene, InvalidScene, "decals.cover makes one; for others set `scene`")
        instance("camera", camera, bool, InvalidScene, "whether to look from the scene's own; it has one")
        self.scene = scene
        if camera:
            view = self._plotter.camera
            view.position, view.focal_point, view.up = (
                scene.camera.position,
                scene.camera.target,
                scene.camera.up,
            )
            view.view_angle = scene.camera.fov
            view.parallel_projection = False
            self._plotter.renderer.camera_set = True
            self._plotter.renderer.reset_camera_clipping_range()
        return scene

    def clear(self) -> None:
        """Show nothing any more in the active subplot."""
        self.stage.scene = None

    # -- how --------------------------------------------------------------------------------------------

    @property
    def stage(self) -> Stage:
        """What draws in the active subplot."""
        self._require_window()
        renderer = self._plotter.renderer
        if id(renderer) not in self._stages:
            if not self._stages:
                warn_of_exports(self._plotter)
            self._stages[id(renderer)] = Stage(self._plotter, renderer, self._window_context)
        return self._stages[id(renderer)]

    @property
    def lights(self) -> Lights:
        """Who lights what the active subplot shows; see `Lights`."""
        return self.stage.lights

    @lights.setter
    def lights(self, lights: Lights | str) -> None:
        self.stage.lights = lights

    @property
    def stages(self) -> tuple[Stage, ...]:
        """What draws, in all subplots that show something through us."""
        return tuple(self._stages.values())

    def _require_window(self) -> None:
        if self._plotter.render_window is None:
            raise NoGraphics("the plotter was closed; make another, as pyvista asks for too")

    def _window_context(self) -> WindowContext:
        self._require_window()
        if self._context is not None and self._context.stale:
            self._context.release()
            self._context = None
        if self._context is None:
            self._context = WindowContext(self._plotter.render_window)
        return self._context

    def _add_object(self, thing: SceneObject) -> None:
        self.scene = self.scene.replace(objects=(*self.scene.objects, thing))

    def _name(self, name: str | None) -> str:
        if name is not None:
            return name  # checked with the object
        taken = {thing.name for thing in self.scene.objects}
        return next(name for n in range(1, len(taken) + 2) if (name := f"object {n}") not in taken)

    def __plotter_close__(self) -> None:
        """Give everything back while the window is still there; pyvista calls it."""
        for stage in self._stages.values():
            stage.release()
        self._stages.clear()
        restore_exports(self._plotter)
        if self._context is not None and not self._context.stale:
            self._context.release()
        self._context = None


def triangles(mesh: pv.DataSet) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices ``float32[n, 3]`` and triangles ``int32[m, 3]`` of a dataset's surface."""
    if not isinstance(mesh, pv.DataSet | pv.MultiBlock):
        raise InvalidScene(
            f"expected a dataset of pyvista's, got {type(mesh).__name__}; pyvista.wrap makes one"
        )
    surface = mesh if isinstance(mesh, pv.PolyData) else mesh.extract_surface(algorithm="dataset_surface")
    surface = surface.triangulate()
    return np.asarray(surface.points, np.float32), np.asarray(surface.regular_faces, np.int32)


def _image(image: Any, number: int) -> DecalImage:
    if isinstance(image, DecalImage):
        return image
    if isinstance(image, str | os.PathLike):
        return DecalImage.load(os.fspath(image))
    try:
        pixels = np.asarray(image)
    except ValueError:
        raise InvalidScene(f"image {number}: expected uint8[h, w, 4], got {shown(image)}") from None
    return DecalImage(f"image {number}", pixels)


def _color(color: Color | str) -> Color:
    """Look up a name; what is none goes on as it is, to be checked with the object."""
    if not isinstance(color, str):
        return color
    try:
        red, green, blue = pv.Color(color).float_rgb
    except ValueError as error:
        raise InvalidScene(
            f"expected a colour that pyvista knows, got {color!r}; give a name such as 'tomato', or #rrggbb"
        ) from error
    return red, green, blue
