"""Our renderer in one of pyvista's renderers: a plotter's window, or one of its subplots."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkRenderingCore import vtkActor

from decals.checks import finite
from decals.errors import InvalidPoints
from decals.render import Renderer, SceneLike, Size
from decals.render.lamps import Lamps
from decals.render.tile import CameraBuffer
from decals.render.wishes import check_scene
from decals.scenes.scene import Box, SceneObject, bounds_of
from decals.scenes.viewpoint import Floats, Projection
from decals.vtk.anchor import Anchor
from decals.vtk.applied import Applied
from decals.vtk.boxes import box_around
from decals.vtk.camera import vtk_projection
from decals.vtk.context import WindowContext
from decals.vtk.frame import Frame, Look, Seen
from decals.vtk.lights import TOO_MANY, Lights, too_many_lights, vtk_lamps
from decals.vtk.modes import complaints
from decals.vtk.picking import Hit, hidden, hit_at
from decals.vtk.settings import Settings
from decals.vtk.weak import weakly

FARTHEST = 2.0**30
"""Pixels that VTK can count."""


class Stage(Settings):
    """Draws a scene among the actors of one of pyvista's renderers.

    Everything may be changed at any time; the plotter's next ``render()`` shows it.

    Parameters
    ----------
    plotter
        The plotter that the renderer belongs to.
    renderer
        One of ``plotter.renderers``.
    context
        Gives the window's context, the same one for all its renderers, while VTK's is current.

    Attributes
    ----------
    measure
        Whether frames wait for the graphics card, so that who times them knows how long they took.
    patient
        Whether frames do without what takes long for the first time, such as programs: until `warm` has made
        it, the picture before stays, or there is none.
    waiting
        Whether the last frame did without.
    applied
        The stock actors that have our decals.
    drawing
        Whether VTK is drawing a frame of the renderer now.
    """

    def __init__(
        self, plotter: pv.BasePlotter, renderer: pv.Renderer, context: Callable[[], WindowContext]
    ) -> None:
        super().__init__()
        self.plotter, self.vtk_renderer = plotter, renderer
        self.measure = self.patient = self.waiting = False
        self.drawing = False
        self._scene: SceneLike | None = None
        self._context = context
        self._frame: Frame | None = None
        self._failed: Seen | None = None
        self._drawn_size: Size | None = None
        self._anchor = Anchor(renderer, weakly(self.draw))
        self._placed: tuple[object, ...] = ()
        self.applied = Applied(self)
        self._said: set[str] = set()
        self._tags = [
            renderer.AddObserver(vtkCommand.StartEvent, weakly(self._prepare)),
            renderer.AddObserver(vtkCommand.EndEvent, weakly(self._finish)),
        ]

    @property
    def scene(self) -> SceneLike | None:
        """What is shown; its camera is not asked, the plotter's is.

        Where pyvista cleared the renderer, or our actor was taken out of it, that is nothing any more.
        """
        self._notice_clearing()
        return self._scene

    @scene.setter
    def scene(self, scene: SceneLike | None) -> None:
        if scene is not None:
            check_scene(scene)
        self._notice_clearing()
        self._scene, self._failed = scene, None
        if scene is None:
            self._anchor.leave()
        self._follow_objects(bounds_of)

    def _notice_clearing(self) -> None:
        """Forget everything where pyvista took our actor out."""
        if self._scene is not None and not self._anchor.there:
            self._scene = None
            self.applied.clear()

    def _follow_objects(self, box: Callable[[Sequence[SceneObject]], Box]) -> None:
        """Stand around the scene's objects, if they are not those of before."""
        if self._scene is None:
            return
        objects = tuple(self._scene.objects)
        known = len(objects) == len(self._placed) and all(
            a is b for a, b in zip(objects, self._placed, strict=True)
        )
        if known and self._anchor.there:
            return
        self._placed = objects
        self._anchor.place(box(cast(Sequence[SceneObject], objects)) if objects else None)

    def lamps(self) -> Lamps | None:
        """Lights of the renderer as `decals.render.Renderer.render` takes them; None for the studio's."""
        return vtk_lamps(self.vtk_renderer, self.frame()) if self.lights is Lights.VTK else None

    def apply(self, actor: Any, *, follow: bool = False) -> None:
        """Put the scene's decals into VTK's own shader of an actor; see `Component.apply`."""
        self.applied.apply(actor, follow=follow)

    def remove(self, actor: Any) -> None:
        """Take the decals off an actor; nothing happens if it had none."""
        self.applied.remove(actor)

    def _finish(self) -> None:
        self.drawing = False
        self.applied.finish()

    def _prepare(self) -> None:
        self.drawing = True
        if self.scene is not None:
            self._follow_objects(box_around)  # what changes in place may do so with every frame
            self._complain()
        self.applied.prepare()

    def _complain(self) -> None:
        """Say, once, what of VTK's modes does not go with what we draw."""
        found = complaints(self.vtk_renderer)
        if self.lights is Lights.VTK and too_many_lights(self.vtk_renderer):
            found.append(TOO_MANY)
        for complaint in found:
            if complaint not in self._said:
                self._said.add(complaint)
                warnings.warn(complaint, stacklevel=2)

    @property
    def renderer(self) -> Renderer:
        """The renderer in the window's context; use it inside ``with stage.current():``."""
        return self._use_frame().renderer

    @property
    def camera(self) -> CameraBuffer:
        """The block from which VTK's shaders read the camera, in the window's context."""
        return self._use_frame().camera

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the window's context current, and keep VTK's state, within a ``with`` block."""
        with self._use_frame().context.current():
            yield

    @contextmanager
    def current_if_there(self) -> Iterator[None]:
        """Make the window's context current if something of ours is in it; else there is nothing to do."""
        if self._frame is None or self._frame.context.stale:
            yield
        else:
            with self._frame.context.current():
                yield

    def viewpoint(self) -> Projection:
        """VTK's camera, as the renderer sees it."""
        return vtk_projection(self.vtk_renderer, self.frame())

    @property
    def drawn(self) -> float:
        """Part of a whole frame's work, 0 to 1, that the last one took: 0 where nothing had changed."""
        return 0.0 if self._frame is None else self._frame.share

    def to_draw(self, samples: int) -> float:
        """Part of its work, 0 to 1, that a frame of the window's size with so many samples would take now.

        It is little where edits reach little of the last such frame.
        """
        scene = self.scene
        if scene is None or self._drawn_size is None:
            return 1.0
        look = self._look(self._drawn_size, 1.0, samples)
        return self._use_frame().share_of(scene, look, self.viewpoint())

    def frame(self) -> Floats:
        """The scene's coordinates to the world's: identity, unless somebody moved or scaled the whole."""
        return self._anchor.matrix()

    @property
    def actor(self) -> vtkActor:
        """What stands for our objects among the renderer's actors."""
        return self._anchor.actor

    def viewport(self) -> tuple[int, int, int, int]:
        """Lower left corner and size of the part of the frame that VTK draws to now, in pixels."""
        return self._use_frame().context.viewport()

    def at(self, x: float, y: float) -> Hit | None:
        """Say what is seen at a place in the window, in pixels from its lower left corner; None for nothing.

        That one pixel is drawn for it, at full resolution. Where an actor of VTK's hid us in the last frame,
        that is nothing; translucent actors and text over the picture hide nothing.

        Raises
        ------
        NoGraphics
            The window has not been rendered yet.
        InvalidPoints
            The place is none.
        """
        return hit_at(self, x, y)

    def covers(self, x: int, y: int) -> bool:
        """Whether a place in the window is in this subplot."""
        places = (finite(name, place, InvalidPoints) for name, place in (("x", x), ("y", y)))
        column, row = (int(np.clip(place, -1.0, FARTHEST)) for place in places)
        return bool(self.vtk_renderer.IsInViewport(column, row))

    def hidden(self, x: int, y: int, position: ArrayLike) -> bool:
        """Whether an actor of VTK's hid a point of ours at a pixel of the last frame; see `at`."""
        return hidden(self, x, y, position)

    def depth_at(self, x: int, y: int) -> float:
        """Least depth that we put into the last frame at a pixel of the renderer: 1 for none.

        It is 0 where that is not known any more, because the stage's renderer drew something else since.
        """
        width, height = self.vtk_renderer.GetSize()
        return 0.0 if self._frame is None else self._frame.nearest(x, y, (width, height))

    def draw(self) -> None:
        """Draw into the frame that VTK is drawing; called by the anchor."""
        scene = self._scene
        if scene is None or self.vtk_renderer.GetSelector() is not None:
            return
        with self._once(scene, self.draw_scale, self.samples) as hopeful:
            if hopeful:
                self._draw(scene)

    def _draw(self, scene: SceneLike) -> None:
        frame = self._use_frame()
        viewport = frame.context.viewport()
        if 0 in viewport[2:]:  # a tile of a large screenshot in which nothing of this subplot lies
            return
        look = self._look(viewport[2:], self.draw_scale, self.samples)
        self._drawn_size = viewport[2:]
        self.waiting = self.patient and not frame.ready(scene, look)
        if self.waiting:
            frame.again(self.vtk_renderer.GetRenderWindow(), viewport)
            return
        targets = frame.draw(scene, look, self.viewpoint(), wait=self.measure)
        samples = 0 if self.draw_scale < 1.0 else look.samples  # 0: magnified
        frame.composite(self.vtk_renderer.GetRenderWindow(), viewport, targets, samples)

    def _look(self, size: Size, scale: float, samples: int) -> Look:
        """How the part of a window is drawn that has this size."""
        if scale < 1.0:
            width, height = (max(1, round(scale * side)) for side in size)
            return Look((width, height), 1, self.mapping, self.contact, self.lamps(), magnified=True)
        supersampled = size[0] > self.vtk_renderer.GetSize()[0]
        return Look(size, 1 if supersampled else samples, self.mapping, self.contact, self.lamps())

    def prepare(self, samples: int, seconds: float) -> float | None:
        """Draw for about so long on a whole frame with so many samples, and show nothing of it yet.

        Gives the seconds that it has taken in all, none where some of it was there already, None while it is
        not done. From then on frames with a
        `draw_scale` of 1 and these `samples` show it. What changes meanwhile makes it begin anew.
        """
        scene = self.scene
        if scene is None or self._drawn_size is None:
            return 0.0
        with self._once(scene, 1.0, samples) as hopeful:
            if hopeful:
                look = self._look(self._drawn_size, 1.0, samples)
                return self._use_frame().prepare(scene, look, self.viewpoint(), seconds)
        return 0.0

    def warm(self, seconds: float) -> str | None:
        """Make for about so long what a `patient` stage's last frame did without.

        Says how far that is, such as ``"shaders 3 of 7"``; None once all is there, or where the scene cannot
        be drawn: what is wrong is raised once.
        """
        scene = self.scene
        self.waiting = False
        if scene is None or self._drawn_size is None:
            return None
        with self._once(scene, self.draw_scale, self.samples) as hopeful:
            if not hopeful:
                return None
            look = self._look(self._drawn_size, self.draw_scale, self.samples)
            news = self._use_frame().warm(scene, look, self.viewpoint(), seconds)
        self.waiting = news is not None
        return news

    @contextmanager
    def _once(self, scene: SceneLike, scale: float, samples: int) -> Iterator[bool]:
        """Whether there is hope to draw this: who waits for it hears once that there is none."""
        size = tuple(self.vtk_renderer.GetSize())
        tried = Seen.tried(scene, size, scale, samples, self.mapping, self.contact)
        try:
            yield not tried.same(self._failed)
        except Exception:
            self._failed = tried
            raise

    def _use_frame(self) -> Frame:
        """Give what draws; made anew where the window has another context than before."""
        if self._frame is None or self._frame.context.stale:
            self._frame = Frame(self._context())
        return self._frame

    def release(self) -> None:
        """Leave the renderer and give everything back; the window must still be there. Twice is harmless."""
        self.applied.clear()
        self._anchor.release()
        for tag in self._tags:
            self.vtk_renderer.RemoveObserver(tag)
        if self._frame is not None and not self._frame.context.stale:
            self._frame.release()
        self._frame = None
        self._scene = None
