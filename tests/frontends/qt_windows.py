"""Drive windows of pyvistaqt by Qt events, as a program: ``python -m tests.frontends.qt_windows NAME``.

DISPLAY names a screen, such as a virtual one.
"""

import gc
import sys
import weakref
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np
import pyvista as pv
from pyvistaqt import BackgroundPlotter, QtInteractor
from qtpy.QtCore import QEvent, QPoint, Qt
from qtpy.QtGui import QImage
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QMainWindow

import decals.vtk  # noqa: F401  (pyvistaqt's windows hide how pyvista finds components)
from decals.window import EditWindow
from decals.window.frames import FrameState
from tests.decals.editing.scenes import scene
from tests.decals.vtk.scenes import both
from tests.decals.window.driver import Driver
from tests.frontends import page as docs

SIZE = (320, 240)
NONE = Qt.KeyboardModifier.NoModifier
LEFT = Qt.MouseButton.LeftButton


def widget(parent: Any = None) -> Any:
    """An interactor of pyvistaqt's on the screen."""
    made = QtInteractor(parent, auto_update=False)
    made.resize(*SIZE)
    made.show()
    QApplication.processEvents()
    return made


def fill(plotter: Any) -> None:
    """Decals on our objects and on an actor of VTK's."""
    actor = plotter.add_mesh(pv.Sphere(center=(0, 0, 1), radius=0.4))
    plotter.add_mesh(pv.Cube(center=(0.5, -0.5, 0.4), x_length=0.6), color="skyblue", opacity=0.4)
    plotter.decals.add_scene(both(), camera=True)
    plotter.decals.apply(actor)


def drawn(plotter: Any) -> np.ndarray:
    """The picture that pyvista saves; it must be the one in the widget."""
    plotter.render()
    QApplication.processEvents()
    picture = np.asarray(plotter.screenshot(None, return_img=True))[..., :3].astype(int)
    image = plotter.grabFramebuffer().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    seen = rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3)
    np.testing.assert_array_equal(picture, seen)
    return picture


def expected(plotter: Any) -> np.ndarray:
    """The same of a plain plotter without a screen, from where the other's camera stands now."""
    height, width = drawn(plotter).shape[:2]
    plain = pv.Plotter(off_screen=True, window_size=[width, height])
    fill(plain)
    plain.set_background(plotter.background_color)
    plain.camera_position = plotter.camera_position
    plain.render()
    picture = np.asarray(plain.screenshot(None, return_img=True))[..., :3].astype(int)
    plain.close()
    return picture


def drag(plotter: Any, *places: tuple[int, int], modifiers: Any = NONE) -> None:
    """A drag with the left button; places count from the lower left, as VTK's do."""
    points = [QPoint(x, plotter.height() - 1 - y) for x, y in places]
    QTest.mousePress(plotter, LEFT, modifiers, points[0])
    for point in points[1:]:
        QTest.mouseMove(plotter, point)
        QApplication.processEvents()
    QTest.mouseRelease(plotter, LEFT, modifiers, points[-1])
    QApplication.processEvents()


def let_go(plotter: Any) -> None:
    """Close and delete a widget."""
    plotter.close()
    plotter.deleteLater()
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


def pixels() -> None:
    """A widget shows what a plain plotter draws: at first, turned by hand, resized."""
    plotter = widget()
    fill(plotter)
    first = drawn(plotter)
    np.testing.assert_array_equal(first, expected(plotter))
    drag(plotter, (20, 20), (40, 25), (90, 60))
    assert (drawn(plotter) != first).any()
    np.testing.assert_array_equal(drawn(plotter), expected(plotter))
    plotter.resize(400, 180)
    QApplication.processEvents()
    assert drawn(plotter).shape == (180, 400, 3)
    np.testing.assert_array_equal(drawn(plotter), expected(plotter))
    hits = [plotter.decals.subplot.at(x, 90) for x in range(0, 400, 40)]
    assert max(-1 if hit is None else hit.owner for hit in hits) >= 0
    let_go(plotter)


def docked() -> None:
    """A widget that is put into another window gets another context there, and shows the same."""
    homes = [QMainWindow(), QMainWindow()]
    plotter = widget(homes[0])
    fill(plotter)
    contexts, pictures = [], []
    for home in homes:
        home.setCentralWidget(plotter)
        home.resize(*SIZE)
        home.show()
        QApplication.processEvents()
        pictures += [drawn(plotter), drawn(plotter)]
        contexts.append(plotter.decals.subplot.renderer.context)
    assert contexts[0] is not contexts[1]
    assert contexts[0].stale
    for picture in pictures:
        np.testing.assert_array_equal(picture, pictures[0])
    let_go(plotter)


def background() -> None:
    """Subplots, and two windows at once; each closes by itself."""
    app = QApplication.instance()
    options = {"app": app, "auto_update": False, "window_size": SIZE, "editor": False, "menu_bar": False}
    one, two = BackgroundPlotter(shape=(1, 2), **options), BackgroundPlotter(**options)
    one.subplot(0, 1)
    fill(one)
    fill(two)
    picture = drawn(one)
    left, right = picture[:, : picture.shape[1] // 2 - 2], picture[:, picture.shape[1] // 2 + 2 :]
    assert left.std() < 1 < right.std()
    first = drawn(two)
    one.close()
    QApplication.processEvents()
    np.testing.assert_array_equal(drawn(two), first)
    two.close()


def user() -> None:
    """Edit decals in a host widget, which is restored when the editor closes."""
    plotter = widget()
    ball = plotter.add_mesh(pv.Sphere(center=(0, 0, -4), radius=0.1))
    window = EditWindow(scene(), plotter=plotter)
    window.show()
    driver = Driver(window)
    first, state = driver.shot(), driver.state
    _, at = next(driver.visible())
    drag(plotter, at)
    assert len(window.actions.state.selection) == 1
    drag(plotter, at, (at[0] + 6, at[1]), (at[0] + 18, at[1] + 5))
    assert driver.session.labels == ("move",), driver.session.labels
    assert (driver.shot() != first).any()
    QTest.keyClick(plotter, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClick(plotter, Qt.Key.Key_Escape)
    QApplication.processEvents()
    assert driver.state == state
    window.actions.state.message = ""
    window.update_overlay()
    np.testing.assert_array_equal(driver.shot(), first)
    window.redraw(whole=False)
    wait_until(lambda: window.frames.state is FrameState.WHOLE)  # the window's timer draws the whole frame
    window.close()
    assert list(plotter.actors.values()) == [ball]
    assert plotter.decals.subplot.scene is None
    drag(plotter, (20, 20), (60, 40))
    drawn(plotter)
    let_go(plotter)
    window.close()
    late = EditWindow(scene(), plotter=(plotter := widget()))
    late.show()
    let_go(plotter)
    late.close()


def wait_until(true: Callable[[], bool]) -> None:
    """Let Qt go on until something is so."""
    for _ in range(1000):
        if true():
            return
        QTest.qWait(10)
    raise AssertionError("that did not happen within ten seconds")


def again() -> None:
    """Nothing of ours outlives a widget, and memory stays flat."""

    def once() -> None:
        plotter = widget()
        fill(plotter)
        drawn(plotter)
        subplot = plotter.decals.subplot
        things = [weakref.ref(item) for item in (plotter, plotter.decals, subplot, subplot.renderer)]
        del subplot
        let_go(plotter)
        del plotter
        gc.collect()
        assert [thing() for thing in things] == [None] * len(things)

    def used() -> float:
        with open("/proc/self/statm", encoding="ascii") as status:  # noqa: PTH123
            return int(status.read().split()[1]) * 4096 / 2**20

    for _ in range(4):
        once()
    before = used()
    for _ in range(10):
        once()
    assert used() - before < 10, f"{used() - before:.1f} MB in ten windows"


def page() -> None:
    """The window of the page shows the page's model."""
    session: dict[str, Any] = {}
    pictures: list[np.ndarray] = []

    def look() -> None:
        """Replace the loop that runs until the window closes."""
        QApplication.processEvents()
        pictures.append(drawn(session["plotter"]))
        let_go(session["plotter"])

    with patch.object(QApplication, "exec", staticmethod(look)):
        exec(compile(docs.code("qt"), "pyvista.md", "exec"), session)
    assert pictures[0].std() > 20


CHECKS = {check.__name__: check for check in (pixels, docked, background, user, again, page)}


def main() -> None:
    """Run one of the functions above, by its name."""
    check = CHECKS[sys.argv[1]]
    app = None if check is page else QApplication([])
    check()
    print("done")
    if app is not None:
        app.quit()


if __name__ == "__main__":
    main()
