"""The table: every gesture asks for one thing, every action exists, and the help says all of it."""

from collections import Counter

from decals.edit.actions import Actions
from decals.edit.keys import BINDINGS, CAMERA, action_of, actions, gesture, help_lines, help_table


def test_every_gesture_means_one_thing_and_every_action_is_there():
    counts = Counter(one for binding in BINDINGS if binding.action != CAMERA for one in binding.gestures)
    assert max(counts.values()) == 1
    handled_by_tools = {"move"}
    for action in set(actions().values()) - handled_by_tools:
        assert callable(getattr(Actions, f"_{action}")), action
    assert len(actions()) == len(counts)


def test_gestures_are_found_however_the_keyboard_types_them():
    assert action_of("z", ctrl=True) == "undo"
    assert action_of("Z", ctrl=True, shift=True) == "redo"
    assert action_of("I", shift=True) == "previous_image"
    assert action_of("plus", shift=True) == action_of("plus") == action_of("equal") == "larger"
    assert action_of("Click") == "pick"
    assert action_of("WheelUp") is None
    assert action_of("F7") is None
    assert gesture("A", ctrl=True) == "Ctrl+a"


def test_the_help_says_everything():
    text = "\n".join(help_lines())
    for binding in BINDINGS:
        assert binding.text in text
        assert binding.text in help_table()
    assert "Ctrl + Z" in text
    assert max(map(len, help_lines())) < 100
