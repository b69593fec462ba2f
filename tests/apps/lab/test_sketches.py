"""The pad of a sketch shows the rims, and the truth on it is that of the float64 fields."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lesson import LESSONS, load_lesson
from decals.apps.lab.sketches import pad, truth
from tests.oracles.contact import RIM, falloff

NEAR = 2e-3
"""Difference of fields below which float32 may decide otherwise."""


def test_a_pad_shows_the_rims_of_all_images() -> None:
    lesson = load_lesson(LESSONS / "2-two-decals.md")
    shown = pad(lesson)
    circles = re.findall(r'cx="([-.\d]+)" cy="([-.\d]+)" r="([.\d]+)"', shown["picture"])
    assert [tuple(map(float, circle)) for circle in circles] == [(-0.8, 0.0, 0.6), (0.0, 0.0, 0.4)]
    x, y, width, height = map(float, re.findall(r'viewBox="(.*?)"', shown["picture"])[0].split())
    assert (x, y, x + width, y + height) == pytest.approx((-1.5, -0.7, 0.5, 0.7))
    assert shown["half"] == pytest.approx(1.5)
    assert shown["picture"].endswith('<polygon points=""/></svg>')


@pytest.mark.parametrize("x", [0.0, 0.3, 2.0])
def test_the_truth_is_what_the_image_covers_under_contact(x: float) -> None:
    lesson = load_lesson(LESSONS / "2-two-decals.md")
    experiment = lesson.experiment()
    moved = experiment.decals.replace(positions=[[-0.8, 0, 0], [x, 0, 0]])
    cells = np.array(truth(lesson, replace(experiment, decals=moved), "owner == 0"))
    side, half = int(np.sqrt(len(cells))), pad(lesson)["half"]
    steps = ((np.arange(side) + 0.5) / side * 2 - 1) * half
    right, down = (grid.ravel() for grid in np.meshgrid(steps, steps))
    own, other = (
        falloff(np.hypot(right - at, down) / (radius / RIM)) for at, radius in ((-0.8, 0.6), (x, 0.4))
    )
    clear = (np.abs(own - 0.5) > NEAR) & ((own < 0.5) | (np.abs(own - other) > NEAR))
    assert clear.mean() > 0.98
    np.testing.assert_array_equal(cells[clear], ((own > 0.5) & (own > other))[clear])


def test_a_sketch_needs_an_outline(tmp_path: Path) -> None:
    text = (LESSONS / "2-two-decals.md").read_text(encoding="utf-8")
    path = tmp_path / "lesson.md"
    path.write_text(text.replace('outline = "owner == 0"\n', ""), encoding="utf-8")
    with pytest.raises(InvalidLesson, match=r"guess\.outline: "):
        load_lesson(path)
