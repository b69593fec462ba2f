"""Long edits beside the window: what they come to is what they would have come to at once."""

import threading

import numpy as np
import pytest

from decals.edit import Actions, Delete, EditSession, MovePrimitive, RemoveObject, Scale, Turn
from decals.edit.background import WAIT, doing
from decals.errors import InvalidEdit
from tests.edit.background import (
    LONG,
    Held,
    finish,
    press,
    threaded,
)
from tests.edit.scenes import digest, scene

pytestmark = pytest.mark.usefixtures("few_are_many")


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


def test_closing_drops_an_edit():
    actions = threaded()
    first = digest(actions.session.document)
    actions.background.edit("scale", doing(Scale(np.arange(60), 2.0)))
    actions.background.close()
    assert digest(actions.session.document) == first


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


def test_an_edit_that_no_thread_does_raises_at_once():
    actions = Actions(EditSession(scene()))
    with pytest.raises(InvalidEdit):
        actions.background.edit("scale", doing(Scale([1], np.nan)))
