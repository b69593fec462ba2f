"""The teacher's page of a class: the answers to a lesson, and a plot of two of their numbers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Self

import numpy as np
from msgspec import Struct

from decals.apps.lab.lesson import Lesson, shown
from decals.apps.lab.plots import HEIGHT, Axes, padded
from decals.pages.page import filled

MARGIN = 0.05
"""Space around the points of the plot, in parts of their range."""

TEMPLATE = Path(__file__).with_name("class.html")


class Answer(Struct, forbid_unknown_fields=True, frozen=True):
    """What a student sends: the numbers of a lesson, in the order of `labels`, and whether it is solved."""

    lesson: str
    name: str
    numbers: tuple[float | None, ...]
    right: bool


def labels(lesson: Lesson) -> list[str]:
    """Return the names of the numbers of an answer."""
    settings = lesson.settings
    sliders = [slider for slider in settings.sliders if not slider.choices]
    rows: list[Any] = [*sliders, *settings.values, *settings.scores]
    return ["guess", *(row.label for row in rows)]


@dataclass(frozen=True)
class Choice:
    """What a teacher looks at: a lesson, and the numbers to the right and up in the plot."""

    lesson: Lesson
    x: int
    y: int

    @classmethod
    def of(cls, lessons: Mapping[str, Lesson], query: Mapping[str, str]) -> Self:
        """Return the choice of an address; by default the first lesson, slider and last number."""
        lesson = lessons.get(query.get("lesson", "")) or next(iter(lessons.values()))
        places = {str(i): i for i in range(len(labels(lesson)))}
        return cls(lesson, places.get(query.get("x", ""), 1), places.get(query.get("y", ""), len(places) - 1))


def board(url: str, lessons: Mapping[str, Lesson], choice: Choice) -> str:
    """Return the teacher's page, whose script asks for the answers."""
    names = labels(choice.lesson)
    slots = {
        "URL": escape(url),
        "LESSONS": _options(
            [(name, one.settings.title) for name, one in lessons.items()], choice.lesson.name
        ),
        "RIGHT": _options([(str(i), name) for i, name in enumerate(names)], str(choice.x)),
        "UP": _options([(str(i), name) for i, name in enumerate(names)], str(choice.y)),
        "NAME": escape(choice.lesson.name),
    }
    return filled(TEMPLATE.read_text(encoding="utf-8"), slots)


def table(choice: Choice, answers: Mapping[int, Answer]) -> str:
    """Return the answers of students, by their numbers, as a plot and a table."""
    names = labels(choice.lesson)
    places = [[_number(one.numbers[axis]) for one in answers.values()] for axis in (choice.x, choice.y)]
    head = _row("th", ["student", "done", *names])
    rows = (
        _row("td", [one.name or f"student {student}", "✓" if one.right else "–", *map(_said, one.numbers)])
        for student, one in answers.items()
    )
    across, up_to = (padded(np.array(numbers), MARGIN) for numbers in places)
    axes = Axes(across, up_to, HEIGHT, rows=1)
    for right, up in zip(*places, strict=True):
        axes.cross(right, up)
    plot = axes.svg("numbers of all students")
    return (
        f'<p role="status">answers: {len(answers)}</p><div class="chart">{plot}</div>'
        f"<div><table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _said(value: float | None) -> str:
    return shown(_number(value))


def _row(tag: str, texts: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(text)}</{tag}>' for text in texts)}</tr>"


def _options(choices: Sequence[tuple[str, str]], chosen: str) -> str:
    return "".join(
        f'<option value="{escape(value)}"{" selected" * (value == chosen)}>{escape(text)}</option>'
        for value, text in choices
    )
