"""The result of one check."""

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """Severity of a finding."""

    GOOD = "good"
    NOTE = "note"  # drawing works without it
    MISSING = "missing"  # drawing does not work without it


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Parameters
    ----------
    name
        Subject of the check.
    value
        Result, in a few words.
    status
        Severity.
    advice
        What to do; empty if nothing needs to be done.
    """

    name: str
    value: str
    status: Status = Status.GOOD
    advice: str = ""


def last_line(text: str) -> str:
    """Return the last line of a program's output, which usually holds the error."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else "no output"
