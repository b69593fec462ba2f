"""Pictures from files, whatever their mode, as RGBA."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from decals.errors import InvalidImage
from decals.paths import is_file

from .builtin import BUILTIN_IMAGES, generate_image, is_builtin

MAX_IMAGE_EDGE = 8192
"""Longest edge of a picture that is taken as a decal image, in pixels."""

_DO_THIS = "give a picture such as PNG or JPEG, or one of: " + ", ".join(BUILTIN_IMAGES)


def load_image(reference: str, *, folder: Path | None = None) -> NDArray[np.uint8]:
    """Get the pixels behind an image reference.

    Parameters
    ----------
    reference : str
        The name of a generated image (see `generate_image`) or the path of a picture.
    folder : Path, optional
        Where relative paths start; the working directory if not given.

    Returns
    -------
    uint8[h, w, 4]
        Straight RGBA, row 0 at the top.

    Raises
    ------
    InvalidImage
        If the file is missing, is no picture, or is empty or too large.
    """
    if is_builtin(reference):
        return generate_image(reference)
    return read_image((folder or Path()) / reference)


def read_image(path: Path) -> NDArray[np.uint8]:
    """Read a picture of any mode (grey, palette, 16 bit, with or without alpha) as uint8[h, w, 4]."""
    if not is_file(path):
        raise InvalidImage(f"expected an image, found no file {str(path)!r}: {_DO_THIS}")
    try:
        with warnings.catch_warnings(), Image.open(path) as picture:
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # MAX_IMAGE_EDGE is the limit
            _check_size(picture, path)
            picture.load()
            return _to_rgba(ImageOps.exif_transpose(picture))
    except UnidentifiedImageError as error:
        raise InvalidImage(f"expected an image, {str(path)!r} is none: {_DO_THIS}") from error
    except Image.DecompressionBombError as error:
        raise InvalidImage(
            f"expected an image of 1 to {MAX_IMAGE_EDGE} pixels a side, "
            f"{str(path)!r} is far larger: scale it first"
        ) from error
    except (OSError, SyntaxError, ValueError) as error:
        if isinstance(error, InvalidImage):
            raise
        raise InvalidImage(f"could not read the image {str(path)!r} ({error}): {_DO_THIS}") from error


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
    """Bring 16- and 32-bit grey down to 8 bits; Pillow's own conversion would clip it to white."""
    if mode == "F":
        finite = np.nan_to_num(values, nan=0.0, posinf=1.0, neginf=0.0)
        grey = finite * 255.0 if finite.max(initial=0.0) <= 1.0 else finite
    else:
        grey = values / 257.0
    level = np.rint(np.clip(grey, 0.0, 255.0)).astype(np.uint8)
    return np.dstack([level, level, level, np.full_like(level, 255)])
