"""Reports of long work reach the callback, a display, or stderr, the log and notebooks."""

import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

import blobtree.progress as progress
from blobtree.cells.scan import arange
from blobtree.errors import Cancelled, ImplicitDecalsError
from blobtree.progress import check_cancelled, displayed, ended_by_cancel, reporting

Reports = list[tuple[str, float]]


@pytest.fixture(autouse=True)
def unset_levels() -> Iterator[None]:
    """Ignore levels of loggers that a page of the documentation has set."""
    loggers = progress._PACKAGE_LOGGER, progress._logger
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.NOTSET)
    yield
    for logger, level in zip(loggers, before, strict=True):
        logger.setLevel(level)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The thread looks often, and shows at once; it is not the one of other tests."""
    monkeypatch.setattr(progress, "TICK", 0.005)
    monkeypatch.setattr(progress, "_displays", [])
    monkeypatch.setattr(progress, "_watcher", progress._Watcher())
    for kind in (progress._Line, progress._TerminalLine, progress._NotebookLine):
        monkeypatch.setattr(kind, "seconds", 0.0)
    yield
    deadline = time.monotonic() + 10.0
    while progress._watcher._running and time.monotonic() < deadline:
        time.sleep(0.005)
    assert not progress._watcher._running


@pytest.fixture
def no_handlers(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a script that configures no logging: pytest has handlers of its own."""
    monkeypatch.setattr(progress._logger, "hasHandlers", lambda: False)


def until_shown(capsys: pytest.CaptureFixture[str], text: str) -> str:
    """Wait until stderr has a text, and return all of it."""
    shown, deadline = "", time.monotonic() + 10.0
    while text not in shown and time.monotonic() < deadline:
        time.sleep(0.01)
        shown += capsys.readouterr().err
    return shown


def test_a_callback_receives_the_reports_of_inner_work_too() -> None:
    seen: Reports = []
    with reporting(lambda *report: seen.append(report)) as report:
        report("outer", 0.25)
        with reporting() as inner:
            inner("inner", 0.5)
        report("outer", 1.0)
    assert seen == [("outer", 0.25), ("inner", 0.5), ("outer", 1.0)]


def test_an_inner_callback_goes_first() -> None:
    outer: Reports = []
    inner: Reports = []
    with reporting(lambda *report: outer.append(report)):
        with reporting(lambda *report: inner.append(report)) as report:
            report("inner", 0.5)
        with reporting() as report:
            report("outer", 0.5)
    assert (outer, inner) == ([("outer", 0.5)], [("inner", 0.5)])


def test_work_of_other_threads_does_not_report_to_a_callback() -> None:
    seen: Reports = []

    def work() -> None:
        with reporting() as report:
            report("other", 0.5)

    with reporting(lambda *report: seen.append(report)):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert not seen


def test_a_display_shows_the_work_of_all_threads_and_its_end() -> None:
    seen: Reports = []

    def work() -> None:
        with reporting() as outer, reporting() as inner:
            outer("outer", 0.5)
            inner("inner", 0.5)

    with displayed(lambda *report: seen.append(report)):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        with reporting():  # without a report there is nothing to end
            pass
    assert seen == [("outer", 0.5), ("inner", 0.5), ("", 1.0)]


@pytest.mark.usefixtures("quick", "no_handlers")
@pytest.mark.parametrize("alone", [True, False])
def test_a_display_that_is_not_alone_leaves_the_line(alone: bool, capsys: pytest.CaptureFixture[str]) -> None:
    seen: Reports = []
    with displayed(lambda *report: seen.append(report), alone=alone), reporting() as report:
        report("finding", 0.0)
        time.sleep(0.05)
        assert bool(until_shown(capsys, "Finding") if not alone else capsys.readouterr().err) is not alone
    assert seen[0] == ("finding", 0.0)


def test_the_cancel_of_outer_work_ends_inner_work_and_launches_too() -> None:
    calls = 0

    def cancel() -> bool:
        nonlocal calls
        calls += 1
        return calls > 2

    with reporting(cancel=cancel), reporting(lambda *_: None) as inner:
        inner("placing", 0.5)
        check_cancelled()
        ends: list[Callable[[], None]] = [lambda: inner("placing", 0.5), check_cancelled, launch_once]
        for end in ends:
            with pytest.raises(Cancelled):
                end()
    launch_once()
    check_cancelled()


def launch_once() -> None:
    arange(8, "cpu")


def test_what_work_waits_for_ends_with_a_cancel() -> None:
    cancelled, ended = threading.Event(), threading.Event()
    with reporting(cancel=cancelled.is_set), ended_by_cancel(ended.set):
        assert not ended.wait(0.1)
        cancelled.set()
        assert ended.wait(10.0)
    ended.clear()
    with reporting(cancel=cancelled.is_set), ended_by_cancel(ended.set):
        pass
    assert not ended.wait(0.1)


def test_cancelled_work_ends_at_its_next_report() -> None:
    seen: Reports = []
    with reporting(lambda *report: seen.append(report), lambda: bool(seen)) as report:
        report("finding", 0.0)
        with pytest.raises(Cancelled, match="cancelled while placing"):
            report("placing", 0.0)
    assert seen == [("finding", 0.0)]


@pytest.mark.parametrize("name", ["progress", "cancel"])
def test_callbacks_must_be_functions(name: str) -> None:
    wrong: Any = {name: 3}
    with pytest.raises(ImplicitDecalsError, match=f"{name}: expected a function or None, got 3"):
        reporting(**wrong).__enter__()


@pytest.mark.usefixtures("quick", "no_handlers")
def test_long_work_prints_lines_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with reporting() as report:
        assert "Working" in until_shown(capsys, "Working\n")
        report("spreading particles", 0.35)
        assert "Spreading particles: 35 % (" in until_shown(capsys, "particles: 35 % (")
        with reporting() as inner:
            inner("compiling kernels: 3 of 11", 3 / 11)
            assert "Compiling kernels: 3 of 11 (" in until_shown(capsys, "3 of 11 (")
        until_shown(capsys, "Spreading")  # again, although it reported nothing


@pytest.mark.usefixtures("quick", "no_handlers")
def test_one_work_after_another_is_long_but_for_a_pause(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress._Line, "seconds", 0.1)
    shown, deadline = "", time.monotonic() + 10.0
    while not shown and time.monotonic() < deadline:
        with reporting() as report:
            report("short", 0.0)
            time.sleep(0.01)
        shown += capsys.readouterr().err
    assert shown.startswith("Short\n")
    monkeypatch.setattr(progress, "PAUSE", 0.0)
    before = time.monotonic()
    with reporting():
        assert progress._watcher._silent_since >= before


@pytest.mark.usefixtures("quick", "no_handlers")
def test_a_terminal_shows_one_line_and_clears_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with reporting() as report:
        report("spreading particles", 0.35)
        shown = until_shown(capsys, "Spreading particles")
    assert "\n" not in shown
    assert all(len(text) < 20 for text in shown.split(progress.CLEAR_LINE))
    assert capsys.readouterr().err.endswith(progress.CLEAR_LINE)


@pytest.mark.usefixtures("quick")
def test_configured_logging_takes_the_lines(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "blobtree.progress"), reporting() as report:
        report("spreading particles", 0.35)
        deadline = time.monotonic() + 10.0
        while not caplog.records and time.monotonic() < deadline:
            time.sleep(0.01)
    assert caplog.records[0].name == "blobtree.progress"
    assert caplog.records[0].getMessage().startswith("Spreading particles: 35 %")
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("no_handlers")
def test_a_level_above_info_silences_the_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    assert type(progress._new_line()) is progress._PrintedLine
    monkeypatch.setattr(logging.getLogger("blobtree"), "level", logging.WARNING)
    assert type(progress._new_line()) is progress._Line


@pytest.mark.usefixtures("quick")
def test_a_notebook_shows_one_text_that_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[str, Any]] = []

    def display(output: Any, *, raw: bool, display_id: bool) -> Any:
        assert raw
        assert display_id
        shown.append(("new", output))
        return SimpleNamespace(update=lambda output, *, raw: shown.append(("update", output)))

    notebook: Any = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    module: Any = SimpleNamespace(display=display)
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    with reporting() as report:
        report("drawing", 0.0)
        deadline = time.monotonic() + 10.0
        while len(shown) < 3 and time.monotonic() < deadline:
            time.sleep(0.01)
    kinds = [kind for kind, _ in shown]
    assert kinds == ["new", *["update"] * (len(shown) - 1)]
    assert shown[0][1] == {"text/plain": "Drawing"}


@pytest.mark.usefixtures("quick", "no_handlers")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded")
def test_a_forked_child_reports_its_own_work() -> None:
    with reporting() as report:
        report("the parent's", 0.5)
        child = os.fork()
        if child == 0:
            code = 1
            try:
                with reporting() as own:
                    own("the child's", 0.5)
                    thread_runs = progress._watcher._running
                code = 0 if thread_runs and not progress._displays else 1
            finally:
                os._exit(code)
        assert os.waitpid(child, 0)[1] == 0
