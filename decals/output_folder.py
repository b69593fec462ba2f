"""Folders for output. Work that fails leaves no empty one behind."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from blobtree.files import exists, make_folder
from decals.errors import InvalidInput


@contextmanager
def output_folder(folder: Path, error: type[InvalidInput]) -> Iterator[None]:
    """Create a folder if it does not exist. If the block fails, remove a new folder that is still empty.

    Raises
    ------
    InvalidInput
        Of the type `error`: the folder cannot be made.
    """
    known = exists(folder)
    make_folder(folder, error)
    try:
        yield
    except BaseException:
        if not known:
            with suppress(OSError):  # it has files
                folder.rmdir()
        raise
