"""Command-line values and the ranges that they must lie in."""

import re
from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token

from ..errors import UsageError
from ..views import Size

MAX_EDGE = 16384
"""Longest edge of a picture, in pixels."""
MAX_SAMPLES = 8
TILE = 768
"""Most samples that are drawn at once, per axis: a command must be interruptible within seconds."""
MAX_DECALS = 1_000_000
MAX_SEED = 2**32 - 1


def _whole(_type: Any, tokens: Sequence[Token]) -> int:
    """Read a whole number; a fraction is no way to write one, though Python would round it."""
    text = tokens[0].value
    if not re.fullmatch(r"[+-]?\d+(_\d+)*", text.strip()):
        raise ValueError(f"expected a whole number, got {text!r}")
    return int(text)


Whole = Annotated[int, Parameter(converter=_whole)]
"""A whole number on the command line."""
OptionalWhole = Annotated[int | None, Parameter(converter=_whole, show_default=False)]
"""One that need not be given."""


Definitions = Annotated[list[str] | None, Parameter(name="--define", negative=(), show_default=False)]
"""Modules that define a user's own kinds of nodes."""


def parse_size(text: str) -> Size:
    """Read a picture size such as ``"1200x900"``."""
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip())
    if match is None:
        raise UsageError(f"--size: expected WIDTHxHEIGHT such as 1200x900, got {text!r}")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
        raise UsageError(f"--size: expected 1 to {MAX_EDGE} pixels a side, got {text!r}")
    return width, height


def check_count(option: str, value: int, low: int, high: int) -> None:
    """Make sure that a whole number lies in its range."""
    if not low <= value <= high:
        raise UsageError(f"{option}: expected a whole number from {low} to {high}, got {value}")
