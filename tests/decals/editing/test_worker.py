"""One job at a time, told of and stopped."""

import threading
from typing import Any, NoReturn

import pytest

from blobtree import device as launch
from decals.editing.background import Job, Worker
from tests.decals.editing.background import LONG


def nothing() -> None:
    return None


def test_a_job_gives_its_outcome_and_tells_how_far_it_is() -> None:
    worker, told, go = Worker(), threading.Event(), threading.Event()

    def work(tell: Any, stop: Any) -> Any:
        tell("thinking", 0.5)
        told.set()
        assert go.wait(LONG)
        return nothing

    assert worker.poll() is None
    assert worker.start(Job("double", work))
    assert told.wait(LONG)
    assert worker.busy
    assert worker.progress == ("thinking", 0.5)
    assert worker.poll() is None
    assert not worker.start(Job("another", work))
    go.set()
    assert worker.poll(timeout=LONG) is nothing
    assert not worker.busy


def test_a_cancelled_job_comes_to_nothing() -> None:
    worker, begun = Worker(), threading.Event()

    def work(tell: Any, stop: Any) -> Any:
        begun.set()
        while not stop():
            pass
        return nothing

    worker.start(Job("endless", work))
    assert begun.wait(LONG)
    assert not worker.cancelling
    worker.cancel()
    assert worker.cancelling
    assert worker.poll(timeout=LONG) is None
    assert not worker.busy
    assert not worker.cancelling


def test_what_a_job_raises_is_raised_where_it_is_asked_for() -> None:
    worker = Worker()

    def work(tell: Any, stop: Any) -> NoReturn:
        raise ValueError("no")

    worker.start(Job("fails", work))
    with pytest.raises(ValueError, match="no"):
        worker.poll(timeout=LONG)
    assert not worker.busy


def test_a_job_leaves_a_core_to_the_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launch, "_core_count", lambda: 4)
    worker, seen = Worker(), []

    def work(tell: Any, stop: Any) -> Any:
        seen.append(launch._thread_count())
        return nothing

    worker.start(Job("count", work))
    assert worker.poll(timeout=LONG) is nothing
    assert seen == [3]
    assert launch._thread_count() == 4
