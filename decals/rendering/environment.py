"""Environments: pictures of all directions as light. Their textures are made in `prefiltering`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from blobtree.identity import Value
from blobtree.validation import finite_number, finite_vector
from decals.errors import InvalidImage, InvalidScene
from decals.images.load import AnyImage, image_pixels, is_embedded, read_image
from decals.images.texels import Pixels, linear_premultiplied
from decals.options import Values
from decals.validation import MAX_LIGHT, instance

Vector = tuple[float, float, float]

_ADVICE = (
    "give an equirectangular picture, Radiance (.hdr) or a usual format such as PNG or JPEG; convert others, "
    "such as OpenEXR, to .hdr"
)

ASPECTS = (1.9, 2.1)
"""Least and greatest width over height of a picture of all directions."""


class Panorama(Value):
    """A picture of all directions in linear light.

    Parameters
    ----------
    picture : image
        See `Environment`.

    Attributes
    ----------
    source : str
        Path of the picture; empty for an array.
    light : float32[h, w, 3]
        Linear light, row 0 at the top.
    """

    def __init__(self, picture: AnyImage) -> None:
        source = os.fspath(picture) if isinstance(picture, str | os.PathLike) else ""
        self.source = "" if is_embedded(source) else source
        pixels = (
            _file_pixels(source) if self.source else image_pixels(picture, name="environment", linear=True)
        )
        self.light = linear_premultiplied(pixels)[..., :3]
        height, width = self.light.shape[:2]
        if not ASPECTS[0] <= width / height <= ASPECTS[1]:
            raise InvalidImage(
                f"environment: expected a picture of all directions, twice as wide as high, got {width} x "
                f"{height}; convert it to an equirectangular picture"
            )

    def kept_at(self, path: str | os.PathLike[str]) -> "Panorama":
        """Return this picture with the path of a file that holds it."""
        kept = object.__new__(type(self))
        vars(kept).update(vars(self), source=os.fspath(path))
        return kept

    def _contents(self) -> Float32Array:
        return self.light  # equal panoramas may come from several files

    def __repr__(self) -> str:
        height, width = self.light.shape[:2]
        return repr(self.source) if self.source else f"<{width} x {height} pixels>"


@dataclass(frozen=True)
class Environment:
    """A picture of all directions as light, such as a sky or a room; it replaces the studio light.

    Parameters
    ----------
    picture : image
        Equirectangular picture, twice as wide as high: a path, or an image of another kind, see
        `decals.images.image_pixels`. Only Radiance files (``.hdr``) and floats are brighter than white. In
        arrays and lists, floats are linear light and integers sRGB. Row 0 is straight up, the middle column
        opposite to the front: at −z, or at +y for an ``up`` along z.
    rotation : float
        Angle in degrees by which the picture turns about ``up``, counterclockwise as seen from above.
    strength : float
        Factor of its light, from 0 to 65,504.
    visible : bool
        True shows the picture behind the objects, in place of the background.
    up : (x, y, z)
        Upward direction of the picture in the scene.

    Raises
    ------
    InvalidImage
        If the picture cannot be read, has another shape, or holds negative or infinite light. Light above
        65,504 counts as that much.
    InvalidScene
        If another parameter is not finite, or out of range.

    Examples
    --------
    >>> import numpy
    >>> from decals.rendering import Environment
    >>> sky = numpy.linspace([0.6, 0.8, 2.0], [0.2, 0.1, 0.1], 64)[:, None] * numpy.ones((128, 1))
    >>> Environment(sky, rotation=90).strength
    1.0
    """

    picture: Panorama
    rotation: Annotated[float, Values(-180.0, 180.0, "°")] = 0.0
    strength: Annotated[float, Values(0.0, 4.0)] = 1.0
    visible: bool = False
    up: Annotated[Vector, Values(kind=tuple)] = (0.0, 1.0, 0.0)  # three numbers are else a colour

    if TYPE_CHECKING:  # images of any kind are converted

        def __init__(
            self,
            picture: "AnyImage | Panorama",
            rotation: float = 0.0,
            strength: float = 1.0,
            visible: bool = False,
            up: Vector = (0.0, 1.0, 0.0),
        ) -> None: ...

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {
            "rotation": finite_number("an environment's rotation", self.rotation, InvalidScene),
            "strength": finite_number("an environment's strength", self.strength, InvalidScene),
            "visible": instance("visible", self.visible, bool, InvalidScene, "such as True"),
            "up": finite_vector("an environment's up", self.up, InvalidScene),
        }
        if not 0.0 <= checked["strength"] <= MAX_LIGHT:
            raise InvalidScene(
                f"an environment's strength: expected 0, which is darkness, to {MAX_LIGHT:g}, got "
                f"{self.strength:g}"
            )
        if not 0.0 < np.linalg.norm(checked["up"]) < np.inf:
            raise InvalidScene(f"an environment's up: expected a direction, got {self.up}; such as (0, 0, 1)")
        if not isinstance(self.picture, Panorama):
            checked["picture"] = Panorama(self.picture)
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def frame(self) -> Float64Array:
        """Directions of the picture in the scene, right, up and toward the front, as rows, float64[3, 3]."""
        up = np.array(self.up) / np.linalg.norm(self.up)
        front = np.array([0.0, 0.0, 1.0] if abs(up[2]) < 0.99 else [0.0, -1.0, 0.0])
        front -= (front @ up) * up
        front /= np.linalg.norm(front)
        right = np.cross(up, front)
        cosine, sine = np.cos(np.radians(self.rotation)), np.sin(np.radians(self.rotation))
        return np.array([cosine * right - sine * front, up, cosine * front + sine * right])


def as_environment(environment: Any) -> Environment:
    """Return an environment, or that of a picture."""
    return environment if isinstance(environment, Environment) else Environment(environment)


def _file_pixels(path: str) -> Pixels:
    """Return the pixels of a file, or raise an `InvalidImage` that says which files are environments."""
    try:
        return read_image(Path(path), advice=_ADVICE)
    except InvalidImage as error:
        raise InvalidImage(f"environment: {error}") from error
