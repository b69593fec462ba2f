"""Open windows one after another, as a program: ``python -m tests.decals.window.on_screen PART …``.

Parts are the keys of `PARTS`. All but "off" need a screen; DISPLAY names one, such as a virtual one.
"""

import sys

import numpy as np

from decals import Camera, MeshObject, Scene
from decals.window import EditWindow
from tests.decals.editing.scenes import box, one, scene
from tests.decals.window import x_events
from tests.decals.window.driver import Driver

SIZE = (180, 120)


def user(window: EditWindow) -> None:
    """Drag a decal, undo it, and say whether the first picture came back."""
    driver = Driver(window)
    first, state = driver.shot(), driver.state
    _, at = next(driver.visible())
    driver.click(at)
    driver.drag(at, (at[0] + 4, at[1]), (at[0] + 12, at[1] + 3))
    assert driver.session.labels == ("move",), driver.session.labels
    assert driver.state != state
    assert (driver.shot() != first).any()
    driver.key("z", ctrl=True)
    driver.key("Escape")
    assert driver.state == state
    window.actions.state.message = ""
    window.update_overlay()
    np.testing.assert_array_equal(driver.shot(), first)
    print("the first picture came back")


def without_a_screen() -> None:
    window = EditWindow(scene(), off_screen=True, size=SIZE)
    window.show()
    user(window)
    window.close()


def at_its_first_tick() -> None:
    """Drive a window from its own timer, in VTK's event loop."""
    window = EditWindow(scene(), size=SIZE)
    interactor = window.plotter.iren.interactor
    failures: list[BaseException] = []
    completed = False

    def once(_source: object, _event: str) -> None:
        nonlocal completed
        interactor.RemoveObserver(tag)
        try:
            user(window)
            completed = True
        except BaseException as error:  # VTK would only print it
            failures.append(error)
        interactor.TerminateApp()

    tag = interactor.AddObserver("TimerEvent", once)  # the window's own timer, at its first tick
    window.show()
    if failures:
        raise failures[0]
    if not completed:
        sys.exit("the window never received a timer event; is the display reachable?")


def asked_to_close() -> None:
    """Let the window manager ask a window with unsaved changes to close, twice."""
    cube = MeshObject("cube", *box((-1, -1, -1), (1, 1, 1)))
    window = EditWindow(
        Scene(objects=(cube,), decals=one(images=[-1]), camera=Camera((0, 0, 6))), size=(120, 80)
    )
    interactor = window.plotter.iren.interactor
    ticks: list[bool] = []

    def tick(*_: object) -> None:
        ticks.append(window.actions.state.prompt.asking)
        if len(ticks) == 3:
            window.tools.key("a", 0, 0, ctrl=True)
            window.tools.key("d", 0, 0)
        if len(ticks) in (3, 6):
            interactor.ExitCallback()  # as VTK does when the window manager asks

    interactor.AddObserver("TimerEvent", tick)
    window.show()
    print("ticks", ticks[:6], "open" if window._host.open else "closed")


PARTS = {
    "off": without_a_screen,
    "tick": at_its_first_tick,
    "asked": asked_to_close,
    "events": x_events.main,
}

if __name__ == "__main__":
    for part in sys.argv[1:]:
        PARTS[part]()
