"""Contents of files, and errors that name their files."""

import codecs
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from blobtree.errors import InvalidFile, UnusableFile
from blobtree.files import read_file
from blobtree.validation import describe


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the content of a file without its byte order mark.

    Raises
    ------
    InvalidFile
        The path is none of a file.
    UnusableFile
        The file cannot be read.
    """
    try:
        return read_file(Path(path)).removeprefix(codecs.BOM_UTF8)
    except OSError as error:
        raise UnusableFile.of(error, os.fspath(path), "read") from error
    except (TypeError, ValueError):
        raise InvalidFile(f"path: expected the path of a file, got {describe(path)}") from None


@contextmanager
def naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Add the path of a file to errors of its content."""
    try:
        yield
    except InvalidFile as error:
        raise InvalidFile(f"{os.fspath(path)}: {error}") from None
