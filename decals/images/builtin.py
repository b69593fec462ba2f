"""The images that the project draws itself, by name."""

import re
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from decals.errors import InvalidImage

from . import eye, rivet, rock, scale, tile
from .canvas import Color, draw, rgb

_PAINTERS = {
    "eye": (eye.paint, eye.COLOR),
    "rivet": (rivet.paint, rivet.COLOR),
    "rock": (rock.paint, rock.COLOR),
    "scale": (scale.paint, scale.COLOR),
    "tile": (tile.paint, tile.COLOR),
}

BUILTIN_IMAGES: tuple[str, ...] = tuple(sorted(_PAINTERS))
"""Names of the generated images; ``"name#rrggbb"`` draws one in another colour."""

MAX_GENERATED_EDGE = 4096
_REFERENCE = re.compile(r"(?P<name>[a-z]+)(?:#(?P<color>[0-9a-fA-F]{6}))?")


def is_builtin(reference: str) -> bool:
    """Whether a reference names a generated image (rather than a file)."""
    match = _REFERENCE.fullmatch(reference)
    return match is not None and match["name"] in _PAINTERS


@lru_cache(maxsize=32)
def generate_image(reference: str, size: int = 256) -> NDArray[np.uint8]:
    """Draw a decal image.

    The decal's rim is the circle inscribed in the square. ``scale``, ``rock`` and ``tile`` are opaque and end
    in a near-black ring, the contact line between neighbours (the paper's figure 8); ``rivet`` and ``eye``
    are cut out of a transparent square.

    Parameters
    ----------
    reference : str
        A name of `BUILTIN_IMAGES`, with an optional colour: ``"tile"``, ``"tile#b0413e"``.
    size : int
        Edge in pixels, 1 to 4096.

    Returns
    -------
    uint8[size, size, 4]
        Straight RGBA, row 0 at the top (v = 1); read-only and the same every time.

    Raises
    ------
    InvalidImage
        If there is no such image or the size is out of range.
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
