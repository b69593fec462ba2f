"""Windows with unsaved changes: they ask before they close, and keep a recovery file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decals import Contact, ImageMapping, edit, load_scene
from decals.editing import ScaleDecals, recovery_path
from decals.window import EditWindow
from tests.decals.editing.scenes import scene


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Note each request to end the event loop."""
    requests: list[bool] = []
    monkeypatch.setattr("decals.window.host_plotter.HostPlotter.leave", lambda _self: requests.append(True))
    return requests


def edited(opened: Any, **options: Any) -> Any:
    driver = opened(**options)
    driver.key("a", ctrl=True)
    driver.key("d")
    assert driver.session.modified
    return driver


def test_without_changes_q_closes(left: list[bool], opened: Any) -> None:
    opened().key("q")
    assert left == [True]


def test_with_changes_q_asks_and_a_second_q_discards(left: list[bool], opened: Any, tmp_path: Path) -> None:
    driver = edited(opened, path=tmp_path / "scene.json")
    driver.key("q")
    assert left == []
    assert "unsaved changes" in driver.window.overlay.status
    assert "Q: close without saving" in driver.window.overlay.status
    driver.key("q")
    assert left == [True]
    driver.window.close()
    assert list(tmp_path.iterdir()) == []


def test_escape_goes_on_editing_and_other_keys_do_nothing(left: list[bool], opened: Any) -> None:
    driver = edited(opened)
    count = len(driver.document.decals)
    driver.key("q")
    driver.key("d")
    assert len(driver.document.decals) == count
    driver.key("Escape")
    assert "unsaved" not in driver.window.overlay.status
    driver.key("d")
    assert len(driver.document.decals) > count
    driver.key("q")
    assert left == []


def test_s_saves_and_closes(left: list[bool], opened: Any, tmp_path: Path) -> None:
    driver = edited(opened, path=tmp_path / "scene.json")
    driver.key("q")
    driver.press("s")
    assert left == [True]
    assert not driver.session.modified
    assert list(tmp_path.iterdir()) == [tmp_path / "scene.json"]


def test_a_save_that_fails_does_not_close(left: list[bool], opened: Any, tmp_path: Path) -> None:
    driver = edited(opened, path=tmp_path / "nowhere" / "scene.json")
    driver.key("q")
    driver.press("s")
    assert left == []
    assert "existing folder" in driver.window.actions.state.message
    driver.window.actions.files.path = None
    driver.window.actions.files.recovery.belong_to(None)


def test_the_window_manager_asks_too(left: list[bool], opened: Any) -> None:
    """The event loop has ended when the window manager asks to close: it goes on after the first request."""
    files = edited(opened).window.actions.files
    assert not files.may_close()
    assert files.may_close()
    assert left == []


def test_a_window_that_is_closed_without_an_answer_keeps_a_recovery_file(opened: Any, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    driver = edited(opened, path=path)
    driver.window.close()
    assert list(tmp_path.iterdir()) == [recovery_path(path)]
    assert len(load_scene(recovery_path(path)).decals) == len(driver.document.decals)


def test_the_next_window_opens_the_recovery_file(opened: Any, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    first = edited(opened, path=path)
    first.window.close()
    driver = opened(path=path, recover=load_scene)
    assert len(driver.document.decals) == len(first.document.decals)
    assert "scene.recovery.json" in driver.window.overlay.status
    driver.press("z", ctrl=True)
    assert len(driver.document.decals) == len(scene().decals)


def test_ticks_keep_the_recovery_file(opened: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.editing.recovery.AUTOSAVE_SECONDS", 0.0)
    path = tmp_path / "scene.json"
    driver = edited(opened, path=path)
    assert driver.window.busy
    driver.window.tick()
    driver.finish()
    assert recovery_path(path).exists()
    assert not driver.window.busy


def test_a_drag_is_not_disturbed(opened: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.editing.recovery.AUTOSAVE_SECONDS", 0.0)
    driver = opened(path=tmp_path / "scene.json")
    _, at = next(driver.visible())
    driver.click(at)
    driver.event("LeftButtonPressEvent", at)
    driver.event("MouseMoveEvent", np.add(at, 12))
    driver.window.tick()
    driver.finish()
    assert driver.session.stroke_open
    assert list(tmp_path.iterdir()) == []
    driver.event("LeftButtonReleaseEvent", np.add(at, 12))
    driver.window.tick()
    driver.finish()
    assert recovery_path(tmp_path / "scene.json").exists()


def test_the_title_names_the_file_and_marks_changes(opened: Any, tmp_path: Path) -> None:
    driver = opened(path=tmp_path / "scene.json")

    def title() -> str:
        return str(driver.plotter.render_window.GetWindowName())

    assert title() == "scene.json - Implicit Decals"
    driver.window.session.do(ScaleDecals([1], 2.0))
    driver.window.redraw(whole=True)
    assert title() == "*scene.json - Implicit Decals"
    driver.press("s", ctrl=True)
    assert title() == "scene.json - Implicit Decals"
    assert "untitled - " in str(opened().plotter.render_window.GetWindowName())


def test_changes_after_a_discard_count_again(left: list[bool], opened: Any, tmp_path: Path) -> None:
    """A plotter of the caller may stay open when the user has discarded the changes."""
    driver = edited(opened, path=tmp_path / "scene.json")
    driver.key("q")
    driver.key("q")
    driver.key("d")
    driver.key("q")
    assert left == [True]
    assert driver.window.actions.state.prompt.asking
    driver.window.close()
    assert list(tmp_path.iterdir()) == [tmp_path / "scene.recovery.json"]


def test_edit_opens_the_recovery_file_and_the_given_modes(
    opened: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scene.json"
    first = edited(opened, path=path)
    first.window.close()
    seen = []

    class Window(EditWindow):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **{**options, "off_screen": True, "size": (60, 40)})
            seen.append((self.subplot.contact, self.subplot.mapping))

    monkeypatch.setattr("decals.window.opening.EditWindow", Window)
    result = edit(scene(), path=path, contact="min", mapping="chord")
    assert len(result.decals) == len(first.document.decals)
    assert seen == [(Contact.MIN, ImageMapping.CHORD)]


def test_an_error_keeps_a_recovery_file(opened: Any, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"

    def fail() -> None:
        with EditWindow(scene(), path=path, off_screen=True, size=(60, 40)) as window:
            window.session.do(ScaleDecals([1], 2.0))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert recovery_path(path).exists()
