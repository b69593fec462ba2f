"""The ZIP package of a 3MF file: its parts, read in pieces and within limits."""

import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote

from decals.surfaces.files.faults import Unreadable
from decals.surfaces.files.xml_events import Attributes, parse_xml

RELATIONSHIPS = "http://schemas.openxmlformats.org/package/2006/relationships"

MAX_UNPACKED = 1 << 24
"""Most bytes that are unpacked, beside `UNPACKED_PER_BYTE`."""

UNPACKED_PER_BYTE = 100
"""Bytes that are unpacked for each byte of the package; meshes unpack to twenty or fewer."""

CHUNK = 1 << 16
"""Bytes that are unpacked at once."""

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

_FAULTS = (zipfile.BadZipFile, zlib.error, struct.error, NotImplementedError, RuntimeError,
           EOFError, OSError, ValueError, OverflowError)  # fmt: skip
"""What `zipfile` raises for damaged archives."""


@contextmanager
def open_package(path: Path) -> Iterator["Package"]:
    """Give the package of a file, which is open until the block ends, also when a part is half read."""
    with path.open("rb") as file:
        yield Package(file, path.stat().st_size)


class Package:
    """A 3MF file that is open for reading."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        try:
            self._zip = zipfile.ZipFile(file)
        except _FAULTS as error:
            raise Unreadable(f"it is no ZIP archive: {error}") from error
        self._unpacked, self._limit = 0, MAX_UNPACKED + UNPACKED_PER_BYTE * size
        self._parts = {_normal(entry.filename): entry for entry in self._zip.infolist()}
        self.model_part = self._start()

    def chunks(self, part: str) -> Iterator[bytes]:
        """Yield the bytes of a part, in order."""
        entry = self._parts.get(_normal(part))
        if entry is None:
            raise Unreadable(f"the part {part[:80]!r} is missing")
        self._unpacked += entry.file_size
        if self._unpacked > self._limit:
            raise Unreadable(f"it unpacks to more than {self._limit:,} bytes with {part[:80]!r}")
        if entry.flag_bits & 1 or entry.compress_type not in _METHODS:
            raise Unreadable(f"the part {part[:80]!r} is encrypted or packed by another method than deflate")
        try:
            with self._zip.open(entry) as content:
                while chunk := content.read(CHUNK):
                    yield chunk
        except _FAULTS as error:
            raise Unreadable(f"the part {part[:80]!r} is damaged: {error}") from error

    def _start(self) -> str:
        """Return the part that holds the model: the package's relationships name it."""
        targets: list[str] = []

        def relationship(attributes: Attributes) -> None:
            if attributes.get("Type", "").endswith("/3dmodel"):
                targets.append(attributes.get("Target", ""))

        if "_rels/.rels" in self._parts:
            parse_xml(self.chunks("_rels/.rels"), {RELATIONSHIPS: ""}, {"Relationship": relationship}, {})
        named = [target for target in targets if _normal(target) in self._parts]
        others = sorted(part for part in self._parts if part.endswith(".model"))
        if not named + others:
            raise Unreadable("it holds no 3D model")
        return (named + others)[0]


def _normal(part: str) -> str:
    """Return the name of a part as it is compared: names ignore case, and may begin at the root."""
    return unquote(part).replace("\\", "/").lstrip("/").lower()
