"""Measures of a trial: plain values stay in its row, others become files by the digest of their content."""

import dataclasses
import hashlib
import shutil
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from blobtree.identity import content_hash
from blobtree.validation import describe
from decals.errors import InvalidInput

ARTEFACTS = "artefacts"
"""Folder of these files, in that of the experiment."""


def measures_of(returned: Any, taken: Collection[str], folder: Path) -> dict[str, Any]:
    """Return measures by name: plain values, and the paths of the files that it writes.

    Parameters
    ----------
    returned
        A number, or a mapping or a dataclass of measures.
    taken
        Names that no measure may have.
    folder
        Folder of the experiment; paths are relative to it.

    Raises
    ------
    InvalidInput
        A measure has a name that is taken, or is of a type that has no file.
    UnusableFile, OSError
        A file cannot be written.
    """
    if dataclasses.is_dataclass(returned) and not isinstance(returned, type):
        returned = {field.name: getattr(returned, field.name) for field in dataclasses.fields(returned)}
    named = returned if isinstance(returned, Mapping) else {} if returned is None else {"result": returned}
    for name in named:
        if not isinstance(name, str) or name in taken:
            raise InvalidInput(
                f"measure {name!r}: expected a text that is no parameter and no other column; rename it"
            )
    return {name: _measure(name, value, folder) for name, value in named.items()}


def is_artefact(value: Any, folder: Path, suffix: str) -> bool:
    """Return whether a measure is the path of a file with a suffix, which lies below `ARTEFACTS`."""
    if not isinstance(value, str) or not value.endswith(suffix):
        return False
    path = (folder / value).resolve()
    return path.is_relative_to((folder / ARTEFACTS).resolve()) and path.is_file()


def _measure(name: str, value: Any, folder: Path) -> Any:
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return [_measure(name, item, folder) for item in value]
    for kind, suffix, write in _writers():
        if isinstance(value, kind):
            return _stored(value, write, folder / ARTEFACTS, suffix).relative_to(folder).as_posix()
    raise InvalidInput(
        f"measure {name!r}: expected a number, a text, a list, a picture, a scene, a tree, decals, an array, "
        f"a mesh or a figure, got {describe(value)}"
    )


def _writers() -> Iterator[tuple[type, str, Callable[[Any, Path], object]]]:
    """Yield kinds of values that become files, their suffixes and writers."""
    import pyvista as pv

    import blobtree
    from decals.model import Decals
    from decals.rendering.picture import Picture
    from decals.scenes.measure import DecalMeasures
    from decals.scenes.scene import Scene

    yield Picture, ".png", lambda picture, path: picture.save(path)
    yield Scene, ".json", lambda scene, path: scene.save(path)
    yield blobtree.Node, ".json", lambda tree, path: blobtree.save(tree, path)
    yield Decals, ".npz", lambda decals, path: np.savez(path, **_arrays(decals))
    yield DecalMeasures, ".npz", lambda measures, path: np.savez(path, **vars(measures))
    yield np.ndarray, ".npy", lambda array, path: np.save(path, array)
    yield pv.PolyData, ".vtp", lambda mesh, path: mesh.save(path)
    yield blobtree.Mesh, ".vtp", lambda mesh, path: mesh.save(path)
    if (figure := sys.modules.get("matplotlib.figure")) is not None:
        yield figure.Figure, ".png", lambda figure, path: figure.savefig(path)


def _arrays(decals: Any) -> dict[str, Any]:
    """Return the arrays of decals; texts as an array that a file can hold."""
    arrays = {field.name: getattr(decals, field.name) for field in dataclasses.fields(decals)}
    return arrays | {"receivers": np.array(decals.receivers.tolist(), np.str_)}


def _digest(value: Any, file: Path) -> str:
    """Return 32 digits that are equal for equal values; of those without a content hash, for equal files."""
    try:
        return content_hash(value)[:32]
    except InvalidInput:
        with file.open("rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()[:32]


def _stored(value: Any, write: Callable[[Any, Path], object], folder: Path, suffix: str) -> Path:
    """Write a file under the content hash of a value, or under the digest of its bytes; return its path.

    Equal pictures and scenes have equal paths, whenever they were made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as temporary:
        file = Path(temporary) / f"value{suffix}"
        write(value, file)
        digest = _digest(value, file)
        target = folder / digest[:2] / f"{digest}{suffix}"
        target.parent.mkdir(exist_ok=True)
        if not target.exists():
            shutil.move(file, target)
    return target
