"""Densities and masks from data: values at vertices, regions of faces, painted images."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.validation import describe, point_array
from decals.errors import InvalidImage, InvalidScattering
from decals.images.load import AnyImage, image_pixels
from decals.images.texels import as_bytes
from decals.scattering.image_projections import Projection
from decals.surfaces.convert import Model, as_mesh_surface, is_model
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Surface
from decals.validation import allowed_number, function_values, real_array

BLENDED_VERTICES = 3
"""Number of nearest vertices from which a value is interpolated where there are no faces."""

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue in grey (Rec. 709)."""

_ADVICE = "for a tree, give a function of points"


def vertex_density(
    vertices: Model | Surface | ArrayLike, values: ArrayLike
) -> Callable[[Float32Array], Float64Array]:
    """Return a density that interpolates values at vertices, for `scatter` and `Relaxation`.

    Parameters
    ----------
    vertices : Model or array_like
        A mesh of any kind that `scatter` takes, in whose faces values are interpolated linearly; or
        ``float[n, 3]``, of which the nearest three are blended by inverse distance.
    values : array_like
        Relative densities at the vertices, ``float[n]``, above zero.

    Returns
    -------
    callable
        A function of ``points[m, 3]`` to ``float64[m]``.

    Raises
    ------
    InvalidScattering
        If values and vertices differ in number, a value is not finite and above zero, or the model is a tree.

    Examples
    --------
    >>> import decals
    >>> density = decals.scattering.vertex_density([[0, 0, 0], [1, 0, 0]], [1.0, 4.0])
    >>> density([[0, 0, 0], [0.5, 0, 0], [1, 0, 0]]).round(2)
    array([1. , 2.5, 4. ])
    """
    given: Any = vertices
    is_mesh = np.ndim(given[0]) == 2 if isinstance(given, tuple) and given else is_model(given)
    mesh = as_mesh_surface(given, _ADVICE, name="vertices", error=InvalidScattering) if is_mesh else None
    positions = point_array(given, "vertices") if mesh is None else mesh.vertices
    densities = real_array("values", values, InvalidScattering)
    if densities.shape != (len(positions),) or len(positions) == 0:
        raise InvalidScattering(
            f"values: expected shape [{len(positions)}], got {list(densities.shape)}; give one per vertex"
        )
    if not (np.isfinite(densities).all() and (densities > 0).all()):
        raise InvalidScattering("values: expected finite numbers above zero; bar regions by a mask")
    if mesh is not None:
        return _interpolated_in_faces(mesh, densities)
    return _blended_from_vertices(positions, densities)


def region_mask(surface: Model | Surface, flags: ArrayLike) -> Callable[[Float32Array], BoolArray]:
    """Return a mask of a region of a mesh, for `scatter` and `Relaxation`.

    Parameters
    ----------
    surface : Model
        A mesh of any kind that `scatter` takes. If it has as many faces as vertices, flags are those of the
        faces.
    flags : array_like
        True inside the region: for each face, ``bool[m]``, or for each vertex, ``bool[n]``; or numbers from 0
        to 1. Those of vertices are interpolated, and the border lies at 1/2.

    Returns
    -------
    callable
        A function of ``points[k, 3]`` to ``bool[k]``.

    Raises
    ------
    InvalidScattering
        If the surface is no mesh, or flags are not true or false for each face or vertex.

    Examples
    --------
    >>> import decals
    >>> square = decals.surfaces.MeshSurface(
    ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
    ... )
    >>> lower = decals.scattering.region_mask(square, [True, False])
    >>> import numpy as np
    >>> lower(np.float32([[0.9, 0.1, 0], [0.1, 0.9, 0]]))
    array([ True, False])
    """
    mesh = as_mesh_surface(surface, _ADVICE, name="surface", error=InvalidScattering)
    values = real_array("flags", flags, InvalidScattering, truths=True)
    faces, vertices = len(mesh.faces), len(mesh.vertices)
    shaped = values.shape in ((faces,), (vertices,))
    if not shaped or not ((values >= 0.0) & (values <= 1.0)).all():
        raise InvalidScattering(
            f"flags: expected true or false, or numbers from 0 to 1, for each of {faces} faces or {vertices} "
            f"vertices, got {'others' if shaped else f'shape {list(values.shape)}'}"
        )
    corners = np.repeat(values[:, None], 3, axis=1) if values.shape == (faces,) else values[mesh.faces]

    def mask(points: Float32Array) -> BoolArray:
        rows, weights = mesh.locate(points)
        inside: BoolArray = (weights * corners[rows]).sum(axis=1) >= 0.5
        return inside

    return mask


def _interpolated_in_faces(mesh: MeshSurface, values: Float64Array) -> Callable[[Float32Array], Float64Array]:
    """Return linear interpolation in the closest face."""

    def density(points: Float32Array) -> Float64Array:
        faces, weights = mesh.locate(points)
        blended: Float64Array = (weights * values[mesh.faces[faces]]).sum(axis=1)
        densities: Float64Array = np.maximum(blended, values.min())  # weights may round below zero
        return densities

    return density


def _blended_from_vertices(
    vertices: Float32Array, values: Float64Array
) -> Callable[[Float32Array], Float64Array]:
    """Return means of the nearest vertices' values, weighted by inverse distance."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    tree = cKDTree(vertices)
    columns = np.arange(1, min(BLENDED_VERTICES, len(vertices)) + 1)

    def density(points: Float32Array) -> Float64Array:
        distances, indices = tree.query(points, k=columns)
        weights = 1.0 / np.maximum(distances, 1e-9 * (distances[:, -1:] + 1e-30))
        blended: Float64Array = (weights * values[indices]).sum(axis=1) / weights.sum(axis=1)
        return blended

    return density


class PaintedImage:
    """An image projected onto a surface, as grey values from 0 (black) to 1 (white).

    Call it with ``points[n, 3]`` for the grey values there, ``float64[n]``.

    Parameters
    ----------
    image : str, path, PIL.Image.Image, pyvista.Texture or array_like
        An image of any kind, see `decals.images.image_pixels`: a file, a name, or an array of shape
        ``[h, w]``, ``[h, w, 3]`` or ``[h, w, 4]``, bytes or floats from 0 to 1, top row first. Colours count
        by their luminance, and transparent pixels as black.
    projection : callable
        Position on the surface to position in the image: `Planar`, `Cylindrical`, `Spherical`,
        `TextureCoordinates`, or any function of ``points[n, 3]`` to ``uv[n, 2]``.
    repeat : bool, default: False
        True to repeat the image beyond its edges; else the pixels at the edges continue.

    Raises
    ------
    InvalidImage
        If the image cannot be read, or has a wrong shape or values.
    InvalidScattering
        If the projection cannot be called.

    Examples
    --------
    >>> import decals
    >>> import numpy as np
    >>> square = decals.scattering.Planar(origin=(0, 0, 0), right=(1, 0, 0), up=(0, 1, 0))
    >>> image = decals.scattering.PaintedImage(np.array([[0.0, 1.0]]), square)
    >>> image(np.float32([[0.25, 0.5, 0], [0.5, 0.5, 0], [0.75, 0.5, 0]]))
    array([0. , 0.5, 1. ])
    >>> image.density(black=1.0, white=5.0)(np.float32([[0.5, 0.5, 0]]))
    array([3.])
    """

    def __init__(self, image: AnyImage | ArrayLike, projection: Projection, *, repeat: bool = False) -> None:
        ready = isinstance(image, np.ndarray | list)  # these may be finer than bytes
        self.grey = grey_values(
            cast(ArrayLike, image) if ready else as_bytes(image_pixels(cast(AnyImage, image)))
        )
        if not callable(projection):
            raise InvalidScattering(
                f"projection: expected one such as Planar.over(surface), or a function of points, "
                f"got {describe(projection)}"
            )
        self.projection = projection
        self.repeat = repeat

    def __call__(self, points: Float32Array) -> Float64Array:
        """Return grey values at points, ``float64[n]``, bilinear between the centres of pixels."""
        height, width = self.grey.shape
        uv = function_values("projection", self.projection, points, error=InvalidScattering)
        if uv.shape != (len(points), 2) or not np.isfinite(uv).all():
            raise InvalidScattering(
                f"projection: expected finite uv of shape [{len(points)}, 2], got {list(uv.shape)}"
            )
        x, y = uv[:, 0] * width - 0.5, (1.0 - uv[:, 1]) * height - 0.5
        left, top = np.floor(x), np.floor(y)
        across, down = x - left, y - top
        columns = [self._pixel_indices(left + step, width) for step in (0, 1)]
        rows = [self._pixel_indices(top + step, height) for step in (0, 1)]
        upper, lower = (
            self.grey[row, columns[0]] * (1.0 - across) + self.grey[row, columns[1]] * across for row in rows
        )
        values: Float64Array = upper * (1.0 - down) + lower * down
        return values

    def density(self, *, black: float = 0.1, white: float = 1.0) -> Callable[[Float32Array], Float64Array]:
        """Return a density for `scatter` and `Relaxation`, linear in the grey value.

        Parameters
        ----------
        black, white : float
            Relative densities where the image is black and white, above 0; only their ratio matters. To
            leave black regions empty, use `mask` as well.
        """
        for name, value in (("black", black), ("white", white)):
            allowed_number(
                name,
                value,
                "a number above 0 (regions are barred by a mask)",
                lambda grey: grey > 0,
                InvalidScattering,
            )
        return lambda points: black + (white - black) * self(points)

    def mask(self, *, above: float = 0.5) -> Callable[[Float32Array], BoolArray]:
        """Return a mask for `scatter` and `Relaxation`: True where the image is brighter than `above`."""
        allowed_number("above", above, "a number", np.isfinite, InvalidScattering)
        return lambda points: self(points) > above

    def _pixel_indices(self, ticks: Float64Array, count: int) -> Int64Array:
        """Return indices of pixels, repeated or continued beyond the edges."""
        if self.repeat:
            return np.mod(ticks, count).astype(np.int64)
        return np.clip(ticks, 0, count - 1).astype(np.int64)


def grey_values(image: ArrayLike) -> Float64Array:
    """Return the brightness of each pixel, ``float64[h, w]``."""
    pixels = np.asarray(image)
    is_color = pixels.ndim == 3 and pixels.shape[2] in (3, 4)
    if not (pixels.ndim == 2 or is_color) or pixels.size == 0:
        raise InvalidImage(f"image: expected shape [h, w], [h, w, 3] or [h, w, 4], got {list(pixels.shape)}")
    if pixels.dtype != np.uint8 and not np.issubdtype(pixels.dtype, np.floating):
        raise InvalidImage(f"image: expected bytes or floats, got {pixels.dtype}")
    values = pixels.astype(np.float64) / (255.0 if pixels.dtype == np.uint8 else 1.0)
    if not (np.isfinite(values).all() and values.min() >= 0.0 and values.max() <= 1.0):
        raise InvalidImage("image: expected floats from 0 to 1, got others; divide by the largest")
    if values.ndim == 2:
        return values
    grey: Float64Array = values[..., :3] @ np.array(LUMINANCE)
    return grey * values[..., 3] if values.shape[2] == 4 else grey
