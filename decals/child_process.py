"""Processes of our own for code that may crash, hang or take much memory: readers, xatlas, OpenUSD."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from blobtree.progress import check_cancelled, ended_by_cancel

Child = subprocess.Popen[bytes]


def can_isolate() -> bool:
    """Return True if a Python of its own can be started; not in programs that embed or freeze Python."""
    return bool(sys.executable) and not getattr(sys, "frozen", False)


def start_child(module: str, *arguments: str, **options: Any) -> Child:
    """Start a module in a Python that finds the same packages, with a pipe from its output.

    Parameters
    ----------
    module, *arguments
        The module's name, and its arguments.
    **options
        More options of `subprocess.Popen`.
    """
    folders = os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path)
    return subprocess.Popen(
        [sys.executable, "-P", "-W", "ignore", "-m", module, *arguments],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": folders},
        start_new_session=True,  # Control-C is for the parent, and `kill` reaches the forks of the child
        **options,
    )


@contextmanager
def time_limit(child: Child, seconds: float) -> Iterator[None]:
    """Kill a process unless the ``with`` block ends in time; a read from its pipe then ends too."""
    timer = threading.Timer(seconds, kill, [child])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def answer_of(child: Child, work: str, given: bytes | None = None) -> tuple[bytes, bytes]:
    """Return what a process writes to its output and its errors; it is killed if its work is cancelled.

    Parameters
    ----------
    child
        The process.
    work
        What it does, as progress reports say it.
    given
        Its input.
    """
    with child:
        try:
            with ended_by_cancel(partial(kill, child)):
                answer = child.communicate(given)
            check_cancelled(work)
        except BaseException:
            kill(child)
            raise
    return answer


def answer_once(work: Callable[[bytes], bytes]) -> None:
    """In a child: write the answer to its input; what libraries print goes to its errors."""
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)
        answer.write(work(sys.stdin.buffer.read()))


def kill(child: Child) -> None:
    """Kill a process and the forks that it made."""
    with suppress(OSError):
        if sys.platform == "win32":
            child.kill()
        else:
            os.killpg(child.pid, signal.SIGKILL)
