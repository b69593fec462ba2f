"""Generated decal images, by name."""

import re
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from decals.errors import InvalidImage
from decals.images import painters
from decals.images.canvas import Color, draw, rgb

_PAINTERS = {
    "eye": (painters.paint_eye, painters.EYE_COLOR),
    "rivet": (painters.paint_rivet, painters.RIVET_COLOR),
    "rock": (painters.paint_rock, painters.ROCK_COLOR),
    "scale": (painters.paint_scale, painters.SCALE_COLOR),
    "tile": (painters.paint_tile, painters.TILE_COLOR),
}

BUILTIN_IMAGES: tuple[str, ...] = tuple(sorted(_PAINTERS))
"""Names of the generated images; ``"name#rrggbb"`` draws one in another colour."""

MAX_GENERATED_EDGE = 4096
_REFERENCE = re.compile(r"(?P<name>[a-z]+)(?:#(?P<color>[0-9a-fA-F]{6}))?")


def is_builtin(reference: str) -> bool:
    """Return True if a reference names a generated image rather than a file.

    Parameters
    ----------
    reference : str
        The name of a generated image, with an optional colour, or the path of a picture.

    Returns
    -------
    bool
        True for the references that `generate_image` accepts.

    Examples
    --------
    >>> from decals.images import is_builtin
    >>> is_builtin("tile#b0413e")
    True
    >>> is_builtin("tile.png")
    False
    """
    match = _REFERENCE.fullmatch(reference)
    return match is not None and match["name"] in _PAINTERS


@lru_cache(maxsize=32)
def generate_image(reference: str, size: int = 256) -> NDArray[np.uint8]:
    """Generate one of the built-in decal images.

    The decal's rim is the circle inscribed in the square. ``scale``, ``rock`` and ``tile`` are opaque and end
    in a near-black ring, the contact line between neighbours (paper, figure 8); ``rivet`` and ``eye``
    are cut out of a transparent square.

    Parameters
    ----------
    reference : str
        A name of `BUILTIN_IMAGES`, with an optional colour: ``"tile"``, ``"tile#b0413e"``.
    size : int, optional
        Edge in pixels, 1 to 4096. Default 256.

    Returns
    -------
    uint8[size, size, 4]
        sRGB with straight alpha, row 0 at the top (v = 1). Read-only, and equal in every call.

    Raises
    ------
    InvalidImage
        There is no such image, or the size is out of range.

    See Also
    --------
    load_image : a generated image, or a picture from a file.

    Examples
    --------
    >>> import decals
    >>> decals.images.BUILTIN_IMAGES
    ('eye', 'rivet', 'rock', 'scale', 'tile')
    >>> decals.images.generate_image("tile#b0413e", size=64).shape
    (64, 64, 4)
    """
    match = _REFERENCE.fullmatch(reference)
    if match is None or match["name"] not in _PAINTERS:
        names = ", ".join(BUILTIN_IMAGES)
        raise InvalidImage(f"expected one of the images {names} (or NAME#rrggbb), got {reference!r}")
    if not 1 <= size <= MAX_GENERATED_EDGE:
        raise InvalidImage(f"expected an image edge of 1 to {MAX_GENERATED_EDGE} pixels, got {size}")
    paint, default = _PAINTERS[match["name"]]
    color: Color = rgb(match["color"]) if match["color"] else default
    pixels = draw(partial(paint, base=color), size)
    pixels.flags.writeable = False
    return pixels
