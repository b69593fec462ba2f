"""The same hands in a real window, where there is a virtual X display."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

SAYS = "the first picture came back"


def run(*arguments: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "tests.window.on_screen", *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def display() -> Iterator[str]:
    """A virtual display of its own."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("Xvfb is not installed (on Debian: apt-get install xvfb)")
    reading, writing = os.pipe()
    command = [server, "-displayfd", str(writing), "-screen", "0", "640x480x24"]
    process = subprocess.Popen(command, pass_fds=(writing,), stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as told:
            yield f":{told.readline().strip()}"
    finally:
        process.terminate()
        process.wait(30)


def test_without_a_screen() -> None:
    assert SAYS in run("off")


def test_on_a_virtual_display(display: str) -> None:
    assert SAYS in run(DISPLAY=display)
