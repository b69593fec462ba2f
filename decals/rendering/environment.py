"""Environments: pictures of all directions as light, prefiltered for surface of any roughness.

A rough surface mirrors light through a lobe. The mean light in the lobe is that of the split sum (Karis,
"Real Shading in Unreal Engine 4", 2013): the mean of the picture, weighted by GGX seen head on, times a
table of what surface of this roughness reflects of light 1. The lobe of roughness 1 is the cosine, so its
means light diffuse surface too. Lobes are round: along circles of latitude, a mean is a convolution, which a
Fourier transform computes without noise.
"""

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Float64Array
from blobtree.identity import Value
from blobtree.lazy import Lazy
from decals.errors import InvalidImage, InvalidScene
from decals.images.load import AnyImage, image_pixels, is_embedded, read_image
from decals.images.texels import Pixels, linear_premultiplied
from decals.options import Values
from decals.shaders import constants
from decals.validation import MAX_LIGHT, finite_number, finite_vector, instance

Vector = tuple[float, float, float]

_ADVICE = (
    "give an equirectangular picture, Radiance (.hdr) or a usual format such as PNG or JPEG; convert others, "
    "such as OpenEXR, to .hdr"
)

ASPECTS = (1.9, 2.1)
"""Least and greatest width over height of a picture of all directions."""

MAX_PICTURE_COLUMNS = 8192
"""Greatest width of a panorama in the background: more takes more than 200 MB of graphics memory."""

GRID_ROWS = (512, 256, 128, 64, 64, 64, 64)
"""Steps from pole to pole of the grids of directions, from mirrors to surface of roughness 1."""

TABLE_SHAPE = (32, 64)
"""Rows of the table, by roughness, and its columns, by the cosine between normal and eye."""

TABLE_LOBE_STEPS = (128, 12)
"""Directions over a lobe, from its axis and around it, with which the table is computed."""

MIN_FACING = constants("material.glsl")["MIN_FACING"]
"""Least cosine between normal and eye."""


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

    @Lazy
    def texels(self) -> NDArray[np.float16]:
        """Return what ``shaders/image_environment.glsl`` reads: all grids, and the table below them."""
        blocks = [_mirror_grid(panorama_cells(self.light, GRID_ROWS[0]))]
        for level, rows in enumerate(GRID_ROWS[1:], 1):
            blocks.append(lobe_means(panorama_cells(self.light, rows), level_alpha(level)))
        blocks.append(np.dstack(reflection_table()))
        blocks = [np.pad(block, ((1, 1), (0, 0), (0, 0)), "edge") for block in blocks]
        texels = np.zeros((sum(map(len, blocks)), 2 * GRID_ROWS[0] + 1, 3), np.float16)
        first = 0
        for block in blocks:
            texels[first : first + len(block), : block.shape[1]] = block
            first += len(block)
        return texels


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
        numbers = finite_vector("an environment's up", self.up, InvalidScene)
        checked: dict[str, Any] = {
            "rotation": finite_number("an environment's rotation", self.rotation, InvalidScene),
            "strength": finite_number("an environment's strength", self.strength, InvalidScene),
            "visible": instance("visible", self.visible, bool, InvalidScene, "such as True"),
            "up": tuple(numbers.tolist()),
        }
        if not 0.0 <= checked["strength"] <= MAX_LIGHT:
            raise InvalidScene(
                f"an environment's strength: expected 0, which is darkness, to {MAX_LIGHT:g}, got "
                f"{self.strength:g}"
            )
        if not 0.0 < np.linalg.norm(numbers) < np.inf:
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


def environment_constants() -> str:
    """Return the places of the grids and of the table as GLSL, for ``shaders/image_environment.glsl``."""
    first, grids = 1, []
    for rows in GRID_ROWS:
        grids.append(f"ivec2({first}, {rows})")
        first += rows + 3  # both poles, and a row above and below
    count, (rows, columns) = len(GRID_ROWS), TABLE_SHAPE
    return (
        f"const int ENVIRONMENT_LEVELS = {count};\n"
        f"const ivec2 ENVIRONMENT_GRIDS[{count}] = ivec2[]({', '.join(grids)});\n"
        f"const ivec3 ENVIRONMENT_TABLE = ivec3({first}, {columns}, {rows});\n"
    )


def _file_pixels(path: str) -> Pixels:
    """Return the pixels of a file, or raise an `InvalidImage` that says which files are environments."""
    try:
        return read_image(Path(path), advice=_ADVICE)
    except InvalidImage as error:
        raise InvalidImage(f"environment: {error}") from error


def picture_texels(light: Float32Array, max_edge: int) -> NDArray[np.float16]:
    """Return a panorama for the background: as it is, or, if it is too large, with fewer pixels."""
    rows = min(max_edge, MAX_PICTURE_COLUMNS) // 2
    small = max(light.shape) <= 2 * rows
    return (light if small else panorama_cells(light, rows)).astype(np.float16)


# -- prefiltering ---------------------------------------------------------------------------------------


def level_alpha(level: int) -> float:
    """Return the width α of GGX, the squared roughness, of a grid: 0 of the first, 1 of the last."""
    return float((2.0**level - 1.0) / (2.0 ** (len(GRID_ROWS) - 1) - 1.0))


def panorama_cells(light: Float32Array, rows: int) -> Float32Array:
    """Return a panorama in another size, float32[rows, 2 rows, 3]: means over the parts of the sphere."""
    height, width = light.shape[:2]
    lines = _overlaps(_heights(rows), _heights(height)) @ light.reshape(height, -1)
    columns = lines.reshape(rows, width, 3).transpose(1, 0, 2).reshape(width, -1)
    turned = _overlaps(np.linspace(0, 1, 2 * rows + 1), np.linspace(0, 1, width + 1)) @ columns
    cells: Float32Array = turned.reshape(2 * rows, rows, 3).transpose(1, 0, 2)
    return np.ascontiguousarray(cells)


def _heights(rows: int) -> Float64Array:
    """Return the heights of the edges of rows below the upper pole, on a sphere of radius 1."""
    return 1.0 - np.cos(np.linspace(0.0, np.pi, rows + 1))


def _overlaps(edges: Float64Array, others: Float64Array) -> Any:
    """Return the part of each interval between edges that each interval between others covers."""
    from scipy.sparse import csr_array

    ends, starts = np.minimum.outer(edges[1:], others[1:]), np.maximum.outer(edges[:-1], others[:-1])
    parts = np.maximum(ends - starts, 0.0) / np.diff(edges)[:, None]
    return csr_array(parts.astype(np.float32))


def lobe(cosine: Float32Array, alpha: float) -> Float32Array:
    """Return the weight of light at an angle from the axis of a lobe that is seen head on.

    That is the distribution of GGX at half the angle, times the cosine; the factor is arbitrary.
    """
    weight: Float32Array = np.maximum(cosine, 0.0) / (1.0 - 0.5 * (1.0 + cosine) * (1.0 - alpha * alpha)) ** 2
    return weight


def lobe_means(cells: Float32Array, alpha: float) -> Float32Array:
    """Return the mean light in the lobe around each direction of a grid.

    Parameters
    ----------
    cells
        Panorama, float32[rows, 2 rows, 3].
    alpha
        Squared roughness.

    Returns
    -------
    float32[rows + 1, 2 rows + 1, 3]
        Means around the corners of the cells: the first and the last row are the poles, the first and the
        last column are the same.
    """
    from scipy.fft import dct, irfft, rfft

    rows = len(cells)
    edges = np.linspace(0.0, np.pi, rows + 1)
    middles, half = 0.5 * (edges[1:] + edges[:-1]), rows // 2 + 1
    turns = np.cos((np.arange(rows) + 0.5) * np.pi / rows).astype(np.float32)
    along = np.outer(np.cos(edges[:half]), np.cos(middles)).astype(np.float32)
    across = np.outer(np.sin(edges[:half]), np.sin(middles)).astype(np.float32)
    weights = lobe(along[..., None] + across[..., None] * turns, alpha)  # of the half that begins at a corner
    waves = dct(weights, axis=-1, overwrite_x=True) * np.diff(_heights(rows)).astype(np.float32)[:, None]
    shift = np.exp(-0.5j * np.pi * np.arange(rows) / rows)[:, None]  # from middles to corners
    spectrum = (rfft(cells, axis=1)[:, :-1] * shift).astype(np.complex64)
    both = np.concatenate([spectrum, spectrum[::-1]], axis=-1)  # the southern half is the northern, reflected
    means = np.matmul(waves.transpose(2, 0, 1), both.transpose(1, 0, 2)).transpose(1, 0, 2)
    means = irfft(means / waves[:, :, 0].sum(axis=1)[:, None, None], 2 * rows, axis=1)
    grid = np.concatenate([means[..., :3], means[-2::-1, :, 3:]])
    closed: Float32Array = np.concatenate([grid, grid[:, :1]], axis=1).astype(np.float32)
    return np.maximum(closed, 0.0)


def _mirror_grid(cells: Float32Array) -> Float32Array:
    """Return the mean of the cells around each corner, as `lobe_means` of an infinitely narrow lobe."""
    rows = np.pad(cells, ((1, 1), (0, 0), (0, 0)), "edge")
    rows = 0.5 * (rows[1:] + rows[:-1])
    corners = 0.5 * (rows + np.roll(rows, 1, axis=1))
    corners[[0, -1]] = corners[[0, -1]].mean(axis=1, keepdims=True)
    return np.concatenate([corners, corners[:, :1]], axis=1)


@cache
def reflection_table() -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return what surface reflects of light 1 from everywhere, by roughness and by the cosine to the eye.

    The first array is the factor of the reflectance seen head on, the second is added to the product: an
    integral of GGX with Smith's height-correlated shadowing, over the normals that the eye sees (Dupuy and
    Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023). The third is the mean of
    (1 - cosine to the half vector)⁵ over diffuse light.
    """
    steps = [np.linspace(0.0, 1.0, count) for count in TABLE_SHAPE]
    roughness, seen = (grid[..., None, None] for grid in np.meshgrid(*steps, indexing="ij"))
    alpha, seen = roughness**2, np.maximum(seen, MIN_FACING)
    parts, turns = ((np.arange(count) + 0.5) / count for count in TABLE_LOBE_STEPS)
    aside = np.sqrt(1.0 - seen**2)
    stretched = np.hypot(alpha * aside, seen)
    x, z = alpha * aside / stretched, seen / stretched
    height = (1.0 - parts[:, None]) * (1.0 + z) - z
    ring = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    half = [alpha * (ring * np.cos(np.pi * turns) + x), alpha * ring * np.sin(np.pi * turns), height + z]
    length = np.sqrt(sum(part**2 for part in half))
    toward_half = np.clip((half[0] * aside + half[2] * seen) / length, 0.0, 1.0)
    lit = 2.0 * toward_half * half[2] / length - seen
    smith = [
        np.sqrt(cosine**2 * (1.0 - alpha**2) + alpha**2) / cosine for cosine in (np.maximum(lit, 1e-9), seen)
    ]
    weight = np.where(lit > 0.0, (1.0 + smith[1]) / (smith[0] + smith[1]), 0.0)
    fresnel = (1.0 - toward_half) ** 5
    diffuse = aside * np.sqrt(parts[:, None]) * np.cos(np.pi * turns) + seen * np.sqrt(1.0 - parts[:, None])
    grazing = np.broadcast_to((1.0 - np.sqrt(0.5 + 0.5 * diffuse)) ** 5, weight.shape)
    means = [values.mean(axis=(2, 3)) for values in ((1.0 - fresnel) * weight, fresnel * weight, grazing)]
    return means[0], means[1], means[2]
