"""Radiance pictures (``.hdr``): light of any brightness, as red, green, blue and a common exponent."""

import re

import numpy as np

from blobtree._typing import Float32Array, UInt8Array
from decals.errors import InvalidImage
from decals.images.texels import check_size
from decals.validation import MAX_LIGHT

SIGNATURES = (b"#?RADIANCE", b"#?RGBE")
"""First bytes of a file."""

RUN_WIDTHS = range(8, 32768)
"""Widths of rows that may be stored as runs."""

EXPONENT_BIAS = 136
HEADER_BYTES = 1 << 16
"""Longest header that is read."""

_SIZE = re.compile(rb"\n\n-Y (\d{1,6}) \+X (\d{1,6})\n")


def is_radiance(content: bytes) -> bool:
    """Return True for the first bytes of a Radiance picture."""
    return content.startswith(SIGNATURES)


def decode_radiance(content: bytes, name: str) -> Float32Array:
    """Return linear light ``float32[h, w, 4]`` with alpha 1, row 0 at the top.

    Parameters
    ----------
    content : bytes
        A file, with rows stored as runs or as plain pixels (Ward, "Real Pixels", Graphics Gems II, 1991).
    name : str
        Name of the file in messages.

    Raises
    ------
    InvalidImage
        If the file is damaged or too large, or has rows in another order than from the top.
    """
    size = _SIZE.search(content[:HEADER_BYTES])
    if size is None or b"FORMAT=32-bit_rle_xyze" in content[: size.start()]:
        raise InvalidImage(
            f"could not read {name!r}: expected RGB rows from the top ('-Y height +X width'); export it again"
        )
    height, width = int(size[1]), int(size[2])
    check_size(width, height, name)
    data = np.frombuffer(content, np.uint8, offset=size.end())
    try:
        texels = _texels(data, height, width)
    except (IndexError, ValueError) as error:
        raise InvalidImage(
            f"could not read {name!r}: its rows are damaged or cut off; export it again"
        ) from error
    pixels = np.ones((height, width, 4), np.float32)
    light = pixels[..., :3]
    np.ldexp(texels[..., :3], texels[..., 3:].astype(np.int32) - EXPONENT_BIAS, out=light, dtype=np.float32)
    light[texels[..., 3] == 0] = 0.0
    np.minimum(light, MAX_LIGHT, out=light)
    return pixels


def _texels(data: UInt8Array, height: int, width: int) -> UInt8Array:
    """Return mantissas and exponents ``uint8[h, w, 4]``; IndexError or ValueError if bytes are missing."""
    start = bytes((2, 2, width >> 8, width & 255)) if width in RUN_WIDTHS else None
    if start is None or data[:4].tobytes() != start:
        return data[: 4 * height * width].reshape(height, width, 4)
    if len(data) < height * (4 + 8 * ((width + 126) // 127)):  # the shortest rows of runs
        raise ValueError("missing bytes")
    texels = np.empty((height, 4, width), np.uint8)
    at = 0
    for row in texels:
        if data[at : at + 4].tobytes() != start:
            raise ValueError("no row")
        at += 4
        for channel in row:
            column = 0
            while column < width:
                count = int(data[at])
                run = count > 128
                count -= 128 if run else 0
                if not 0 < count <= width - column:
                    raise ValueError("no run")
                end = at + 2 if run else at + 1 + count
                channel[column : column + count] = data[at + 1 : end]
                column, at = column + count, end
    return np.moveaxis(texels, 1, 2)
