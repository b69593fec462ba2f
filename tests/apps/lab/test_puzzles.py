"""Puzzles: links with sizes and pars, and scores in the lab."""

from typing import Any

import numpy as np
import pytest

from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lab import Lab
from decals.apps.lab.lesson import LESSONS, Lesson, load_lesson
from decals.apps.lab.puzzles import Puzzle, read_puzzle
from decals.editing import MoveDecals
from decals.window import EditWindow
from tests.apps.lab.answers import SOLVED
from tests.apps.lab.test_lab import lab, number_of, wait, window

__all__ = ["lab", "window"]  # fixtures

LINK = "puzzle=0.5,0.45,0.4,0.3&par=0.5,2"


@pytest.fixture
def lesson() -> Lesson:
    return load_lesson(LESSONS / "9-packing.md")


def test_a_link_has_sizes_and_pars(lesson: Lesson) -> None:
    own = Puzzle.of(lesson)
    assert own == Puzzle((0.62, 0.5, 0.5, 0.42), (1.0, 4.0))
    assert read_puzzle(own.text, lesson) == own
    made = Puzzle.made([0.5, 0.45, 0.4, 0.3], [0.41, 1.97])
    assert made.text == LINK
    np.testing.assert_allclose(made.sized(lesson.scene).decals.radii, made.radii, rtol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "",
        None,
        7,
        "puzzle=1,1,1&par=1,4",
        "puzzle=1,1,1,1&par=1",
        "puzzle=1,1,1,nan&par=1,4",
        "puzzle=1,1,1,-1&par=1,4",
        "puzzle=1,1,1,1e9&par=1,4",
        "puzzle=1,1,1,1&par=1,inf",
        "puzzle=1,1,1,x&par=1,4",
        LINK + "0" * 200,
    ],
)
def test_what_is_no_puzzle_is_refused(lesson: Lesson, text: Any) -> None:
    with pytest.raises(InvalidLesson, match="puzzle: expected sizes and pars"):
        read_puzzle(text, lesson)


def test_the_pars_of_the_lesson_can_be_reached(lab: Lab, window: EditWindow) -> None:
    lab.start(8)
    lab.guess(20.0)
    first = wait(lab)["lab_puzzle"]
    assert not first["counts"]
    for number, (x, y) in zip(lab.numbers, SOLVED, strict=True):
        window.session.do(MoveDecals([number], np.array([x, y, 0.0]), np.array([0.0, 0.0, 1.0])))
    found = wait(lab)["lab_puzzle"]
    assert found["counts"]
    for before, row in zip(first["rows"], found["rows"], strict=True):
        assert row["value"] <= row["par"] < before["value"]
    assert found["text"].startswith("puzzle=0.62,0.5,0.5,0.42&par=")
    assert found["key"] == "9-packing puzzle=0.62,0.5,0.5,0.42"


def test_a_puzzle_is_made_and_played(lab: Lab) -> None:
    lab.start(8)
    lab.guess(20.0)
    for color, radius in (("orange", 0.5), ("violet", 0.3)):
        lab.set_value(number_of(lab, f"Radius of {color}"), radius)
    made = wait(lab)["lab_puzzle"]
    assert made["text"].startswith("puzzle=0.5,0.5,0.5,0.3&par=")
    assert [row["par"] for row in made["rows"]] == [None, None]  # the lesson's pars are for its own sizes
    number, puzzle = lab.puzzle(LINK)
    assert number == 8
    lab.start(number, puzzle=puzzle)
    assert lab.waits
    lab.guess(10.0)
    played = wait(lab)["lab_puzzle"]
    assert [row["par"] for row in played["rows"]] == [0.5, 2.0]
    assert played["key"] == "9-packing puzzle=0.5,0.45,0.4,0.3"
    with pytest.raises(InvalidLesson, match="puzzle"):
        lab.puzzle("puzzle=1")
