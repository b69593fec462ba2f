"""Output files: checked before the long work, written atomically after it."""

import tempfile
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.table import Table

from blobtree.files import exists, is_folder, is_read_only, is_too_long, make_folder
from decals.errors import InvalidInput

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff")


def check_output(path: Path, suffixes: tuple[str, ...]) -> None:
    """Check that a file of one of these formats can be written.

    Raises
    ------
    InvalidInput
        If the extension is unknown, the folder missing or read-only, or the path a folder.
    """
    if is_too_long(path):
        raise InvalidInput(f"expected a shorter name of an output file, got {path.name!r:.80}; rename it")
    if is_folder(path):
        raise InvalidInput(f"expected a file to write, {str(path)!r} is a folder; add a file name")
    if is_read_only(path):
        raise InvalidInput(f"the output file {str(path)!r} is read-only; choose another name")
    if path.suffix.lower() not in suffixes:
        known = " or ".join(suffixes)
        raise InvalidInput(f"expected an output file that ends in {known}, got {str(path)!r}; rename it")
    _check_writable(path.parent)


def check_animation(path: Path, suffixes: tuple[str, ...]) -> None:
    """Check that a folder of pictures, or a file of one of these formats, can be written."""
    if path.suffix and not is_folder(path):
        check_output(path, suffixes)
    else:
        known = exists(path)
        make_folder(path, InvalidInput)
        _check_writable(path)
        if not known:  # the first picture makes it
            path.rmdir()


def _check_writable(folder: Path) -> None:
    if not is_folder(folder):
        raise InvalidInput(f"the output folder {str(folder)!r} does not exist; create it first")
    try:
        tempfile.TemporaryFile(dir=folder).close()  # permissions alone are no proof
    except OSError as error:
        reason = f"the output folder {str(folder)!r} cannot be written ({error.strerror}); choose another"
        raise InvalidInput(reason) from error


def print_names(titles: Mapping[str, str]) -> None:
    """Print names, each with its title."""
    table = Table("", "", show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, title in titles.items():
        table.add_row(name, title)
    Console().print(table)


def print_path(path: Path) -> None:
    """Say on stdout which file was written."""
    Console().print(str(path), soft_wrap=True, highlight=False, markup=False)
