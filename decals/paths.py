"""Questions to the file system that have an answer for every path."""

from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether there is a file; a path that none could have (too long, with a NUL) is no file."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
