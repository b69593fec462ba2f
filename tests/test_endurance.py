"""A short run of threads and windows finds nothing; results that differ are reported."""

import itertools
from typing import Any

import numpy as np
import pytest

from tests import endurance


@pytest.mark.slow
def test_threads_and_windows_find_nothing() -> None:
    assert endurance.thread_failures("cpu", 1) == []
    assert endurance.window_failures(4)[0] == []


def test_a_result_that_differs_and_an_exception_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    turns, tries = itertools.count(), itertools.count()

    def failing() -> tuple[Any, ...]:
        if next(tries) > 0:
            raise LookupError("of Python")
        return (np.zeros(1),)

    works = {"differs": lambda: (np.array([next(turns)]),), "fails": failing}
    monkeypatch.setattr(endurance, "works", lambda _: works)
    found = sorted(endurance.thread_failures("cpu", 1, threads=1))
    assert found[0] == "thread 0, round 0: differs differs"
    assert "fails: Traceback" in found[1]
    assert "LookupError: of Python" in found[1]
    assert len(found) == 2
