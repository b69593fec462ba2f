"""One job at a time, told of and stopped."""

import threading

import pytest

from decals.edit import Scale
from decals.edit.jobs import Job, Worker


def test_a_job_gives_its_command_and_tells_how_far_it_is():
    worker, told, go = Worker(), threading.Event(), threading.Event()

    def work(tell, stop):
        tell("thinking", 0.5)
        told.set()
        assert go.wait(5)
        return Scale([0], 2.0)

    assert worker.take() is None
    assert worker.start(Job("double", work))
    assert told.wait(5)
    assert worker.busy
    assert worker.progress == ("thinking", 0.5)
    assert worker.take() is None
    assert not worker.start(Job("another", work))
    go.set()
    command = worker.take(timeout=5)
    assert isinstance(command, Scale)
    assert not worker.busy


def test_a_cancelled_job_makes_nothing():
    worker, begun = Worker(), threading.Event()

    def work(tell, stop):
        begun.set()
        while not stop():
            pass
        return Scale([0], 2.0)

    worker.start(Job("endless", work))
    assert begun.wait(5)
    worker.cancel()
    assert worker.take(timeout=5) is None
    assert not worker.busy


def test_what_a_job_raises_is_raised_where_it_is_asked_for():
    worker = Worker()

    def work(tell, stop):
        raise ValueError("no")

    worker.start(Job("fails", work))
    with pytest.raises(ValueError, match="no"):
        worker.take(timeout=5)
    assert not worker.busy
