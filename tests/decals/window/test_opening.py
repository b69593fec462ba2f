"""Windows that open and close, keep nothing, and refuse what they cannot show."""

import os
import sys
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import decals
from blobtree import Point
from decals import edit, render
from decals.errors import InvalidScene, NoGraphics
from decals.window import EditWindow
from tests.decals.editing.scenes import scene
from tests.programs import output_of

SIZES = [(0, 90), (-5, 10), (120,), None, 120, (10**9, 5), ("a", "b"), (float("nan"), 5)]


@pytest.mark.parametrize("size", SIZES)
def test_a_window_without_pixels_is_refused(size: Any) -> None:
    with pytest.raises(InvalidScene, match="size: expected"):
        EditWindow(scene(), off_screen=True, size=size)


@pytest.mark.parametrize("options", [{"samples": 0}, {"samples": None}, {"samples": 99}, {"path": 5}])
def test_samples_and_paths_that_are_none_are_refused(options: Any) -> None:
    with pytest.raises(InvalidScene, match=f"{next(iter(options))}: expected"):
        EditWindow(scene(), off_screen=True, **options)


def test_what_is_no_scene_is_refused() -> None:
    with pytest.raises(InvalidScene, match="EditSession to edit, got NoneType"):
        EditWindow(None, off_screen=True)  # type: ignore[arg-type]


def test_without_a_screen_a_window_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pv, "OFF_SCREEN", False)
    ball = Point((0, 0, 0), radius=1.0)
    for opened in (
        lambda: edit(scene()),
        lambda: decals.show(scene()),
        lambda: ball.plot(resolution=8),
        lambda: ball.slice(resolution=8).plot(),
    ):
        with pytest.raises(NoGraphics, match="DISPLAY is not set"):
            opened()
    assert np.asarray(ball.plot(resolution=8, off_screen=True, return_img=True)).std() > 1


def test_the_background_is_that_of_a_rendered_picture() -> None:
    """Above as well as below the object."""
    size, shown = (64, 48), scene()
    with EditWindow(shown, off_screen=True, size=size) as window:
        window.show()
        window.overlay.release()
        window.plotter.camera.zoom(0.3)
        seen = np.asarray(window.plotter.screenshot(None, return_img=True))[..., :3].astype(int)
    rendered = np.asarray(render(shown, size=size))[..., :3].astype(int)
    assert abs(rendered[0, 0] - rendered[-1, 0]).max() > 20
    for row in (0, -1):
        np.testing.assert_allclose(seen[row, 0], rendered[row, 0], atol=3)


MEMORY = """
import gc, resource, sys
from decals.window import EditWindow
from tests.decals.editing.scenes import scene

def once():
    with EditWindow(scene(), off_screen=True, size=(120, 80), samples=1) as window:
        window.show()

def used():
    gc.collect()
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize() / 2**20

warm, rounds, chunks = int(sys.argv[1]), int(sys.argv[2]), 5
for _ in range(warm):
    once()
marks = [used()]
for _ in range(chunks):
    for _ in range(rounds // chunks):
        once()
    marks.append(used())
grown = min(after - before for before, after in zip(marks, marks[1:]))
print(grown * chunks / rounds, marks[-1] - marks[0])
"""


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="memory is read from /proc")  # noqa: PTH110
@pytest.mark.parametrize(
    ("warm", "rounds"),
    [pytest.param(3, 10, marks=pytest.mark.slow), pytest.param(20, 75, marks=pytest.mark.slow)],
)
def test_opening_and_closing_keeps_no_memory(warm: Any, rounds: Any) -> None:
    """In a process of its own: megabytes kept by each window, and by all.

    The first is the least of five chunks: allocators and drivers take memory in steps of many megabytes, more
    often on a busy machine. What each window keeps is in every chunk.
    """
    each, together = map(float, output_of(MEMORY, str(warm), str(rounds), timeout=3600).split()[-2:])
    assert each < (1.0 if rounds < 50 else 0.1)
    assert together < 60.0
