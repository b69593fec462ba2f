"""Open a window, drive it and close it, as a program: ``python -m tests.decals.window.on_screen [off]``.

With "off" it does without a screen; otherwise DISPLAY names one, such as a virtual one.
"""

import sys

import numpy as np

from decals.window import EditWindow
from tests.decals.editing.scenes import scene
from tests.decals.window.driver import Driver


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


def main() -> None:
    """Open, drive and close."""
    off_screen = "off" in sys.argv[1:]
    window = EditWindow(scene(), off_screen=off_screen, size=(180, 120))
    interactor = window.plotter.iren.interactor
    if off_screen:
        window.show()
        user(window)
        window.close()
        return
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


if __name__ == "__main__":
    main()
