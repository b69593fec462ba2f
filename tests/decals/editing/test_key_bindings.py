"""The key table: gestures are unique, every action exists, and the help lists all of them."""

from collections import Counter

from decals.editing import KEYS, Actions, EditSession
from decals.editing.brush_settings import Brush
from decals.editing.key_bindings import CAMERA, gesture_name
from tests.decals.editing.scenes import scene


def test_every_gesture_has_one_action_and_every_action_exists() -> None:
    bindings = [binding for binding in KEYS.bindings if binding.action != CAMERA]
    counts = Counter(gesture for binding in bindings for gesture in binding.gestures)
    assert max(counts.values()) == 1
    actions = Actions(EditSession(scene()))
    for name in {binding.action for binding in bindings} - {"move"}:
        actions.perform(name, lambda: None)


def test_brushes_are_chosen_by_keys_and_the_camera_needs_a_window() -> None:
    actions = Actions(EditSession(scene()))
    for brush in Brush:
        actions.perform(f"brush_{brush}", lambda: None)
        assert actions.state.brush.brush is brush
    for name in ("view_front", "frame"):
        actions.perform(name, lambda: None)
        assert "no window is open" in actions.state.message


def test_gestures_do_not_depend_on_the_keyboard() -> None:
    action_of = KEYS.action_of
    assert action_of("z", ctrl=True) == "undo"
    assert action_of("Z", ctrl=True, shift=True) == "redo"
    assert action_of("I", shift=True) == "previous_image"
    assert action_of("plus", shift=True) == action_of("plus") == action_of("equal") == "larger"
    assert action_of("Click") == "select"
    assert action_of("WheelUp") is None
    assert action_of("F7") is None
    assert gesture_name("A", ctrl=True) == "Ctrl+a"


def test_the_help_is_complete() -> None:
    text = "\n".join(KEYS.help_lines())
    for binding in KEYS.bindings:
        assert binding.summary in text
        assert binding.summary in KEYS.help_table()
    assert "Ctrl + Z" in text
    assert max(map(len, KEYS.help_lines())) < 100
