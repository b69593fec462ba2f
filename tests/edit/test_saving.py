"""Saves beside the window: what was asked for is what is in the file."""

import threading

import numpy as np
import pytest

from decals.edit import Scale
from decals.edit.background import doing
from decals.errors import InvalidScene
from decals.scenes.scene_file import load_scene
from tests.edit.background import (
    LONG,
    finish,
    hold_writing,
    press,
    threaded,
)
from tests.edit.scenes import scene

pytestmark = pytest.mark.usefixtures("few_are_many")


def test_a_save_writes_what_was_there_when_it_was_asked_for(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    session = actions.session
    session.do(Scale([1], 2.0))
    saved = session.document.decals.decals
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    session.do(Scale([1], 3.0))
    assert session.modified
    assert "save" in actions.background.progress
    assert not path.exists()
    go.set()
    finish(actions)
    assert str(path) in actions.message
    assert load_scene(path).decals.packed().tobytes() == saved.packed().tobytes()
    assert session.modified
    session.undo()
    assert not session.modified
    session.undo()
    assert session.modified


def saving_twice(path, monkeypatch):
    """Actions that write, and were asked to save a later state too; the event that lets the writing go on."""
    actions = threaded(path=path)
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    actions.session.do(Scale([1], 3.0))
    press(actions, "save")
    return actions, go


def test_who_asks_twice_to_save_gets_the_later_state(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions, go = saving_twice(path, monkeypatch)
    session = actions.session
    assert "once more" in actions.message
    press(actions, "let_go")
    go.set()
    finish(actions)
    assert not session.modified
    assert load_scene(path).decals.radii[1] == session.document.decals[1].radii[0]


def test_saving_and_a_long_edit_go_on_together(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    actions.background.edit("scale", doing(Scale(np.arange(60), 2.0)))
    assert "save" in actions.background.progress
    assert "scale" in actions.background.progress
    go.set()
    finish(actions)
    assert actions.session.modified
    assert actions.session.labels == ("scale",)


def test_a_save_that_fails_says_so_and_nothing_counts_as_saved(tmp_path):
    actions = threaded(path=tmp_path / "nowhere" / "scene.json")
    actions.session.do(Scale([1], 2.0))
    press(actions, "save")
    finish(actions)
    assert "existing folder" in actions.message
    assert actions.session.modified


def test_no_room_for_the_file_is_said_and_the_old_file_stays(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    press(actions, "save")
    finish(actions)
    before = path.read_bytes()
    actions.session.do(Scale([1], 2.0))

    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    press(actions, "save")
    finish(actions)
    assert "No space left" in actions.message
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    assert actions.session.modified


def test_closing_waits_for_the_file(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions, go = saving_twice(path, monkeypatch)
    session = actions.session
    go.set()
    actions.background.close()
    assert not session.modified
    assert load_scene(path).decals.radii[1] == session.document.decals[1].radii[0]
    assert not actions.background.busy


def test_closing_says_what_could_not_be_saved(tmp_path):
    actions = threaded(path=tmp_path / "nowhere" / "scene.json")
    press(actions, "save")
    with pytest.raises(InvalidScene, match="existing folder"):
        actions.background.close()
    actions.background.close()


def test_after_a_save_that_nobody_foresaw_fails_the_later_one_is_written(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    actions.session.do(Scale([1], 2.0))
    begun, go = threading.Event(), threading.Event()

    def failing(*_args, **_options):
        begun.set()
        assert go.wait(LONG)
        raise MemoryError

    with monkeypatch.context() as patched:
        patched.setattr("decals.edit.session.save_scene", failing)
        press(actions, "save")
        assert begun.wait(LONG)
        press(actions, "save")
    go.set()
    with pytest.raises(MemoryError):
        actions.background.look(timeout=LONG)
    finish(actions)
    assert load_scene(path).decals.radii[1] == 2 * scene().decals.radii[1]
    assert not actions.session.modified
