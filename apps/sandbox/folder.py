"""A folder as the start page lists it, and files that a page sends."""

import base64
import mimetypes
import os
import tempfile
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from blobtree.files import is_file, write_atomically
from blobtree.validation import describe
from decals import DecalImage, Scene, load_model
from decals.apps.models.samples import sample_mesh
from decals.editing.file_names import is_reserved
from decals.editing.recovery import SUFFIX, in_use
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.images import read_image
from decals.scenes.objects import SceneObject, unused_name

MODELS = (".json", ".vm", ".frep", ".ply", ".obj", ".stl", ".vtp", ".vtk", ".glb", ".gltf", ".3mf", ".off")
HDR = ".hdr"
IMAGES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".tif", ".tiff", HDR)

MAX_RECENT = 12
MAX_LOOKED_AT = 5000
"""Most files of a folder that the start page looks at."""

MAX_UPLOAD_BYTES = 100_000_000
MAX_UPLOADS = 32
"""Most files that are taken at once."""

MAX_STEM_BYTES = 120
"""Longest name of a file that a page sends, without its suffix."""


def _files(folder: Path) -> Iterator[os.DirEntry[str]]:
    """Yield the visible files of a folder, and of the folders in it."""
    looked = 0
    for level in (folder, *(Path(entry.path) for entry in _entries(folder) if _is_folder(entry))):
        for entry in _entries(level):
            looked += 1
            if looked > MAX_LOOKED_AT:
                return
            if not entry.name.startswith(".") and entry.is_file(follow_symlinks=False):
                yield entry


def _entries(folder: Path) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            return list(entries)
    except OSError:  # not readable, or gone
        return []


def _is_folder(entry: os.DirEntry[str]) -> bool:
    return entry.is_dir(follow_symlinks=False) and not entry.name.startswith((".", "_"))


def listed(folder: Path) -> dict[str, list[dict[str, str]]]:
    """Return the files that a start page offers, the latest first: "recent" models and "recovered" ones.

    Each has a "name" relative to the folder and a "when". A recovered one stands for the unsaved changes of
    the scene of its name, which no session shows.
    """
    found: dict[str, list[tuple[float, str]]] = {"recent": [], "recovered": []}
    for entry in _files(folder):
        name = os.path.relpath(entry.path, folder)
        when = entry.stat(follow_symlinks=False).st_mtime
        if name.endswith(SUFFIX):
            if not in_use(Path(entry.path)):
                found["recovered"].append((when, name.removesuffix(SUFFIX) + ".json"))
        elif Path(name).suffix.lower() in MODELS:
            found["recent"].append((when, name))
    return {
        family: [
            {"name": name, "when": f"{datetime.fromtimestamp(when).astimezone():%Y-%m-%d %H:%M}"}
            for when, name in sorted(files, reverse=True)[:MAX_RECENT]
        ]
        for family, files in found.items()
    }


def read_upload(file: object) -> Scene | SceneObject | DecalImage:
    """Return what a file that a page sent holds: a scene, a model, or an image.

    Parameters
    ----------
    file
        A dictionary with the file's "name" and "content" (bytes).

    Raises
    ------
    InvalidEdit
        It is no such file, it is too large, its suffix is unknown, or it cannot be read.
    """
    name, content = _checked(file)
    suffix = Path(name).suffix.lower()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{plain_name(name)}{suffix}"
        path.write_bytes(content)
        try:
            if suffix in IMAGES:
                return DecalImage(path.stem, read_image(path))
            return load_model(path, samples=sample_mesh)
        except ImplicitDecalsError as error:
            raise InvalidEdit(str(error).replace(f"{folder}{os.sep}", "")) from error


def keep_upload(file: object, folder: Path) -> Path:
    """Write an uploaded file into a folder, unless the folder has it already, and return its path.

    Raises
    ------
    InvalidEdit
        The sandbox reads no files of this kind, or the folder cannot be written.
    """
    name, content = _checked(file)
    stem, suffix = plain_name(name), Path(name).suffix.lower()
    path = folder / f"{stem}{suffix}"
    try:
        if not (is_file(path) and path.read_bytes() == content):
            path = folder / f"{unused_name(stem, {other.stem for other in folder.iterdir()}, ' ')}{suffix}"
            write_atomically(path, content)
    except OSError as error:
        raise InvalidEdit(f"could not write {path.name} into the folder ({error.strerror})") from error
    return path


def _checked(file: object) -> tuple[str, bytes]:
    """Return name and content of a file that a page sent."""
    name = file.get("name") if isinstance(file, dict) else None
    content = file.get("content") if isinstance(file, dict) else None
    if isinstance(content, list) and all(isinstance(part, bytes) for part in content):
        content = b"".join(content)
    if not isinstance(name, str) or not isinstance(content, bytes | bytearray | memoryview):
        raise InvalidEdit(f"upload: expected a file with name and content, got {describe(file)}")
    if len(content) > MAX_UPLOAD_BYTES:
        raise InvalidEdit(
            f"{name}: expected at most {MAX_UPLOAD_BYTES // 1_000_000} MB, got {len(content) // 1_000_000} MB"
        )
    if Path(name).suffix.lower() not in MODELS + IMAGES:
        raise InvalidEdit(f"{name}: expected a name that ends in {', '.join(MODELS + IMAGES)}")
    return name, bytes(content)


def plain_name(name: str) -> str:
    """Return the stem of a file's name without characters that mean something in paths."""
    stem = Path(name.replace("\\", "/")).stem
    plain = "".join(c if c.isalnum() or c in "-_ " else "-" for c in stem)[:60]
    while len(plain.encode()) > MAX_STEM_BYTES:
        plain = plain[:-1]
    plain = plain.strip() or "model"
    return f"{plain}-" if is_reserved(plain) else plain


def thumbnails(suffix: str = ".jpg") -> dict[str, str]:
    """Return pictures of the samples, or of the built-in images (".png"), as data of a page, by name."""
    pictures = sorted((Path(__file__).parent / "thumbnails").glob(f"*{suffix}"))
    start = f"data:{mimetypes.types_map[suffix]};base64,"
    return {path.stem: start + base64.b64encode(path.read_bytes()).decode() for path in pictures}
