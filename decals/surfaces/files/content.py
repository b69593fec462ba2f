"""Contents of mesh files: bytes, lines of text in any encoding that its mark names, numbers, and errors."""

import codecs
import re
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from blobtree.files import read_file
from decals.errors import InvalidMesh

T = TypeVar("T")

_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF32_LE: "utf-32-le",  # before UTF-16, whose mark begins alike
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
"""Byte order marks and the encodings that they name."""

_UNDEFINED = re.compile(rb"[+-]?(nan\(\w*\)|1\.#(qnan|snan|ind)\d*)", re.IGNORECASE)
"""Undefined numbers as programs on Windows write them."""


MAX_TEXT = 300
"""Letters of a reason in a message."""


class Line(NamedTuple):
    """A line of a text: its number from 1 on, and its content."""

    number: int
    text: bytes

    def fail(self, reason: str) -> ValueError:
        """Return the error that names this line."""
        return ValueError(f"line {self.number}: {reason}")

    def expected(self, what: str) -> ValueError:
        """Return the error for a line that should hold something else."""
        return self.fail(f"expected {what}, got {shown(self.text)}")


def file_bytes(path: Path) -> bytes:
    """Return the content of a file; InvalidMesh if the system refuses it."""
    try:
        return read_file(path)
    except OSError as error:
        raise InvalidMesh(
            f"could not read {str(path)!r} ({error.strerror}); check its permissions"
        ) from error


def refusal(path: Path, kind: str, error: Exception) -> InvalidMesh:
    """Return the exception for a file that a reader of some kind of files refused with an error."""
    reason = "it takes too much memory" if isinstance(error, MemoryError) else shortened(str(error))
    return InvalidMesh(f"could not read {str(path)!r} as {kind} ({reason}); correct it or export it again")


def encoding_of(content: bytes) -> str | None:
    """Return the encoding that a byte order mark names; None without a mark."""
    return next((name for mark, name in _MARKS.items() if content.startswith(mark)), None)


def without_mark(content: bytes) -> bytes:
    """Return a content without its byte order mark, and as UTF-8; ValueError if the mark is wrong."""
    encoding = encoding_of(content)
    if encoding is None or encoding == "utf-8":
        return content.removeprefix(codecs.BOM_UTF8)
    try:
        return content.decode(encoding).removeprefix("\ufeff").encode("utf-8", "replace")
    except UnicodeDecodeError as error:
        name = encoding[:6].upper()
        raise ValueError(f"it starts with the mark of {name}, but is no whole {name} text") from error


def text_lines(content: bytes) -> list[bytes]:
    """Return the lines of a text of any encoding with a mark, and any line ends; ValueError if it is none."""
    text = without_mark(content)
    if b"\0" in text:
        raise ValueError("it holds null bytes: it is binary, or UTF-16 without a byte order mark")
    text = text.replace(codecs.BOM_UTF8, b"")  # where several files were joined to one
    return text.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")


def shortened(text: str) -> str:
    """Return a text for a message, whose names and numbers of a file may be of any length."""
    return text if len(text) <= MAX_TEXT else f"{text[:MAX_TEXT]} …"


def shown(text: bytes) -> str:
    """Return the start of a text for a message."""
    return repr(" ".join(text[:60].decode("utf-8", "replace").split()))


def decimal_numbers(words: Iterable[bytes]) -> Float64Array:
    """Return words of text as numbers, also infinite ones; ValueError if a word is no number."""
    words = list(words)
    _refuse_underscores(words)
    try:
        return np.array(list(map(float, words)), np.float64)
    except ValueError:
        return np.array(list(map(_number, words)), np.float64)


def _number(word: bytes) -> float:
    """Return a word as a number; programs on Windows write undefined ones as -nan(ind) or 1.#QNAN."""
    if _UNDEFINED.fullmatch(word):
        return np.nan
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"expected a number, got {shown(word)}") from None


def finite_numbers(words: Iterable[bytes]) -> Float64Array:
    """Return words of text as finite numbers; ValueError if a word is no finite number."""
    values = decimal_numbers(words)
    if not np.isfinite(values).all():
        raise ValueError("expected finite numbers")
    return values


def whole_numbers(words: Iterable[bytes]) -> Int64Array:
    """Return words of text as whole numbers of 64 bits; ValueError if a word is no whole number."""
    words = list(words)
    _refuse_underscores(words)
    try:
        return np.array(list(map(int, words)), np.int64)
    except OverflowError as error:
        raise ValueError("a number has more than 64 bits") from error


def _refuse_underscores(words: list[bytes]) -> None:
    if b"_" in b" ".join(words):  # Python takes it as part of a number
        raise ValueError("expected numbers")


def points_of(lines: list[Line]) -> Float64Array:
    """Return the first three numbers of each line, ``float64[n, 3]``; ValueError if a line lacks them."""

    def coordinates(some: list[Line]) -> Float64Array:
        numbers = finite_numbers(chain.from_iterable(line.text.split()[:3] for line in some))
        return numbers.reshape(len(some), 3)

    return parsed(lines, coordinates, "three finite numbers of a vertex")


def parsed(lines: list[Line], parse: Callable[[list[Line]], T], what: str) -> T:
    """Parse lines all at once; the ValueError names the first line that cannot be parsed."""
    try:
        return parse(lines)
    except ValueError:
        for line in lines:
            try:
                parse([line])
            except ValueError:
                raise line.expected(what) from None
        raise
