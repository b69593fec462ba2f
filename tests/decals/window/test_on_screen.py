"""The same user in a real window, where there is a virtual X display."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import pytest

from decals.apps.models.samples import sample_mesh
from decals.scenes.files import load_scene
from tests.display import display, run_module

__all__ = ["display"]
SAYS = "the first picture came back"
PROGRAM = "tests.decals.window.on_screen"


@pytest.mark.slow  # the other tests of the window drive it without a screen, too
def test_without_a_screen() -> None:
    assert SAYS in run_module(PROGRAM, "off")


def test_real_keys_and_buttons_do_what_the_help_says(display: str) -> None:
    try:
        ctypes.CDLL("libXtst.so.6")
    except OSError:
        pytest.skip("libXtst is not installed (on Debian: apt-get install libxtst6)")
    assert "all of it worked" in run_module("tests.decals.window.x_events", DISPLAY=display)


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


def test_ctrl_c_in_the_terminal_closes_the_window(display: str, tmp_path: Path) -> None:
    done = run_script(INTERRUPTED, tmp_path, display)
    assert done.returncode == 130, done.stderr
    assert done.stderr.strip().endswith("interrupted")
    assert "Ctrl-C" not in done.stderr + done.stdout
    assert "unsaved changes are kept in knot-decals.recovery.json" in done.stderr
    assert len(load_scene(tmp_path / "knot-decals.recovery.json", samples=sample_mesh).decals) == 4


CLOSED = """
from decals import Camera, MeshObject, Scene
from decals.window import EditWindow
from tests.decals.editing.scenes import box, one

cube = MeshObject("cube", *box((-1, -1, -1), (1, 1, 1)))
decals = one(images=[-1])
window = EditWindow(Scene(objects=(cube,), decals=decals, camera=Camera((0, 0, 6))), size=(120, 80))
interactor, ticks = window.plotter.iren.interactor, []

def tick(*_):
    ticks.append(window.actions.state.prompt.asking)
    if len(ticks) == 3:
        window.tools.key("a", 0, 0, ctrl=True)
        window.tools.key("d", 0, 0)
    if len(ticks) in (3, 6):
        interactor.ExitCallback()  # as VTK does when the window manager asks

interactor.AddObserver("TimerEvent", tick)
window.show()
print("ticks", ticks[:6], "open" if window._host.open else "closed")
"""


def test_the_first_request_of_the_window_manager_asks_and_the_second_closes(display: str) -> None:
    done = run_script(CLOSED, Path.cwd(), display)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "ticks [False, False, False, True, True, True] closed"


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


def test_on_a_virtual_display(display: str) -> None:
    assert SAYS in run_module(PROGRAM, DISPLAY=display)
