"""The same user in a real window, where there is a virtual X display."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from decals import load_scene
from decals.apps.models.samples import sample_mesh
from tests.display import display
from tests.programs import run_module

__all__ = ["display"]
SAYS = "the first picture came back"
PROGRAM = "tests.decals.window.on_screen"


@pytest.mark.slow  # the other tests of the window drive it without a screen, too
def test_without_a_screen() -> None:
    assert SAYS in run_module(PROGRAM, "off")


@pytest.mark.slow
def test_windows_on_a_virtual_display(display: str) -> None:
    """One process opens three windows. A timer, a request to close and real keys end them."""
    try:
        ctypes.CDLL("libXtst.so.6")
        parts = ["tick", "asked", "events"]
    except OSError:  # on Debian: apt-get install libxtst6
        parts = ["tick", "asked"]
    printed = run_module(PROGRAM, *parts, DISPLAY=display).splitlines()
    expected = [SAYS, "ticks [False, False, False, True, True, True] closed", "all of it worked"]
    assert printed == expected[: len(parts)]


INTERRUPTED = """
import os, signal, sys, time
from decals.apps.cli import run
from decals.window import EditWindow

signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background of a shell ignores it
begin = EditWindow.begin

def begin_and_interrupt(window):
    begin(window)
    ticks, deadline = [], time.monotonic() + 60.0
    def tick(*_):
        ticks.append(0)
        if len(ticks) == 3:
            window.tools.key("a", 0, 0, ctrl=True)
            window.tools.key("d", 0, 0)
            os.kill(os.getpid(), signal.SIGINT)
        elif time.monotonic() > deadline:
            os._exit(9)
    window.plotter.iren.interactor.AddObserver("TimerEvent", tick)

EditWindow.begin = begin_and_interrupt
sys.exit(run(["edit", "knot", "--decals", "2", "--size", "120x80"]))
"""


@pytest.mark.slow
def test_ctrl_c_in_the_terminal_closes_the_window(display: str, tmp_path: Path) -> None:
    done = run_script(INTERRUPTED, tmp_path, display)
    assert done.returncode == 130, done.stderr
    assert done.stderr.strip().endswith("interrupted")
    assert "Ctrl-C" not in done.stderr + done.stdout
    assert "unsaved changes are kept in knot-decals.recovery.json" in done.stderr
    assert len(load_scene(tmp_path / "knot-decals.recovery.json", samples=sample_mesh).decals) == 4


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only X servers are missing silently")
def test_a_display_that_does_not_answer_is_an_error(tmp_path: Path) -> None:
    command = "import sys; from decals.apps.cli import run; sys.exit(run(['edit', 'knot', '--decals', '2']))"
    done = run_script(command, tmp_path, ":30999")
    assert done.returncode == 2, done.stderr
    assert "error: expected a screen for the window, got none (no X server answers at" in done.stderr
    assert "':30999'" in done.stderr


def run_script(script: str, folder: Path, display: str) -> "subprocess.CompletedProcess[str]":
    """Run a script with a display in a folder."""
    environment = {name: value for name, value in os.environ.items() if name != "WAYLAND_DISPLAY"}
    return subprocess.run(
        [sys.executable, "-c", script],
        env={**environment, "DISPLAY": display},
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
