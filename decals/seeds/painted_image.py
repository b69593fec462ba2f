"""Images painted on surfaces, to say how densely seeds lie, and where."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.checks import shown
from decals.errors import InvalidImage, InvalidSeeding
from decals.images import load_image
from decals.seeds.population import Density, Mask
from decals.seeds.projections import Projection
from decals.surfaces.surface import Floats
from decals.wishes import answers, number

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Shares of red, green and blue in grey (Rec. 709)."""


class PaintedImage:
    """Grey values from 0 (black) to 1 (white) all over a surface, from an image that lies on it.

    Parameters
    ----------
    image
        A file, the name of a generated image, or an array: ``[h, w]``, ``[h, w, 3]`` or ``[h, w, 4]``, bytes
        or floats from 0 to 1, top row first. Colours count as bright as they look, transparent ones as black.
    projection
        How it lies on the surface: `Planar`, `Cylindrical`, `Spherical`, `TextureCoordinates`, or any
        function of ``points[n, 3]`` to ``uv[n, 2]``.
    repeat
        Whether the image goes on beyond its edges; else they are drawn out.

    Raises
    ------
    InvalidImage
        If the image cannot be read or is no image.
    """

    def __init__(
        self, image: str | Path | ArrayLike, projection: Projection, *, repeat: bool = False
    ) -> None:
        self.grey = _grey(load_image(str(image)) if isinstance(image, str | Path) else image)
        if not callable(projection):
            raise InvalidSeeding(
                f"projection: expected one such as Planar.over(surface), or a function of points, "
                f"got {shown(projection)}"
            )
        self.projection = projection
        self.repeat = repeat

    def __call__(self, points: Floats) -> NDArray[np.float64]:
        """Grey values at points, ``float64[n]``, between the centres of pixels by bilinear interpolation."""
        height, width = self.grey.shape
        places = answers("projection", self.projection, points)
        if places.shape != (len(points), 2) or not np.isfinite(places).all():
            raise InvalidSeeding(
                f"projection: expected finite uv of shape [{len(points)}, 2], got {list(places.shape)}"
            )
        x, y = places[:, 0] * width - 0.5, (1.0 - places[:, 1]) * height - 0.5
        left, top = np.floor(x), np.floor(y)
        across, down = x - left, y - top
        columns = [self._within(left + step, width) for step in (0, 1)]
        rows = [self._within(top + step, height) for step in (0, 1)]
        upper, lower = (
            self.grey[row, columns[0]] * (1.0 - across) + self.grey[row, columns[1]] * across for row in rows
        )
        found: NDArray[np.float64] = upper * (1.0 - down) + lower * down
        return found

    def density(self, *, black: float = 0.1, white: float = 1.0) -> Density:
        """How densely seeds lie: so much where the image is black, so much where it is white.

        Only the ratio of the two counts. For no seeds at all where it is black, give a `mask` as well.
        """
        for name, value in (("black", black), ("white", white)):
            number(name, value, "a number above 0 (places are barred by a mask)", lambda grey: grey > 0)
        return lambda points: black + (white - black) * self(points)

    def mask(self, *, above: float = 0.5) -> Mask:
        """Where seeds may lie: where the image is brighter than that."""
        number("above", above, "a number", np.isfinite)
        return lambda points: self(points) > above

    def _within(self, ticks: NDArray[np.float64], count: int) -> NDArray[np.int64]:
        """Pixels that there are, for numbers of pixels on either side of the edges."""
        if self.repeat:
            return np.mod(ticks, count).astype(np.int64)
        return np.clip(ticks, 0, count - 1).astype(np.int64)


def _grey(image: ArrayLike) -> NDArray[np.float64]:
    """Brightness of each pixel, ``float64[h, w]``."""
    given = np.asarray(image)
    if given.ndim not in (2, 3) or given.size == 0 or (given.ndim == 3 and given.shape[2] not in (3, 4)):
        raise InvalidImage(f"image: expected shape [h, w], [h, w, 3] or [h, w, 4], got {list(given.shape)}")
    if given.dtype != np.uint8 and not np.issubdtype(given.dtype, np.floating):
        raise InvalidImage(f"image: expected bytes or floats, got {given.dtype}")
    values = given.astype(np.float64) / (255.0 if given.dtype == np.uint8 else 1.0)
    if not (np.isfinite(values).all() and values.min() >= 0.0 and values.max() <= 1.0):
        raise InvalidImage("image: expected floats from 0 to 1, got others; divide by the largest")
    if values.ndim == 2:
        return values
    grey: NDArray[np.float64] = values[..., :3] @ np.array(LUMINANCE)
    return grey * values[..., 3] if values.shape[2] == 4 else grey
