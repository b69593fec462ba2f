"""Long edits beside the window: what they come to is what they would have come to at once."""

import sys
import threading
from typing import Any

import numpy as np
import pytest

from blobtree import Point
from blobtree.kernels import NotCompiled
from decals import TreeObject
from decals.editing import (
    Actions,
    AddObject,
    AddPrimitive,
    DeleteDecals,
    Document,
    EditSession,
    FillBarePlaces,
    FlagNodes,
    MoveDecals,
    MovePrimitive,
    RelaxDecals,
    RemoveObject,
    RenameObject,
    ScaleDecals,
    SetCamera,
    SetValues,
    TurnDecals,
)
from decals.editing.action_state import COMPILING
from decals.editing.background import BUSY, MAX_WAITING, SWITCH_INTERVAL, ShortSwitchInterval
from decals.editing.brush_settings import Brush
from decals.editing.document import Edit
from decals.editing.inputs import LOOKS, inputs_of
from decals.editing.scatter_commands import decals_on
from decals.editing.session import step_of
from decals.errors import InvalidEdit
from tests.decals.editing.background import LONG, Held, finish, press, threaded
from tests.decals.editing.scenes import digest, goes_back_and_forth, scene

pytestmark = pytest.mark.usefixtures("few_are_many")


@pytest.mark.parametrize(
    "action", ["larger", "turn_left", "delete", "duplicate", "next_tint", "fainter", "relax"]
)
def test_what_is_done_in_the_background_is_what_is_done_at_once(action: Any) -> None:
    there, here = threaded(), Actions(EditSession(scene()))
    first = digest(there.state.session.document)
    for actions in (there, here):
        press(actions, "select_all")
        press(actions, action)
    assert there.state.background.busy
    assert digest(there.state.session.document) == first
    finish(there)
    assert digest(there.state.session.document) == digest(here.state.session.document) != first
    assert (there.state.message, there.state.selection) == (here.state.message, here.state.selection)
    there.state.end_stroke()
    here.state.end_stroke()
    assert there.state.session.labels == here.state.session.labels
    press(there, "undo")
    finish(there)
    assert digest(there.state.session.document) == first
    press(there, "redo")
    finish(there)
    assert digest(there.state.session.document) == digest(here.state.session.document)


def test_few_decals_are_changed_at_once() -> None:
    actions = threaded()
    actions.state.selection = (1, 2)
    press(actions, "larger")
    assert not actions.state.background.busy
    actions.state.end_stroke()
    assert actions.state.session.labels == ("larger",)


class Uncompiled(ScaleDecals):
    """A command whose kernels only other threads may compile."""

    def compute(self, document: Document) -> Edit:
        if threading.current_thread() is threading.main_thread():
            raise NotCompiled
        return super().compute(document)


def test_edits_whose_kernels_are_to_compile_go_to_the_background() -> None:
    actions = threaded()
    state, radius = actions.state, scene().decals.radii[7]
    state.run(Uncompiled([7], 3.0))
    assert state.background.busy
    finish(actions)
    state.begin_stroke("drag")
    state.run_latest(Uncompiled([7], 2.0))
    assert state.background.following
    finish(actions)
    state.end_stroke()
    assert state.session.document.decals[7].radii[0] == pytest.approx(6 * radius)
    assert state.session.labels == ("scale", "drag")


def refuse_in_this_thread(kernels: object, device: object = None) -> None:
    if threading.current_thread() is threading.main_thread():
        raise NotCompiled


def test_an_edit_is_not_carried_out_in_part_if_kernels_of_the_index_are_to_compile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    actions = threaded()
    state, before = actions.state, digest(actions.state.session.document)
    with monkeypatch.context() as patched:
        patched.setattr("decals.index.editable_index.load_together", refuse_in_this_thread)
        for command in (ScaleDecals([7], 3.0), DeleteDecals([8])):
            state.run(command)
            assert state.background.busy
            assert (digest(state.session.document), state.session.labels) == (before, ())
            state.background.cancel()
            finish(actions)
    state.run(ScaleDecals([7], 3.0))
    assert not state.background.busy
    assert state.session.labels == ("scale",)
    state.session.undo()
    assert digest(state.session.document) == before


def test_a_click_does_not_wait_for_kernels() -> None:
    actions = threaded()
    state, asked = actions.state, threading.Event()

    def middle(document: Document) -> int:
        if threading.current_thread() is threading.main_thread() and not asked.is_set():
            raise NotCompiled
        asked.set()
        return len(document.decals)

    assert state.asked("count", middle) is None
    assert state.message == COMPILING
    assert state.background.busy
    finish(actions)
    assert asked.is_set()
    assert state.asked("count", middle) == len(state.session.document.decals)
    assert state.session.labels == ()


def test_what_hands_do_meanwhile_stays_and_counts() -> None:
    actions = threaded()
    session, radius = actions.state.session, scene().decals.radii[7]
    held = Held(ScaleDecals(np.arange(60), 2.0))
    actions.state.background.edit("scale", held)
    assert held.begun.wait(LONG)
    session.do(ScaleDecals([7], 3.0))
    session.do(DeleteDecals([8]))
    session.undo()
    held.go.set()
    finish(actions)
    assert held.runs == 2
    assert session.document.decals[7].radii[0] == pytest.approx(6 * radius)
    assert session.labels == ("scale", "scale")
    session.undo()
    assert session.document.decals[7].radii[0] == pytest.approx(3 * radius)


def test_an_edit_that_hands_made_impossible_says_so() -> None:
    actions = threaded()
    held = Held(ScaleDecals(np.arange(60), 2.0))
    actions.state.background.edit("scale", held)
    assert held.begun.wait(LONG)
    actions.state.session.do(DeleteDecals([8]))
    after = digest(actions.state.session.document)
    held.go.set()
    finish(actions)
    assert "number of a decal, got 8" in actions.state.message
    assert digest(actions.state.session.document) == after


def test_an_undo_that_something_came_before_takes_nothing_back() -> None:
    actions = threaded()
    session = actions.state.session
    session.do(ScaleDecals(np.arange(60), 2.0))
    press(actions, "undo")
    session.do(ScaleDecals([3], 2.0))
    after = digest(session.document)
    finish(actions)
    assert "undo again" in actions.state.message
    assert digest(session.document) == after
    assert session.labels == ("scale", "scale")


def held_edit(actions: Any) -> Held:
    """An edit that goes on in the thread."""
    held = Held(ScaleDecals(np.arange(60), 2.0))
    actions.state.background.edit("scale", held)
    assert held.begun.wait(LONG)
    return held


def test_requests_follow_the_running_edit_in_their_order() -> None:
    actions = threaded()
    session = actions.state.session
    held = held_edit(actions)
    state = digest(session.document)
    for action in ("relax", "undo", "relax"):
        press(actions, action)
        assert (actions.state.message, actions.state.refusal) == ("", "")
    assert actions.state.background.waiting == 3
    assert actions.state.background.progress == "scale …, 3 more after it"
    assert digest(session.document) == state
    held.go.set()
    finish(actions)
    assert (session.labels, session.undone_labels) == (("scale", "relax"), ())
    assert (actions.state.background.waiting, actions.state.background.progress) == (0, "")


def test_a_request_is_left_out_if_the_user_selects_something_else_meanwhile() -> None:
    actions = threaded()
    session = actions.state.session
    actions.state.selection = (1, 2)
    held = held_edit(actions)
    press(actions, "relax")
    actions.state.selection = (3,)
    press(actions, "undo")
    held.go.set()
    finish(actions)
    assert (session.labels, session.undone_labels) == ((), ("scale",))


def test_a_request_follows_an_edit_that_selects_something() -> None:
    actions = threaded()
    session = actions.state.session
    actions.state.selection = tuple(range(60))
    press(actions, "duplicate")
    press(actions, "scatter")
    assert actions.state.background.waiting == 1
    finish(actions)
    assert session.labels == ("duplicate", "scatter")


def test_repeated_and_too_many_requests_are_refused() -> None:
    actions = threaded()
    held = held_edit(actions)
    press(actions, "thicker")  # a key that is held down
    assert (actions.state.refusal, actions.state.message) == (BUSY, BUSY)
    for _ in range(MAX_WAITING):
        press(actions, "relax")
        assert actions.state.refusal == ""
    press(actions, "relax")
    assert (actions.state.refusal, actions.state.background.waiting) == (BUSY, MAX_WAITING)
    press(actions, "deselect")
    assert actions.state.background.waiting == 0
    held.go.set()
    finish(actions)
    assert actions.state.session.labels == ()


def test_a_refusal_stays_until_the_next_request() -> None:
    actions = threaded()
    held = held_edit(actions)
    press(actions, "thicker")
    held.go.set()
    finish(actions)
    assert (actions.state.message, actions.state.refusal) == ("scale", BUSY)
    actions.state.refuse(InvalidEdit("no"))
    actions.state.attempt(lambda: None)
    assert (actions.state.message, actions.state.refusal) == ("", "")


def test_an_undo_waits_for_the_steps_of_a_drag() -> None:
    actions = threaded()
    session, first = actions.state.session, digest(actions.state.session.document)
    held = Held(ScaleDecals(np.arange(60), 2.0))
    actions.state.begin_stroke("drag")
    actions.state.background.edit_latest("scale", held)
    assert held.begun.wait(LONG)
    actions.state.end_stroke()
    press(actions, "undo")
    assert actions.state.message != BUSY
    held.go.set()
    finish(actions)
    assert digest(session.document) == first
    assert (session.labels, session.undone_labels) == ((), ("drag",))


def test_escape_drops_what_goes_on() -> None:
    actions = threaded()
    first = digest(actions.state.session.document)
    held = Held(ScaleDecals(np.arange(60), 2.0))
    actions.state.background.edit("scale", held)
    assert held.begun.wait(LONG)
    press(actions, "deselect")
    assert actions.state.message == "cancelled"
    held.go.set()
    finish(actions)
    assert digest(actions.state.session.document) == first
    assert actions.state.session.labels == ()


def test_of_a_drag_of_many_the_last_place_counts_and_it_is_one_entry() -> None:
    actions = threaded()
    session = actions.state.session
    numbers = np.arange(60)
    session.begin_stroke("move")
    held = Held(TurnDecals(numbers, 10.0))
    actions.state.background.edit_latest("turn", held)
    assert held.begun.wait(LONG)
    left_out, last = Held(TurnDecals(numbers, 20.0)), Held(TurnDecals(numbers, 30.0))
    for step in (left_out, last):
        actions.state.background.edit_latest("turn", step)
        step.go.set()
    actions.state.end_stroke()
    held.go.set()
    finish(actions)
    assert (held.runs, left_out.runs, last.runs) == (1, 0, 1)
    assert session.labels == ("move",)
    expected = EditSession(scene())
    expected.do(TurnDecals(numbers, 10.0))
    expected.do(TurnDecals(numbers, 30.0))
    assert digest(session.document) == digest(expected.document)


def test_a_drag_that_begins_before_the_last_one_is_all_seen_is_an_entry_of_its_own() -> None:
    actions = threaded()
    session = actions.state.session
    numbers = np.arange(60)
    held = Held(TurnDecals(numbers, 10.0))
    actions.state.begin_stroke("move")
    actions.state.background.edit_latest("turn", held)
    assert held.begun.wait(LONG)
    actions.state.end_stroke()
    actions.state.begin_stroke("again")
    session.do(TurnDecals([1], 10.0))
    held.go.set()
    finish(actions)
    session.do(TurnDecals([2], 10.0))
    session.do(TurnDecals([3], 10.0))
    actions.state.end_stroke()
    assert session.labels == ("again",)
    session.undo()
    assert digest(session.document) == digest(EditSession(scene()).document)


def test_while_something_is_dragged_other_edits_wait() -> None:
    actions = threaded()
    actions.state.background.edit("scale", step_of(ScaleDecals(np.arange(60), 2.0)))
    actions.state.session.begin_stroke("move")
    actions.state.session.do(TurnDecals([1], 5.0))
    assert not actions.state.background.poll(dragging=True, timeout=LONG)
    actions.state.end_stroke()
    finish(actions)
    assert actions.state.session.labels == ("move", "scale")


def test_edits_continue_while_decals_are_scattered(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go = threading.Event(), threading.Event()
    actions = threaded()
    from decals import scatter
    from decals.editing import scatter_commands as population

    def slowly(*arguments: Any, **options: Any) -> Any:
        begun.set()
        assert go.wait(LONG)
        return scatter(*arguments, **options)

    monkeypatch.setattr(population, "scatter", slowly)
    press(actions, "scatter")
    assert begun.wait(LONG)
    session = actions.state.session
    box = session.document.decals.numbers[-1]
    actions.state.selection = (int(box),)
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


def test_flags_and_names_of_an_object_do_not_refuse_its_new_decals() -> None:
    actions = threaded()
    press(actions, "scatter")
    session = actions.state.session
    session.do(FlagNodes(locked={0: ((0,),)}))
    session.do(RenameObject(1, "stone"))
    finish(actions)
    assert session.labels[-1] == "scatter"


def test_an_undo_that_changes_a_shape_waits_for_scattered_decals() -> None:
    actions = threaded()
    session = actions.state.session
    session.do(MovePrimitive(0, (0, 0), (0.05, 0, 0)))
    press(actions, "scatter")
    press(actions, "undo")
    assert [(work.label, work.running) for work in actions.state.background.queue] == [
        ("scatter", True),
        ("undo", False),
    ]
    finish(actions)
    assert (len(session.labels), session.undone_labels) == (1, ("scatter",))


def test_work_is_dropped_by_its_number_and_the_rest_goes_on() -> None:
    actions = threaded()
    background, session = actions.state.background, actions.state.session
    held = held_edit(actions)
    for action in ("relax", "scatter", "undo"):
        press(actions, action)
    labels = [work.label for work in background.queue]
    assert labels == ["scale", "relax", "scatter", "undo"]
    numbers = {work.label: work.number for work in background.queue}
    background.drop(numbers["relax"])
    assert actions.state.message == "cancelled: relax"
    background.drop(numbers["scale"])  # the next one runs, though the thread of this one goes on
    with pytest.raises(InvalidEdit, match="it has ended"):
        background.drop(numbers["scale"])
    held.go.set()
    finish(actions)
    assert (session.labels, session.undone_labels) == ((), ("scatter",))
    assert background.queue == []


def test_escape_ends_one_thing_with_each_press() -> None:
    actions = threaded()
    state, session = actions.state, actions.state.session
    before = digest(session.document)
    held = held_edit(actions)
    state.begin_stroke("turn")
    session.do(TurnDecals([1], 10.0))
    state.selection, state.primitive = (1,), (0, (0,))
    state.brush.brush, actions.help_page = Brush.PUSH, 1

    def left() -> list[bool]:
        return [
            actions.help_visible,
            state.brush.brush is not Brush.SELECT,
            session.stroke_open,
            bool(state.selection) or state.primitive is not None,
            state.background.busy,
        ]

    assert all(left())
    press(actions, "deselect")
    assert left() == [False, True, True, True, True]
    state.brush.brush = Brush.SELECT
    for ended in (3, 4, 5):
        press(actions, "deselect")
        assert left() == [False] * ended + [True] * (5 - ended)
    assert (state.message, digest(session.document)) == ("cancelled", before)
    held.go.set()
    assert state.background._edits.stop(LONG)
    assert digest(session.document) == before


def test_a_brush_ends_with_its_stroke() -> None:
    actions = threaded()
    state, before = actions.state, digest(actions.state.session.document)
    state.brush.brush = Brush.PUSH
    state.begin_stroke("push brush")
    state.session.do(TurnDecals([1], 10.0))
    press(actions, "deselect")
    assert (state.brush.brush, state.session.stroke_open) == (Brush.SELECT, False)
    assert digest(state.session.document) == before


def test_scattered_decals_for_a_changed_object_are_refused() -> None:
    actions = threaded()
    press(actions, "scatter")
    actions.state.session.do(MovePrimitive(0, (0, 0), (0.05, 0, 0)))
    after = digest(actions.state.session.document)
    finish(actions)
    assert "scatter again" in actions.state.message
    assert actions.state.refusal == actions.state.message  # a page shows it in red
    assert digest(actions.state.session.document) == after


def test_relaxing_goes_on_where_its_object_went() -> None:
    actions = threaded()
    press(actions, "relax")
    actions.state.session.do(RemoveObject(0))
    finish(actions)
    assert actions.state.session.labels[0] == "remove an object"


def test_closing_drops_an_edit() -> None:
    actions = threaded()
    first = digest(actions.state.session.document)
    actions.state.background.edit("scale", step_of(ScaleDecals(np.arange(60), 2.0)))
    actions.state.background.close()
    assert digest(actions.state.session.document) == first


def test_what_nobody_foresaw_is_raised_and_what_waits_goes_on() -> None:
    actions = threaded()
    called = []

    def step(_session: Any) -> None:
        raise MemoryError

    actions.state.background.edit_latest("move", step)
    actions.state.background.when_followed(lambda: called.append(True))
    with pytest.raises(MemoryError):
        actions.state.background.poll(timeout=LONG)
    assert called
    assert not actions.state.background.following
    actions.state.background.edit("scale", step_of(ScaleDecals(np.arange(60), 2.0)))
    finish(actions)
    assert actions.state.session.labels == ("scale",)


def test_an_edit_that_no_thread_does_raises_at_once() -> None:
    actions = Actions(EditSession(scene()))
    with pytest.raises(InvalidEdit):
        actions.state.background.edit("scale", step_of(ScaleDecals([1], np.nan)))


class Counted:
    """A command that counts how often it is computed, and waits the first time."""

    def __init__(self, command: Any) -> None:
        self.command, self.label, self.runs = command, command.label, 0
        self.begun, self.go = threading.Event(), threading.Event()
        if hasattr(command, "inputs"):
            self.inputs = command.inputs

    def compute(self, document: Any) -> Any:
        self.runs += 1
        self.begun.set()
        assert self.go.wait(LONG)
        return self.command.compute(document)


def looks(session: EditSession) -> None:
    """Edits that neither move a decal nor change a shape."""
    numbers = session.document.decals.numbers[-9:]
    session.do(SetValues.each(numbers, tints=(1.0, 0.5, 0.2), opacities=0.5, images=1))
    session.do(SetCamera(session.document.camera))


def far_away(session: EditSession) -> None:
    """Edits of decals on another object."""
    numbers = session.document.decals.numbers
    numbers = numbers[session.document.decals.column("positions")[:, 0].argsort()]
    session.do(ScaleDecals(numbers[:1], 1.5))
    session.do(DeleteDecals(numbers[1:2]))
    session.do(RenameObject(1, "stone"))


WORK: dict[str, Any] = {
    "relax": lambda: RelaxDecals((1.8, 1.5, 0)),
    "fill": lambda: FillBarePlaces((0,)),
    "scale many": lambda: ScaleDecals(decals_on(EditSession(scene()).document, [0])[6:], 2.0),
    "add an object": lambda: AddObject(TreeObject("ball", Point((5, 0, 0), radius=1.0))),
    "add a primitive": lambda: AddPrimitive(0, (), Point((0, 1.2, 0), radius=0.4)),
    "move a primitive": lambda: MovePrimitive(0, (0, 0), (0.1, 0, 0)),
}


@pytest.mark.parametrize(
    ("name", "meanwhile", "runs"),
    [
        *((name, looks, 1) for name in WORK),
        ("relax", far_away, 1),
        ("fill", far_away, 2),
        ("move a primitive", far_away, 2),
        ("relax", lambda session: session.do(MovePrimitive(0, (0, 0), (0.05, 0, 0))), 2),
        ("relax", lambda session: session.do(MoveDecals([59], (1.5, 1.3, 0.5), (0, 0, 1))), 2),
        ("scale many", far_away, 2),
    ],
)
def test_work_begins_again_only_if_what_it_reads_has_changed(name: str, meanwhile: Any, runs: int) -> None:
    actions = threaded()
    session, command = actions.state.session, Counted(WORK[name]())
    first: Any = DeleteDecals(decals_on(session.document, [0])[:6])
    if name == "relax":  # decals interact over some radii
        first = ScaleDecals(session.document.decals.numbers, 0.45)
    session.do(first)
    actions.state.background.edit(command.label, step_of(command), inputs=inputs_of(command))
    assert command.begun.wait(LONG)
    meanwhile(session)
    command.go.set()
    finish(actions)
    assert command.runs == runs
    assert session.labels[-1] == command.label
    # the same as one after the other
    other = EditSession(scene())
    other.do(first)
    meanwhile(other)
    other.do(WORK[name]())
    present, expected = session.document.decals.decals, other.document.decals.decals
    for column in ("positions", "normals", "tangents", "radii", "layers", "tints", "opacities"):
        # new decals are like those that were there when the work began
        rows = slice(0, 50) if column in LOOKS else slice(None)
        np.testing.assert_array_equal(getattr(present, column)[rows], getattr(expected, column)[rows])
    assert session.document.decals.numbers.tolist() == other.document.decals.numbers.tolist()
    assert [item.name for item in session.document.objects] == [o.name for o in other.document.objects]
    goes_back_and_forth(session)


def test_a_result_that_cannot_be_carried_over_is_computed_again() -> None:
    """The inputs claim too little: the same values changed, so the work runs once more."""
    actions = threaded()
    session, command = actions.state.session, Counted(ScaleDecals(np.arange(60), 2.0))
    radius = scene().decals.radii[7]
    actions.state.background.edit("scale", step_of(command), inputs=lambda _document: ())
    assert command.begun.wait(LONG)
    session.do(ScaleDecals([7], 3.0))
    command.go.set()
    finish(actions)
    assert command.runs == 2
    assert session.document.decals[7].radii[0] == pytest.approx(6 * radius)


# -- the switch interval -------------------------------------------------------------------------------


def test_turns_are_short_inside_and_as_before_outside() -> None:
    before = sys.getswitchinterval()
    shortest_rotations = ShortSwitchInterval()
    inside, leave = threading.Event(), threading.Event()

    def work() -> None:
        with shortest_rotations:
            inside.set()
            leave.wait()

    thread = threading.Thread(target=work)
    thread.start()
    inside.wait()
    with pytest.raises(KeyError), shortest_rotations:
        raise KeyError
    assert sys.getswitchinterval() == pytest.approx(min(SWITCH_INTERVAL, before), rel=0.05), (
        "the thread is still inside"
    )
    leave.set()
    thread.join()
    assert sys.getswitchinterval() == pytest.approx(before, rel=0.05)


def test_turns_that_are_shorter_already_stay() -> None:
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL / 10)
    try:
        with ShortSwitchInterval():
            assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL / 10, rel=0.05)
    finally:
        sys.setswitchinterval(before)
