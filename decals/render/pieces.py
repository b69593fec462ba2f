"""What must be there before a picture can be drawn, in pieces: for whoever must not wait for all at once."""

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass

SHADERS, SHAPES, DECALS, IMAGES = "shaders", "shapes", "decals", "images"
"""What people are told that pieces are."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Something that is made once: whoever asks for it later finds it there.

    Attributes
    ----------
    name
        What it belongs to, one of the names above.
    make
        Makes it. The context must be current.
    beside
        Whether it needs no graphics, so that it may be made in another thread.
    """

    name: str
    make: Callable[[], object]
    beside: bool = False


@dataclass(frozen=True, eq=False)
class Ahead:
    """What drawing something needs that takes long for the first time.

    Attributes
    ----------
    key
        Whatever has the same key needs the same programs.
    pieces
        In the order in which they are made; none of them needs longer than it must.
    """

    key: Hashable
    pieces: Sequence[Piece]


def told(pieces: Sequence[Piece]) -> Iterator[tuple[Piece, str]]:
    """Give each piece with how far it is once that is made: ``"shaders 3 of 7"``."""
    names = [piece.name for piece in pieces]
    for number, piece in enumerate(pieces, 1):
        done, count = names[:number].count(piece.name), names.count(piece.name)
        yield piece, f"{piece.name} {done} of {count}" if count > 1 else piece.name
