"""Drive a window by the events of a virtual X server: ``python -m tests.decals.window.x_events``.

Keys and buttons are pressed through the XTEST extension, so they take the way of user: X server, VTK's event
loop, its interactor, ours. DISPLAY names the display; it should have no window manager.
"""

import ctypes
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from decals.window import EditWindow
from tests.decals.editing.scenes import scene
from tests.decals.window.driver import Driver

SIZE = (320, 240)
PATIENCE = 60.0
"""Seconds that an event may take."""

Step = tuple[str, Callable[[], None], Callable[[], bool]]
"""What is tried, how, and what holds once it was done."""


class UserInput:
    """Mouse and keys of a display, as the XTEST extension moves them.

    However long this program is held up between a key's press and its release, the key does not repeat.
    """

    def __init__(self) -> None:
        self._x, self._test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XStringToKeysym.restype = ctypes.c_ulong
        self._display = ctypes.c_void_p(self._x.XOpenDisplay(None))
        self._x.XAutoRepeatOff(self._display)
        self._x.XFlush(self._display)

    def move(self, at: tuple[int, int]) -> None:
        """Point at a pixel of the window, from its lower left corner; it lies in the display's corner."""
        self._test.XTestFakeMotionEvent(self._display, -1, int(at[0]), int(SIZE[1] - 1 - at[1]), 0)
        self._x.XFlush(self._display)

    def button(self, number: int, *, down: bool) -> None:
        """Press or release a button; 4 and 5 are the wheel's."""
        self._test.XTestFakeButtonEvent(self._display, number, int(down), 0)
        self._x.XFlush(self._display)

    def press(self, name: str, *, down: bool) -> None:
        """Press or release a key, by its X name."""
        code = self._x.XKeysymToKeycode(self._display, ctypes.c_ulong(self._x.XStringToKeysym(name.encode())))
        self._test.XTestFakeKeyEvent(self._display, code, int(down), 0)
        self._x.XFlush(self._display)

    def click(self, at: tuple[int, int], *modifiers: str, button: int = 1) -> None:
        """Click, with keys held down."""
        self.move(at)

        def act() -> None:
            self.button(button, down=True)
            self.button(button, down=False)

        self._holding(modifiers, act)

    def key(self, name: str, *modifiers: str) -> None:
        """Press and release a key, with others held down."""

        def act() -> None:
            self.press(name, down=True)
            self.press(name, down=False)

        self._holding(modifiers, act)

    def _holding(self, modifiers: tuple[str, ...], act: Callable[[], None]) -> None:
        for modifier in modifiers:
            self.press(modifier, down=True)
        act()
        for modifier in modifiers:
            self.press(modifier, down=False)


def steps(window: EditWindow, user: UserInput, path: Path) -> Iterator[Step]:
    """What a new user tries, one thing after another."""
    driver, actions, document = Driver(window), window.actions, window.document
    first = driver.state
    (number, at), (other, there) = ((n, at) for _, (n, at) in zip(range(2), driver.visible(), strict=False))
    position = document.decals[number].positions[0]

    def entries(count: int) -> Callable[[], bool]:
        return lambda: len(window.session.labels) == count and not window.session.stroke_open

    def press() -> None:
        user.move(at)
        user.button(1, down=True)

    def hold() -> None:
        user.move(at)
        user.key("m")

    def shows_page(page: int) -> bool:
        return bool(actions.help_page == page)

    place = window.plotter.iren.interactor.GetEventPosition
    yield "point", lambda: user.move(at), lambda: tuple(place()) == at
    yield "help", lambda: user.key("h"), lambda: window.overlay.help_visible
    for page in range(2, actions.help_pages + 1):
        yield "next page", lambda: user.key("h"), partial(shows_page, page)
    yield "no help", lambda: user.key("F1"), lambda: not window.overlay.help_visible
    yield "click", lambda: user.click(at), lambda: actions.state.selection == (number,)
    yield "one more", lambda: user.click(there, "Shift_L"), lambda: actions.state.selection == (number, other)
    yield "one less", lambda: user.click(there, "Control_L"), lambda: actions.state.selection == (number,)
    yield "press", press, lambda: window.tools.drags_decals
    yield "drag", lambda: user.move((at[0] + 9, at[1] + 4)), lambda: window.tools.dragging
    yield "drop", lambda: user.button(1, down=False), entries(1)
    yield "it moved", lambda: None, lambda: (document.decals[number].positions[0] != position).any()
    count = len(document.decals)
    yield "duplicate", lambda: user.key("d"), lambda: len(document.decals) == count + 1
    yield "delete", lambda: user.key("Delete"), lambda: len(document.decals) == count
    yield "aim", lambda: user.move(there), lambda: tuple(place()) == there
    yield "place", lambda: user.key("a"), lambda: len(document.decals) == count + 1
    placed = actions.state.selection[0]
    radius = document.decals[placed].radii[0]
    yield (
        "larger",
        lambda: user.click(there, "Control_L", button=4),
        lambda: document.decals[placed].radii[0] > radius,
    )
    tangent = document.decals[placed].tangents[0]
    yield (
        "turn",
        lambda: user.click(there, "Shift_L", button=5),
        lambda: (document.decals[placed].tangents[0] != tangent).any(),
    )
    yield "image", lambda: user.key("i"), lambda: window.session.labels[-1] == "change the image"
    yield "layer", lambda: user.key("Prior"), lambda: document.decals[placed].layers[0] == 1
    yield "undo", lambda: user.key("z", "Control_L"), lambda: document.decals[placed].layers[0] == 0
    yield "redo", lambda: user.key("y", "Control_L"), lambda: document.decals[placed].layers[0] == 1
    yield "hold a primitive", hold, lambda: window.handle.widget is not None
    yield "let it go", lambda: user.key("m"), lambda: window.handle.widget is None
    yield "save", lambda: user.key("s", "Control_L"), path.is_file
    camera = driver.plotter.camera.position
    yield "zoom", lambda: user.click(there, button=4), lambda: driver.plotter.camera.position != camera
    while window.session.labels:
        left = len(window.session.labels) - 1
        yield "undo all", lambda: user.key("z", "Control_L"), entries(left)
    yield "as at first", lambda: None, lambda: driver.state == first
    yield "ask", lambda: user.key("q"), lambda: actions.state.prompt.asking
    yield "close", lambda: user.key("q"), lambda: False


def main() -> None:
    """Open, drive and close."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.json"
        window = EditWindow(scene(), path=path, size=SIZE)
        play = Play(window, path)
        window.plotter.iren.interactor.AddObserver("TimerEvent", lambda *_: play.tick())
        window.show()
        assert play.failure is None, play.failure
        assert play.name == "close", f"ended at {play.name!r}"
    print("all of it worked")


class Play:
    """Takes a step when the one before has had its effect."""

    def __init__(self, window: EditWindow, path: Path) -> None:
        self._window, self._path = window, path
        self._steps: Iterator[Step] | None = None
        self._holds: Callable[[], bool] = lambda: True
        self._since = time.monotonic()
        self.name = ""
        self.failure: BaseException | None = None

    def tick(self) -> None:
        """Look whether the last step is done, and begin the next."""
        try:
            if self._steps is None:
                self._steps = steps(self._window, UserInput(), self._path)
            if not self._holds():
                assert time.monotonic() < self._since + PATIENCE, f"{self.name!r} had no effect"
                return
            self.name, act, self._holds = next(self._steps)
            self._since = time.monotonic()
            act()
        except BaseException as error:  # VTK would only print it
            self.failure = error
            self._window.plotter.iren.interactor.TerminateApp()


if __name__ == "__main__":
    main()
