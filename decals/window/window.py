"""A window in which decals are pushed by hand."""

import os
import time
from typing import Any

import pyvista as pv

import decals.vtk  # noqa: F401  (it registers `plotter.decals`)
from decals.checks import shown, whole
from decals.edit.actions import Actions
from decals.edit.session import EditSession
from decals.edit.tools import Tools
from decals.errors import InvalidEdit, InvalidScene
from decals.render.libraries import require_gl
from decals.scenes.scene import Scene
from decals.surfaces.surface import Floats
from decals.vtk.settings import MOST_SAMPLES
from decals.vtk.weak import weakly
from decals.window.bindings import Bindings
from decals.window.grip import Grip
from decals.window.home import (
    SIZE,
    before_screenshots,
    checked_size,
    lent_plotter,
    new_plotter,
    require_screen,
)
from decals.window.looking import camera_of, ray_through, view_of
from decals.window.marks import Marks
from decals.window.quality import Quality
from decals.window.tenancy import Tenancy, edits_at
from decals.window.ticker import TICK, Ticker, running_loop
from decals.window.timing import Timing
from decals.window.waiting import NEWS, SLICE, Waiting

GLANCE = 0.25
"""Size of the very first frame, when nobody knows how fast the machine is."""

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
    plotter
        Edit in the active subplot of this one, such as pyvistaqt's or one that trame serves, in place of a
        window of our own. It stays open, and ``size`` and ``off_screen`` are its own. A subplot that showed
        a scene through us goes on to show the edited one; one that showed none is empty again.

    Raises
    ------
    NoGraphics
        There is no OpenGL, or no screen for a window.
    InvalidScene
        There is no scene to edit, no pixel in the window, or no interaction in the plotter.
    """

    def __init__(
        self,
        scene: Scene | EditSession,
        *,
        path: str | os.PathLike[str] | None = None,
        size: tuple[int, int] = SIZE,
        off_screen: bool = False,
        samples: int = 2,
        plotter: pv.BasePlotter | None = None,
    ) -> None:
        if not isinstance(scene, Scene | EditSession):
            raise InvalidScene(f"expected a Scene or an EditSession to edit, got {type(scene).__name__}")
        size = checked_size(size)
        whole("samples", samples, 1, MOST_SAMPLES, InvalidScene)
        if path is not None and not isinstance(path, str | os.PathLike):
            raise InvalidScene(f"path: expected a path to save to, got {shown(path)}")
        require_gl()
        self._guest = plotter is not None
        self.plotter: Any = lent_plotter(plotter) if plotter is not None else new_plotter(off_screen, size)
        self.session = scene if isinstance(scene, EditSession) else EditSession(scene)
        self.document = self.session.document
        self.samples, self._closed = samples, False
        self.quality = Quality()
        self.actions = Actions(self.session, path=path, threaded=True)
        self.background = self.actions.background
        self.actions.camera = lambda: camera_of(self.stage)
        self.actions.view = lambda: view_of(self.stage)
        self.tools = Tools(self.actions, lambda x, y: ray_through(self.stage, x, y), self._hidden)
        self._open_stage()
        self.marks = Marks(self.plotter)
        self.grip = Grip(self.stage.vtk_renderer, self.actions, lambda whole: self.redraw(whole=whole))
        self._interactor = self.plotter.iren.interactor
        self._bindings = Bindings(self, self._interactor)
        self._ticker = Ticker(self)
        self._timer, self._moved, self._told = 0, 0.0, 0.0
        self._whole: tuple[int, ...] = self._shown

    def _open_stage(self) -> None:
        self.stage = self.plotter.decals.stage
        self._tenancy = Tenancy(self.stage)
        self.plotter.decals.add_scene(
            self.document.scene, camera=not (self._guest and self.plotter.renderer.camera_set)
        )
        self.stage.scene = self.document
        self.stage.measure, self.stage.samples = True, self.samples
        self.waiting = Waiting(self.stage, weakly(self._show_status), weakly(self._give_up))
        self._timing = Timing(self.stage, self.quality)
        self._end_screenshots = before_screenshots(self.plotter, weakly(self.make_whole))

    @property
    def ticking(self) -> bool:
        """Whether a timer calls `tick`, or a loop of asyncio's; where none does, frames are whole at once."""
        return self._timed or running_loop() is not None

    @property
    def _timed(self) -> bool:
        """Whether the plotter's interactor has timers: off screen nobody waits for events."""
        return not getattr(self.plotter, "off_screen", False)

    @property
    def busy(self) -> bool:
        """Whether something goes on in the background, or a whole frame is still to be drawn."""
        goes_on = self.background.busy or self._moved > 0.0 or self.stage.waiting
        return not self._closed and goes_on

    # -- what is seen -----------------------------------------------------------------------------------

    def redraw(self, *, whole: bool) -> None:
        """Show what there is: as a whole once nothing moves any more, or quickly; nothing once closed."""
        if self._closed:
            return
        self.actions_shown()
        if self.busy:
            self._ticker.wake()
        if not whole:
            self._edited()
            self.plotter.render()
        elif not self.ticking:
            self.rest()
        else:
            if self._whole != self._shown:
                self._edited()  # `tick` draws the whole frame a little later
            self.plotter.render()

    @property
    def _shown(self) -> tuple[int, ...]:
        """Tells apart what the scene's pictures show."""
        document = self.document
        return id(document.objects), id(document.images), document.decals.version

    def actions_shown(self) -> None:
        """Bring outlines, handle, help and status up to date."""
        dragging = self.tools.dragging or self.grip.moving or self.background.following
        if not dragging:
            self.grip.update()
        outlined = () if dragging else self.actions.selection  # it takes longer than the move itself
        self.marks.outline(self.document, outlined, self.stage.contact, self.stage.mapping)
        self.marks.show_help(self.actions.help)
        self.marks.say(self._status())

    def _status(self) -> str:
        told = (self.waiting.news, self.background.progress, self.actions.message)
        return "   ".join(filter(None, told)) or "h: help"

    def _edited(self) -> None:
        """Draw the next frame as at rest, or with fewer samples, where little of it changed; or coarsely."""
        for samples in (self.samples, 1):
            if self.quality.in_time(samples, self.stage.to_draw(samples)):
                self.stage.draw_scale, self.stage.samples = 1.0, samples
                if samples == self.samples:
                    self._moved, self._whole = 0.0, self._shown  # nothing is left for later
                else:
                    self._moved = time.perf_counter()
                return
        self.moving()

    def moving(self) -> None:
        """Draw the next frames at the size that is done in time, all of each."""
        self._moved = time.perf_counter()
        self._ticker.wake()
        if self.quality.expected(self.samples) > self.quality.target:
            self.stage.draw_scale, self.stage.samples = self.quality.scale, 1

    def rest(self) -> None:
        """Draw a whole frame now, however long that takes."""
        self.stage.draw_scale, self.stage.samples = 1.0, self.samples
        self._moved, self._whole = 0.0, self._shown
        patient, self.stage.patient = self.stage.patient, False
        self.plotter.render()
        self.stage.patient = patient

    def make_whole(self) -> None:
        """Draw a whole frame now, unless the last one was, or the window is closed."""
        was = not self.stage.waiting and (self.stage.draw_scale, self.stage.samples) == (1.0, self.samples)
        if not (was or self._closed):
            self.rest()

    def _refine(self) -> None:
        """Draw better than now, slice by slice: first at the window's size, then with all samples."""
        samples = 1 if self.stage.draw_scale < 1.0 else self.samples
        if not self.quality.known or self.quality.expected(samples) > SLICE:
            seconds = self.stage.prepare(samples, SLICE)
            if seconds is None:
                return
            if seconds:
                self.quality.saw(samples, seconds)
        if samples == self.samples:
            self.rest()
        else:
            self.stage.draw_scale, self.stage.samples = 1.0, samples
            self.plotter.render()

    # -- what goes on -----------------------------------------------------------------------------------

    def tick(self) -> None:
        """Look after the background work, and draw a whole frame once nothing moves; nothing once closed."""
        now, dragging = time.perf_counter(), self.tools.dragging or self.grip.moving
        if self._closed or self.waiting.go_on():
            return
        if self.background.look(dragging=dragging):
            self.redraw(whole=not dragging)
        elif self.background.busy and now - self._told > NEWS:
            self._told = now
            self._show_status()
        elif self._moved and now - self._moved > REST:
            self._refine()

    def _give_up(self) -> None:
        self._moved = 0.0  # better frames would fail alike

    def _show_status(self) -> None:
        self.marks.say(self._status())
        self.plotter.render()

    def elsewhere(self, x: int, y: int) -> bool:
        """Whether a place is in a subplot of the same plotter that another window edits."""
        return any(edits_at(stage, x, y) for stage in self.plotter.decals.stages if stage is not self.stage)

    def _hidden(self, x: float, y: float, position: Floats) -> bool:
        """Whether an actor that was added to the plotter hides a point of a surface."""
        return bool(self.stage.hidden(int(x), int(y), position))

    # -- opening and closing ----------------------------------------------------------------------------

    require_screen = staticmethod(require_screen)

    def show(self) -> None:
        """Open the window, and stay until it is closed; off screen and in a lent plotter, draw a frame.

        Raises
        ------
        InvalidEdit
            The window was closed.
        """
        self.begin()
        if self._guest:
            self.plotter.render()
            return
        self.plotter.show(auto_close=False, interactive=self._timed)
        if self._timed:
            self.close()

    def begin(self) -> None:
        """Do what `show` does before it waits for events; the scene comes into the window with `tick`."""
        if self._closed:
            raise InvalidEdit("the window was closed; open another EditWindow on its session")
        self.actions_shown()
        if self.ticking:
            self.stage.patient = True
            self.stage.draw_scale, self._moved = GLANCE, time.perf_counter() - REST
        self.plotter.iren.initialize()
        if self._timed:
            self._timer = self._interactor.CreateRepeatingTimer(TICK)
        self._ticker.wake()

    def close(self) -> None:
        """Close the window, or leave the plotter that was lent, once what goes to a file is there.

        Twice is harmless. What else goes on is stopped.

        Raises
        ------
        InvalidScene
            The file could not be written; the window is closed all the same.
        """
        if self._closed:
            return
        self._closed = True
        self._ticker.stop()
        try:
            self.background.close()
        finally:
            self._close()

    def _close(self) -> None:
        self.session.end()
        self.actions.release()
        self.grip.release()
        self._bindings.release()
        self._end_screenshots()
        if not self._guest:
            self.plotter.close()
        elif self.plotter.render_window is not None:  # otherwise it was closed before us
            self._leave()

    def _leave(self) -> None:
        """Take out of a lent plotter what we put there."""
        self.marks.release()
        if self._timer:
            self._interactor.DestroyTimer(self._timer)
        self._timing.release()
        self._tenancy.end(self.document)
        self.plotter.render()

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
