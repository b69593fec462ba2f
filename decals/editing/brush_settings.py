"""What a drag of the pointer does: the kinds of brushes, and the settings of a window's brush."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any, Protocol

from decals.options import Values

LEAST_DENSITY = 0.05
"""Low end of the slider of the density."""


class Brush(StrEnum):
    """What a drag with the left button does to decals.

    SELECT selects and moves single ones, BOX and LASSO select those in a box, or in a line around them, and
    PAINT those that it touches. ADD adds a decal with each click. PULL drags the surface below them. ALIGN
    turns images along the stroke.
    """

    SELECT = "select"
    ADD = "add"
    BOX = "box"
    LASSO = "lasso"
    PAINT = "paint"
    PULL = "pull"
    SCATTER = "scatter"
    PUSH = "push"
    ERASE = "erase"
    RELAX = "relax"
    ALIGN = "align"


@dataclass
class BrushSettings:
    """The brush of a window.

    Attributes
    ----------
    brush
        The kind of brush.
    radius
        Its radius in model units; 0 for a tenth of the scene's size.
    decal_radius
        Radius of the decals that the scatter brush adds, in model units; 0 for the median of the scene.
    density
        Decals of the scatter brush relative to a tiling without gaps, above 0 and at most 1.
    images
        Images that the scatter brush chooses from; empty for all.
    seed
        Seed of its next touch.
    """

    brush: Brush = Brush.SELECT
    radius: float = 0.0
    decal_radius: float = 0.0
    density: Annotated[float, Values(LEAST_DENSITY, 1.0)] = 1.0
    images: tuple[int, ...] = ()
    seed: int = 0


class Stroke(Protocol):
    """A drag of a brush over surfaces."""

    @property
    def label(self) -> str:
        """Text of the undo entry."""
        ...

    def touch(self, point: Any, normal: Any) -> None:
        """Change the decals around a surface point."""
        ...
