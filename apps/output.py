"""Output files: checked before the long work, written atomically after it."""

import io
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from blobtree.io import write_atomically
from decals.errors import InvalidInput

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff")
MESH_SUFFIXES = (".ply", ".obj", ".stl", ".vtp")


def check_output(path: Path, suffixes: tuple[str, ...]) -> None:
    """Check that a file of one of these formats can be written.

    Raises
    ------
    InvalidInput
        If the extension is unknown, the folder missing or read-only, or the path a folder.
    """
    if path.is_dir():
        raise InvalidInput(f"expected a file to write, {str(path)!r} is a folder; add a file name")
    if path.suffix.lower() not in suffixes:
        known = ", ".join(suffixes)
        raise InvalidInput(f"expected an output file that ends in {known}, got {str(path)!r}; rename it")
    folder = path.parent
    if not folder.is_dir():
        raise InvalidInput(f"the output folder {str(folder)!r} does not exist; create it first")
    try:
        tempfile.TemporaryFile(dir=folder).close()  # permissions alone are no proof
    except OSError as error:
        reason = f"the output folder {str(folder)!r} cannot be written ({error.strerror}); choose another"
        raise InvalidInput(reason) from error


def write_picture(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write uint8[h, w, 3 or 4] in the format of the file's extension."""
    file_format = Image.registered_extensions()[path.suffix.lower()]
    content = io.BytesIO()
    picture = Image.fromarray(pixels)
    (picture.convert("RGB") if file_format == "JPEG" else picture).save(content, file_format)
    write_atomically(path, content.getvalue())


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``, and rename it to ``path`` on success."""
    temporary = path.with_name(f".{uuid.uuid4().hex}{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
