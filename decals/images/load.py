"""Decal images of any kind as RGBA: names, picture files, arrays, textures; and the decoding of sRGB."""

import base64
import io
import logging
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from blobtree._typing import Float32Array
from blobtree.files import is_file, no_file
from blobtree.validation import describe
from decals.errors import InvalidImage
from decals.images.builtin import BUILTIN_IMAGES, generate_image, is_builtin
from decals.images.extras import DECODERS
from decals.images.texels import MAX_IMAGE_EDGE, Pixels, check_size
from decals.validation import MAX_LIGHT, require_rgba

PICTURE_FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "GIF", "PPM", "TGA", "JPEG2000", "AVIF")
"""Formats that are read, by their names in Pillow. Others, such as EPS, would start programs or are rare."""


class HasPixels(Protocol):
    """An image of a scene, such as `decals.DecalImage`."""

    @property
    def pixels(self) -> Pixels:
        """Straight RGBA, ``[h, w, 4]``."""
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

PNG_DEPTH = 24
"""Place of the bits of a channel in a PNG file."""

MAX_FILE_BYTES = 1 << 29
"""Most bytes of a Radiance file that are read."""

_DAMAGED = "it is damaged or of another kind, so export it again"
_ADVICE = "give a picture such as PNG or JPEG, or one of: " + ", ".join(BUILTIN_IMAGES)


def load_image(reference: str, *, folder: Path | None = None) -> Pixels:
    """Return the pixels of a generated image or of a picture file.

    Parameters
    ----------
    reference : str
        The name of a generated image (see `generate_image`) or the path of a picture.
    folder : Path, optional
        Folder of relative paths. Default: the working directory.

    Returns
    -------
    uint8, uint16 or float32[h, w, 4]
        Straight alpha, row 0 at the top. Integers hold sRGB. Radiance files give floats in linear light.

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


def image_pixels(
    image: AnyImage, *, name: str = "image", folder: Path | None = None, linear: bool = False
) -> Pixels:
    """Return the pixels of an image of any kind.

    Parameters
    ----------
    image : str, path, PIL.Image.Image, numpy.ndarray, pyvista.Texture or DecalImage
        The name of a generated image; the path of a picture; or pixels, row 0 at the top. Arrays are grey
        ``[h, w]``, RGB ``[h, w, 3]`` or RGBA ``[h, w, 4]``, of bytes, of 16 bits, of sRGB floats from 0 to 1,
        or of truth values, such as those of a mask: True is white. The pixels of a `DecalImage` may also be
        linear light of any brightness.
    name : str
        Name of the image in messages.
    folder : Path, optional
        Folder of relative paths. Default: the working directory.
    linear : bool
        True takes floats of arrays as linear light of any brightness.

    Returns
    -------
    uint8, uint16 or float32[h, w, 4]
        Straight alpha, row 0 at the top. Integers hold sRGB. Radiance files give floats in linear light.

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
    array = cast(HasArray, image).to_array() if hasattr(image, "to_array") else image
    return _array_pixels(array, name, linear)


EMBEDDED = {
    "uint8": "data:image/png;base64,",
    "uint16": "data:image/png;bytes-of=uint16;base64,",
    "float32": "data:image/png;bytes-of=float32;base64,",
}
"""How references begin that hold the picture itself, by the type of its pixels.

The bytes of wider pixels, in little-endian order, are those of a wider picture.
"""


def is_embedded(reference: str) -> bool:
    """Return True if a reference holds the picture itself, as `embedded_image` writes it."""
    return reference.startswith(tuple(EMBEDDED.values()))


def embedded_image(pixels: Pixels) -> str:
    """Return pixels as a text that `load_image` reads."""
    buffer = io.BytesIO()
    rows = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder("<"))
    Image.fromarray(rows.view(np.uint8).reshape(len(rows), -1, 4)).save(buffer, "PNG")
    return EMBEDDED[pixels.dtype.name] + base64.b64encode(buffer.getvalue()).decode("ascii")


def _embedded_pixels(reference: str) -> Pixels:
    kind, start = next(item for item in EMBEDDED.items() if reference.startswith(item[1]))
    width = np.dtype(kind).itemsize
    try:
        data = base64.b64decode(reference.removeprefix(start), validate=True)
        rows = _read_picture(io.BytesIO(data), "an image within the file", max_edge=width * MAX_IMAGE_EDGE)
        if width == 1:
            return rows
        wide = np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.dtype(kind).newbyteorder("<"))
        pixels: Pixels = wide.reshape(len(rows), -1, 4).astype(kind)
    except ValueError as error:
        raise InvalidImage("could not read an image within the file (no base64); save it again") from error
    return require_rgba("an image within the file", pixels)


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


def _array_pixels(image: Any, name: str, linear: bool) -> Pixels:
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
    levels = _light(planes, name) if linear and planes.dtype.kind == "f" else _levels(planes, name, linear)
    if levels.shape[2] == 4:
        return levels
    return opaque(np.broadcast_to(levels, (*levels.shape[:2], 3)))


def opaque(colors: NDArray[Any]) -> Pixels:
    """Return the colours ``[h, w, 3]`` of an image without alpha as RGBA."""
    most = 1.0 if colors.dtype.kind == "f" else np.iinfo(colors.dtype).max
    alpha = np.full(colors.shape[:2], most, colors.dtype)
    return np.dstack([colors, alpha])


def _levels(values: NDArray[Any], name: str, linear: bool) -> NDArray[Any]:
    """Return channels as integers; True is the brightest level."""
    values = values.astype(values.dtype.newbyteorder("="), copy=False)
    if values.dtype == np.bool_:
        return np.where(values, np.uint8(255), np.uint8(0))
    if values.dtype in (np.uint8, np.uint16):
        return values
    if values.dtype.kind != "f" or not ((values >= 0.0) & (values <= 1.0)).all():
        limits = f" from {values.min()} to {values.max()}" if values.dtype.kind in "biuf" else ""
        kinds = "16-bit levels or floats of linear light" if linear else "or floats from 0 to 1"
        light = "" if linear else ", or give decals.DecalImage linear light, float32[h, w, 4]"
        raise InvalidImage(f"{name}: expected bytes, {kinds}, got {values.dtype}{limits}; scale it{light}")
    return np.rint(values * 255.0).astype(np.uint8)


def _light(values: NDArray[Any], name: str) -> Float32Array:
    """Return channels of linear light; light above `MAX_LIGHT` counts as that much."""
    wrong = np.argwhere(~((values >= 0.0) & np.isfinite(values)))
    if len(wrong):
        row, column, channel = wrong[0].tolist()
        raise InvalidImage(
            f"{name}: expected finite light of at least 0, got {values[row, column, channel]:g} "
            f"in row {row}, column {column}; replace such pixels"
        )
    light: Float32Array = np.minimum(values, MAX_LIGHT).astype(np.float32)
    light[..., 3:] = np.minimum(light[..., 3:], 1.0)
    return light


def _picture_pixels(picture: Image.Image, name: str, max_edge: int = MAX_IMAGE_EDGE) -> Pixels:
    """Return the pixels of an open picture, upright."""
    check_size(*picture.size, name, max_edge)
    try:
        picture.load()
        return _to_rgba(ImageOps.exif_transpose(picture))
    except (OSError, SyntaxError, ValueError) as error:
        raise InvalidImage(f"could not read the image {name!r} ({error}); {_DAMAGED}") from error


def _has_invalid_color(reference: str, folder: Path | None) -> bool:
    """Return True for the name of a generated image with another text than a colour, unless it is a file."""
    name, mark, _ = reference.partition("#")
    return bool(mark) and name in BUILTIN_IMAGES and not is_file((folder or Path()) / reference)


def read_image(path: Path, *, advice: str = _ADVICE) -> Pixels:
    """Return the pixels of a picture file of any mode: grey, palette, 16 bit, with or without alpha.

    Parameters
    ----------
    path : Path
        A PNG, JPEG, WebP, TIFF, BMP, GIF, PPM, TGA, JPEG 2000, AVIF or Radiance (``.hdr``) file.
    advice : str
        End of the message for a missing file or another kind of file.

    Returns
    -------
    uint8, uint16 or float32[h, w, 4]
        Straight alpha, row 0 at the top. Integers hold sRGB. Radiance files give floats in linear light.

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
    if reason := no_file(path):
        raise InvalidImage(f"expected an image, {reason}; {advice}")
    try:
        with path.open("rb") as file:
            start = file.read(PNG_DEPTH + 1)
            for begins, decode in DECODERS:
                if begins(start):
                    return decode(start + file.read(MAX_FILE_BYTES), str(path))
    except OSError as error:
        raise InvalidImage(f"could not read the image {str(path)!r} ({error.strerror})") from error
    pixels = _read_picture(path, str(path), advice=advice)
    wide = start.startswith(b"\x89PNG") and start[PNG_DEPTH:] == b"\x10" and pixels.dtype == np.uint8
    return _wide_colors(path, pixels) if wide else pixels


def picture_pixels(content: bytes, name: str) -> Pixels:
    """Return the pixels of a picture file's bytes, as `read_image` does; messages call it by a name."""
    return _read_picture(io.BytesIO(content), name)


def _wide_colors(path: Path, narrow: Pixels) -> Pixels:
    """Return the 16-bit colours of a PNG file, of which Pillow reads 8 bits."""
    import pyvista as pv
    from vtkmodules.vtkIOImage import vtkPNGReader

    reader = vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    height, width = narrow.shape[:2]
    if image.GetDimensions() != (width, height, 1) or image.GetScalarSize() != 2:  # turned by its tags
        return narrow
    scalars: Any = pv.convert_array(image.GetPointData().GetScalars())
    values = scalars.reshape(height, width, -1)[::-1]
    colors = np.broadcast_to(values[..., :-1], (height, width, 3)) if values.shape[2] in (2, 4) else values
    return np.dstack([colors, values[..., -1]]) if values.shape[2] in (2, 4) else opaque(colors)


def _known_formats() -> list[str]:
    """Return the formats that Pillow knows here: its releases before 11.3 have no AVIF."""
    known = find_spec("PIL.AvifImagePlugin") is not None
    return [name for name in PICTURE_FORMATS if known or name != "AVIF"]


def _read_picture(
    file: Path | io.BytesIO, name: str, max_edge: int = MAX_IMAGE_EDGE, advice: str = _ADVICE
) -> Pixels:
    """Return the pixels of a picture file; messages call it by a name."""
    try:
        # Pillow warns of odd tags, and of sizes, for which MAX_IMAGE_EDGE is the limit.
        with (
            warnings.catch_warnings(action="ignore"),
            _without_log(),
            Image.open(file, formats=_known_formats()) as picture,
        ):
            return _picture_pixels(picture, name, max_edge)
    except UnidentifiedImageError as error:
        raise InvalidImage(f"expected an image, {name!r} is not a picture; {advice}") from error
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


def _to_rgba(picture: Image.Image) -> Pixels:
    if picture.mode.startswith("I;16"):
        grey = np.asarray(picture).astype(np.uint16)
        return opaque(np.dstack([grey, grey, grey]))
    if picture.mode.startswith(("I", "F")):
        return _wide_grey(np.asarray(picture, dtype=np.float64), picture.mode)
    return np.asarray(picture.convert("RGBA"), dtype=np.uint8)


def _wide_grey(values: NDArray[np.float64], mode: str) -> NDArray[np.uint8]:
    """Return 32-bit grey as 8-bit RGBA; the conversion of Pillow would clip it to white."""
    if mode == "F":
        finite = np.nan_to_num(values, nan=0.0, posinf=1.0, neginf=0.0)
        grey = finite * 255.0 if finite.max(initial=0.0) <= 1.0 else finite
    else:
        grey = values / 257.0
    level = np.rint(np.clip(grey, 0.0, 255.0)).astype(np.uint8)
    return np.dstack([level, level, level, np.full_like(level, 255)])
