"""The switch interval of Python's threads: short during a background job, restored afterwards."""

import sys
import threading

import pytest

from decals.editing.background import SWITCH_INTERVAL, ShortSwitchInterval


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
