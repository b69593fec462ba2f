"""Saves beside the window: what was asked for is what is in the file."""

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decals import load_scene
from decals.editing import ScaleDecals
from decals.editing.session import step_of
from decals.errors import InvalidScene
from tests.decals.editing.background import LONG, finish, hold_writing, press, threaded
from tests.decals.editing.scenes import scene

pytestmark = pytest.mark.usefixtures("few_are_many")


def test_a_save_writes_what_was_there_when_it_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    session = actions.state.session
    session.do(ScaleDecals([1], 2.0))
    saved = session.document.decals.decals
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    session.do(ScaleDecals([1], 3.0))
    assert session.modified
    assert "saving" in actions.state.background.progress
    assert not path.exists()
    go.set()
    finish(actions)
    assert str(path) in actions.state.message
    assert load_scene(path).decals.packed().tobytes() == saved.packed().tobytes()
    assert session.modified
    session.undo()
    assert not session.modified
    session.undo()
    assert session.modified


def saving_twice(path: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Actions that write, and were asked to save a later state too; the event that lets the writing go on."""
    actions = threaded(path=path)
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    actions.state.session.do(ScaleDecals([1], 3.0))
    press(actions, "save")
    return actions, go


def test_who_asks_twice_to_save_gets_the_later_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.json"
    actions, go = saving_twice(path, monkeypatch)
    session = actions.state.session
    assert "the save follows" in actions.state.message
    press(actions, "deselect")
    go.set()
    finish(actions)
    assert not session.modified
    assert load_scene(path).decals.radii[1] == session.document.decals[1].radii[0]


def test_saving_and_a_long_edit_go_on_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    actions.state.background.edit("scale", step_of(ScaleDecals(np.arange(60), 2.0)))
    assert "saving" in actions.state.background.progress
    assert "scale" in actions.state.background.progress
    go.set()
    finish(actions)
    assert actions.state.session.modified
    assert actions.state.session.labels == ("scale",)


def test_a_save_that_fails_says_so_and_nothing_counts_as_saved(tmp_path: Path) -> None:
    actions = threaded(path=tmp_path / "nowhere" / "scene.json")
    actions.state.session.do(ScaleDecals([1], 2.0))
    press(actions, "save")
    finish(actions)
    assert "existing folder" in actions.state.message
    assert actions.state.session.modified


def test_no_room_for_the_file_is_said_and_the_old_file_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    press(actions, "save")
    finish(actions)
    before = path.read_bytes()
    actions.state.session.do(ScaleDecals([1], 2.0))

    def full(_descriptor: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    press(actions, "save")
    finish(actions)
    assert "No space left" in actions.state.message
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    assert actions.state.session.modified


def test_closing_waits_for_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.json"
    actions, go = saving_twice(path, monkeypatch)
    session = actions.state.session
    go.set()
    actions.state.background.close()
    assert not session.modified
    assert load_scene(path).decals.radii[1] == session.document.decals[1].radii[0]
    assert not actions.state.background.busy


def test_closing_asks_about_changes_that_the_running_save_leaves_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Undo, too, is such a change: it leads back to what the old file has, and the save replaces that."""
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    state, left = actions.state, []
    actions.files.leave = lambda: left.append(True)
    state.session.do(ScaleDecals([1], 2.0))
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    press(actions, "close")
    assert "closes afterwards" in state.message
    assert not state.prompt.asking
    state.session.undo()
    press(actions, "close")
    assert state.prompt.asking
    go.set()
    finish(actions)
    actions.files.update()
    assert state.session.modified
    assert left == []
    state.prompt.key("q", "q")
    assert left == [True]


def test_closing_says_what_could_not_be_saved(tmp_path: Path) -> None:
    actions = threaded(path=tmp_path / "nowhere" / "scene.json")
    press(actions, "save")
    with pytest.raises(InvalidScene, match="existing folder"):
        actions.state.background.close()
    actions.state.background.close()


def test_after_a_save_that_nobody_foresaw_fails_the_later_one_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    actions.state.session.do(ScaleDecals([1], 2.0))
    begun, go = threading.Event(), threading.Event()

    def failing(*_args: Any, **_options: Any) -> None:
        begun.set()
        assert go.wait(LONG)
        raise MemoryError

    with monkeypatch.context() as patched:
        patched.setattr("decals.editing.session.save_scene", failing)
        press(actions, "save")
        assert begun.wait(LONG)
        press(actions, "save")
    go.set()
    with pytest.raises(MemoryError):
        actions.state.background.poll(timeout=LONG)
    finish(actions)
    assert load_scene(path).decals.radii[1] == 2 * scene().decals.radii[1]
    assert not actions.state.session.modified
