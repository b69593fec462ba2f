"""The bytes behind the URIs of a model: data URIs, and files in the model's folder."""

import binascii
import re
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote, unquote_to_bytes

from blobtree.files import read_file
from decals.surfaces.files.faults import Unreadable

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # two letters or more, for one is a drive of Windows


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
        inside, exists = found.is_relative_to(folder.resolve()), found.is_file()
    except (OSError, RuntimeError, ValueError):  # a name that no file can have, or a circle of links
        return None
    if not inside:
        raise Unreadable(
            f"{name}, {path[:80]!r}, lies outside of the model's folder", "put it beside the model"
        )
    return found if exists else None


def _file(path: Path, name: str) -> bytes:
    try:
        return read_file(path)
    except OSError as error:
        raise Unreadable(f"{name}, {path.name!r}: {error.strerror}", "check its permissions") from error
