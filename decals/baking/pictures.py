"""Textures as PNG files, compressed on all cores."""

import os
import struct
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import BinaryIO

import numpy as np

from blobtree._typing import UInt8Array
from blobtree.lazy import Lazy

SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}
"""Color type of a PNG file by its number of channels."""

ZLIB_HEADER = b"\x78\x01"
"""Begin of compressed data (RFC 1950): deflate with a window of 32 kB."""

UP = 2
"""Filter that writes each row as its difference from the row above."""

LEVEL, STRATEGY = 1, zlib.Z_RLE
"""How zlib compresses: higher levels take twice as long and save one hundredth of the size. Other strategies
look for repeated bytes farther back, take half as long again and save a thirtieth."""

ADLER_BASE = 65521
"""The largest prime below 2^16."""

STRIP_BYTES = 1 << 20
"""Bytes that a thread compresses at once."""


def png_bytes(texels: UInt8Array) -> bytes:
    """Return an image ``uint8[h, w]`` or ``uint8[h, w, channels]`` as a PNG file."""
    return _begun(texels)()


def _begun(texels: UInt8Array) -> Callable[[], bytes]:
    """Begin to compress an image, and return a function that waits for its PNG file."""
    rows = texels.reshape(len(texels), -1)
    channels = 1 if texels.ndim == 2 else texels.shape[2]
    starts = range(0, len(rows), max(1, STRIP_BYTES // rows.shape[1]))
    ends = [*starts[1:], len(rows)]
    pool = ThreadPoolExecutor(os.cpu_count())
    strips = pool.map(lambda first, last: _strip(rows, first, last), starts, ends)
    pool.shutdown(wait=False)

    def content() -> bytes:
        checksum, chunks = 1, [SIGNATURE]
        header = struct.pack(">IIBBBBB", texels.shape[1], len(texels), 8, COLOR_TYPES[channels], 0, 0, 0)
        chunks += [_chunk(b"IHDR", header), _chunk(b"IDAT", ZLIB_HEADER)]
        for chunk, own, length in strips:
            chunks.append(chunk)
            checksum = _joined_checksum(checksum, own, length)
        chunks += [_chunk(b"IDAT", checksum.to_bytes(4, "big")), _chunk(b"IEND", b"")]
        return b"".join(chunks)

    return content


def _joined_checksum(checksum: int, following: int, length: int) -> int:
    """Return Adler's checksum (RFC 1950) of bytes and of ``length`` bytes that follow, from that of both."""
    high, low = divmod(checksum, 1 << 16)
    next_high, next_low = divmod(following, 1 << 16)
    total = (high + next_high + length * (low - 1)) % ADLER_BASE
    return (total << 16) | (low + next_low - 1) % ADLER_BASE


def _strip(rows: UInt8Array, first: int, last: int) -> tuple[bytes, int, int]:
    """Return a chunk with some rows, filtered and compressed, and checksum and length of what it holds."""
    filtered = np.empty((last - first, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = UP
    above = rows[first - 1] if first else np.zeros_like(rows[0])
    np.subtract(rows[first], above, out=filtered[0, 1:])
    np.subtract(rows[first + 1 : last], rows[first : last - 1], out=filtered[1:, 1:])
    packer = zlib.compressobj(LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, STRATEGY)
    packed = packer.compress(filtered.data)
    packed += packer.flush(zlib.Z_FINISH if last == len(rows) else zlib.Z_SYNC_FLUSH)
    return _chunk(b"IDAT", packed), zlib.adler32(filtered.data), filtered.nbytes


def _chunk(name: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG file."""
    length, checksum = (
        number.to_bytes(4, "big") for number in (len(data), zlib.crc32(data, zlib.crc32(name)))
    )
    return b"".join([length, name, data, checksum])


class PngTexture:
    """A texture in place of an image of Pillow, for libraries that save their images themselves.

    It is compressed while the library does other work.

    Parameters
    ----------
    texels : uint8[h, w, channels]
    """

    format = "PNG"

    def __init__(self, texels: UInt8Array) -> None:
        self._wait = _begun(texels)

    @Lazy
    def _content(self) -> bytes:
        return self._wait()

    def save(self, file: BinaryIO, **_: object) -> None:
        """Write the PNG file; Pillow's options are ignored."""
        file.write(self._content)
