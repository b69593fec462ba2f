"""VTK's events to tools: ours first, what they do not use goes on to the camera."""

import weakref
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from decals.window.window import EditWindow

PRIORITY = 0.4
"""After VTK's widgets (0.5), before its camera (0)."""

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
BEGINNINGS = (
    "LeftButtonPressEvent",
    "MouseWheelForwardEvent",
    "MouseWheelBackwardEvent",
    "KeyPressEvent",
)
"""Events that belong to the window in whose subplot the pointer is."""
STYLE_EVENTS = ("StartInteractionEvent", "InteractionEvent", "EndInteractionEvent")
"""While the camera moves, VTK tells nobody but its style of the pointer."""


class Bindings:
    """Observers of a window's interactor and of its style; they do not keep the window alive."""

    def __init__(self, window: "EditWindow", interactor: Any) -> None:
        self._interactor = interactor
        self._window = weakref.ref(window)
        self._used_key = False
        me = weakref.ref(self)
        self._tags = {event: interactor.AddObserver(event, _heard(me), PRIORITY) for event in EVENTS}
        self._style: Any = None
        self._style_tags: list[int] = []
        self._follow_style()

    def _follow_style(self) -> None:
        """Observe the style that the interactor has now; somebody may give it another at any time."""
        style = self._interactor.GetInteractorStyle()
        if style is self._style:
            return
        self._leave_style()
        me = weakref.ref(self)
        self._style = style
        self._style_tags = [style.AddObserver(event, _heard_style(me)) for event in STYLE_EVENTS]

    def _leave_style(self) -> None:
        for tag in self._style_tags:
            self._style.RemoveObserver(tag)
        self._style_tags = []

    def release(self) -> None:
        """Observe no more."""
        for tag in self._tags.values():
            self._interactor.RemoveObserver(tag)
        self._leave_style()
        self._tags = {}

    def hear(self, event: str) -> None:
        """Take an event of the interactor; one that is used goes nowhere else."""
        window = self._window()
        self._follow_style()
        if window is not None and self._used(window, event):
            self._interactor.GetCommand(self._tags[event]).SetAbortFlag(1)

    def _used(self, window: "EditWindow", event: str) -> bool:
        if event == "TimerEvent":
            window.tick()
            return False
        if event == "CharEvent":
            return self._used_key
        source = self._interactor
        place = source.GetEventPosition()
        ctrl, shift = bool(source.GetControlKey()), bool(source.GetShiftKey())
        tools = window.tools
        if event in BEGINNINGS and window.elsewhere(*place):
            self._used_key = False
            return False
        if event == "KeyPressEvent":
            self._used_key = tools.key(source.GetKeySym() or "", *place, ctrl=ctrl, shift=shift)
            used = self._used_key
        elif event == "LeftButtonPressEvent":
            return tools.press(*place, ctrl=ctrl, shift=shift)  # nothing to see yet
        elif event == "LeftButtonReleaseEvent":
            used = tools.release(*place, ctrl=ctrl, shift=shift)
        elif event == "MouseMoveEvent":
            used = tools.move(*place)
        else:
            up = event == "MouseWheelForwardEvent"
            used = tools.wheel(up, *place, ctrl=ctrl, shift=shift)
        if used:
            window.redraw(whole=not tools.dragging)
        return used

    def hear_style(self, event: str) -> None:
        """Take an event of the camera: it begins to move, moves, or rests."""
        window = self._window()
        if window is None:
            return
        source = self._interactor
        place = source.GetEventPosition()
        if event == "StartInteractionEvent":
            window.moving()
        elif event == "InteractionEvent":
            window.tools.move(*place)
        else:
            ctrl, shift = bool(source.GetControlKey()), bool(source.GetShiftKey())
            window.tools.move(*place)
            window.tools.release(*place, ctrl=ctrl, shift=shift)
            window.redraw(whole=True)


def _heard(me: "weakref.ref[Bindings]") -> Any:
    def call(_interactor: Any, event: str) -> None:
        bindings = me()
        if bindings is not None:
            bindings.hear(event)

    return call


def _heard_style(me: "weakref.ref[Bindings]") -> Any:
    def call(_style: Any, event: str) -> None:
        bindings = me()
        if bindings is not None:
            bindings.hear_style(event)

    return call
