"""Colours as users write them: names, hexadecimal codes, or numbers from 0 to 1."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias, cast

import numpy as np
from PIL import ImageColor

from blobtree.errors import ImplicitDecalsError, InvalidNode, MissingPackage
from blobtree.validation import describe, real, real_number

Rgb = tuple[float, float, float]
Rgba = tuple[float, float, float, float]

ColorLike: TypeAlias = str | Sequence[float]
"""The name of a colour, a code ``#rrggbb``, or three numbers from 0 to 1; four with alpha."""

ADVICE = "give a name such as 'tomato', a code such as '#b0413e', or numbers from 0 to 1"


def color_rgb(name: str, value: object, error: type[ImplicitDecalsError] = InvalidNode) -> Rgb:
    """Return a colour as red, green and blue from 0 to 1.

    Parameters
    ----------
    name : str
        Name of the colour in messages.
    value : str, pyvista.Color or (red, green, blue)
        A name that pyvista knows (those of CSS and of matplotlib's tab colours), a code ``#rrggbb``, or three
        numbers from 0 to 1.
    error : type
        Exception for all other values.

    Examples
    --------
    >>> from blobtree.colors import color_rgb
    >>> color_rgb("color", "red"), color_rgb("color", "#336699")
    ((1.0, 0.0, 0.0), (0.2, 0.4, 0.6))
    """
    channels = _channels(value)
    if is_named(value) and channels[3:] == (1.0,):
        channels = channels[:3]
    if len(channels) != 3:
        raise error(f"{name}: expected red, green, blue in [0, 1] or a name, got {_line(value)}; {ADVICE}")
    return channels[0], channels[1], channels[2]


def color_rgba(name: str, value: object, error: type[ImplicitDecalsError] = InvalidNode) -> Rgba:
    """Return a colour as red, green, blue and alpha from 0 to 1; alpha is 1 if it is left out.

    Arguments are those of `color_rgb`; a code may be ``#rrggbbaa``.
    """
    channels = _channels(value)
    if not channels:
        raise error(f"{name}: expected sRGB and alpha in [0, 1] or a name, got {_line(value)}; {ADVICE}")
    red, green, blue, alpha = channels if len(channels) == 4 else (*channels, 1.0)
    return red, green, blue, alpha


def is_named(value: object) -> bool:
    """Return True for a colour that is no sequence of numbers: a name, a code or a `pyvista.Color`."""
    return isinstance(value, str) or hasattr(value, "float_rgba")


def _channels(value: object) -> tuple[float, ...]:
    """Return three or four numbers from 0 to 1; nothing for a value that is no colour."""
    try:
        if is_named(value):
            return _named_channels(value)
        values = real(value) if isinstance(value, np.ndarray) else cast(Iterable[Any], value)
        channels = tuple(map(real_number, values))
    except (TypeError, ValueError, OverflowError):
        return ()
    return channels if len(channels) in (3, 4) and all(0.0 <= c <= 1.0 for c in channels) else ()


def _named_channels(value: Any) -> tuple[float, ...]:
    if isinstance(value, str) and value.lower() in ImageColor.colormap:  # pyvista's colours import matplotlib
        return (*(channel / 255.0 for channel in ImageColor.getrgb(value)), 1.0)
    try:
        import pyvista as pv
    except ImportError as error:
        raise MissingPackage("names of colours need pyvista; run: pip install pyvista") from error
    return tuple(map(float, pv.Color(value).float_rgba))


def _line(value: object) -> str:
    text = " ".join(describe(value).split())
    return f"{text:.60}"
