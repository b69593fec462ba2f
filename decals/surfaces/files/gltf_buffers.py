"""The bytes that a glTF file names: the chunk of a GLB file, data URIs, and files in the model's folder."""

import binascii
import re
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote, unquote_to_bytes

from decals.surfaces.files.faults import Unreadable, item
from decals.surfaces.files.gltf_document import Buffer
from decals.surfaces.files.pieces import Budget

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # two letters or more, for one is a drive of Windows


class Buffers:
    """Buffers of a file, each read when it is first used."""

    def __init__(
        self, buffers: tuple[Buffer, ...], binary: bytes | None, folder: Path, budget: Budget
    ) -> None:
        self._buffers = buffers
        self._binary = binary
        self._folder = folder
        self._budget = budget
        self._contents: dict[int, bytes] = {}

    def has_bytes(self, index: int) -> bool:
        """Return True if a buffer has a source, which those that decompression fills do not have."""
        buffer = item(self._buffers, index, "buffer", "a buffer view")
        return buffer.uri is not None or (index == 0 and self._binary is not None)

    def content(self, index: int, place: str) -> bytes:
        """Return the bytes of a buffer that a place of the file names."""
        buffer = item(self._buffers, index, "buffer", place)
        if index not in self._contents:
            self._contents[index] = self._read(buffer, f"buffer {index}")
        return self._contents[index]

    def _read(self, buffer: Buffer, name: str) -> bytes:
        if buffer.uri is not None:
            content = read_uri(buffer.uri, self._folder, name)
            self._budget.grow(len(content))
            return content
        if self._binary is None or name != "buffer 0":
            raise Unreadable(f"{name} has neither a URI nor a binary chunk")
        return self._binary


def read_uri(uri: str, folder: Path, name: str) -> bytes:
    """Return the bytes of a data URI or of a file in a folder; messages call them by a name."""
    if uri[:5].lower() == "data:":
        return _data(uri, name)
    if _SCHEME.match(uri):
        raise Unreadable(
            f"{name} lies at {uri[:80]!r}, and addresses are not read", "save it beside the model"
        )
    for path in dict.fromkeys((unquote(uri), uri)):  # some exporters do not escape "%" or spaces
        found = _inside(folder, path, name)
        if found is not None:
            return _file(found, name)
    raise Unreadable(f"{name}, {uri[:80]!r}, is missing", "put the file beside the model")


def _data(uri: str, name: str) -> bytes:
    """Return the bytes in a data URI (RFC 2397)."""
    header, comma, text = uri.partition(",")
    if not comma:
        raise Unreadable(f"{name} is a data URI without data")
    if not header.lower().endswith(";base64"):
        return unquote_to_bytes(text)
    try:
        packed = unquote(text).rstrip("=")
        return binascii.a2b_base64(packed + "=" * (-len(packed) % 4))
    except ValueError as error:
        raise Unreadable(f"{name} is no base64 text ({error})") from error


def _inside(folder: Path, path: str, name: str) -> Path | None:
    """Return the file of a path relative to a folder; `Unreadable` if it lies elsewhere."""
    try:
        found = folder.joinpath(*PureWindowsPath(path).parts).resolve()
        if not found.is_relative_to(folder.resolve()):
            raise Unreadable(
                f"{name}, {path[:80]!r}, lies outside of the model's folder", "put it beside the model"
            )
        return found if found.is_file() else None
    except (OSError, RuntimeError):  # a name that no file can have, or a circle of links
        return None


def _file(path: Path, name: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise Unreadable(f"{name}, {path.name!r}: {error.strerror}", "check its permissions") from error
