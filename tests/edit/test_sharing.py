"""Turns of Python's threads: short while somebody works beside, as before afterwards."""

import sys
import threading

import pytest

from decals.edit.sharing import SWITCH, ShortTurns


def test_turns_are_short_inside_and_as_before_outside():
    before = sys.getswitchinterval()
    turns = ShortTurns()
    inside, leave = threading.Event(), threading.Event()

    def work():
        with turns:
            inside.set()
            leave.wait()

    thread = threading.Thread(target=work)
    thread.start()
    inside.wait()
    with pytest.raises(KeyError), turns:
        raise KeyError
    assert sys.getswitchinterval() == pytest.approx(min(SWITCH, before), rel=0.05), (
        "the thread is still inside"
    )
    leave.set()
    thread.join()
    assert sys.getswitchinterval() == pytest.approx(before, rel=0.05)


def test_turns_that_are_shorter_already_stay():
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH / 10)
    try:
        with ShortTurns():
            assert sys.getswitchinterval() == pytest.approx(SWITCH / 10, rel=0.05)
    finally:
        sys.setswitchinterval(before)
