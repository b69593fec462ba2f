"""What is wrong with a file that is read: faults that end the reading, and notes that become warnings."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import numpy as np

from decals.errors import InvalidMesh
from decals.surfaces.files.content import shortened

_logger = logging.getLogger(__name__)

_Item = TypeVar("_Item")

SHOWN = 3
"""Places that a warning lists; it counts the others."""


class Unreadable(ValueError):
    """A fault for which a file is refused; the text says what is wrong, ``advice`` what to do."""

    def __init__(self, text: str, advice: str = "export it again") -> None:
        super().__init__(text)
        self.advice = advice


class Notes:
    """What is left out of a mesh or replaced; each kind becomes one warning that names the places."""

    def __init__(self) -> None:
        self._places: dict[str, list[str]] = {}

    def add(self, kind: str, place: str) -> None:
        """Note what happens, such as "lines are left out", and a place where it does, such as a primitive."""
        self._places.setdefault(kind, []).append(place)

    def report(self, path: Path) -> None:
        """Log the notes as warnings."""
        for kind, places in self._places.items():
            known = list(dict.fromkeys(places))
            rest = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
            _logger.warning("%s: %s: %s%s", path, kind, shortened(", ".join(known[:SHOWN])), rest)


@contextmanager
def reading(path: Path, kind: str) -> Iterator[Notes]:
    """Give the notes of a file of some kind, and log them; faults become `InvalidMesh`."""
    notes = Notes()
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # the results are checked
            yield notes
    except Unreadable as fault:
        raise InvalidMesh(
            f"could not read {str(path)!r} as {kind} ({shortened(str(fault))}); {fault.advice}"
        ) from fault
    except MemoryError as fault:
        raise InvalidMesh(f"could not read {str(path)!r}: it takes too much memory; reduce it") from fault
    except OSError as fault:
        raise InvalidMesh(
            f"could not read {str(path)!r} ({fault.strerror}); check its permissions"
        ) from fault
    notes.report(path)


def item(items: Sequence[_Item], index: int, kind: str, place: str) -> _Item:
    """Return an item that a place of a file names by its index; raise `Unreadable` for a wrong index."""
    if not 0 <= index < len(items):
        raise Unreadable(f"{place} asks for {kind} {index}, but there are {len(items)}")
    return items[index]
