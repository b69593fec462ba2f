"""Long edits beside the window: what they come to is what they would have come to at once."""

import threading
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decals.edit import Actions, Delete, EditSession, MovePrimitive, Pick, RemoveObject, Scale, Turn
from decals.edit.background import WAIT, doing
from decals.errors import InvalidEdit, InvalidScene
from decals.scenes.scene_file import load_scene
from tests.edit.scenes import digest, scene

LONG = 30.0
"""Seconds that a test would wait for a thread; it never takes as long."""


@pytest.fixture(autouse=True)
def few_are_many(monkeypatch):
    monkeypatch.setattr("decals.edit.background.MANY", 5)
    monkeypatch.setattr("decals.edit.session.FEW", 5)


def threaded(**options):
    return Actions(EditSession(scene()), threaded=True, **options)


def finish(actions):
    while actions.background.busy:
        actions.background.look(timeout=LONG)


def surface_pick(actions):
    item = actions.session.document.objects[0]
    positions, normals = item.surface.project([[0.0, 0.3, 1.2]])
    return Pick(0, positions[0], normals[0], -1)


def press(actions, action):
    actions.perform(action, lambda: surface_pick(actions))


class Held:
    """A step that waits in its thread until it is let go."""

    def __init__(self, command):
        self.begun, self.go, self.runs = threading.Event(), threading.Event(), 0
        self._step = doing(command)

    def __call__(self, session):
        self.runs += 1
        self.begun.set()
        assert self.go.wait(LONG)
        return self._step(session)


@pytest.mark.parametrize(
    "action", ["larger", "turn_left", "delete", "duplicate", "next_tint", "fainter", "relax"]
)
def test_what_is_done_in_the_background_is_what_is_done_at_once(action):
    there, here = threaded(), Actions(EditSession(scene()))
    first = digest(there.session.document)
    for actions in (there, here):
        press(actions, "pick_all")
        press(actions, action)
    assert there.background.busy
    assert digest(there.session.document) == first
    finish(there)
    assert digest(there.session.document) == digest(here.session.document) != first
    assert (there.message, there.selection) == (here.message, here.selection)
    there.settle()
    here.settle()
    assert there.session.labels == here.session.labels
    press(there, "undo")
    finish(there)
    assert digest(there.session.document) == first
    press(there, "redo")
    finish(there)
    assert digest(there.session.document) == digest(here.session.document)


def test_few_decals_are_changed_at_once():
    actions = threaded()
    actions.selection = (1, 2)
    press(actions, "larger")
    assert not actions.background.busy
    actions.settle()
    assert actions.session.labels == ("larger",)


def test_what_hands_do_meanwhile_stays_and_counts():
    actions = threaded()
    session, radius = actions.session, scene().decals.radii[7]
    held = Held(Scale(np.arange(60), 2.0))
    actions.background.edit("scale", held)
    assert held.begun.wait(LONG)
    session.do(Scale([7], 3.0))
    session.do(Delete([8]))
    session.undo()
    held.go.set()
    finish(actions)
    assert held.runs == 2
    assert session.document.decals[7].radii[0] == pytest.approx(6 * radius)
    assert session.labels == ("scale", "scale")
    session.undo()
    assert session.document.decals[7].radii[0] == pytest.approx(3 * radius)


def test_an_edit_that_hands_made_impossible_says_so():
    actions = threaded()
    held = Held(Scale(np.arange(60), 2.0))
    actions.background.edit("scale", held)
    assert held.begun.wait(LONG)
    actions.session.do(Delete([8]))
    after = digest(actions.session.document)
    held.go.set()
    finish(actions)
    assert "number of a decal, got 8" in actions.message
    assert digest(actions.session.document) == after


def test_an_undo_that_something_came_before_takes_nothing_back():
    actions = threaded()
    session = actions.session
    session.do(Scale(np.arange(60), 2.0))
    press(actions, "undo")
    session.do(Scale([3], 2.0))
    after = digest(session.document)
    finish(actions)
    assert "undo again" in actions.message
    assert digest(session.document) == after
    assert session.labels == ("scale", "scale")


def test_one_edit_at_a_time_and_who_comes_next_is_told():
    actions = threaded()
    session = actions.session
    session.do(Turn([1], 5.0))
    held = Held(Scale(np.arange(60), 2.0))
    actions.background.edit("scale", held)
    assert held.begun.wait(LONG)
    state = digest(session.document)
    for action in ("relax", "scatter", "undo", "redo"):
        actions.message = ""
        press(actions, action)
        assert actions.message == WAIT
    assert digest(session.document) == state
    assert "scale" in actions.background.progress
    held.go.set()
    finish(actions)
    assert session.labels == ("turn", "scale")
    assert actions.background.progress == ""


def test_escape_drops_what_goes_on():
    actions = threaded()
    first = digest(actions.session.document)
    held = Held(Scale(np.arange(60), 2.0))
    actions.background.edit("scale", held)
    assert held.begun.wait(LONG)
    press(actions, "let_go")
    assert actions.message == "stopped"
    held.go.set()
    finish(actions)
    assert digest(actions.session.document) == first
    assert actions.session.labels == ()


def test_of_a_drag_of_many_the_last_place_counts_and_it_is_one_entry():
    actions = threaded()
    session = actions.session
    numbers = np.arange(60)
    session.begin("move")
    held = Held(Turn(numbers, 10.0))
    actions.background.follow("turn", held)
    assert held.begun.wait(LONG)
    left_out, last = Held(Turn(numbers, 20.0)), Held(Turn(numbers, 30.0))
    for step in (left_out, last):
        actions.background.follow("turn", step)
        step.go.set()
    actions.settle()
    held.go.set()
    finish(actions)
    assert (held.runs, left_out.runs, last.runs) == (1, 0, 1)
    assert session.labels == ("move",)
    expected = EditSession(scene())
    expected.do(Turn(numbers, 10.0))
    expected.do(Turn(numbers, 30.0))
    assert digest(session.document) == digest(expected.document)


def test_a_drag_that_begins_before_the_last_one_is_all_seen_is_an_entry_of_its_own():
    actions = threaded()
    session = actions.session
    numbers = np.arange(60)
    held = Held(Turn(numbers, 10.0))
    actions.begin("move")
    actions.background.follow("turn", held)
    assert held.begun.wait(LONG)
    actions.settle()
    actions.begin("again")
    session.do(Turn([1], 10.0))
    held.go.set()
    finish(actions)
    session.do(Turn([2], 10.0))
    session.do(Turn([3], 10.0))
    actions.settle()
    assert session.labels == ("again",)
    session.undo()
    assert digest(session.document) == digest(EditSession(scene()).document)


def test_while_something_is_dragged_other_edits_wait():
    actions = threaded()
    actions.background.edit("scale", doing(Scale(np.arange(60), 2.0)))
    actions.session.begin("move")
    actions.session.do(Turn([1], 5.0))
    assert not actions.background.look(dragging=True, timeout=LONG)
    actions.settle()
    finish(actions)
    assert actions.session.labels == ("move", "scale")


def test_a_coat_is_made_while_hands_go_on(monkeypatch):
    begun, go = threading.Event(), threading.Event()
    actions = threaded()
    from decals.edit import population

    seed = population.seed

    def slowly(*arguments, **options):
        begun.set()
        assert go.wait(LONG)
        return seed(*arguments, **options)

    monkeypatch.setattr(population, "seed", slowly)
    press(actions, "scatter")
    assert begun.wait(LONG)
    session = actions.session
    box = session.document.decals.numbers[-1]
    actions.selection = (int(box),)
    press(actions, "larger")
    press(actions, "undo")
    press(actions, "larger")
    go.set()
    finish(actions)
    assert session.labels == ("larger", "scatter")
    press(actions, "undo")
    finish(actions)
    press(actions, "undo")
    finish(actions)
    assert digest(session.document) == digest(EditSession(scene()).document)


def test_a_coat_for_an_object_that_changed_is_refused():
    actions = threaded()
    press(actions, "scatter")
    actions.session.do(MovePrimitive(0, (0, 0), (0.05, 0, 0)))
    after = digest(actions.session.document)
    finish(actions)
    assert "scatter again" in actions.message
    assert digest(actions.session.document) == after


def test_relaxing_goes_on_where_its_object_went():
    actions = threaded()
    press(actions, "relax")
    actions.session.do(RemoveObject(0))
    finish(actions)
    assert actions.session.labels[0] == "remove an object"


def hold_writing(monkeypatch):
    """Let saves wait until they are let go; the events that say that one has begun, and let it go."""
    from decals.scenes import scene_file

    begun, go, write = threading.Event(), threading.Event(), scene_file.write_atomically

    def slowly(path, content):
        begun.set()
        assert go.wait(LONG)
        write(path, content)

    monkeypatch.setattr(scene_file, "write_atomically", slowly)
    return begun, go


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


def test_who_asks_twice_to_save_gets_the_later_state(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    actions = threaded(path=path)
    session = actions.session
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    session.do(Scale([1], 3.0))
    press(actions, "save")
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
    actions = threaded(path=path)
    session = actions.session
    begun, go = hold_writing(monkeypatch)
    press(actions, "save")
    assert begun.wait(LONG)
    session.do(Scale([1], 3.0))
    press(actions, "save")
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


def test_closing_drops_an_edit():
    actions = threaded()
    first = digest(actions.session.document)
    actions.background.edit("scale", doing(Scale(np.arange(60), 2.0)))
    actions.background.close()
    assert digest(actions.session.document) == first


def test_what_few_decals_come_to_is_a_change_of_these_alone(monkeypatch):
    monkeypatch.setattr("decals.edit.session.FEW", 500)
    session = EditSession(scene())
    editor = session.document.decals
    version = editor.version
    fork = session.fork()
    fork.do(Scale([1, 4], 2.0))
    assert session.adopt(fork)
    records = editor.changes(version)["decal_records"]
    assert sum(end - first for first, end in records) == 8
    assert editor.touched(version) is not None


def test_a_fork_goes_its_own_way_and_is_adopted_once():
    session = EditSession(scene())
    session.do(Scale([1], 2.0))
    first, heard = digest(session.document), []
    session.listen(heard.append)
    fork = session.fork()
    fork.undo()
    fork.do(Delete([3, 4]))
    assert digest(session.document) == first
    late = session.fork()
    assert session.adopt(fork)
    assert [change.after.numbers.tolist() for change in heard] == [[1], [3, 4]]
    assert session.labels == ("delete",)
    assert not session.document.decals.has([3]).any()
    assert not session.adopt(late)
    assert not EditSession(scene()).adopt(session.fork())
    session.undo()
    assert digest(session.document) == digest(EditSession(scene()).document)


@pytest.mark.parametrize("few", [0, 500])
def test_a_fork_of_a_fork_brings_all_that_was_done(monkeypatch, few):
    monkeypatch.setattr("decals.edit.session.FEW", few)
    session, alone = EditSession(scene()), EditSession(scene())
    fork = session.fork()
    further = fork.fork()
    for command in (Scale([1, 4], 2.0), Delete([3])):
        further.do(command)
        alone.do(command)
    assert fork.adopt(further)
    fork.do(Turn([5], 9.0))
    alone.do(Turn([5], 9.0))
    assert session.adopt(fork)
    assert session.labels == alone.labels
    assert digest(session.document) == digest(alone.document)


def test_what_nobody_foresaw_is_raised_and_what_waits_goes_on():
    actions = threaded()
    called = []

    def step(_session):
        raise MemoryError

    actions.background.follow("move", step)
    actions.background.afterwards(lambda: called.append(True))
    with pytest.raises(MemoryError):
        actions.background.look(timeout=LONG)
    assert called
    assert not actions.background.following
    actions.background.edit("scale", doing(Scale(np.arange(60), 2.0)))
    finish(actions)
    assert actions.session.labels == ("scale",)


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


KEYS = (
    "larger", "turn_left", "delete", "duplicate", "next_tint", "fainter", "layer_up", "relax", "place",
    "undo", "undo", "redo", "redo",
)  # fmt: skip
OPERATIONS = st.one_of(
    st.tuples(st.just("press"), st.sampled_from(KEYS), st.sampled_from(["all", "one", "two"])),
    st.tuples(st.sampled_from(["look", "look", "escape", "save"])),
)


class Twins:
    """Actions in a thread, and others at once that are asked when the thread's are seen."""

    def __init__(self, path):
        self.live, self.shadow = threaded(path=path), Actions(EditSession(scene()))
        self.path, self.pending, self.saved = Path(path), None, None

    def press(self, key, chosen):
        numbers = self.live.session.document.decals.numbers
        selection = {"all": numbers, "one": numbers[:1], "two": numbers[-2:]}[chosen]
        at, was_busy = surface_pick(self.live), self.live.background.busy_editing
        entries = self.shadow.session.next_undo, self.shadow.session.next_redo
        self.live.selection = tuple(selection.tolist())
        self.live.perform(key, lambda: at)
        echo = partial(self._echo, key, tuple(selection.tolist()), at, entries)
        if self.live.background.busy_editing and not was_busy:
            self.pending = echo
        elif self.live.message != WAIT:
            echo()

    def _echo(self, key, selection, at, entries):
        """Do what was seen now; an undo only where nothing else came before it."""
        now = self.shadow.session.next_undo, self.shadow.session.next_redo
        if (key == "undo" and now[0] is not entries[0]) or (key == "redo" and now[1] is not entries[1]):
            return
        self.shadow.selection = selection
        self.shadow.perform(key, lambda: at)

    def look(self):
        self.live.background.look(timeout=LONG)
        if not self.live.background.busy_editing and self.pending is not None:
            self.pending()
            self.pending = None

    def escape(self):
        self.live.background.cancel()
        self.pending = None

    def save(self):
        self.saved = self.live.session.document.decals.decals.packed().tobytes()
        self.live.perform("save", lambda: None)

    def settle(self):
        while self.live.background.busy:
            self.look()

    def same(self):
        return digest(self.live.session.document) == digest(self.shadow.session.document)


@settings(max_examples=40, deadline=None)
@given(operations=st.lists(OPERATIONS, max_size=14), few=st.sampled_from([0, 5, 500]))
def test_whatever_comes_between_nothing_is_lost(tmp_path_factory, operations, few):
    with patch("decals.edit.session.FEW", few):
        go_through(operations, tmp_path_factory)


def go_through(operations, tmp_path_factory):
    twins = Twins(tmp_path_factory.mktemp("saves") / "scene.json")
    for name, *arguments in operations:
        getattr(twins, name)(*arguments)
        if twins.pending is None:
            assert twins.same()
    twins.settle()
    assert twins.same()
    session = twins.live.session
    twins.live.settle()
    last = digest(session.document)
    entries = len(session.labels)
    for _ in range(entries):
        session.undo()
    assert digest(session.document) == digest(EditSession(scene()).document)
    for _ in range(entries):
        session.redo()
    assert digest(session.document) == last
    if twins.saved is not None:
        assert load_scene(twins.path).decals.packed().tobytes() == twins.saved


def test_an_edit_that_no_thread_does_raises_at_once():
    actions = Actions(EditSession(scene()))
    with pytest.raises(InvalidEdit):
        actions.background.edit("scale", doing(Scale([1], np.nan)))
