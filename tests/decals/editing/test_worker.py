"""One job at a time, told of and stopped."""

import threading
import weakref
from typing import Any, NoReturn

import numpy as np
import pytest

from blobtree import device as launch
from blobtree.errors import Cancelled
from blobtree.progress import check_cancelled, reporting
from decals.editing.background import MAX_ENDING, Job, Worker
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


def test_a_cancelled_job_comes_to_nothing_and_the_next_one_does_not_wait() -> None:
    worker, begun, go = Worker(), threading.Event(), threading.Event()

    def work(tell: Any, stop: Any) -> Any:
        begun.set()
        assert go.wait(LONG)  # as a compilation, it looks at nothing
        assert stop()
        return nothing

    worker.start(Job("endless", work))
    assert begun.wait(LONG)
    assert not worker.stopping
    worker.cancel()
    assert (worker.busy, worker.stopping, worker.poll(timeout=LONG)) == (False, True, None)
    assert worker.start(Job("next", lambda tell, stop: nothing))
    assert worker.poll(timeout=LONG) is nothing
    assert worker.stopping
    go.set()
    assert worker.stop(LONG)
    assert not worker.stopping


def test_no_more_than_a_few_cancelled_jobs_go_on_beside_the_next_one() -> None:
    worker, go, running = Worker(), threading.Event(), threading.Semaphore(0)

    def work(tell: Any, stop: Any) -> Any:
        running.release()
        assert go.wait(LONG)
        return nothing

    for number in range(MAX_ENDING + 3):
        assert worker.start(Job(f"stubborn {number}", work))
        if number <= MAX_ENDING:
            assert running.acquire(timeout=LONG)
        worker.cancel()
    assert not running.acquire(timeout=0.05)  # the others have not begun
    assert worker.start(Job("last", work))
    assert not worker.stop(0.0)
    go.set()
    assert worker.stop(LONG)


def test_a_cancelled_job_ends_at_its_next_launch_or_report() -> None:
    worker = Worker()
    for check in (lambda tell: check_cancelled(), lambda tell: loops()):
        begun, ended = threading.Event(), threading.Event()

        def work(tell: Any, stop: Any, check: Any = check, begun: Any = begun, ended: Any = ended) -> Any:
            begun.set()
            try:
                while True:
                    check(tell)
            except Cancelled:
                ended.set()
                raise

        worker.start(Job("endless", work))
        assert begun.wait(LONG)
        worker.cancel()
        assert ended.wait(LONG)


def loops() -> None:
    """Report as a library function does whose caller passed no callback."""
    with reporting() as report:
        report("looping", 0.5)


def test_a_cancelled_job_keeps_nothing() -> None:
    worker, kept = Worker(), list[weakref.ref[Any]]()
    begun, go = threading.Event(), threading.Event()

    def work(tell: Any, stop: Any) -> NoReturn:
        large = np.zeros(3)
        kept.append(weakref.ref(large))
        begun.set()
        assert go.wait(LONG)
        raise Cancelled

    worker.start(Job("large", work))
    assert begun.wait(LONG)
    worker.cancel()
    go.set()
    assert worker.stop(LONG)
    assert kept[0]() is None


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
