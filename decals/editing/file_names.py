"""Names of files that a page sends: what they may contain, and reading files without following links."""

import os
import re
import unicodedata
from pathlib import Path
from typing import BinaryIO

MAX_NAME_BYTES = 200
"""Longest name of a file or folder; recovery files and temporary files have longer ones."""

MAX_DEPTH = 16
"""Most folders of a path."""

RESERVED = re.compile(r"(CON|PRN|AUX|NUL|CONIN\$|CONOUT\$|(COM|LPT)[0-9¹²³])\s*(\..*)?", re.IGNORECASE)
"""Names that Windows takes as devices, with any suffix."""

SPECIAL = set('<>:"|?*\\')
"""Characters that mean something in paths or commands of some system."""


def name_fault(path: Path) -> str:
    """Return what is wrong with the names of a relative path that some system cannot have, or nothing."""
    if len(path.parts) > MAX_DEPTH:
        return f"at most {MAX_DEPTH} folders"
    for name in path.parts:
        if len(name.encode(errors="replace")) > MAX_NAME_BYTES:
            return f"a name of at most {MAX_NAME_BYTES} bytes"
        if any(c in SPECIAL or unicodedata.category(c) in ("Cc", "Cf", "Cs") for c in name):
            return "a name without control characters and any of " + " ".join(sorted(SPECIAL))
        if name != ".." and name.endswith((".", " ")):
            return "a name that ends in no dot or space"
        if is_reserved(name):
            return "a name that is no device of Windows"
    return ""


def is_reserved(name: str) -> bool:
    """Return True for a name that Windows takes as a device."""
    return RESERVED.fullmatch(name) is not None


def open_plain(folder: Path, path: Path) -> BinaryIO:
    """Open a file below a folder for reading; a link on the way is an error, also one of this moment.

    Raises
    ------
    OSError
        The file cannot be opened, or is no regular file, or a link leads to it.
    """
    relative = path.relative_to(folder)
    if not (os.open in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")):  # Windows: links need rights there
        if not path.resolve().is_relative_to(folder.resolve()):
            raise PermissionError(f"{relative} leads out of the folder")
        return path.open("rb")
    place = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        for name in relative.parts[:-1]:
            inner = os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=place)
            os.close(place)
            place = inner
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK  # a pipe does not block
        return os.fdopen(os.open(relative.name, flags, dir_fd=place), "rb")
    finally:
        os.close(place)
