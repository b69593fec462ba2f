"""Input files: only regular ones are read, as a device may never end and a pipe may never begin."""

import errno
import io
import os
import stat
from pathlib import Path

from blobtree.files import exists, is_file, is_folder


def read_file(path: Path) -> bytes:
    """Return the content of a regular file.

    Raises
    ------
    OSError
        There is no file, it is a folder, a device or a pipe, or it cannot be read.
    ValueError
        No file can have this name.
    """
    with open(path, "rb", opener=_open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is a device or a pipe", str(path))
        return file.read()


def read_text(path: Path) -> str:
    """Return the text of a regular file in UTF-8, whose lines end in one letter; errors are those above."""
    return io.StringIO(read_file(path).decode(), newline=None).read()


def _open_at_once(path: str, flags: int) -> int:
    """Open a file without waiting for a program that writes into a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def no_file(path: str | os.PathLike[str]) -> str:
    """Return what is at a path instead of a regular file, for a message; "" for a regular file."""
    name = repr(os.fspath(path))
    if is_file(path):
        return ""
    if is_folder(path):
        return f"{name} is a folder"
    return f"{name} is a device or a pipe" if exists(path) else f"found no file {name}"
