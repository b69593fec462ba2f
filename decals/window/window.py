"""The editing window."""

import os
import weakref
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

import decals.vtk  # noqa: F401  (registers `plotter.decals`)
from blobtree._typing import Float32Array
from blobtree.graphics import require_gl, require_screen
from blobtree.progress import displayed
from blobtree.validation import describe
from decals.editing.actions import Actions
from decals.editing.background import BackgroundJobs
from decals.editing.document import Document
from decals.editing.pointer_tools import PointerTools
from decals.editing.session import EditSession
from decals.errors import InvalidEdit, InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.scenes.scene import Scene
from decals.validation import count_number
from decals.vtk.adapters import weak_callback
from decals.vtk.subplot import MAX_SAMPLES, SubplotRenderer
from decals.vtk.window_title import WindowTitle
from decals.window.event_bindings import TICK_MILLISECONDS, AsyncTicker, EventBindings, running_loop
from decals.window.frames import STATUS_INTERVAL, FrameController, FrameState, RateLimit, Warmup
from decals.window.host_plotter import (
    DEFAULT_SIZE,
    HostPlotter,
    SubplotBackup,
    SubplotCamera,
    before_screenshots,
    camera_of,
    checked_size,
    collected_interrupts,
    edits_at,
    move_camera,
    pixels_of,
    ray_through,
)
from decals.window.overlay import Overlay, PrimitiveHandle

HELP_HINT = "h: help"
"""First part of the status line, unless a prompt is open."""

BARE_HINT = "Shift+G: fill bare places"
"""Part of the status line after an edit that opened some; their number follows."""

EMPTY_HINT = f"{HELP_HINT}   n: add a ball   l: add a limb"
"""The same for a scene without objects."""


class EditWindow:
    """A pyvista window in which a scene is edited.

    ``window.plotter`` is an ordinary plotter, so anything of pyvista can be added. `decals.edit` opens a
    window, waits until it is closed, and returns the edited scene.

    Parameters
    ----------
    scene : Scene, EditSession, SceneObject or Model
        A scene or a session; or a model as `decals.cover` takes it, a list of such models, or the path of a
        model or a scene.
    path : str or path-like, optional
        File to save to.
    size : (int, int)
        Width and height of the window in pixels.
    off_screen : bool
        If True, the window has no screen and receives no events.
    samples : int
        Samples per pixel along each axis, while nothing moves.
    plotter : pyvista.BasePlotter, optional
        Edit in the active subplot of this plotter, such as one of pyvistaqt or trame, in place of a new
        window. The plotter stays open; ``size`` and ``off_screen`` do not apply. A subplot that showed a
        scene of ``plotter.decals`` shows the edited scene afterwards.
    recover : callable, optional
        Reads the recovery file that an earlier window left beside ``path``, such as `decals.load_scene`. Its
        changes become one undo entry. Default: a recovery file is ignored.
    contact : Contact or str, optional
        Contact mode at the beginning. Default: that of the scene, or of the plotter's subplot if it was set
        there. Scenes that the window saves keep the present one.
    mapping : ImageMapping or str, optional
        Image mapping at the beginning, likewise.
    stiffness : float, optional
        Stiffness of elastic contact at the beginning, likewise.

    Attributes
    ----------
    session : EditSession
        The edited session.
    actions : Actions
        Selection and actions.
    tools : PointerTools
        Pointer, wheel and key input.
    subplot : SubplotRenderer
        Draws the scene.
    frames : FrameController
        Chooses the quality of frames.
    camera : SubplotCamera
        The camera of the subplot.

    Raises
    ------
    NoGraphics
        There is no OpenGL, or no screen for a window.
    InvalidScene
        The scene, size, path, samples or plotter is not valid.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=30, images=["eye"])
    >>> with decals.window.EditWindow(scene, off_screen=True, size=(160, 120)) as window:
    ...     window.show()
    ...     window.actions.perform("select_all", lambda: None)
    ...     selected = len(window.actions.state.selection)
    >>> selected
    30
    """

    def __init__(
        self,
        scene: Scene | EditSession,
        *,
        path: str | os.PathLike[str] | None = None,
        size: tuple[int, int] = DEFAULT_SIZE,
        off_screen: bool = False,
        samples: int = 2,
        plotter: pv.BasePlotter | None = None,
        recover: Callable[[Path], Scene] | None = None,
        contact: AnyContact | str | None = None,
        mapping: ImageMapping | str | None = None,
        stiffness: float | None = None,
    ) -> None:
        if not isinstance(scene, Scene | EditSession):
            raise InvalidScene(f"expected a Scene or an EditSession to edit, got {type(scene).__name__}")
        size = checked_size(size)
        samples = count_number("samples", samples, 1, MAX_SAMPLES, InvalidScene)
        if path is not None and not isinstance(path, str | os.PathLike):
            raise InvalidScene(f"path: expected a path to save to, got {describe(path)}")
        require_gl()
        self._host = HostPlotter(plotter, off_screen=off_screen, size=size)
        self.session = scene if isinstance(scene, EditSession) else EditSession(scene)
        self._closed = False
        self._work, self._title = "", WindowTitle(self.plotter)
        self._opened = ExitStack()
        self._interrupts: list[int] = []
        self.actions = Actions(self.session, path=path, threaded=True)
        if recover is not None:
            self.actions.files.recover(recover)
        self.subplot: SubplotRenderer = self.plotter.decals.subplot
        self._backup = SubplotBackup(self.subplot)
        self._host.add_scene(self.document.scene)
        drawing = self.subplot.drawing.overridden(contact=contact, mapping=mapping, stiffness=stiffness)
        self.subplot.scene = self.document
        move_camera(self.subplot, np.negative(self.document.origin))
        self.frames = FrameController(self.subplot, samples, self.plotter.render, self._shown_version)
        self.warmup = Warmup(self.subplot, weak_callback(self._show_status), self.frames.give_up)
        self._end_screenshots = before_screenshots(self.plotter, weak_callback(self._before_screenshot))
        self.actions.files.camera = lambda: camera_of(self.subplot) if self._host.open else None
        self.actions.files.leave = self._host.leave
        for name, mode in drawing.modes.items():
            setattr(self.subplot, name, mode)
        self.camera = self.actions.state.camera = SubplotCamera(self.subplot)
        self.tools = PointerTools(
            self.actions,
            lambda x, y: ray_through(self.subplot, x, y),
            self._is_occluded,
            lambda points: pixels_of(self.subplot, points),
        )
        self.overlay = Overlay(self.plotter, self.actions.state, lambda: self.subplot.draw_scale)
        self.handle = PrimitiveHandle(
            self.subplot.vtk_renderer,
            self.actions,
            lambda whole: self.redraw(whole=whole),
            lambda: self.tools.click_through(*self._host.interactor.GetEventPosition()),
        )
        self._bindings = EventBindings(self, self._host.interactor)
        self._ticker = AsyncTicker(self)
        self._status_limit = RateLimit(STATUS_INTERVAL)

    # -- state ------------------------------------------------------------------------------------------

    @property
    def plotter(self) -> Any:
        """The pyvista plotter."""
        return self._host.plotter

    @property
    def document(self) -> Document:
        """The edited document."""
        return self.session.document

    @property
    def background(self) -> BackgroundJobs:
        """Long edits and saves."""
        return self.actions.state.background

    @property
    def ticking(self) -> bool:
        """True if a timer or an asyncio loop calls `tick`; otherwise every frame is whole."""
        return self._host.has_timers or running_loop() is not None

    @property
    def busy(self) -> bool:
        """True while background work runs, or the frame is to be refined."""
        coarse = self.frames.state is FrameState.COARSE
        unsaved = self.actions.files.recovery.pending
        drawing = coarse or self.subplot.warming_up or self.subplot.walking
        working = self.background.busy or self.actions.bare.busy
        return not self._closed and (working or unsaved or drawing)

    def _shown_version(self) -> tuple[object, ...]:
        subplot, document = self.subplot, self.document
        drawing = subplot.drawing, subplot.shown_mapping, id(subplot.drawn_objects)
        camera = subplot.vtk_renderer.camera
        place = tuple(camera.position), tuple(camera.focal_point), tuple(camera.up)
        lens = camera.view_angle, camera.parallel_projection, camera.parallel_scale
        return id(document.objects), id(document.images), document.decals.version, *drawing, *place, *lens

    # -- frames -----------------------------------------------------------------------------------------

    def redraw(self, *, whole: bool) -> None:
        """Show the present state; a closed window does nothing.

        Parameters
        ----------
        whole
            If True, the frame is whole, now or a little later. If False, it is drawn in time for a drag.
        """
        if self._closed:
            return
        self.camera.keep_usable()
        self.frames.prepare_aside(self.ticking)  # a server's loop begins after the first frame
        self.update_overlay()
        if whole and not self.ticking:
            self.draw_whole_frame()
            return
        if not whole or self.frames.outdated:
            self.frames.choose_for_edit()
        self.plotter.render()
        self._ticker.wake()

    def begin_motion(self) -> None:
        """Draw the next frames at a quality that is in time for a moving camera."""
        self.camera.keep_usable()
        self.frames.choose_for_motion()
        self._ticker.wake()

    def cancel_press(self) -> None:
        """Forget a press of the button: revert what its drag has changed, and let the camera stop."""
        self.tools.cancel()
        self._host.interactor.InvokeEvent("LeftButtonReleaseEvent")

    def draw_whole_frame(self) -> None:
        """Draw a whole frame now, however long it takes."""
        self.frames.draw_whole()

    def _before_screenshot(self) -> None:
        if not self._closed:
            self.frames.require_whole()

    def update_overlay(self) -> None:
        """Update outlines, handle, help and status."""
        dragging = self.tools.dragging or self.handle.dragging or self.background.following
        dragging |= self.overlay.moving
        if not dragging:
            self.handle.update()
        state = self.actions.state
        outlined = ((), ()) if dragging else (state.selection, state.nodes)  # outlines take longer
        self.overlay.outline(*outlined, self.subplot.contact, self.subplot.shown_mapping)
        self.actions.help_pages = self.overlay.show_help(self.actions.help_page)
        self.overlay.show_status(self._status())
        self._host.set_title(self.session.title_of(self.actions.files.path))

    def _status(self) -> str:
        state = self.actions.state
        hint = HELP_HINT if self.document.objects else EMPTY_HINT
        progress = self.warmup.status, self._work, self.background.progress
        places = self.actions.bare.places
        bare = f"{BARE_HINT}: {places}" if places and self.actions.bare.offer else ""
        parts = (state.prompt.text or hint, bare, *progress, state.message)
        return "   ".join(filter(None, parts))

    def _show_work(self, stage: str, fraction: float) -> None:
        """Show other work, such as a compilation: the next status has it, and the title if it blocks."""
        self._work = stage
        self._title.show(stage, fraction)

    def _show_status(self) -> None:
        if self.overlay.shows_status:
            self.overlay.show_status(self._status())
            self.plotter.render()

    # -- background work --------------------------------------------------------------------------------

    def tick(self) -> None:
        """Do the next piece of background work, and refine the frame once nothing moves."""
        if self._interrupts and not self._closed:
            self._host.interactor.TerminateApp()
            return
        dragging = self.tools.dragging or self.handle.dragging
        if self._closed or self.warmup.advance():
            return
        if self.background.poll(dragging=dragging) or self.subplot.end_walking():
            self.redraw(whole=not dragging)
        elif self.background.busy and self._status_limit.take():
            self._show_status()
        else:
            self.frames.refine_when_due()
        bare = self.actions.bare
        if not dragging:
            self.actions.files.update()
            if bare.update(resting=not self.background.busy_editing):
                self._show_status()
        elif bare.busy or bare.places:
            bare.forget()

    def in_other_subplot(self, x: int, y: int) -> bool:
        """Return True if a pixel is in a subplot of the same plotter that another window edits."""
        if self.subplot.covers(x, y):
            return False
        subplots = self.plotter.decals.subplots
        return any(edits_at(subplot, x, y) for subplot in subplots if subplot is not self.subplot)

    def _is_occluded(self, x: float, y: float, position: Float32Array) -> bool:
        """Return True if another actor of the plotter hides a surface point."""
        return bool(self.subplot.hidden(int(x), int(y), position))

    # -- opening and closing ----------------------------------------------------------------------------

    require_screen = staticmethod(require_screen)

    def show(self) -> None:
        """Open the window and wait until it is closed; off screen and in a given plotter, draw one frame.

        If there are unsaved changes, the window asks before it closes. Ctrl+C in the terminal leaves them in
        the recovery file.

        Raises
        ------
        InvalidEdit
            The window was closed before.
        KeyboardInterrupt
            Ctrl + C was pressed in the terminal; the window is closed then.
        """
        self.begin()
        if self._host.provided:
            self.plotter.render()
            return
        if not self._host.has_timers:
            self._host.run()
            return
        files = self.actions.files
        with collected_interrupts() as self._interrupts:
            self._host.run()
            while self._host.open and not self._interrupts and not files.may_close():
                self.redraw(whole=False)
                self._host.resume()
        self.close()
        if self._interrupts:
            raise KeyboardInterrupt

    def begin(self) -> None:
        """Start the timer and the first, coarse frame; `show` calls it."""
        if self._closed:
            raise InvalidEdit("the window was closed; open another EditWindow on its session")
        alive = weakref.ref(self)
        self._opened.enter_context(
            displayed(
                lambda *report: None if (window := alive()) is None else window._show_work(*report),
                alone=self._title.visible,
            )
        )
        self.update_overlay()
        self.frames.prepare_aside(self.ticking)
        if self.ticking:
            self.frames.begin()
        self._host.start_timer(TICK_MILLISECONDS)
        self._ticker.wake()

    def close(self) -> None:
        """Close the window, or leave the given plotter, after all saves are complete.

        Background edits are cancelled. Unsaved changes stay in the recovery file, unless the user discarded
        them. Closing twice is harmless.

        Raises
        ------
        InvalidScene
            The file could not be written; the window is closed nevertheless.
        """
        if self._closed:
            return
        self._closed = True
        self._ticker.stop()
        try:
            self.actions.bare.close()
            self.background.close()
            self.actions.files.finish()
        finally:
            self._release()

    def _release(self) -> None:
        self._opened.close()
        self.session.end_stroke()
        self.actions.state.close()
        self.handle.release()
        self._bindings.release()
        self._end_screenshots()
        if not self._host.provided:
            self.plotter.close()
        elif self._host.open:  # else the caller closed it
            self._leave_plotter()

    def _leave_plotter(self) -> None:
        """Remove from the caller's plotter what the window added."""
        self.overlay.release()
        self._host.stop_timer()
        self.frames.release()
        self._backup.restore(self.document)
        move_camera(self.subplot, self.document.origin)
        self.plotter.render()

    def __enter__(self) -> "EditWindow":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
