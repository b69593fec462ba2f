"""Properties that any thread may ask for first."""

import threading
from typing import Any

import pytest

from blobtree.lazy import Lazy

LONG = 30.0
"""Seconds that a test would wait for a thread; it never takes as long."""


class Thing:
    def __init__(self, make: Any) -> None:
        self.make = make

    @Lazy
    def value(self) -> Any:
        """What was made."""
        return self.make()


def test_it_is_made_once() -> None:
    made: list[object] = []

    def make() -> object:
        made.append(object())
        return made[-1]

    thing = Thing(make)
    assert thing.value is thing.value
    assert made == [thing.value]
    assert Thing.value.__doc__ == "What was made."


def test_an_error_is_not_kept() -> None:
    answers = [LookupError(), None]

    def make() -> Any:
        if error := answers.pop(0):
            raise error
        return "made"

    thing = Thing(make)
    with pytest.raises(LookupError):
        thing.value  # noqa: B018  (asking fails)
    assert thing.value == "made"


def test_nobody_waits_for_what_another_thread_makes_and_both_have_the_same() -> None:
    begun, go, found = threading.Event(), threading.Event(), []

    def slow() -> Any:
        if threading.current_thread() is not threading.main_thread():
            begun.set()
            assert go.wait(LONG)
        return object()

    slowly, other = Thing(slow), Thing(object)
    thread = threading.Thread(target=lambda: found.append(slowly.value))
    thread.start()
    assert begun.wait(LONG)
    assert other.value is other.value
    first = slowly.value
    go.set()
    thread.join(LONG)
    assert found == [first]
    assert slowly.value is first
