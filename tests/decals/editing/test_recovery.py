"""Unsaved changes: the recovery file keeps them, and the next session takes them over."""

from pathlib import Path
from typing import Any

import pytest

from decals import load_scene, save_scene
from decals.editing import Actions, EditSession, ScaleDecals, recovery_path
from decals.errors import InvalidScene
from tests.decals.editing.background import finish, hold_writing, press, threaded
from tests.decals.editing.scenes import digest, scene


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.editing.recovery.AUTOSAVE_SECONDS", 0.0)
    monkeypatch.setattr("decals.editing.recovery.MAX_WRITING_SHARE", float("inf"))


def edited(path: Path, **options: Any) -> Any:
    """Actions with one unsaved edit."""
    actions = Actions(EditSession(scene()), path=path, **options)
    actions.state.session.do(ScaleDecals([1], 2.0))
    return actions


@pytest.mark.usefixtures("at_once")
def test_unsaved_changes_are_written_beside_the_scene_and_removed_by_a_save(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    actions = edited(path)
    actions.files.update()
    kept = load_scene(recovery_path(path))
    assert kept.decals.radii[1] == actions.state.session.document.decals[1].radii[0]
    assert actions.state.session.modified
    assert not actions.files.recovery.pending
    press(actions, "save")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.usefixtures("at_once")
def test_undoing_all_changes_removes_the_file(tmp_path: Path) -> None:
    actions = edited(tmp_path / "scene.json")
    actions.files.update()
    press(actions, "undo")
    actions.files.update()
    assert list(tmp_path.iterdir()) == []


def test_the_file_is_not_written_with_every_edit(tmp_path: Path) -> None:
    actions = edited(tmp_path / "scene.json")
    actions.files.update()
    assert not actions.files.recovery.pending  # the first edit is kept at once
    actions.state.session.do(ScaleDecals([1], 2.0))
    actions.files.update()
    assert actions.files.recovery.pending


@pytest.mark.usefixtures("at_once")
def test_repeated_keys_are_kept_too(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    actions = edited(path)
    actions.files.update()
    actions.state.selection = (2,)
    press(actions, "larger")
    assert actions.state.session.stroke_open
    actions.files.update()
    kept = load_scene(recovery_path(path)).decals
    assert kept.radii[2] == actions.state.session.document.decals[2].radii[0] > scene().decals.radii[2]
    press(actions, "larger")
    assert actions.state.session.stroke_open


def test_a_key_that_changes_nothing_leaves_no_unsaved_changes(tmp_path: Path) -> None:
    actions = Actions(EditSession(scene()), path=tmp_path / "scene.json")
    press(actions, "larger")
    assert "no decal is selected" in actions.state.message
    assert not actions.state.session.modified
    assert actions.files.may_close()


@pytest.mark.usefixtures("at_once")
def test_a_save_during_an_autosave_comes_after_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    actions.state.session.do(ScaleDecals([1], 2.0))
    _, go = hold_writing(monkeypatch)
    actions.files.update()
    assert not actions.state.background.saving
    press(actions, "save")
    assert actions.state.background.saving
    go.set()
    finish(actions)
    assert not actions.state.session.modified
    assert list(tmp_path.iterdir()) == [path]


def test_the_next_session_takes_the_changes_over_and_undo_goes_back(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    save_scene(scene(), path)
    before = edited(path)
    assert before.files.recovery.keep() == recovery_path(path)
    before.files.recovery.release()  # as the system does when a process ends

    session = EditSession(load_scene(path))
    first = digest(session.document)
    actions = Actions(session, path=path)
    actions.files.recover(load_scene)
    assert "scene.recovery.json" in actions.state.message
    assert session.modified
    found, expected = (one.document.decals.decals for one in (session, before.state.session))
    assert found.packed().tobytes() == expected.packed().tobytes()
    press(actions, "undo")
    assert digest(session.document) == first
    actions.files.update()
    assert list(tmp_path.iterdir()) == [path]


def test_without_a_recovery_file_nothing_is_recovered(tmp_path: Path) -> None:
    actions = Actions(EditSession(scene()), path=tmp_path / "scene.json")
    actions.files.recover(load_scene)
    assert not actions.state.session.modified
    assert actions.state.message == ""


def test_a_damaged_recovery_file_is_named_and_stays(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    recovery_path(path).write_text('{"format": "implicit-decals-scene"')
    actions = Actions(EditSession(scene()), path=path)
    with pytest.raises(InvalidScene, match=r"scene\.recovery\.json"):
        actions.files.recover(load_scene)
    assert recovery_path(path).exists()


def test_what_another_window_left_is_not_removed_unless_it_was_taken_over(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    edited(path).files.recovery.keep()
    Actions(EditSession(scene()), path=path).files.finish()
    assert recovery_path(path).exists()


def test_a_folder_that_cannot_be_written_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.editing.recovery.AUTOSAVE_SECONDS", 0.0)
    actions = threaded(path=tmp_path / "nowhere" / "scene.json")
    actions.state.session.do(ScaleDecals([1], 2.0))
    actions.files.update()
    finish(actions)
    assert "existing folder" in actions.state.message
    assert not actions.files.recovery.pending


@pytest.mark.usefixtures("at_once")
def test_windows_of_one_file_keep_their_changes_apart(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    first, second = edited(path), edited(path)
    second.state.session.do(ScaleDecals([2], 3.0))
    for actions in (first, second):
        actions.files.update()
    assert first.files.recovery.path == recovery_path(path)
    assert second.files.recovery.path == recovery_path(path, number=2)
    for actions in (first, second):
        kept = load_scene(actions.files.recovery.path).decals.packed().tobytes()
        assert kept == actions.state.session.document.decals.decals.packed().tobytes()
    third = Actions(EditSession(scene()), path=path)
    third.files.recover(load_scene)
    assert not third.state.session.modified  # both belong to windows that are open
    second.files.recovery.release()
    third.files.recover(load_scene)
    assert third.files.recovery.path == recovery_path(path, number=2)
    assert third.state.session.document.decals.decals.packed().tobytes() == kept
    for actions in (first, third):
        press(actions, "save")
    assert {file.name for file in tmp_path.iterdir()} == {"scene.json", "scene-2.json"}  # both are new
