"""Host plotters: the window of an editor, its own or one that the caller provides."""

import math
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.graphics import require_screen, vtk_warnings_hidden
from blobtree.validation import describe
from decals.editing.document import Document
from decals.editing.gizmo import Ray
from decals.errors import InvalidScene
from decals.rendering.options import STUDIO, Background
from decals.rendering.viewpoint import Projection
from decals.scenes.camera import Camera
from decals.scenes.scene import Scene
from decals.validation import whole_number
from decals.vtk.subplot import SubplotRenderer

DEFAULT_SIZE = (1200, 800)
"""Width and height of a window, in pixels."""

TITLE = "Implicit Decals"
"""Title of a window, after the name of the file."""

MAX_WINDOW_SIDE = 16384
"""Pixels along each side of a window, at most: the limit of VTK."""


class HostPlotter:
    """The plotter in which a scene is edited.

    Parameters
    ----------
    plotter
        The caller's plotter; None for a new window.
    off_screen, size
        Of a new window.

    Attributes
    ----------
    plotter
        The plotter.
    provided
        True for the caller's plotter, which stays open.
    """

    def __init__(self, plotter: Any, *, off_screen: bool, size: tuple[int, int]) -> None:
        self.provided = plotter is not None
        self.plotter: Any = checked_plotter(plotter) if self.provided else new_plotter(off_screen, size)
        self._timer = 0

    @property
    def interactor(self) -> Any:
        """VTK's interactor."""
        return self.plotter.iren.interactor

    @property
    def has_timers(self) -> bool:
        """True if the interactor sends timer events: it does not off screen."""
        return not getattr(self.plotter, "off_screen", False)

    def start_timer(self, milliseconds: int) -> None:
        """Send repeated timer events, if the interactor has timers."""
        self.plotter.iren.initialize()
        if self.has_timers:
            self._timer = self.interactor.CreateRepeatingTimer(milliseconds)

    def stop_timer(self) -> None:
        """Stop the timer events."""
        if self._timer:
            self.interactor.DestroyTimer(self._timer)
            self._timer = 0

    def add_scene(self, scene: Scene) -> None:
        """Show a scene; a provided plotter keeps a camera that was set."""
        if not self.provided:
            show_background(self.plotter, scene.drawing.background)
        keep_camera = self.provided and self.plotter.renderer.camera_set
        self.plotter.decals.add_scene(scene, camera=not keep_camera)

    @property
    def open(self) -> bool:
        """True until the plotter is closed."""
        return self.plotter.render_window is not None

    def set_title(self, title: str) -> None:
        """Name the document in the title of a new window; a provided plotter keeps its own."""
        title = f"{title} - {TITLE}"
        if not self.provided and self.open and self.plotter.title != title:
            self.plotter.title = title
            self.plotter.render_window.SetWindowName(title)

    def leave(self) -> None:
        """End the event loop of the plotter."""
        self.interactor.ExitCallback()

    def run(self) -> None:
        """Show the window, and handle events until the event loop ends."""
        self.plotter.show(auto_close=False, interactive=self.has_timers)

    def resume(self) -> None:
        """Go on to handle events."""
        self.plotter.iren.start()


def show_background(plotter: Any, background: Background) -> None:
    """Show a background behind all objects of a window."""
    plotter.set_background(background.bottom[:3], top=background.top[:3])


def ray_through(subplot: SubplotRenderer, x: float, y: float) -> Ray | None:
    """Return the ray through the centre of a pixel of the window, or None outside the subplot."""
    renderer: Any = subplot.vtk_renderer
    (left, low), (width, height) = renderer.GetOrigin(), renderer.GetSize()
    x, y = x - left + 0.5, y - low + 0.5
    if not (0 <= x <= width and 0 <= y <= height):
        return None
    rays = subplot.viewpoint().rays(width, height)
    return rays.origins(x, y), rays.directions(x, y)


def pixels_of(subplot: SubplotRenderer, points: ArrayLike) -> Float64Array:
    """Return the pixels of the window at which points appear, float64[n, 2]; NaN behind the camera."""
    renderer: Any = subplot.vtk_renderer
    (left, low), (width, height) = renderer.GetOrigin(), renderer.GetSize()
    places = np.asarray(points, np.float64).reshape(-1, 3)
    box = places.min(axis=0, initial=-1.0), places.max(axis=0, initial=1.0)  # decides depths alone
    matrix = subplot.viewpoint().clip_matrix((width, height), box)
    clip = matrix @ np.column_stack([places, np.ones(len(places))]).T
    depth = np.where(clip[3] > 0.0, clip[3], np.nan)
    pixels: Float64Array = (0.5 + 0.5 * (clip[:2] / depth).T) * (width, height) + (left - 0.5, low - 0.5)
    return pixels


def camera_of(subplot: SubplotRenderer) -> Camera | None:
    """Return the camera of a subplot, or None for a parallel projection, which a scene cannot store."""
    camera = subplot.vtk_renderer.camera
    if camera.parallel_projection:
        return None
    return Camera(tuple(camera.position), tuple(camera.focal_point), tuple(camera.up), camera.view_angle)


def move_camera(subplot: SubplotRenderer, shift: ArrayLike) -> None:
    """Move the camera of a subplot by a vector, shape (3,)."""
    if not np.any(shift):
        return
    camera = subplot.vtk_renderer.camera
    camera.position, camera.focal_point = (
        tuple(np.add(point, shift).tolist()) for point in (camera.position, camera.focal_point)
    )
    subplot.vtk_renderer.reset_camera_clipping_range()


TURN_DEGREES = 200.0
"""Degrees of a turn by the height of the view, as VTK's camera turns with the mouse."""

VIEW_HEIGHTS = 1e-5, 1e4
"""Smallest and largest height of the view that zooming reaches, in diagonals of the scene."""


class SubplotCamera:
    """The camera of a subplot; a `decals.editing.action_state.ViewCamera`.

    Parameters
    ----------
    subplot
        The subplot.
    """

    def __init__(self, subplot: SubplotRenderer) -> None:
        self._subplot = subplot
        self._renderer: Any = subplot.vtk_renderer
        self._usable: tuple[Projection, pv.Camera] | None = None

    def keep_usable(self) -> None:
        """Go back to the last usable camera if the present camera is too near, too far or not finite."""
        try:
            projection = self._subplot.viewpoint()
        except InvalidScene:
            if self._usable is None:
                raise
            self._renderer.camera.DeepCopy(self._usable[1])
        else:
            if self._usable is None or projection is not self._usable[0]:
                self._usable = projection, self._renderer.camera.copy()

    @property
    def parallel(self) -> bool:
        """True for a parallel projection; what lies at the target keeps its size when this changes."""
        return bool(self._renderer.camera.parallel_projection)

    @parallel.setter
    def parallel(self, parallel: bool) -> None:
        camera = self._renderer.camera
        if parallel == self.parallel:
            return
        half_height = math.tan(math.radians(camera.view_angle / 2.0))
        if parallel:
            camera.parallel_scale = camera.distance * half_height
        else:
            eye, target = map(np.array, self.eye_and_target())
            camera.position = target + (eye - target) * (
                camera.parallel_scale / half_height / camera.distance
            )
        camera.parallel_projection = parallel
        self._renderer.reset_camera_clipping_range()

    def eye_and_target(self) -> tuple[ArrayLike, ArrayLike]:
        """Return the position of the camera, and its focal point."""
        return self._renderer.camera.position, self._renderer.camera.focal_point

    def look(self, toward: ArrayLike, up: ArrayLike) -> None:
        """Look at the same target from a direction, shape (3,)."""
        camera, direction = self._renderer.camera, np.asarray(toward, np.float64)
        distance = camera.distance / np.linalg.norm(direction)
        camera.position = tuple((np.array(camera.focal_point) + distance * direction).tolist())
        camera.up = tuple(np.asarray(up, np.float64).tolist())
        self._renderer.reset_camera_clipping_range()

    def frame(self, low: ArrayLike, high: ArrayLike) -> None:
        """Show a box, given by its corners, as large as it fits."""
        self._renderer.ResetCamera(np.stack([low, high], axis=1).ravel().astype(float).tolist())

    def turn(self, right: float, up: float) -> None:
        """Turn around the target as a drag by parts of the view's height does."""
        camera = self._renderer.camera
        camera.Azimuth(-TURN_DEGREES * right)
        camera.Elevation(-TURN_DEGREES * up)
        camera.OrthogonalizeViewUp()
        self._renderer.reset_camera_clipping_range()

    def move_and_zoom(self, right: float, up: float, factor: float) -> None:
        """Move what lies at the target, in heights of the view, then enlarge it by a factor.

        The height of the view stays within `VIEW_HEIGHTS`.
        """
        camera = self._renderer.camera
        eye, target = map(np.array, self.eye_and_target())
        tangent = math.tan(math.radians(camera.view_angle / 2.0))
        height = 2.0 * (camera.parallel_scale if self.parallel else camera.distance * tangent)
        side = np.cross(target - eye, camera.up)
        side /= np.linalg.norm(side)
        upward = np.cross(side, target - eye) / camera.distance
        shift = -height * (right * side + up * upward)
        low, high = np.reshape(self._renderer.ComputeVisiblePropBounds(), (3, 2)).T
        if (low <= high).all():
            smallest, largest = np.linalg.norm(high - low) * np.array(VIEW_HEIGHTS)
            factor = height / min(max(height / factor, smallest), largest)
        zoom = 1.0 if self.parallel else 1.0 / factor
        camera.focal_point = tuple((target + shift).tolist())
        camera.position = tuple((target + shift + zoom * (eye - target)).tolist())
        camera.parallel_scale /= factor if self.parallel else 1.0
        self._renderer.reset_camera_clipping_range()


FRAME_SETTINGS = "draw_scale", "samples", "wait_for_gpu", "keep_previous_frame", "walks_in_thread"
"""Settings of a subplot that say how it draws frames for a window."""


class SubplotBackup:
    """Scene and settings of a subplot before a document is edited in it.

    Parameters
    ----------
    subplot
        The subplot.
    """

    def __init__(self, subplot: SubplotRenderer) -> None:
        self._subplot, self._scene = subplot, subplot.scene
        self._kept = {name: getattr(subplot, name) for name in FRAME_SETTINGS}

    def restore(self, document: Document) -> None:
        """Restore settings and scene; a scene that was edited is replaced by the result."""
        subplot = self._subplot
        for name, value in self._kept.items():
            setattr(subplot, name, value)
        if subplot.scene is document:
            subplot.scene = document.scene if isinstance(self._scene, Scene) else self._scene


def edits_at(subplot: SubplotRenderer, x: int, y: int) -> bool:
    """Return True if a subplot covers a pixel and a window edits in it."""
    return isinstance(subplot.scene, Document) and subplot.covers(x, y)


@contextmanager
def collected_interrupts() -> Iterator[list[int]]:
    """Collect the first Ctrl + C in a list within a ``with`` block.

    VTK ends the process, with a text of its own, if a callback raises KeyboardInterrupt. Only a second
    Ctrl + C raises it, in case the window does not respond.
    """
    received: list[int] = []

    def receive(number: int, _frame: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)

    own = signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    if own or threading.current_thread() is not threading.main_thread():
        yield received
        return
    signal.signal(signal.SIGINT, receive)
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def checked_size(size: object) -> tuple[int, int]:
    """Return width and height of a window, or raise `InvalidScene`."""
    if not isinstance(size, Sequence) or len(size) != 2:
        raise InvalidScene(f"size: expected width and height in pixels, got {describe(size)}")
    width, height = (whole_number("size", side, 1, MAX_WINDOW_SIDE, InvalidScene) for side in size)
    return width, height


def new_plotter(off_screen: bool, size: tuple[int, int]) -> Any:
    """Return an empty plotter with a background, without VTK's multisampling.

    Decals are antialiased by their own samples. Without a graphics card, multisampling takes half of a
    frame's time.
    """
    if not off_screen:
        require_screen()
    with vtk_warnings_hidden():
        plotter: Any = pv.Plotter(off_screen=off_screen, window_size=list(size), title=TITLE)
    plotter.disable_anti_aliasing()
    show_background(plotter, STUDIO)
    return plotter


def checked_plotter(plotter: Any) -> Any:
    """Return the caller's plotter if it is open and has an interactor, or raise `InvalidScene`."""
    if not isinstance(plotter, pv.BasePlotter):
        raise InvalidScene(f"expected a pyvista plotter to edit in, got {type(plotter).__name__}")
    if getattr(plotter, "render_window", None) is None:
        raise InvalidScene("expected an open plotter to edit in, but this one was closed; make another")
    if getattr(plotter, "iren", None) is None:
        raise InvalidScene("expected a plotter with an interactor; make pyvistaqt's with off_screen=False")
    return plotter


def before_screenshots(plotter: Any, call: Callable[[], None]) -> Callable[[], None]:
    """Call a function before each screenshot of a plotter; the returned function ends that."""
    method, before = plotter.screenshot, vars(plotter).get("screenshot")

    @wraps(method)
    def screenshot(*arguments: Any, **options: Any) -> Any:
        call()
        return method(*arguments, **options)

    def end() -> None:
        if vars(plotter).get("screenshot") is screenshot:  # else it was wrapped once more
            del vars(plotter)["screenshot"]
            if before is not None:
                vars(plotter)["screenshot"] = before

    vars(plotter)["screenshot"] = screenshot  # pyvista refuses new attributes in the usual way
    return end
