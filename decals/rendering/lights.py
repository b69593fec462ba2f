"""Lights of a scene in place of the studio light, of the same kinds as VTK's."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from blobtree._typing import Float64Array
from blobtree.colors import ColorLike, color_rgb, is_named
from blobtree.validation import describe, finite_number, finite_vector
from decals.errors import InvalidScene
from decals.shaders import constants

MAX_LIGHTS = int(constants("light_rows.glsl")["MAX_LIGHTS"])
"""Number of lights that shaders have room for."""

NO_CONE_COSINE = -2.0
"""Cosine of the cone of a light that shines in all directions."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Light:
    """A light in the world.

    Parameters
    ----------
    color : (red, green, blue) or str
        Display values of a white surface that faces the light, intensity included; or the name of a colour.
    direction : (x, y, z)
        Unit vector along which the light travels.
    position : (x, y, z), optional
        Position of the light; None for a light at infinity.
    attenuation : (float, float, float)
        Constant, linear and quadratic term of the distance by which the light is divided.
    cone : float
        Half angle in degrees beyond which the light sheds none; above 90, it shines in all directions.
    exponent : float
        Power of the cosine by which the light fades from the axis of its cone.

    Raises
    ------
    InvalidScene
        If a parameter is not made of finite numbers.

    Examples
    --------
    >>> from decals.rendering import Light
    >>> headlight = Light((1, 1, 1), (0, 0, -1))
    """

    color: Vector
    direction: Vector
    position: Vector | None = None
    attenuation: Vector = (1.0, 0.0, 0.0)
    cone: float = 180.0
    exponent: float = 1.0

    if TYPE_CHECKING:  # names of colours are converted

        def __init__(
            self,
            color: ColorLike,
            direction: Vector,
            position: Vector | None = None,
            attenuation: Vector = (1.0, 0.0, 0.0),
            cone: float = 180.0,
            exponent: float = 1.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        positions = () if self.position is None else ("position",)
        if is_named(self.color):
            object.__setattr__(self, "color", color_rgb("a light's color", self.color, InvalidScene))
        for name in ("color", "direction", "attenuation", *positions):
            numbers = finite_vector(f"a light's {name}", getattr(self, name), InvalidScene)
            object.__setattr__(self, name, numbers)
        for name in ("cone", "exponent"):
            finite_number(f"a light's {name}", getattr(self, name), InvalidScene)

    def rows(self) -> list[tuple[float, ...]]:
        """Return the four rows that the shader reads."""
        position = (0.0, 0.0, 0.0, 0.0) if self.position is None else (*self.position, 1.0)
        cone = math.cos(math.radians(self.cone)) if self.cone <= 90.0 else NO_CONE_COSINE
        return [
            position,
            (*self.direction, cone),
            (*self.color, self.exponent),
            (*self.attenuation, 0.0),
        ]


@dataclass(frozen=True, slots=True)
class Lighting:
    """Lights, and the frame in which they are given; without any light, objects show their plain colours.

    Parameters
    ----------
    lights : tuple of Light
        At most MAX_LIGHTS.
    frame : tuple of 16 floats
        4 × 4 matrix, row by row, from the scene's coordinates to those of the lights. Default: identity.

    Raises
    ------
    InvalidScene
        If there are more lights, or the tuple holds other values.

    Examples
    --------
    >>> from decals.rendering import Light, Lighting
    >>> len(Lighting((Light((1, 1, 1), (0, 0, -1)),)).lights)
    1
    """

    lights: tuple[Light, ...]
    frame: tuple[float, ...] = tuple(np.eye(4).ravel().tolist())

    def __post_init__(self) -> None:
        known = isinstance(self.lights, tuple) and all(isinstance(light, Light) for light in self.lights)
        if not known or len(self.lights) > MAX_LIGHTS:
            raise InvalidScene(
                f"lights: expected at most {MAX_LIGHTS} Lights in a tuple, got {describe(self.lights)}"
            )

    def packed(self) -> bytes:
        """Return the rows of all lights, ``float32[4 * MAX_LIGHTS, 4]``, as bytes."""
        packed = np.zeros((MAX_LIGHTS * 4, 4), np.float32)
        rows = [row for light in self.lights for row in light.rows()]
        packed[: len(rows)] = np.reshape(rows, (-1, 4))
        return packed.tobytes()

    @property
    def matrix(self) -> Float64Array:
        """``frame`` as ``float64[4, 4]``."""
        return np.reshape(self.frame, (4, 4))
