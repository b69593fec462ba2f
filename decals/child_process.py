"""Processes of our own for code that may crash, hang or take much memory: readers of files, and xatlas."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

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


def kill(child: Child) -> None:
    """Kill a process and the forks that it made."""
    with suppress(OSError):
        if sys.platform == "win32":
            child.kill()
        else:
            os.killpg(child.pid, signal.SIGKILL)
