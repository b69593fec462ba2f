"""Folders for output, which work that fails leaves behind only with something in them."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from blobtree.files import exists, make_folder
from decals.errors import InvalidInput


@contextmanager
def output_folder(folder: Path, error: type[InvalidInput]) -> Iterator[None]:
    """Create a folder if there is none; remove it if the work in the block fails and leaves it empty.

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
