"""Decal images from picture files of any mode, as RGBA, and the decoding of sRGB."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from blobtree._typing import FloatArray
from decals.errors import InvalidImage
from decals.images.builtin import BUILTIN_IMAGES, generate_image, is_builtin
from decals.validation import describe, is_file

MAX_IMAGE_EDGE = 8192
"""Longest edge of a decal image that is read from a file, in pixels."""

PICTURE_FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "GIF", "PPM", "TGA", "JPEG2000", "AVIF")
"""Formats that are read, by their names in Pillow. Others, such as EPS, would start programs or are rare."""

_ADVICE = "give a picture such as PNG or JPEG, or one of: " + ", ".join(BUILTIN_IMAGES)


def load_image(reference: str, *, folder: Path | None = None) -> NDArray[np.uint8]:
    """Return the pixels of a generated image or of a picture file.

    Parameters
    ----------
    reference : str
        The name of a generated image (see `generate_image`) or the path of a picture.
    folder : Path, optional
        Folder of relative paths. Default: the working directory.

    Returns
    -------
    uint8[h, w, 4]
        sRGB with straight alpha, row 0 at the top.

    Raises
    ------
    InvalidImage
        The file is missing, is no picture, or is empty or too large.

    See Also
    --------
    generate_image : a generated image of any size.

    Examples
    --------
    >>> import decals
    >>> decals.load_image("scale").shape
    (256, 256, 4)
    """
    if not isinstance(reference, str):
        raise InvalidImage(f"reference: expected the name or the path of an image, got {describe(reference)}")
    if is_builtin(reference) or _has_invalid_color(reference, folder):
        return generate_image(reference)
    return read_image((folder or Path()) / reference)


def _has_invalid_color(reference: str, folder: Path | None) -> bool:
    """Return True for the name of a generated image with another text than a colour, unless it is a file."""
    name, mark, _ = reference.partition("#")
    return bool(mark) and name in BUILTIN_IMAGES and not is_file((folder or Path()) / reference)


def read_image(path: Path) -> NDArray[np.uint8]:
    """Return the pixels of a picture file of any mode: grey, palette, 16 bit, with or without alpha.

    Parameters
    ----------
    path : Path
        A PNG, JPEG, WebP, TIFF, BMP, GIF, PPM, TGA, JPEG 2000 or AVIF file.

    Returns
    -------
    uint8[h, w, 4]
        sRGB with straight alpha, row 0 at the top.

    Raises
    ------
    InvalidImage
        The file is missing, is no picture, or is empty or too large.

    See Also
    --------
    load_image : the same, or a generated image.

    Examples
    --------
    >>> from pathlib import Path
    >>> from PIL import Image
    >>> from decals.images import read_image
    >>> Image.new("L", (3, 2), 128).save("grey.png")
    >>> read_image(Path("grey.png"))[0, 0].tolist()
    [128, 128, 128, 255]
    """
    if not is_file(path):
        raise InvalidImage(f"expected an image, found no file {str(path)!r}: {_ADVICE}")
    try:
        # Pillow warns of odd tags, and of sizes, for which MAX_IMAGE_EDGE is the limit.
        with (
            warnings.catch_warnings(action="ignore"),
            Image.open(path, formats=PICTURE_FORMATS) as picture,
        ):
            _check_size(picture, path)
            picture.load()
            return _to_rgba(ImageOps.exif_transpose(picture))
    except UnidentifiedImageError as error:
        raise InvalidImage(f"expected an image, {str(path)!r} is not a picture: {_ADVICE}") from error
    except Image.DecompressionBombError as error:
        raise InvalidImage(
            f"expected an image of 1 to {MAX_IMAGE_EDGE} pixels a side, "
            f"{str(path)!r} is far larger: scale it first"
        ) from error
    except (OSError, SyntaxError, ValueError) as error:
        if isinstance(error, InvalidImage):
            raise
        raise InvalidImage(f"could not read the image {str(path)!r} ({error}): {_ADVICE}") from error


def _check_size(picture: Image.Image, path: Path) -> None:
    width, height = picture.size
    if not (0 < width <= MAX_IMAGE_EDGE and 0 < height <= MAX_IMAGE_EDGE):
        raise InvalidImage(
            f"expected an image of 1 to {MAX_IMAGE_EDGE} pixels a side, "
            f"{str(path)!r} has {width} x {height}: scale it first"
        )


def _to_rgba(picture: Image.Image) -> NDArray[np.uint8]:
    if picture.mode.startswith(("I", "F")):
        return _wide_grey(np.asarray(picture, dtype=np.float64), picture.mode)
    return np.asarray(picture.convert("RGBA"), dtype=np.uint8)


def _wide_grey(values: NDArray[np.float64], mode: str) -> NDArray[np.uint8]:
    """Return 16- or 32-bit grey as 8-bit RGBA; the conversion of Pillow would clip it to white."""
    if mode == "F":
        finite = np.nan_to_num(values, nan=0.0, posinf=1.0, neginf=0.0)
        grey = finite * 255.0 if finite.max(initial=0.0) <= 1.0 else finite
    else:
        grey = values / 257.0
    level = np.rint(np.clip(grey, 0.0, 255.0)).astype(np.uint8)
    return np.dstack([level, level, level, np.full_like(level, 255)])


def decode_srgb(colors: FloatArray) -> FloatArray:
    """Decode sRGB colours from 0 to 1 to linear light, in the precision of ``colors``."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)


def encode_srgb(colors: FloatArray) -> FloatArray:
    """Encode linear light, clamped to [0, 1], as sRGB colours, in the precision of ``colors``."""
    light = np.clip(colors, 0.0, 1.0)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
