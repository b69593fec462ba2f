"""A window in which decals are pushed by hand."""

import os
import sys
import time
import weakref
from collections.abc import Sequence
from typing import Any

import pyvista as pv

import decals.vtk  # noqa: F401  (it registers `plotter.decals`)
from blobtree import BlobTreeError
from decals.checks import shown, whole
from decals.edit.actions import Actions
from decals.edit.jobs import Job, Worker
from decals.edit.session import EditSession
from decals.edit.tools import Ray, Tools
from decals.errors import DecalsError, InvalidEdit, InvalidScene, NoGraphics
from decals.render.libraries import require_gl
from decals.scenes.camera import Camera
from decals.scenes.scene import Scene
from decals.surfaces.surface import Floats
from decals.vtk.stage import MOST_SAMPLES
from decals.window.bindings import Bindings
from decals.window.grip import Grip
from decals.window.marks import Marks
from decals.window.quality import Quality

SIZE = (1200, 800)
LARGEST = 16384
"""Pixels that a window may have along each side, as many as VTK draws."""
BACKGROUND = ((0.80, 0.82, 0.85), (0.96, 0.96, 0.95))
"""Colours at the bottom and at the top."""

TICK = 100
"""Milliseconds between looks at the background work."""

REST = 0.2
"""Seconds without any movement after which a whole frame is drawn."""


class EditWindow:
    """A scene in a pyvista window, edited by hand.

    ``window.plotter`` is an ordinary plotter: everything of pyvista can be added. `decals.view` is one call
    over this.

    Parameters
    ----------
    scene
        What to edit, or a session that goes on.
    path
        Where to save.
    size
        Of the window, in pixels.
    off_screen
        Whether to do without a screen; events are then the caller's.
    samples
        Samples a pixel along each axis, at rest.

    Raises
    ------
    NoGraphics
        There is no OpenGL, or no screen for a window.
    InvalidScene
        There is no scene to edit, or no pixel in the window.
    """

    def __init__(
        self,
        scene: Scene | EditSession,
        *,
        path: str | os.PathLike[str] | None = None,
        size: tuple[int, int] = SIZE,
        off_screen: bool = False,
        samples: int = 2,
    ) -> None:
        if not isinstance(scene, Scene | EditSession):
            raise InvalidScene(f"expected a Scene or an EditSession to edit, got {type(scene).__name__}")
        size = _checked_size(size)
        whole("samples", samples, 1, MOST_SAMPLES, InvalidScene)
        if path is not None and not isinstance(path, str | os.PathLike):
            raise InvalidScene(f"path: expected a path to save to, got {shown(path)}")
        require_gl()
        if not off_screen:
            self.require_screen()
        self.session = scene if isinstance(scene, EditSession) else EditSession(scene)
        self.document = self.session.document
        self.samples, self._closed = samples, False
        self.worker, self.quality = Worker(), Quality()
        self.actions = Actions(self.session, path=path, run=self._start)
        self.actions.camera, self.actions.interrupt = self._camera, self.worker.cancel
        self.plotter = _plotter(off_screen, size)
        self.plotter.set_background(BACKGROUND[0], top=BACKGROUND[1])
        self.tools = Tools(self.actions, self._ray, self._hidden)
        self._open_stage()
        self.marks = Marks(self.plotter)
        self.grip = Grip(self.plotter, self.actions, lambda whole: self.redraw(whole=whole))
        self._bindings = Bindings(self, self.plotter.iren.interactor)
        self._moved = 0.0
        self._whole: tuple[int, ...] = self._shown

    def _open_stage(self) -> None:
        self.plotter.decals.add_scene(self.document.scene)
        self.stage = self.plotter.decals.stage
        self.stage.scene = self.document
        self.stage.measure, self.stage.samples = True, self.samples
        me = weakref.ref(self)
        self._began = 0.0
        self.plotter.renderer.AddObserver("StartEvent", lambda *_: _timed(me, begin=True))
        self.plotter.renderer.AddObserver("EndEvent", lambda *_: _timed(me, begin=False))

    # -- what is seen -----------------------------------------------------------------------------------

    def redraw(self, *, whole: bool) -> None:
        """Show what there is: as a whole once nothing moves any more, or quickly; nothing once closed."""
        if self._closed:
            return
        self.actions_shown()
        if not whole:
            self.moving()
            self.plotter.render()
        elif self.plotter.off_screen:
            self.rest()
        else:
            if self._whole != self._shown:
                self.moving()  # `tick` draws the whole frame a little later
            self.plotter.render()

    @property
    def _shown(self) -> tuple[int, ...]:
        """Tells apart what the scene's pictures show."""
        document = self.document
        return id(document.objects), id(document.images), document.decals.version

    def actions_shown(self) -> None:
        """Bring outlines, handle, help and status up to date."""
        if not self.tools.dragging:
            self.grip.update()
        self.marks.outline(self.document, self.actions.selection, self.stage.contact)
        self.marks.show_help(self.actions.help)
        self.marks.say(self._status())

    def _status(self) -> str:
        if not self.worker.busy:
            return self.actions.message or "h: help"
        stage, fraction = self.worker.progress
        return f"{stage}: {100 * fraction:.0f} %"

    def moving(self) -> None:
        """Draw the next frames at the size that is done in time."""
        self._moved = time.perf_counter()
        if self.quality.expected(self.samples) > self.quality.target:
            self.stage.draw_scale, self.stage.samples = self.quality.scale, 1

    def rest(self) -> None:
        """Draw a whole frame."""
        self.stage.draw_scale, self.stage.samples = 1.0, self.samples
        self._moved, self._whole = 0.0, self._shown
        self.plotter.render()

    def _refine(self) -> None:
        """Draw better than now: first at the window's size, then, at the next tick, with all samples.

        In between the window listens, so whoever goes on waits for one frame at most.
        """
        if self.stage.draw_scale < 1.0 < self.samples:
            self.stage.draw_scale, self.stage.samples = 1.0, 1
            self.plotter.render()
        else:
            self.rest()

    def _timed(self, *, begin: bool) -> None:
        if begin:
            self._began = time.perf_counter()
        elif self.stage.drawn:
            size = self.stage.draw_scale * self.stage.samples
            self.quality.saw(size, time.perf_counter() - self._began)

    # -- what goes on -----------------------------------------------------------------------------------

    def tick(self) -> None:
        """Look after the background work, and draw a whole frame once nothing moves."""
        busy = self.worker.busy
        if busy:
            self._finish()
            self.marks.say(self._status())
        if self._moved and time.perf_counter() - self._moved > REST and not self.tools.dragging:
            self._refine()
        elif busy:
            self.plotter.render()

    def _start(self, job: Job) -> None:
        if not self.worker.start(job):
            self.actions.message = "wait for what goes on, or press Escape"

    def _finish(self) -> None:
        try:
            command = self.worker.take()
        except (DecalsError, BlobTreeError) as error:
            self.actions.message = str(error)
            return
        if command is not None:
            self.actions.settle()
            self.actions.attempt(command)
            self.redraw(whole=True)

    def _ray(self, x: float, y: float) -> Ray | None:
        """The ray through the middle of a pixel."""
        renderer = self.plotter.renderer
        (left, low), (width, height) = renderer.GetOrigin(), renderer.GetSize()
        x, y = x - left + 0.5, y - low + 0.5
        if not (0 <= x <= width and 0 <= y <= height):
            return None
        rays = self.stage.viewpoint().rays(width, height)
        return rays.origins(x, y), rays.directions(x, y)

    def _hidden(self, x: float, y: float, position: Floats) -> bool:
        """Whether an actor that was added to the plotter hides a point of a surface."""
        return bool(self.stage.hidden(int(x), int(y), position))

    def _camera(self) -> Camera | None:
        """The camera to save: VTK's, if it is one of ours."""
        view = self.plotter.camera
        if view.parallel_projection:
            return None
        return Camera(tuple(view.position), tuple(view.focal_point), tuple(view.up), view.view_angle)

    # -- opening and closing ----------------------------------------------------------------------------

    @staticmethod
    def require_screen() -> None:
        """Raise `NoGraphics` where a window has no screen: VTK would do without one silently."""
        here = sys.platform.startswith("linux")
        if here and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise NoGraphics(
                "expected a screen for the window, got none (DISPLAY is not set); log in with a desktop, "
                "use `ssh -X`, or draw pictures with `implicit-decals render`"
            )

    def show(self) -> None:
        """Open the window, and stay until it is closed; off screen, draw the first frame.

        Raises
        ------
        InvalidEdit
            The window was closed.
        """
        if self._closed:
            raise InvalidEdit("the window was closed; open another EditWindow on its session")
        self.actions_shown()
        self.plotter.iren.initialize()
        self.plotter.iren.interactor.CreateRepeatingTimer(TICK)
        interactive = not self.plotter.off_screen
        self.plotter.show(auto_close=False, interactive=interactive)
        if interactive:
            self.close()

    def close(self) -> None:
        """Close the window, and give everything back. Twice is harmless."""
        if self._closed:
            return
        self._closed = True
        self.worker.cancel()
        self.session.end()
        self.actions.release()
        self.grip.release()
        self._bindings.release()
        self.plotter.close()

    def __enter__(self) -> "EditWindow":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def view(
    scene: Scene | EditSession,
    *,
    path: str | os.PathLike[str] | None = None,
    size: tuple[int, int] = SIZE,
) -> Scene:
    """Open a window, edit in it, and give the scene as it is when the window is closed.

    Arguments and errors are those of `EditWindow`.
    """
    with EditWindow(scene, path=path, size=size) as window:
        window.show()
        return window.document.scene


def _checked_size(size: object) -> tuple[int, int]:
    """Give width and height of a window, or `InvalidScene`."""
    if not isinstance(size, Sequence) or len(size) != 2:
        raise InvalidScene(f"size: expected width and height in pixels, got {shown(size)}")
    width, height = (whole("size", side, 1, LARGEST, InvalidScene) for side in size)
    return width, height


def _plotter(off_screen: bool, size: tuple[int, int]) -> Any:
    """Make an empty window; its methods are wrapped in ways that type checkers do not follow.

    It does without VTK's multisampling: what we draw is smoothed by ourselves, and without a graphics card
    half of the time of a frame would go there.
    """
    plotter: Any = pv.Plotter(off_screen=off_screen, window_size=list(size), title="Implicit Decals")
    plotter.disable_anti_aliasing()
    return plotter


def _timed(me: "weakref.ref[EditWindow]", *, begin: bool) -> None:
    window = me()
    if window is not None:
        window._timed(begin=begin)
