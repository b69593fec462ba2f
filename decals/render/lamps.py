"""Lights that somebody else set up, in place of the studio's: VTK's kinds, as values."""

import math
from dataclasses import dataclass

import numpy as np

from decals.checks import finite, shown, triple
from decals.errors import InvalidScene
from decals.scenes.viewpoint import Floats

MOST_LAMPS = 32
"""As many as the shader has room for; see ``shaders/lamps.glsl``."""
NO_CONE = -2.0
"""Stands for the cosine of a cone that holds everything."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light in the world.

    Parameters
    ----------
    color
        What a white surface that faces it shows, in display values, its intensity included.
    direction
        Where its light goes, a unit vector.
    position
        Where it stands; None for one that is infinitely far away.
    attenuation
        Constant, linear and quadratic term by which the distance divides it.
    cone
        Half angle in degrees beyond which it sheds no light; above 90, all around.
    exponent
        Power of the cosine with which a cone fades from its axis.
    """

    color: Vector
    direction: Vector
    position: Vector | None = None
    attenuation: Vector = (1.0, 0.0, 0.0)
    cone: float = 180.0
    exponent: float = 1.0

    def __post_init__(self) -> None:
        places = () if self.position is None else ("position",)
        for name in ("color", "direction", "attenuation", *places):
            numbers = triple(f"a lamp's {name}", getattr(self, name), InvalidScene)
            object.__setattr__(self, name, tuple(numbers.tolist()))
        for name in ("cone", "exponent"):
            finite(f"a lamp's {name}", getattr(self, name), InvalidScene)

    def rows(self) -> list[tuple[float, ...]]:
        """Give the four rows that the shader reads."""
        place = (0.0, 0.0, 0.0, 0.0) if self.position is None else (*self.position, 1.0)
        cone = math.cos(math.radians(self.cone)) if self.cone <= 90.0 else NO_CONE
        return [place, (*self.direction, cone), (*self.color, self.exponent), (*self.attenuation, 0.0)]


@dataclass(frozen=True, slots=True)
class Lamps:
    """Lights, and how a scene stands among them; without any, things show their colours as they are.

    Parameters
    ----------
    lamps
        At most MOST_LAMPS.
    place
        The scene's coordinates to those of the lights, 4 × 4, row by row.
    """

    lamps: tuple[Lamp, ...]
    place: tuple[float, ...] = tuple(np.eye(4).ravel().tolist())

    def __post_init__(self) -> None:
        known = isinstance(self.lamps, tuple) and all(isinstance(lamp, Lamp) for lamp in self.lamps)
        if not known or len(self.lamps) > MOST_LAMPS:
            raise InvalidScene(
                f"lamps: expected at most {MOST_LAMPS} Lamps in a tuple, got {shown(self.lamps)}"
            )

    def data(self) -> bytes:
        """Give the rows of all lamps, ``float32[MOST_LAMPS * 4, 4]``."""
        rows = np.zeros((MOST_LAMPS * 4, 4), np.float32)
        given = [row for lamp in self.lamps for row in lamp.rows()]
        rows[: len(given)] = np.reshape(given, (-1, 4))
        return rows.tobytes()

    @property
    def matrix(self) -> Floats:
        """``place`` as ``float64[4, 4]``."""
        return np.reshape(self.place, (4, 4))
