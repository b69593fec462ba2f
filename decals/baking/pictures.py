"""Textures as PNG files, compressed on all cores."""

import os
import struct
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import BinaryIO

import numpy as np

from blobtree._typing import UInt8Array
from blobtree.lazy import Lazy

SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}
"""Color type of a PNG file by its number of channels."""

UP = 2
"""Filter that writes each row as its difference from the row above."""

LEVEL, STRATEGY = 1, zlib.Z_RLE
"""How zlib compresses: higher levels take twice as long and save one hundredth of the size. Other strategies
look for repeated bytes farther back, take half as long again and save a thirtieth."""

STRIP_BYTES = 1 << 20
"""Bytes that a thread compresses at once."""


def png_bytes(texels: UInt8Array) -> bytes:
    """Return an image ``uint8[h, w]`` or ``uint8[h, w, channels]`` as a PNG file."""
    rows = texels.reshape(len(texels), -1)
    channels = 1 if texels.ndim == 2 else texels.shape[2]
    starts = range(0, len(rows), max(1, STRIP_BYTES // rows.shape[1]))
    ends = [*starts[1:], len(rows)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        strips = list(pool.map(lambda first, last: _strip(rows, first, last), starts, ends))
    checksum = 1
    for filtered, _ in strips:
        checksum = zlib.adler32(filtered.data, checksum)
    content = b"".join([b"\x78\x01", *(packed for _, packed in strips), checksum.to_bytes(4, "big")])
    header = struct.pack(">IIBBBBB", texels.shape[1], len(texels), 8, COLOR_TYPES[channels], 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", content), (b"IEND", b"")]
    return b"".join([SIGNATURE, *(part for name, data in chunks for part in _chunk(name, data))])


def _strip(rows: UInt8Array, first: int, last: int) -> tuple[UInt8Array, bytes]:
    """Return some rows filtered, and compressed so that others may follow."""
    filtered = np.empty((last - first, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = UP
    above = rows[first - 1] if first else np.zeros_like(rows[0])
    np.subtract(rows[first], above, out=filtered[0, 1:])
    np.subtract(rows[first + 1 : last], rows[first : last - 1], out=filtered[1:, 1:])
    packer = zlib.compressobj(LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, STRATEGY)
    packed = packer.compress(filtered.data)
    return filtered, packed + packer.flush(zlib.Z_FINISH if last == len(rows) else zlib.Z_SYNC_FLUSH)


def _chunk(name: bytes, data: bytes) -> Iterator[bytes]:
    """Yield the parts of a chunk of a PNG file."""
    yield len(data).to_bytes(4, "big")
    yield name
    yield data
    yield zlib.crc32(data, zlib.crc32(name)).to_bytes(4, "big")


class PngTexture:
    """A texture in place of an image of Pillow, for libraries that save their images themselves.

    Parameters
    ----------
    texels : uint8[h, w, channels]
    """

    format = "PNG"

    def __init__(self, texels: UInt8Array) -> None:
        self._texels = texels

    @Lazy
    def _content(self) -> bytes:
        return png_bytes(self._texels)

    def save(self, file: BinaryIO, **_: object) -> None:
        """Write the PNG file; Pillow's options are ignored."""
        file.write(self._content)
