"""Command-line values that are more than a number: sizes of pictures and cameras."""

import math
import re

from decals.camera import Camera
from decals.errors import DecalsError
from decals.scene import Box

from .errors import UsageError

Size = tuple[int, int]
Direction = tuple[float, float, float]

MAX_EDGE = 16384
"""Longest edge of a picture, in pixels."""
MAX_SAMPLES = 8
MAX_DECALS = 1_000_000
MAX_SEED = 2**32 - 1

CAMERAS: dict[str, Direction] = {
    "three-quarter": (0.55, 0.35, 1.0),
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}
"""Directions from the objects toward the camera, by name."""


def parse_size(text: str) -> Size:
    """Read a picture size such as ``"1200x900"``."""
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip())
    if match is None:
        raise UsageError(f"--size: expected WIDTHxHEIGHT such as 1200x900, got {text!r}")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
        raise UsageError(f"--size: expected 1 to {MAX_EDGE} pixels a side, got {text!r}")
    return width, height


def parse_direction(text: str) -> Direction:
    """Read a camera: a name of `CAMERAS`, or a direction ``"x,y,z"`` toward it."""
    if text in CAMERAS:
        return CAMERAS[text]
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        names = ", ".join(CAMERAS)
        raise UsageError(
            f"--camera: expected {names}, or a direction such as 1,0.5,2; got {text!r}"
        ) from None
    if not (math.isfinite(math.hypot(x, y, z)) and math.hypot(x, y, z) > 0.0):
        raise UsageError(f"--camera: expected a finite direction other than 0,0,0; got {text!r}")
    return x, y, z


def frame(bounds: Box, direction: Direction, size: Size) -> Camera:
    """Look at a box from a direction so that all of it is in a picture of this size."""
    try:
        return Camera.framing(bounds, direction=direction, aspect=size[0] / size[1])
    except DecalsError as error:
        raise UsageError(f"--camera: {error}") from error


def check_count(option: str, value: int, low: int, high: int) -> None:
    """Make sure that a whole number lies in its range."""
    if not low <= value <= high:
        raise UsageError(f"{option}: expected a whole number from {low} to {high}, got {value}")
