"""Programs of clauses: the text that Fidget and libfive print (`.vm`), and archives of libfive (`.frep`).

An archive is a list of shapes, the first of which is read. A shape begins with T and two texts in quotes.
Clauses follow: a byte for the operation, then four bytes of a constant, or four for the number of each
operand, the last one first. The byte 255 ends them; names of free variables end the shape.
"""

import os
import struct
from collections.abc import Sequence

from numpy.typing import ArrayLike

from blobtree.errors import InvalidFile, InvalidNode
from blobtree.foreign.content import naming, read_bytes
from blobtree.nodes.clauses import ARITIES, MOST_CLAUSES
from blobtree.nodes.expressions import Expression

FLAT_DEPTH = 0.2
"""Thickness of a program without z, by default."""

ITEM_END = 255

_FIRST = ("const", "var-x", "var-y", "var-z", "free", "const-var", "square", "sqrt", "neg", "sin", "cos",
          "tan", "asin", "acos", "atan", "exp")  # fmt: skip
_LATER = ("add", "mul", "min", "max", "sub", "div", "atan2", "pow", "nth-root", "mod", "nanfill")

ORDERED = (*_FIRST, *_LATER, "abs", "recip", "ln", "compare", "oracle")
"""Operations of libfive by their codes in archives, from 1 on."""

PACKED = (*_FIRST, "abs", "ln", "recip", *_LATER, "compare", "oracle")
"""The same in archives of MPR, and of other builds with packed codes."""

ABSENT_IF_PACKED = frozenset({"add", "mul", "min"})
"""What packed codes of unary operations are in the order of libfive, with too few operands to end well."""

PRESENT_IF_PACKED = frozenset({"div", "atan2", "pow", "nth-root"})
"""What packed codes of min, max, sub and div are in the order of libfive."""


def read_program(
    path: str | os.PathLike[str], center: ArrayLike = (0.0, 0.0, 0.0), size: ArrayLike | None = None
) -> Expression:
    """Return the solid of a program in a file: text of clauses (`.vm`), or an archive of libfive (`.frep`).

    Parameters
    ----------
    path : str or path-like
        Path of the file.
    center, size : array-like (3,), optional
        Box at which the solid ends, because a program has none. It is by default the cube from −1 to 1 that
        Fidget and MPR show, 0.2 thick for a program without z.

    Raises
    ------
    InvalidFile
        The file holds no program, or one with an operation that has no counterpart.
    InvalidNode
        The box is impossible.
    UnusableFile
        The file cannot be read.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from blobtree.foreign import read_program
    >>> path = pathlib.Path(tempfile.mkdtemp(), "half.vm")
    >>> _ = path.write_text("x var-x")
    >>> read_program(path).size
    (2.0, 2.0, 0.2)
    """
    content = read_bytes(path)
    with naming(path):
        lines = archive_clauses(content) if content.startswith(b'T"') else text_clauses(content)
        flat = not any(line.split()[1:2] == ["var-z"] for line in lines)
        box: ArrayLike = (2.0, 2.0, FLAT_DEPTH if flat else 2.0) if size is None else size
        try:
            return Expression("\n".join(lines), center, box)  # type: ignore[arg-type]  # checked there
        except InvalidNode as error:
            if str(error).startswith("clauses"):
                raise InvalidFile(str(error)) from None
            raise


def text_clauses(content: bytes) -> list[str]:
    """Return the clauses of a text."""
    try:
        lines = content.decode().splitlines()
    except UnicodeDecodeError:
        raise InvalidFile("expected a text of clauses, or an archive that begins with T") from None
    return [line for line in map(str.strip, lines) if line and not line.startswith("#")]


def archive_clauses(content: bytes) -> list[str]:
    """Return the clauses of the first shape of an archive.

    Nothing in an archive says which codes it has. With the wrong ones it does not end, or it has nothing of
    `ABSENT_IF_PACKED` but something of `PRESENT_IF_PACKED`.
    """
    try:
        lines = _shape_clauses(content, ORDERED)
    except InvalidFile as error:
        try:
            return _shape_clauses(content, PACKED)
        except InvalidFile:
            raise error from None
    found = {line.split()[1] for line in lines}
    if found & ABSENT_IF_PACKED or not found & PRESENT_IF_PACKED:
        return lines
    try:
        return _shape_clauses(content, PACKED)
    except InvalidFile:
        return lines


def _shape_clauses(content: bytes, operations: Sequence[str]) -> list[str]:
    """Return the clauses of the first shape of an archive with these codes."""
    archive = _Archive(content)
    lines: list[str] = []
    while (code := archive.byte()) != ITEM_END:
        operation = operations[code - 1] if 0 < code <= len(operations) else f"the code {code}"
        if operation not in (*ARITIES, "const-var"):
            raise InvalidFile(f"clause {len(lines)}: {operation} has no counterpart")
        lines.append(f"_{len(lines)} {archive.clause(operation, len(lines))}")
        if len(lines) > MOST_CLAUSES:
            raise InvalidFile(f"expected at most {MOST_CLAUSES:,} clauses")
    return lines


class _Archive:
    """The bytes of an archive, read from the start; its head is left out."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._place = 1
        for _ in ("name", "description"):
            self._skip_text()

    def _take(self, size: int) -> bytes:
        taken = self._content[self._place : self._place + size]
        if len(taken) < size:
            raise InvalidFile("expected more clauses, the archive ends too early")
        self._place += size
        return taken

    def _skip_text(self) -> None:
        if self._take(1) != b'"':
            raise InvalidFile('expected a text in "quotes" at the head of the shape')
        while (character := self._take(1)) != b'"':
            if character == b"\\":
                self._take(1)

    def byte(self) -> int:
        """Return the next byte."""
        return self._take(1)[0]

    def clause(self, operation: str, count: int) -> str:
        """Return the clause of an operation, behind `count` others."""
        if operation == "const":
            (value,) = struct.unpack("<f", self._take(4))
            return f"const {value!r}"
        arity = 1 if operation == "const-var" else ARITIES[operation]
        operands: Sequence[int] = struct.unpack(f"<{arity}I", self._take(4 * arity))[::-1]
        if max(operands, default=-1) >= count:
            raise InvalidFile(f"clause {count}: expected earlier clauses as operands, got {max(operands)}")
        if operation == "const-var":
            return f"max _{operands[0]} _{operands[0]}"  # the operand
        return " ".join((operation, *(f"_{operand}" for operand in operands)))
