"""Exported glTF files made again: what they keep of how they were made, and how a new one differs."""

import base64
import json
import struct
import tempfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from blobtree.files import read_file
from blobtree.progress import Progress
from decals.baking.export import EXPORT_FUNCTION, export
from decals.errors import ImplicitDecalsError, InvalidInput
from decals.scenes.files import from_json
from decals.scenes.provenance import changes_since, device_text, package_versions, provenance
from decals.scenes.records import SampleLoader
from decals.scenes.render import missing_beside
from decals.scenes.reproduction import Reproduction
from decals.scenes.scene import Scene

MAX_SCENE = 1 << 26
"""Largest text, in bytes, of a scene in a file; a few kilobytes can hold any number of equal ones."""

NO_RECIPE = "a recipe: the file does not say how it was made"


def reproduce_export(
    path: Path,
    scene: Scene | None = None,
    *,
    samples: SampleLoader | None = None,
    trust: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Export a scene again as a glTF or GLB file says, and compare the files.

    Parameters
    ----------
    path : path
        The file.
    scene : Scene, optional
        Its scene, if the file does not hold it.
    samples : callable, optional
        See `load_scene`.
    trust : bool
        Read images that lie outside of the file's folder, if its scene has some.
    progress : callable, optional
        Called with a stage and the fraction done.

    Raises
    ------
    InvalidInput
        The file cannot be read.
    """
    try:
        content = read_file(path)
    except OSError as error:
        raise InvalidInput(f"could not read {str(path)!r} ({error.strerror}); check the path") from error
    before = _Content.of(content, path)
    recipe = before.extras.get("export")
    if not isinstance(recipe, Mapping) or recipe.get("function") != EXPORT_FUNCTION:
        return Reproduction((NO_RECIPE,))
    try:
        if scene is None and isinstance(held := recipe.get("source"), str):
            scene = from_json(_unpacked(held), folder=path.parent, samples=samples, trust=trust)
        missing = missing_beside(recipe, scene)
        if missing or scene is None:
            return Reproduction(missing)
        with tempfile.TemporaryDirectory() as folder:
            again = Path(folder) / path.name
            export(scene, again, progress=progress, **recipe["parameters"])
            after = _Content.of(again.read_bytes(), again)
    except (ImplicitDecalsError, ValueError, LookupError, TypeError, AttributeError, zlib.error) as error:
        return Reproduction((f"a recipe that this version takes: {error}",))
    now = {"versions": package_versions(), "made": provenance(device_text("cpu"))}
    return Reproduction((), scene.decals, before.changes(after), changes_since(recipe, now))


def _unpacked(held: str) -> bytes:
    """Return the text of a scene that a file holds; raise ValueError if it is too long."""
    reader = zlib.decompressobj()
    text = reader.decompress(base64.b64decode(held), MAX_SCENE)
    if not reader.eof:
        raise ValueError(f"expected a whole scene of at most {MAX_SCENE} bytes")
    return text


class _Content:
    """The parts of a glTF or GLB file that are compared."""

    def __init__(self, tree: dict[str, Any], buffer: bytes) -> None:
        self.extras: dict[str, Any] = dict(tree["asset"].pop("extras", {}))
        self._tree, self._buffer = tree, buffer

    @classmethod
    def of(cls, content: bytes, path: Path) -> "_Content":
        """Return the parts of a file's content."""
        try:
            if not content.startswith(b"glTF"):
                return cls(json.loads(content), b"")
            (length,) = struct.unpack_from("<I", content, 12)
            return cls(json.loads(content[20 : 20 + length]), content[28 + length :])
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError, struct.error) as error:
            raise InvalidInput(f"could not read {str(path)!r} as glTF; export it again") from error

    def changes(self, other: "_Content") -> tuple[str, ...]:
        """Return how another file differs."""
        own = {**self._tree, "binary": self._buffer}
        theirs = {**other._tree, "binary": other._buffer}
        names = [name for name in sorted({*own, *theirs}) if own.get(name) != theirs.get(name)]
        return tuple(f"{name}: not as in the file" for name in names)
