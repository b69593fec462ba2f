"""Identity of values: equal contents have one content hash, in every process and on every machine.

A hash is made of types and numbers alone: no address in memory, no path, no time, no order of a set. Numbers
that are equal in Python have equal hashes, so 1, 1.0 and a float32 of 1 are one value.
"""

import math
import os
import struct
from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from enum import Enum
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.errors import InvalidInput, UnusableFile
from blobtree.immutable import Immutable
from blobtree.lazy import Lazy
from blobtree.validation import describe

FORM = b"implicit-decals 1"
"""Form of the encoding that is hashed; another one gives all values other hashes."""

DIGEST_BYTES = 20

MAX_NESTING = 900
"""Most levels of lists and mappings in each other, about as many as Python's usual limit allows."""


def content_hash(value: object) -> str:
    """Return the content hash of a value: 40 hexadecimal digits, equal for equal contents alone.

    It is the same in every process and on every machine, after pickling, and after writing to a file and
    reading it.

    Parameters
    ----------
    value : object
        A scene, an object of one, a tree, decals, an image or a mesh; None, a truth value, number, text,
        bytes, member of an enumeration or array; a dataclass; a sequence, set or mapping of such values. A
        `pathlib.Path` stands for the bytes of its file.

    Raises
    ------
    InvalidInput
        The value is of another type, such as a function.
    UnusableFile
        A path leads to no file that can be read.

    Examples
    --------
    >>> import blobtree
    >>> ball = blobtree.Point((0, 0, 0), radius=1)
    >>> blobtree.content_hash(ball) == blobtree.content_hash(blobtree.from_json(blobtree.to_json(ball)))
    True
    >>> blobtree.content_hash({"count": 1000}) == blobtree.content_hash({"count": 1e3})
    True
    """
    held = _held_hash(value)
    try:
        return _hash_of(value) if held is None else held
    except RecursionError:
        raise _too_deep() from None


class Value(Immutable):
    """A base of immutable values: objects with equal contents are equal, and have one content hash.

    The contents are the fields of a dataclass, but for those with ``compare=False``.
    """

    def _contents(self) -> Any:
        """Return what counts of the value."""
        return _compared(self)

    @Lazy
    def content_hash(self) -> str:
        """Content hash, see `blobtree.content_hash`; computed at the first access."""
        return _hash_of((type(self).__name__, self._contents()))

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, Value):
            return NotImplemented
        return type(self) is type(other) and self.content_hash == other.content_hash

    def __hash__(self) -> int:
        return int(self.content_hash[:15], 16)

    def __dask_tokenize__(self) -> str:
        return self.content_hash


def _held_hash(value: object) -> str | None:
    """Return the content hash that a value or a node of a tree has; None for other objects."""
    held = None if isinstance(value, type) else getattr(value, "content_hash", None)
    return held if isinstance(held, str) else None


def _too_deep() -> InvalidInput:
    return InvalidInput("expected a value with a content hash, got one nested too deeply")


def _hash_of(value: object, depth: int = 0) -> str:
    digest = blake2b(FORM, digest_size=DIGEST_BYTES)
    for part in _encoded(value, depth):
        digest.update(part)
    return digest.hexdigest()


def _compared(value: Any) -> dict[str, Any]:
    """Return the fields by which a dataclass is compared."""
    return {field.name: getattr(value, field.name) for field in fields(value) if field.compare}


def _encoded(value: Any, depth: int) -> Iterable[bytes | memoryview]:
    """Yield bytes that no other value has: a letter for the type, a length where it varies, the content."""
    if depth > MAX_NESTING:
        raise _too_deep()
    held = _held_hash(value)
    if held is not None:
        yield b"v" + held.encode()
    elif value is None:
        yield b"-"
    elif isinstance(value, Enum):
        yield from _sized(b"e", f"{type(value).__qualname__}.{value.name}".encode())
    elif isinstance(value, bool | np.bool_):
        yield b"t" if value else b"f"
    elif isinstance(value, int | float | np.integer | np.floating):
        yield _number(value)
    elif isinstance(value, str):
        yield from _sized(b"s", value.encode("utf-8", "surrogatepass"))
    elif isinstance(value, bytes | bytearray | memoryview):
        yield from _sized(b"b", bytes(value))
    elif isinstance(value, np.ndarray):
        yield from _array(value, depth)
    elif isinstance(value, os.PathLike):
        yield from _sized(b"b", _file_bytes(value))
    elif is_dataclass(value) and not isinstance(value, type):
        yield from _sized(b"d", type(value).__qualname__.encode())
        yield from _encoded(_compared(value), depth + 1)
    elif isinstance(value, Mapping):
        yield from _sized(b"m", "".join(sorted(_hash_of(item, depth + 1) for item in value.items())).encode())
    elif isinstance(value, AbstractSet):
        yield from _sized(b"u", "".join(sorted(_hash_of(item, depth + 1) for item in value)).encode())
    elif isinstance(value, Sequence):
        yield b"l%d:" % len(value)
        for item in value:
            yield from _encoded(item, depth + 1)
    else:
        raise InvalidInput(
            f"expected a value with a content hash, got {describe(value)}; give numbers, texts, arrays, "
            "dataclasses, lists and mappings of them, or values of this package"
        )


def _sized(kind: bytes, content: bytes) -> tuple[bytes, bytes]:
    return b"%b%d:" % (kind, len(content)), content


def _number(value: Any) -> bytes:
    """Return a number: whole ones by their digits, whatever their type is; others as float64."""
    if isinstance(value, int | np.integer) or float(value).is_integer():
        return b"i%d;" % int(value)
    number = float(value)
    return b"r" + struct.pack("<d", math.nan if math.isnan(number) else number)


def _array(array: NDArray[Any], depth: int) -> Iterable[bytes | memoryview]:
    """Yield an array of numbers, truth values or texts, the last axis fastest, in little-endian bytes."""
    if array.dtype.kind in "OTU":
        yield from _sized(b"a", f"text {array.shape}".encode())
        yield from _texts(array.ravel().tolist(), depth)
        return
    if array.dtype.kind not in "biuf":
        raise InvalidInput(f"expected an array of numbers or texts, got one of {array.dtype}; convert it")
    little = array.dtype.newbyteorder("<")
    yield from _sized(b"a", f"{little.str} {array.shape}".encode())
    plain = np.ascontiguousarray(array, little)
    if plain.dtype.kind == "f":
        plain = plain + plain.dtype.type(0)  # minus zero equals zero
        plain[np.isnan(plain)] = np.nan
    yield plain.reshape(-1).view(np.uint8).data


def _texts(texts: list[Any], depth: int) -> Iterable[bytes | memoryview]:
    """Yield many texts at once, or a list of other values."""
    if not all(isinstance(text, str) for text in texts):
        yield from _encoded(texts, depth + 1)
        return
    yield from _array(np.array([len(text) for text in texts], np.int64), depth)
    yield from _sized(b"s", "".join(texts).encode("utf-8", "surrogatepass"))


def _file_bytes(path: "os.PathLike[Any]") -> bytes:
    try:
        with open(path, "rb") as file:  # noqa: PTH123 - any path-like object
            return file.read()
    except OSError as error:
        raise UnusableFile.of(error, os.fspath(path), "read") from error
