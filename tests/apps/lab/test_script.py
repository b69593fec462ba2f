"""The lines of Python of a lesson make its picture, also where sliders have changed the scene."""

from collections.abc import Iterator
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest
from PIL import Image

import decals
from decals.apps.lab.lab import Lab
from decals.apps.lab.lesson import LESSONS, load_lessons
from decals.window import EditWindow
from tests.apps.lab.answers import BLUE, DECAL, GREEN, MODE, STEP
from tests.apps.lab.test_lab import EMPTY, begin, number_of, wait

CHANGES: list[list[tuple[str, Any]]] = [
    [("Visible radius", 0.9)],
    [(BLUE, 0.1), ("Radius of the blue decal", 0.5)],
    [(MODE, "elastic"), ("Stiffness", 7.5)],
    [("Interaction of the eye", "overlap"), ("Layer of the rock", -1)],
    [(STEP, 7)],
    [("Green ball", 1.1), (GREEN, 0.2)],
    [("Green ball", 0.5), (GREEN, 0.25)],
    [(DECAL, 0.9)],
    [("Radius of orange", 0.4)],
]
"""For each lesson, what a student sets."""


@pytest.fixture(scope="module")
def lab(vtk_display: None) -> Iterator[Lab]:
    with EditWindow(EMPTY, off_screen=True, size=(60, 40)) as window:
        window.show()
        lab = Lab(window, load_lessons(LESSONS))
        yield lab
        lab.close()


@pytest.mark.ordinary_cases("1")
@pytest.mark.parametrize("number", range(len(CHANGES)))
def test_the_lines_make_the_picture(
    lab: Lab, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    begin(lab, number)
    wait(lab)
    first = made(lab.script(), tmp_path)
    for label, value in CHANGES[number]:
        lab.set_value(number_of(lab, label), value)
    wait(lab)
    text = lab.script()
    assert len([line for line in text.splitlines() if line]) <= 10
    again = made(text, tmp_path)
    scene = lab._window.document.scene.replace(camera=lab.lesson.scene.camera)
    expected = np.asarray(scene.render(size=(600, 600)))
    assert np.abs(again.astype(int) - expected).max() <= 1
    assert np.abs(first.astype(int) - again).max() > 8


def made(text: str, folder: Path) -> np.ndarray:
    """Run a script, and return the one picture that it writes."""
    exec(compile(text, "script", "exec"), {"__name__": "__main__"})
    (path,) = folder.glob("*.png")
    picture = np.asarray(Image.open(path).convert("RGBA"))
    path.unlink()
    return picture


def test_lines_for_lessons_of_ones_own_name_no_folder(lab: Lab, tmp_path: Path) -> None:
    for part in (*LESSONS.glob("2-*"), LESSONS / "target.png"):
        copy(part, tmp_path)
    own = Lab(lab._window, load_lessons(tmp_path))
    begin(own, 0)
    assert "decals.load_scene('2-two-decals.json')" in own.script()
    assert str(tmp_path) not in own.script()
    number = lab._window.document.decals.numbers[-1]
    lab._window.session.do(decals.editing.SetValues([int(number)], {"tints": (0.2, 0.4, 0.6)}, "tint"))
    assert "tints=[[0.95, 0.55, 0.25], [0.2, 0.4, 0.6]]" in own.script()
    own.close()
