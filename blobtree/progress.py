"""Progress of long work: how it is reported, where it is shown, and how it is cancelled.

Long functions do their work within `reporting`. Their reports go to the first of these that exists:

1. the function that the caller passed as ``progress``;
2. the innermost display (`displayed`), such as the title of a window;
3. once this work, or a series of such works, takes long: the output of the notebook's cell, the logger
   ``blobtree.progress`` if logging is configured, or else stderr. A thread repeats the last report with the
   elapsed seconds.

Reports of functions that the work calls, and of kernels that it compiles, go the same way.

A ``cancel`` function of any work around counts as well. It is called at each report and at each
`check_cancelled`, which loops without reports call. Every launch of kernels does.
"""

import logging
import math
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from typing import Any

from blobtree.errors import Cancelled, ImplicitDecalsError

Progress = Callable[[str, float], None]
"""A function (stage in plain words, fraction of it that is done, from 0 to 1)."""

Cancel = Callable[[], bool]
"""A function that returns True once the work is to stop; it is called often."""

LINE_SECONDS, UPDATE_SECONDS = 1.5, 0.5
"""Seconds until work is shown, and between two texts, where they stay and where they are replaced."""

TICK = 0.25
"""Seconds between two looks at the work."""

CANCEL_TICK = 0.05
"""Seconds between two looks whether work that waits is cancelled."""

PAUSE = 1.5
"""Work that begins so many seconds after other work goes on with its silence."""

IDLE_TICKS = 20
"""Number of looks without work after which their thread ends."""

CLEAR_LINE = "\r\x1b[2K"
"""Moves a terminal's cursor to the start of its line, and clears the line."""

_logger = logging.getLogger("blobtree.progress")
_PACKAGE_LOGGER = logging.getLogger("blobtree")


# -- reports --------------------------------------------------------------------------------------------

_outer: ContextVar["Progress | _Work | None"] = ContextVar("outer", default=None)
"""Where reports of the present work go; each thread has its own."""

_cancels: ContextVar[tuple[Cancel, ...]] = ContextVar("cancels", default=())
"""The ``cancel`` functions of the present work and of all work that called it."""

_displays: list[tuple[Progress, bool]] = []
"""Displays, and whether each is the only place that shows reports."""


@contextmanager
def reporting(progress: Progress | None = None, cancel: Cancel | None = None) -> Iterator[Progress]:
    """Within a ``with`` block, pass on reports of long work, and of the functions that it calls.

    Parameters
    ----------
    progress
        Receives the reports. Default: the work that called this one, or a display.
    cancel
        Called at each report and at each `check_cancelled` of the work, which raise `Cancelled` once it
        returns True.

    Examples
    --------
    >>> seen = []
    >>> with reporting(lambda stage, fraction: seen.append(stage)) as report:
    ...     report("placing vertices", 0.5)
    >>> seen
    ['placing vertices']
    """
    for name, callback in (("progress", progress), ("cancel", cancel)):
        if callback is not None and not callable(callback):
            raise ImplicitDecalsError(f"{name}: expected a function or None, got {callback!r}")
    target = progress or _outer.get() or _Work()

    def report(stage: str, fraction: float) -> None:
        check_cancelled(stage)
        target(stage, fraction)

    token = _outer.set(target)
    cancels = _cancels.set(_cancels.get() + (() if cancel is None else (cancel,)))
    try:
        if isinstance(target, _Work):
            with target.nested():
                yield report
        else:
            yield report
    finally:
        _cancels.reset(cancels)
        _outer.reset(token)


def check_cancelled(stage: str = "computing") -> None:
    """Raise `Cancelled` if this work, or work that called it, is to stop; call this in long loops.

    Parameters
    ----------
    stage
        What is being done, in plain words.

    Examples
    --------
    >>> with reporting(cancel=lambda: False):
    ...     check_cancelled("placing vertices")
    """
    for cancel in _cancels.get():
        if cancel():
            raise Cancelled(f"cancelled while {stage}")


@contextmanager
def ended_by_cancel(end: Callable[[], None]) -> Iterator[None]:
    """Within a ``with`` block that waits, call `end` from a thread once the work is to stop.

    The block itself then ends and calls `check_cancelled`.

    Parameters
    ----------
    end
        Ends what the block waits for, such as a child process; it may be called when that has ended.

    Examples
    --------
    >>> import threading
    >>> ended = threading.Event()
    >>> with reporting(cancel=lambda: True), ended_by_cancel(ended.set):
    ...     ended.wait()
    True
    """
    cancels, done = _cancels.get(), threading.Event()

    def watch() -> None:
        while not done.wait(CANCEL_TICK):
            if any(cancel() for cancel in cancels):
                end()
                return

    if cancels:
        threading.Thread(target=watch, name="blobtree cancel", daemon=True).start()
    try:
        yield
    finally:
        done.set()


@contextmanager
def displayed(display: Progress, *, alone: bool = True) -> Iterator[None]:
    """Within a ``with`` block, show the reports of work without a callback, in all threads, by `display`.

    The thread that works calls it, with an empty stage at the end.

    Parameters
    ----------
    display
        Receives the reports.
    alone
        False to show them where they are shown by default too.

    Examples
    --------
    >>> from blobtree import Point, polygonize
    >>> stages = []
    >>> with displayed(lambda stage, fraction: stages.append(stage)):
    ...     mesh = polygonize(Point((0, 0, 0), radius=1.0), resolution=16)
    >>> stages[-2:]
    ['connecting vertices', '']
    """
    added = display, alone
    _displays.append(added)
    try:
        yield
    finally:
        _displays.remove(added)


class _Work:
    """Work whose caller passed no callback; calling it reports a stage."""

    def __init__(self) -> None:
        self._stage, self._fraction = "", 0.0
        self._depth, self._displayed = 0, False
        self._began = time.monotonic()
        self._line = _new_line()

    def __call__(self, stage: str, fraction: float) -> None:
        self._stage, self._fraction = stage, fraction
        if _displays:
            _displays[-1][0](stage, fraction)
            self._displayed = True

    @contextmanager
    def nested(self) -> Iterator[None]:
        """Within a ``with`` block, watch this work; the stage is then what it was before the block."""
        before = self._stage, self._fraction
        if not self._depth:
            _watcher.add(self)
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1
            self._stage, self._fraction = before
            if not self._depth:
                _watcher.remove(self)
                self._line.end()
                if self._displayed and _displays:
                    _displays[-1][0]("", 1.0)

    def show(self, now: float, silence: float) -> bool:
        """Show the stage, if the silence was long; return True if it was shown."""
        if (_displays and _displays[-1][1]) or silence < self._line.seconds:
            return False
        self._line.show(self._text(now))
        return True

    def _text(self, now: float) -> str:
        """Return the stage, its fraction unless the stage counts itself, and the elapsed seconds from 1."""
        stage, fraction = self._stage or "working", self._fraction
        part = f": {100 * fraction:.0f} %" if 0.0 < fraction < 1.0 and ":" not in stage else ""
        seconds = round(now - self._began)
        elapsed = f" ({seconds} s)" if seconds else ""  # short work may end a long row of other work
        return f"{stage[0].upper()}{stage[1:]}{part}{elapsed}"


# -- the thread that watches the work -------------------------------------------------------------------


class _Watcher:
    """Shows work that takes long, from a thread that lives while there is work."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._work: list[_Work] = []
        self._running = False
        self._silent_since = self._ended = -math.inf

    def add(self, work: _Work) -> None:
        """Watch some work."""
        with self._lock:
            now = time.monotonic()
            if not self._work and now - self._ended > PAUSE:
                self._silent_since = now
            self._work.append(work)
            if not self._running:
                self._running = True
                threading.Thread(target=self._run, name="blobtree progress", daemon=True).start()

    def remove(self, work: _Work) -> None:
        """Watch some work no more; it is not being shown when this returns."""
        with self._lock:
            if work in self._work:  # else this process was forked from the one that added it
                self._work.remove(work)
                self._ended = time.monotonic()

    def _run(self) -> None:
        idle = 0
        while True:
            time.sleep(TICK)
            with self._lock:
                idle = 0 if self._work else idle + 1
                if idle == IDLE_TICKS:
                    self._running = False
                    return
                now = time.monotonic()
                silence = now - self._silent_since
                for work in self._work:
                    if work.show(now, silence):
                        self._silent_since = now


_watcher = _Watcher()


def _renew() -> None:
    """In a forked child: forget the parent's work, its displays and the thread that the child lacks."""
    global _watcher
    _watcher = _Watcher()
    _displays.clear()
    _outer.set(None)
    _cancels.set(())


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_renew)


# -- where work is shown by default ---------------------------------------------------------------------


class _Line:
    """A text that replaces the one before, or follows it in a line of its own; this one is not shown."""

    seconds = LINE_SECONDS

    def show(self, text: str) -> None:
        """Show a text."""

    def end(self) -> None:
        """Finish the output."""


class _LoggedLine(_Line):
    """Records of the logger."""

    def show(self, text: str) -> None:
        _logger.info("%s", text)


class _PrintedLine(_Line):
    """Lines on stderr."""

    def show(self, text: str) -> None:
        if sys.stderr is not None:  # as in a program without a console
            print(text, file=sys.stderr, flush=True)


class _TerminalLine(_Line):
    """One line of a terminal, which is cleared at the end."""

    seconds = UPDATE_SECONDS

    def __init__(self) -> None:
        self._shown = False

    def show(self, text: str) -> None:
        text = text[: shutil.get_terminal_size().columns - 1]
        print(f"{CLEAR_LINE}{text}", end="", file=sys.stderr, flush=True)
        self._shown = True

    def end(self) -> None:
        if self._shown:
            print(CLEAR_LINE, end="", file=sys.stderr, flush=True)


class _NotebookLine(_Line):
    """One line below the cell of a notebook."""

    seconds = UPDATE_SECONDS

    def __init__(self) -> None:
        self._handle: Any = None

    def show(self, text: str) -> None:
        output = {"text/plain": text}
        if self._handle is None:
            display: Any = import_module("IPython.display").display
            self._handle = display(output, raw=True, display_id=True)
        else:
            self._handle.update(output, raw=True)


def _new_line() -> _Line:
    """Return where work is shown by default."""
    if max(_logger.level, _PACKAGE_LOGGER.level) > logging.INFO:
        return _Line()
    if in_notebook():
        return _NotebookLine()
    if _logger.hasHandlers():
        return _LoggedLine()
    return _TerminalLine() if _is_terminal() else _PrintedLine()


def _is_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def in_notebook() -> bool:
    """Return True in a kernel of Jupyter, which shows pages and pictures below its cells."""
    shell = sys.modules.get("IPython")
    return shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None
