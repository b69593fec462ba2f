"""Puzzles: a lesson with scores, whose sizes and pars a link carries, such as ``puzzle=0.6,0.5&par=1,4``."""

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs

import numpy as np

from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lesson import Lesson
from decals.scenes.scene import Scene

MOST = 200
"""Most characters of a puzzle in a link."""


@dataclass(frozen=True)
class Puzzle:
    """Visible radii of the decals of a lesson, and a par for each of its scores."""

    radii: tuple[float, ...]
    pars: tuple[float, ...]

    @classmethod
    def of(cls, lesson: Lesson) -> "Puzzle":
        """Return the puzzle of the lesson itself."""
        radii = (float(f"{radius:.4g}") for radius in lesson.scene.decals.radii.tolist())
        return cls(tuple(radii), tuple(score.par for score in lesson.settings.scores))

    @classmethod
    def made(cls, radii: Sequence[float], scores: Sequence[float]) -> "Puzzle":
        """Return a puzzle of these sizes; its pars are scores that were reached, rounded up to tenths."""
        return cls(tuple(radii), tuple(float(np.ceil(10.0 * score) / 10.0) for score in scores))

    @property
    def text(self) -> str:
        """The puzzle as a link has it."""
        radii, pars = (",".join(f"{number:.4g}" for number in row) for row in (self.radii, self.pars))
        return f"puzzle={radii}&par={pars}"

    def sized(self, scene: Scene) -> Scene:
        """Return a scene whose decals have the puzzle's sizes."""
        return scene.replace(decals=scene.decals.replace(radii=np.array(self.radii)))


def read_puzzle(text: object, lesson: Lesson) -> Puzzle:
    """Return the puzzle of a link.

    Raises
    ------
    InvalidLesson
        The text is no puzzle of this lesson.

    Examples
    --------
    >>> from decals.apps.lab.lesson import LESSONS, load_lessons
    >>> from decals.apps.lab.puzzles import read_puzzle
    >>> read_puzzle("puzzle=0.6,0.5,0.5,0.4&par=1,4", load_lessons(LESSONS)[8]).radii
    (0.6, 0.5, 0.5, 0.4)
    """
    found = parse_qs(text) if isinstance(text, str) and len(text) <= MOST else {}
    radii, pars = (_numbers(found.get(name, [""])[0]) for name in ("puzzle", "par"))
    fits = len(radii) == len(lesson.scene.decals) and len(pars) == len(lesson.settings.scores) > 0
    if not fits or not all(0.0 < radius <= lesson.size for radius in radii) or not np.isfinite(pars).all():
        raise InvalidLesson(f"puzzle: expected sizes and pars as a shared link has them, got {text!r:.80}")
    return Puzzle(radii, pars)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
