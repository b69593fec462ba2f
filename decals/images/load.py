"""Decal images of any kind as RGBA: names, picture files, arrays, textures; and the decoding of sRGB."""

import base64
import io
import logging
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from blobtree._typing import FloatArray, UInt8Array
from decals.errors import InvalidImage
from decals.images.builtin import BUILTIN_IMAGES, generate_image, is_builtin
from decals.validation import describe, is_file, require_rgba

MAX_IMAGE_EDGE = 8192
"""Longest edge of a decal image that is read from a file, in pixels."""

PICTURE_FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "GIF", "PPM", "TGA", "JPEG2000", "AVIF")
"""Formats that are read, by their names in Pillow. Others, such as EPS, would start programs or are rare."""


class HasPixels(Protocol):
    """An image of a scene, such as `decals.DecalImage`."""

    @property
    def pixels(self) -> UInt8Array:
        """Straight RGBA, ``uint8[h, w, 4]``."""
        ...


class HasArray(Protocol):
    """A texture, such as `pyvista.Texture`."""

    def to_array(self) -> NDArray[Any]:
        """Return the texels, row 0 at the top."""
        ...


AnyImage: TypeAlias = str | os.PathLike[str] | Image.Image | NDArray[Any] | HasPixels | HasArray
"""Everything that is an image: see `image_pixels`."""

DEFAULT_IMAGE = "scale"
"""Image of decals for which no image is given."""

_DAMAGED = "it is damaged or of another kind, so export it again"
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
    if not isinstance(reference, str) or not reference:
        raise InvalidImage(f"reference: expected the name or the path of an image, got {describe(reference)}")
    if is_builtin(reference) or _has_invalid_color(reference, folder):
        return generate_image(reference)
    if is_embedded(reference):
        return _embedded_pixels(reference)
    return read_image((folder or Path()) / reference)


def image_pixels(image: AnyImage, *, name: str = "image", folder: Path | None = None) -> UInt8Array:
    """Return the pixels of an image of any kind.

    Parameters
    ----------
    image : str, path, PIL.Image.Image, numpy.ndarray, pyvista.Texture or DecalImage
        The name of a generated image; the path of a picture; or pixels, row 0 at the top. Arrays are grey
        ``[h, w]``, RGB ``[h, w, 3]`` or RGBA ``[h, w, 4]``, of bytes or of floats from 0 to 1.
    name : str
        Name of the image in messages.
    folder : Path, optional
        Folder of relative paths. Default: the working directory.

    Returns
    -------
    uint8[h, w, 4]
        sRGB with straight alpha, row 0 at the top.

    Raises
    ------
    InvalidImage
        The image is of another kind, or cannot be read.

    Examples
    --------
    >>> import numpy
    >>> from decals.images import image_pixels
    >>> image_pixels(numpy.full((2, 3), 0.5))[0, 0].tolist()
    [128, 128, 128, 255]
    """
    if isinstance(image, str | os.PathLike):
        return load_image(os.fspath(image), folder=folder)
    if isinstance(image, Image.Image):
        return _picture_pixels(image, name)
    if isinstance(getattr(image, "pixels", None), np.ndarray):
        return require_rgba(name, cast(HasPixels, image).pixels)
    if isinstance(image, type):
        raise InvalidImage(f"{name}: expected an image, got the class {image.__name__}; {_ADVICE}")
    return _array_pixels(cast(HasArray, image).to_array() if hasattr(image, "to_array") else image, name)


EMBEDDED = "data:image/png;base64,"
"""How a reference begins that holds the picture itself."""


def is_embedded(reference: str) -> bool:
    """Return True if a reference holds the picture itself, as `embedded_image` writes it."""
    return reference.startswith(EMBEDDED)


def embedded_image(pixels: UInt8Array) -> str:
    """Return ``uint8[h, w, 4]`` as a text that `load_image` reads."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return EMBEDDED + base64.b64encode(buffer.getvalue()).decode("ascii")


def _embedded_pixels(reference: str) -> UInt8Array:
    try:
        data = base64.b64decode(reference.removeprefix(EMBEDDED), validate=True)
    except ValueError as error:
        raise InvalidImage("could not read an image within the file (no base64); save it again") from error
    return _read_picture(io.BytesIO(data), "an image within the file")


def each_image(images: Any) -> list[Any]:
    """Return images as a list; a single one may stand for a list of one.

    Raises
    ------
    InvalidImage
        The value is neither an image nor a list.
    """
    array = isinstance(images, np.ndarray) and images.ndim < 4
    kinds = (str, os.PathLike, Image.Image)
    if array or isinstance(images, kinds) or hasattr(images, "pixels") or hasattr(images, "to_array"):
        return [images]
    if not isinstance(images, Iterable) or isinstance(images, bytes | Mapping):
        raise InvalidImage(f"images: expected an image or a list of images, got {describe(images)}")
    return list(images)


def _array_pixels(image: Any, name: str) -> UInt8Array:
    try:
        array = np.asarray(image)
    except (TypeError, ValueError):  # rows of different lengths
        array = np.zeros(0)
    planes = array[..., None] if array.ndim == 2 else array
    if planes.ndim != 3 or planes.shape[2] not in (1, 3, 4) or 0 in planes.shape:
        raise InvalidImage(
            f"{name}: expected an image of shape [h, w], [h, w, 3] or [h, w, 4], "
            f"got {describe(image) if array.ndim < 2 else list(array.shape)}"
        )
    if max(planes.shape) > MAX_IMAGE_EDGE:
        raise InvalidImage(
            f"{name}: expected an image of at most {MAX_IMAGE_EDGE} pixels a side, got {list(array.shape)}"
        )
    levels = _levels(planes, name)
    if levels.shape[2] == 4:
        return levels
    colors = np.broadcast_to(levels, (*levels.shape[:2], 3))
    return np.dstack([colors, np.full(levels.shape[:2], 255, np.uint8)])


def _levels(values: NDArray[Any], name: str) -> UInt8Array:
    """Return channels as bytes."""
    if values.dtype == np.uint8:
        return values
    if values.dtype == np.uint16:
        return np.rint(values / 257.0).astype(np.uint8)
    if values.dtype.kind != "f" or not ((values >= 0.0) & (values <= 1.0)).all():
        raise InvalidImage(
            f"{name}: expected bytes, or floats from 0 to 1, got {values.dtype} from {values.min()} to "
            f"{values.max()}; scale it first"
        )
    return np.rint(values * 255.0).astype(np.uint8)


def _picture_pixels(picture: Image.Image, name: str) -> UInt8Array:
    """Return the pixels of an open picture, upright."""
    _check_size(picture, name)
    try:
        picture.load()
        return _to_rgba(ImageOps.exif_transpose(picture))
    except (OSError, SyntaxError, ValueError) as error:
        raise InvalidImage(f"could not read the image {name!r} ({error}); {_DAMAGED}") from error


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
        raise InvalidImage(f"expected an image, found no file {str(path)!r}; {_ADVICE}")
    return _read_picture(path, str(path))


def _read_picture(file: Path | io.BytesIO, name: str) -> UInt8Array:
    """Return the pixels of a picture file; messages call it by a name."""
    try:
        # Pillow warns of odd tags, and of sizes, for which MAX_IMAGE_EDGE is the limit.
        with (
            warnings.catch_warnings(action="ignore"),
            _without_log(),
            Image.open(file, formats=PICTURE_FORMATS) as picture,
        ):
            return _picture_pixels(picture, name)
    except UnidentifiedImageError as error:
        raise InvalidImage(f"expected an image, {name!r} is not a picture; {_ADVICE}") from error
    except Image.DecompressionBombError as error:
        raise InvalidImage(
            f"expected an image of 1 to {MAX_IMAGE_EDGE} pixels a side, "
            f"{name!r} is far larger: scale it first"
        ) from error
    except (OSError, SyntaxError, ValueError) as error:
        if isinstance(error, InvalidImage):
            raise
        raise InvalidImage(f"could not read the image {name!r} ({error}); {_DAMAGED}") from error


@contextmanager
def _without_log() -> Iterator[None]:
    """Within a ``with`` block, Pillow logs no errors; without a handler, Python prints them."""
    logger = logging.getLogger("PIL")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)


def _check_size(picture: Image.Image, name: str) -> None:
    width, height = picture.size
    if not (0 < width <= MAX_IMAGE_EDGE and 0 < height <= MAX_IMAGE_EDGE):
        raise InvalidImage(
            f"expected an image of 1 to {MAX_IMAGE_EDGE} pixels a side, "
            f"{name!r} has {width} x {height}: scale it first"
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
