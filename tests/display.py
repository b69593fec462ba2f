"""A virtual X display for programs that open windows: a fixture to import."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

NUMBERS = range(100, 30_000)
"""Of displays: each process has one of its own.

Servers that choose theirs take the least that is free. One that is on its way out then removes the socket of
the one that has just begun under its number, and nobody can connect to that any more.
"""


@pytest.fixture
def display() -> Iterator[str]:
    """A virtual display of its own."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("Xvfb is not installed (on Debian: apt-get install xvfb)")
    reading, writing = os.pipe()
    name = f":{NUMBERS[os.getpid() % len(NUMBERS)]}"
    command = [server, name, "-displayfd", str(writing), "-screen", "0", "640x480x24"]
    process = subprocess.Popen(command, pass_fds=(writing,), stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as told:
            assert told.readline().strip() == name[1:], f"no display {name}"
            yield name
    finally:
        process.terminate()
        process.wait(30)


def run_module(module: str, *arguments: str, **environment: str) -> str:
    """Run a module of the tests as a program, and give what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
