"""One thing that was looked at, and how much it matters."""

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """How much a finding matters."""

    GOOD = "good"
    NOTE = "note"  # something to know; everything draws without it
    MISSING = "missing"  # nothing draws without it


@dataclass(frozen=True)
class Finding:
    """One line of the examination.

    Parameters
    ----------
    name
        What was looked at.
    value
        What is there, in a few words.
    status
        How much it matters.
    advice
        What to do about it; empty where there is nothing to do.
    """

    name: str
    value: str
    status: Status = Status.GOOD
    advice: str = ""


def last_line(text: str) -> str:
    """Give the last line of what a program said, which tells most when it failed."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else "it says nothing"
