"""The stack: strokes, undo, redo, saving, listeners."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blobtree.nodes.surgery import dominant_primitive
from decals import DecalImage, MeshObject, load_scene
from decals.editing import (
    AddDecals,
    DeleteDecals,
    EditSession,
    MoveDecals,
    PaintPrimitive,
    RemoveObject,
    RenameObject,
    ReplaceImage,
    ScaleDecals,
    SetParameter,
    SetValues,
)
from decals.editing.document import NODE_BYTES
from decals.editing.session import ENTRY_BYTES
from decals.errors import InvalidDecals, InvalidEdit, InvalidScene
from tests.decals.editing.scenes import digest, one, scene, tree_of


@pytest.fixture
def session() -> Any:
    return EditSession(scene())


def drag(session: Any, steps: Any = 10) -> None:
    for x in np.linspace(0, 0.5, steps):
        session.do(MoveDecals([3], np.array([x, 0, 1], np.float32), np.array([0, 0, 1], np.float32)))


def test_a_drag_is_one_entry(session: EditSession) -> None:
    first = digest(session.document)
    session.begin_stroke("drag")
    drag(session)
    assert session.modified
    session.end_stroke()
    last = digest(session.document)
    assert session.labels == ("drag",)
    assert session.undo() == "drag"
    assert digest(session.document) == first
    assert session.redo() == "drag"
    assert digest(session.document) == last
    assert session.redo() is None


def test_objects_of_far_entries_forget_their_surfaces(
    session: EditSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.editing.session.MAX_SURFACES", 2)
    first, objects = digest(session.document), []
    path = dominant_primitive(tree_of(session.document), np.zeros(3, np.float32))
    for blue in (0.2, 0.4, 0.6, 0.8):
        session.do(PaintPrimitive(0, path, (0.0, 0.0, blue)))
        objects.append(session.document.objects)
        assert session.document.objects[0].surface.area > 1.0
    assert ["surface" in vars(tree) for tree, _ in objects] == [False, True, True, True]
    assert all("surface" in vars(mesh) for _, mesh in objects)
    while session.undo():
        assert session.document.objects[0].surface.area > 1.0
    assert digest(session.document) == first
    assert ["surface" in vars(tree) for tree, _ in objects] == [True, True, False, False]


def test_a_cancelled_stroke_leaves_no_trace(session: EditSession) -> None:
    first = digest(session.document)
    session.do(ScaleDecals([1], 2.0))
    before = digest(session.document)
    session.begin_stroke("drag")
    drag(session)
    session.do(DeleteDecals([3]))
    session.do(AddDecals(one()))
    session.cancel_stroke()
    assert digest(session.document) == before
    assert session.labels == ("scale",)
    session.undo()
    assert digest(session.document) == first
    assert session.undo() is None


def test_a_stroke_can_start_over(session: EditSession) -> None:
    session.begin_stroke("drag")
    session.do(ScaleDecals([1], 2.0))
    session.revert_stroke()
    session.do(ScaleDecals([1], 3.0))
    session.end_stroke()
    radius = scene().decals.radii[1]
    assert session.document.decals[1].radii[0] == pytest.approx(3 * radius)
    session.undo()
    assert session.document.decals[1].radii[0] == radius


def scale_and_fail(session: Any) -> None:
    with session.stroke("both"):
        session.do(ScaleDecals([1], 2.0))
        session.do(DeleteDecals([99]))


def test_an_error_within_a_stroke_takes_all_of_it_back(session: EditSession) -> None:
    before = digest(session.document)
    with pytest.raises(InvalidDecals):
        scale_and_fail(session)
    assert digest(session.document) == before
    assert session.labels == ()


def test_a_stroke_says_in_words_what_it_is(session: EditSession) -> None:
    with pytest.raises(InvalidEdit, match="label: expected a str, got None"), session.stroke(None):  # type: ignore[arg-type]
        session.do(ScaleDecals([1], 1.5))
    assert session.labels == ()


def test_a_stroke_that_adds_and_deletes(session: EditSession) -> None:
    before = digest(session.document)
    with session.stroke("flicker"):
        session.do(AddDecals(one()))
        session.do(ScaleDecals([60], 2.0))
        session.do(DeleteDecals([60, 5]))
    after = digest(session.document)
    session.undo()
    assert digest(session.document) == before
    session.redo()
    assert digest(session.document) == after


def test_a_new_command_ends_what_could_be_redone(session: EditSession) -> None:
    session.do(ScaleDecals([1], 2.0))
    session.undo()
    session.do(ScaleDecals([2], 2.0))
    assert session.redo() is None
    assert session.labels == ("scale",)


def test_what_does_nothing_leaves_no_entry(session: EditSession) -> None:
    session.do(DeleteDecals([]))
    with session.stroke("nothing"):
        pass
    assert session.labels == ()


def test_a_listener_may_end_with_what_it_hears(session: EditSession) -> None:
    heard = []

    def once(_change: Any) -> None:
        heard.append("once")
        stop()

    stop = session.subscribe(once)
    session.subscribe(lambda _change: heard.append("always"))
    session.do(ScaleDecals([1], 2.0))
    session.do(ScaleDecals([1], 2.0))
    assert heard == ["once", "always", "always"]


def test_listeners_hear_of_every_change(session: EditSession) -> None:
    heard = []
    stop = session.subscribe(lambda change: heard.append(change.after.numbers.tolist()))
    session.do(ScaleDecals([1, 4], 2.0))
    session.undo()
    session.redo()
    with pytest.raises(InvalidDecals):
        session.do(DeleteDecals([99]))
    stop()
    stop()
    session.do(ScaleDecals([2], 2.0))
    assert heard == [[1, 4]] * 3


def test_saving(session: EditSession, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    session.do(SetValues.each([1], tints=[0.5, 1, 0]))
    session.do(DeleteDecals([0]))
    assert session.modified
    session.save(path)
    assert not session.modified
    loaded = load_scene(path)
    assert loaded.decals.packed().tobytes() == session.document.decals.decals.packed().tobytes()
    session.undo()
    assert session.modified
    session.redo()
    assert not session.modified


def test_a_save_that_fails_leaves_the_file_and_the_mark(session: EditSession, tmp_path: Path) -> None:
    session.do(DeleteDecals([0]))
    with pytest.raises(InvalidScene, match="existing folder"):
        session.save(tmp_path / "nowhere" / "scene.json")
    assert session.modified


def test_the_oldest_entries_are_forgotten_beyond_a_limit_of_memory(tmp_path: Path) -> None:
    drags = EditSession(scene())
    drag(drags, 2)
    each = ENTRY_BYTES + (drags.next_undo.edit.held_bytes if drags.next_undo else 0)
    session = EditSession(scene(), max_history_bytes=5 * each)
    states = [digest(session.document)]
    for x in np.linspace(0, 0.5, 12):
        session.do(MoveDecals([3], np.array([x, 0, 1], np.float32), np.array([0, 0, 1], np.float32)))
        states.append(digest(session.document))
        if len(states) == 8:
            session.save(tmp_path / "scene.json")
    assert (len(session.labels), session.forgotten) == (5, 7)
    fork = session.fork()
    assert (fork.forgotten, fork.position) == (7, session.position)
    for state in states[-2:-7:-1]:
        assert session.modified
        session.undo()
        assert digest(session.document) == state
    assert session.undo() is None
    assert not session.modified  # the saved state is the oldest one now
    while session.redo():
        pass
    assert (digest(session.document), session.forgotten) == (states[-1], 7)
    assert session._history.held_bytes == sum(entry.held_bytes for entry in session._history.done) == 5 * each
    session.forget_history()
    assert (session.forgotten, session.modified) == (0, False)


def test_the_first_state_is_not_saved_once_its_entries_are_forgotten() -> None:
    session = EditSession(scene(), max_history_bytes=0)
    drag(session, 3)
    assert (len(session.labels), session.forgotten) == (1, 2)  # the last one can always be undone
    session.undo()
    assert session.modified


def test_entries_count_what_they_alone_hold(session: EditSession) -> None:
    def held() -> int:
        entry = session.next_undo
        assert entry is not None
        return entry.edit.held_bytes

    item = session.document.objects[1]
    assert isinstance(item, MeshObject)
    session.do(RenameObject(1, "chest"))
    assert held() == 0
    path = dominant_primitive(tree_of(session.document), np.zeros(3, np.float32))
    session.do(SetParameter(0, path, "radius", 0.9))
    assert 3 * NODE_BYTES < held() < 60 * NODE_BYTES  # decals on it have moved too
    session.do(RemoveObject(1))
    assert held() >= item.vertices.nbytes + item.faces.nbytes
    image = session.document.images[0]
    session.do(ReplaceImage(0, DecalImage.load("tile")))
    assert held() == image.pixels.nbytes
