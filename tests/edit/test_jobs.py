"""One job at a time, told of and stopped."""

import threading

import pytest

from blobtree import launch
from decals.edit.jobs import Job, Worker


def nothing():
    return None


def test_a_job_gives_its_outcome_and_tells_how_far_it_is():
    worker, told, go = Worker(), threading.Event(), threading.Event()

    def work(tell, stop):
        tell("thinking", 0.5)
        told.set()
        assert go.wait(5)
        return nothing

    assert worker.take() is None
    assert worker.start(Job("double", work))
    assert told.wait(5)
    assert worker.busy
    assert worker.progress == ("thinking", 0.5)
    assert worker.take() is None
    assert not worker.start(Job("another", work))
    go.set()
    assert worker.take(timeout=5) is nothing
    assert not worker.busy


def test_a_cancelled_job_comes_to_nothing():
    worker, begun = Worker(), threading.Event()

    def work(tell, stop):
        begun.set()
        while not stop():
            pass
        return nothing

    worker.start(Job("endless", work))
    assert begun.wait(5)
    assert not worker.stopping
    worker.cancel()
    assert worker.stopping
    assert worker.take(timeout=5) is None
    assert not worker.busy
    assert not worker.stopping


def test_what_a_job_raises_is_raised_where_it_is_asked_for():
    worker = Worker()

    def work(tell, stop):
        raise ValueError("no")

    worker.start(Job("fails", work))
    with pytest.raises(ValueError, match="no"):
        worker.take(timeout=5)
    assert not worker.busy


def test_a_job_leaves_a_core_to_the_window(monkeypatch):
    monkeypatch.setattr(launch, "_cores", lambda: 4)
    worker, seen = Worker(), []

    def work(tell, stop):
        seen.append(launch._workers())
        return nothing

    worker.start(Job("count", work))
    assert worker.take(timeout=5) is nothing
    assert seen == [3]
    assert launch._workers() == 4
