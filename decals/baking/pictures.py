"""Textures as PNG files."""

import io

from PIL import Image

from blobtree._typing import UInt8Array


def png_bytes(texels: UInt8Array) -> bytes:
    """Return an image as a PNG file."""
    file = io.BytesIO()
    Image.fromarray(texels).save(file, format="png")
    return file.getvalue()
