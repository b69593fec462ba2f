"""A virtual X display for programs that open windows: a fixture to import."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from itertools import count

import pytest

FIRST_NUMBER, LAST_NUMBER, NUMBERS_PER_PROCESS = 100, 30_000, 50
"""Display numbers: each process, and each server of a process, has its own.

A server that chooses its number takes the lowest free one. A server that is just closing then removes the
socket of its successor, which can no longer be reached. For the same reason a server stays as it is
(``-noreset``) when its last client leaves: while it resets, new clients are refused.
"""

_started = count()


@pytest.fixture
def display() -> Iterator[str]:
    """Yield the name of a new virtual display."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("Xvfb is not installed (on Debian: apt-get install xvfb)")
    reading, writing = os.pipe()
    offset = os.getpid() * NUMBERS_PER_PROCESS + next(_started) % NUMBERS_PER_PROCESS
    name = f":{FIRST_NUMBER + offset % (LAST_NUMBER - FIRST_NUMBER)}"
    command = [server, name, "-noreset", "-displayfd", str(writing), "-screen", "0", "640x480x24"]
    process = subprocess.Popen(command, pass_fds=(writing,), stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as number:
            assert number.readline().strip() == name[1:], f"no display {name}"
            yield name
    finally:
        process.terminate()
        process.wait(30)
