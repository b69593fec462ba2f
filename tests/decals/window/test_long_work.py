"""What takes long goes on beside a driven window, and is seen once it is done."""

from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from blobtree.kernels import COMPILING
from blobtree.progress import displayed, reporting
from decals import load_scene
from decals.editing import ScaleDecals
from decals.editing.decal_actions import FIRST_DECAL_COUNT
from decals.editing.scatter_commands import decals_on
from decals.errors import InvalidEdit, InvalidScene
from decals.vtk.window_title import WindowTitle
from decals.window import EditWindow
from tests.decals.editing.scenes import scene
from tests.decals.window.driver import Driver


def test_scattering_goes_on_in_the_background(driver: Driver) -> None:
    number, at = next((n, at) for n, at in driver.visible() if n in decals_on(driver.document, [0]))
    driver.key("g", at)
    assert driver.window.background.busy
    assert number in driver.document.decals.numbers
    status = driver.window.overlay.status
    assert "scatter" in status or "spreading particles" in status  # or how far
    driver.finish()
    assert number not in driver.document.decals.numbers
    assert driver.session.labels == ("scatter",)


def test_an_object_without_decals_gets_a_first_coat(opened: Any) -> None:
    shown = scene()
    driver = opened(shown.replace(decals=shown.decals[:0]))
    driver.press("g", (90, 60))
    driver.finish()
    assert driver.session.labels == ("scatter",)
    assert len(driver.document.decals) == FIRST_DECAL_COUNT


def test_escape_stops_what_goes_on_in_the_background(driver: Driver) -> None:
    state = driver.state
    at = next(at for n, at in driver.visible() if n in decals_on(driver.document, [0]))
    driver.key("g", at)
    driver.key("Escape", at)
    assert "cancelled" in driver.window.overlay.status
    driver.finish()
    assert driver.state == state
    assert driver.session.labels == ()


def test_everything_is_scaled_in_the_background_and_seen_with_the_next_tick(
    driver: Driver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.editing.commands.MAX_IMMEDIATE_DECALS", 5)
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", 5)
    first, state = driver.shot(), driver.state
    driver.key("a", ctrl=True)
    driver.key("plus")
    assert driver.state == state
    assert "scale …" in driver.window.overlay.status
    driver.finish()
    assert driver.state != state
    driver.key("Escape")
    assert (driver.shot() != first).any()
    driver.key("z", ctrl=True)
    driver.finish()
    assert driver.state == state
    driver.window.actions.state.message = ""
    driver.window.update_overlay()
    np.testing.assert_array_equal(driver.shot(), first)


def test_a_drag_of_many_follows_the_pointer_in_the_background(
    driver: Driver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.editing.commands.MAX_IMMEDIATE_DECALS", 5)
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", 5)
    number, at = next(driver.visible())
    driver.click(at)
    driver.key("a", ctrl=True)
    before, radius = driver.document.decals[number].positions[0], driver.document.decals[number].radii[0]
    driver.drag(at, (at[0] + 4, at[1]), (at[0] + 9, at[1]), (at[0] + 12, at[1]))
    driver.finish()
    goal = driver.window.tools.at(at[0] + 12, at[1])
    moved = driver.document.decals[number].positions[0]
    assert np.linalg.norm(moved - before) > 0.3 * radius
    assert goal is not None
    assert driver.session.labels == ("move",)
    driver.key("z", ctrl=True)
    driver.finish()
    np.testing.assert_array_equal(driver.document.decals[number].positions[0], before)


def test_a_window_that_is_closed_while_it_saves_has_saved(opened: Any, tmp_path: Path) -> None:
    driver = opened(path=tmp_path / "scene.json")
    driver.session.do(ScaleDecals(driver.document.decals.numbers[:1], 1.5))
    driver.key("s", ctrl=True)
    driver.window.close()
    assert not driver.session.modified
    assert load_scene(tmp_path / "scene.json").decals.radii[0] == driver.document.decals[0].radii[0]


def test_a_window_that_is_closed_and_could_not_save_says_so(opened: Any, tmp_path: Path) -> None:
    driver = opened(path=tmp_path / "nowhere" / "scene.json")
    driver.key("s", ctrl=True)
    with pytest.raises(InvalidScene, match="existing folder"):
        driver.window.close()
    with pytest.raises(InvalidEdit, match="was closed"):
        driver.window.show()


def test_the_status_names_a_compilation_in_another_thread() -> None:
    shown: list[str] = []

    with EditWindow(scene(), off_screen=True, size=(120, 80)) as window:
        window.show()

        def work() -> None:
            with reporting() as report:
                report(f"{COMPILING}: 3 of 11", 3 / 11)
                shown.append(window._status())
            shown.append(window._status())

        thread = Thread(target=work)
        thread.start()
        thread.join()
    during, after = shown
    assert "compiling kernels for this machine (once): 3 of 11" in during
    assert "compiling" not in after


def test_the_title_names_work_that_blocks_the_window() -> None:
    class Window:
        titles: ClassVar[list[str]] = []

        def SetWindowName(self, title: str) -> None:
            self.titles.append(title)

    plotter = SimpleNamespace(render_window=Window(), off_screen=False, title="knot.json")
    title = WindowTitle(plotter)
    with displayed(title.show):
        thread = Thread(target=lambda: title.show("of another thread", 0.5))
        thread.start()
        thread.join()
        with reporting() as report:
            report("preparing the picture", 0.0)
    assert Window.titles == ["Preparing the picture - knot.json", "knot.json"]
    plotter.off_screen = True
    assert not title.visible
