"""Events of a window: those of VTK go to the pointer tools, and ticks come from timers or an asyncio loop.

Events that the tools do not use go on to the camera.
"""

import asyncio
import weakref
from collections.abc import Callable
from typing import Any, Protocol

from decals.editing.pointer_tools import PointerTools

PRIORITY = 0.4
"""Priority of the observers: after VTK's widgets (0.5), before its camera (0)."""

EVENTS = (
    "LeftButtonPressEvent",
    "LeftButtonReleaseEvent",
    "MouseMoveEvent",
    "MouseWheelForwardEvent",
    "MouseWheelBackwardEvent",
    "KeyPressEvent",
    "CharEvent",
    "TimerEvent",
)
LOCAL_EVENTS = (
    "LeftButtonPressEvent",
    "MouseWheelForwardEvent",
    "MouseWheelBackwardEvent",
    "KeyPressEvent",
)
"""Events that belong to the window whose subplot is under the pointer."""

STYLE_EVENTS = ("StartInteractionEvent", "InteractionEvent", "EndInteractionEvent")
"""Events of the camera. While it moves, VTK sends pointer events to its style only."""


class EventTarget(Protocol):
    """A window that receives events."""

    @property
    def tools(self) -> PointerTools:
        """Pointer tools of the window."""
        ...

    def tick(self) -> None:
        """Do the next piece of background work."""
        ...

    def redraw(self, *, whole: bool) -> None:
        """Show the present state."""
        ...

    def begin_motion(self) -> None:
        """Draw coarse frames from now on."""
        ...

    def in_other_subplot(self, x: int, y: int) -> bool:
        """Return True if a pixel belongs to another window."""
        ...


class EventBindings:
    """Observers of an interactor and its style; they do not keep the window alive.

    Parameters
    ----------
    window
        Receives the events.
    interactor
        VTK's interactor.
    """

    def __init__(self, window: EventTarget, interactor: Any) -> None:
        self._interactor = interactor
        self._window = weakref.ref(window)
        self._key_used = False
        observer = self._observer(EventBindings._handle)
        self._tags = {event: interactor.AddObserver(event, observer, PRIORITY) for event in EVENTS}
        self._style: Any = None
        self._style_tags: list[int] = []
        self._observe_style()

    def _observer(
        self, method: Callable[["EventBindings", EventTarget, str], None]
    ) -> Callable[[Any, str], None]:
        """Return a VTK observer that calls a method while the window lives."""
        bindings = weakref.ref(self)

        def observe(_caller: Any, event: str) -> None:
            alive = bindings()
            window = None if alive is None else alive._window()
            if alive is not None and window is not None:
                method(alive, window, event)

        return observe

    def _observe_style(self) -> None:
        """Observe the interactor's present style, which may be replaced at any time."""
        style = self._interactor.GetInteractorStyle()
        if style is self._style:
            return
        self._release_style()
        observer = self._observer(EventBindings._handle_style)
        self._style = style
        self._style_tags = [style.AddObserver(event, observer) for event in STYLE_EVENTS]

    def _release_style(self) -> None:
        for tag in self._style_tags:
            self._style.RemoveObserver(tag)
        self._style_tags = []

    def release(self) -> None:
        """Remove all observers."""
        for tag in self._tags.values():
            self._interactor.RemoveObserver(tag)
        self._release_style()
        self._tags = {}

    def _handle(self, window: EventTarget, event: str) -> None:
        """Handle an event of the interactor; used events go no further."""
        self._observe_style()
        if self._use(window, event):
            self._interactor.GetCommand(self._tags[event]).SetAbortFlag(1)

    def _use(self, window: EventTarget, event: str) -> bool:
        """Pass an event to the tools, and return True if they used it."""
        if event == "TimerEvent":
            window.tick()
            return False
        if event == "CharEvent":
            return self._key_used
        source, tools = self._interactor, window.tools
        pixel = source.GetEventPosition()
        ctrl, shift = bool(source.GetControlKey()), bool(source.GetShiftKey())
        if event in LOCAL_EVENTS and window.in_other_subplot(*pixel):
            self._key_used = False
            return False
        if event == "KeyPressEvent":
            name, text = source.GetKeySym() or "", source.GetKeyCode() or ""
            self._key_used = tools.key(name, *pixel, ctrl=ctrl, shift=shift, text=text)
            used = self._key_used
        elif event == "LeftButtonPressEvent":
            pressed = tools.press(*pixel, ctrl=ctrl, shift=shift)
            if tools.dragging:  # a press alone changes nothing visible, but with a brush
                window.redraw(whole=False)
            return pressed
        elif event == "LeftButtonReleaseEvent":
            used = tools.release(*pixel, ctrl=ctrl, shift=shift)
        elif event == "MouseMoveEvent":
            used = tools.move(*pixel)
        else:
            up = event == "MouseWheelForwardEvent"
            used = tools.wheel(up, *pixel, ctrl=ctrl, shift=shift)
        if used:
            window.redraw(whole=not tools.dragging)
        return used

    def _handle_style(self, window: EventTarget, event: str) -> None:
        """Handle an event of the camera: it begins to move, moves, or stops."""
        source = self._interactor
        pixel = source.GetEventPosition()
        if event == "StartInteractionEvent":
            window.begin_motion()
        elif event == "InteractionEvent":
            window.tools.move(*pixel)
        else:
            ctrl, shift = bool(source.GetControlKey()), bool(source.GetShiftKey())
            window.tools.move(*pixel)
            window.tools.release(*pixel, ctrl=ctrl, shift=shift)
            window.redraw(whole=True)


TICK_MILLISECONDS = 20
"""Time between two ticks of a window."""


class Ticking(Protocol):
    """An object with work to do in small steps."""

    @property
    def busy(self) -> bool:
        """True while there is work."""
        ...

    def tick(self) -> None:
        """Do one step."""
        ...


def running_loop() -> asyncio.AbstractEventLoop | None:
    """Return the asyncio loop that runs in this thread, or None."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None


class AsyncTicker:
    """Calls ``tick`` from a task of the running asyncio loop, while there is work.

    Parameters
    ----------
    target
        The object with work. It is not kept alive.
    """

    def __init__(self, target: Ticking) -> None:
        self._target = weakref.ref(target)
        self._task: asyncio.Task[None] | None = None

    def wake(self) -> None:
        """Start the task, if an asyncio loop runs and no task does."""
        loop, task = running_loop(), self._task
        if loop is not None and (task is None or task.done() or task.get_loop() is not loop):
            self._task = loop.create_task(_tick_while_busy(self._target), name="ticks of an EditWindow")

    def stop(self) -> None:
        """Cancel the task."""
        if self._task is not None and not self._task.get_loop().is_closed():
            self._task.cancel()
        self._task = None


async def _tick_while_busy(target: "weakref.ref[Ticking]") -> None:
    while _tick(target()):
        await asyncio.sleep(TICK_MILLISECONDS / 1000)


def _tick(target: Ticking | None) -> bool:
    """Do one step, and return True if there is more work."""
    if target is None or not target.busy:
        return False
    target.tick()
    return target.busy
