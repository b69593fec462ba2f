"""Languages of the pages of lessons: one file each, with every text of the pages and of all lessons."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import msgspec
from msgspec import Struct

from blobtree.files import read_text
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lesson import PLACEHOLDER
from decals.apps.lab.symbols import DEFINITIONS

LANGUAGES = Path(__file__).parent / "languages"
"""The folder of the languages that are installed, but for English, in which lessons are written."""

ENGLISH = "en"

PAGE_TEXTS = {
    "lessons": "Lessons",
    "about": "Text and tasks",
    "parameters": "Parameters",
    "values": "Values and plots",
    "readings": "At the probe",
    "check": "Check the answer",
    "again": "Start again",
    "see": "See",
    "skip": "Skip the guess",
    "next": "Next",
    "previous": "Previous",
    "keys": "Drag decals and the probe, or use arrow keys; Ctrl + Z undoes. Drag the background to turn.",
    "turn": "Drag to turn the model.",
    "needs": "The model can be turned once the page is ready. This needs JavaScript and WebGL 2.",
    "still": "The model cannot be turned here:",
    "compared": "You guessed {guess}, it is now {truth}.",
    "later": "Values and plots follow after your guess.",
    "undo": "Undo",
    "yes": "yes",
    "no": "no",
    "point": ".",
    "probe": "Probe: drag it, or move it by the arrow keys",
    "decal": "decal",
    "stretch": "stretch",
    "score": "Score",
    "now": "now",
    "par": "par",
    "best": "best",
    "share": "Share as a puzzle",
    "person": "Name (optional)",
    "send": "Send my numbers",
    "sent": "Sent to the teacher.",
    "unsent": "Not sent: wait a second, then send again.",
    "guess": "Your guess",
    "truth": "It is now",
    "python": "Python for the first picture",
    "sketched": "Your outline is off by {difference} % of the true area, which is blue.",
    "sandbox": "Open in the sandbox",
    "run": "A page starts no program. Install implicit-decals[browser] with pip, and run this in a terminal:",
    "copy": "Copy",
    "lost": "A decal of the lesson was deleted: undo, or start again.",
}
"""Texts of a page that belong to no lesson, by their names."""


class _File(Struct, forbid_unknown_fields=True, frozen=True):
    name: str
    page: dict[str, str]
    texts: dict[str, str]
    bodies: dict[str, str]


@dataclass(frozen=True)
class Translation:
    """A language.

    Attributes
    ----------
    code, name
        Its code, such as "de", and its own name.
    page
        Texts of a page by their names, see `PAGE_TEXTS`.
    texts
        Its texts by those in English; none for English.
    bodies
        The texts of lessons in Markdown, by the names of the lessons' files.
    """

    code: str
    name: str
    page: dict[str, str]
    texts: dict[str, str]
    bodies: dict[str, str]

    def said(self, text: str) -> str:
        """Return a text in this language; in English if it has no translation."""
        return self.texts.get(text, text)

    @property
    def definitions(self) -> dict[str, str]:
        """Definitions of symbols, see `symbols.DEFINITIONS`."""
        return {symbol: self.said(text) for symbol, text in DEFINITIONS.items()}


def translation(code: str, folder: Path = LANGUAGES) -> Translation:
    """Return a language by its code.

    Raises
    ------
    InvalidLesson
        There is no such language, or its file cannot be used; the message names the text.

    Examples
    --------
    >>> from decals.apps.lesson_pages.translation import translation
    >>> translation("en").said("One decal")
    'One decal'
    """
    if code == ENGLISH:
        return Translation(ENGLISH, "English", PAGE_TEXTS, {}, {})
    known = sorted([ENGLISH, *(path.stem for path in folder.glob("*.toml"))])
    if code not in known:
        raise InvalidLesson(f"language: expected one of {', '.join(known)}, got {code!r}")
    path = folder / f"{code}.toml"
    try:
        loaded = msgspec.convert(tomllib.loads(read_text(path)), type=_File)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise InvalidLesson(f"{str(path)!r}: {error}; correct the TOML") from error
    if missing := sorted(set(PAGE_TEXTS) ^ set(loaded.page)):
        raise InvalidLesson(f"{str(path)!r}: [page] lacks, or should not have, {', '.join(missing)}")
    for text, said in loaded.texts.items():
        if sorted(PLACEHOLDER.findall(text)) != sorted(PLACEHOLDER.findall(said)):
            raise InvalidLesson(f"{str(path)!r}: expected the formulas of {text!r:.60} in {said!r:.60}")
    return Translation(code, loaded.name, loaded.page, loaded.texts, loaded.bodies)
