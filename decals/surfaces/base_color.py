"""`BaseColor`: the colours of a surface under its decals, per vertex, face or corner, and by textures."""

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array, Float64Array, Int32Array, UInt8Array
from blobtree.identity import Value
from blobtree.validation import describe, real
from decals.errors import InvalidMesh
from decals.images.load import AnyImage, image_pixels
from decals.images.texels import as_bytes, decode_srgb, encode_srgb, unit_levels
from decals.validation import member

_logger = logging.getLogger(__name__)

Color = tuple[float, float, float]
"""One sRGB colour, each channel in [0, 1]."""

CLAY: Color = (0.72, 0.68, 0.62)
"""Default colour of a mesh."""

WHITE: Color = (1.0, 1.0, 1.0)
"""Factor that leaves textures and colours as they are."""

NO_TEXTURE = -1
"""Index of the texture of a face that has none."""

COLOR_ARRAYS = ("colors", "coordinates", "texture_of_face", "corners")
"""Arrays of a `BaseColor`, by which files keep it."""

ROUNDING = 1e-3
"""Distance from [0, 1] up to which a number is a rounded colour; those farther away are an error."""

DECIMALS = 6
"""Digits of one colour: as many as float32 holds of linear light."""

_LEVELS = decode_srgb(np.arange(256, dtype=np.float64) / 255.0)
"""Linear light of sRGB bytes."""


class Wrap(Enum):
    """How a texture goes on where a coordinate is below 0 or above 1.

    Examples
    --------
    >>> from decals.surfaces import BaseTexture, Wrap
    >>> BaseTexture("tile", Wrap.MIRROR).wrap[0] is Wrap.MIRROR
    True
    """

    REPEAT = "repeat"
    MIRROR = "mirror"
    CLAMP = "clamp"

    def texels(self, numbers: NDArray[np.int64], size: int) -> NDArray[np.int64]:
        """Return rows or columns of an image of a size in place of any numbers."""
        if self is Wrap.CLAMP:
            return np.clip(numbers, 0, size - 1)
        if self is Wrap.REPEAT:
            return numbers % size
        around = numbers % (2 * size)
        return np.minimum(around, 2 * size - 1 - around)


@dataclass(frozen=True, eq=False)
class BaseTexture(Value):
    """An image of a surface's base colour.

    Parameters
    ----------
    pixels : image
        Of any kind, see `decals.images.image_pixels`; stored as uint8[h, w, 3], sRGB, row 0 at the top, which
        is v = 1. Its alpha is ignored: surfaces are opaque.
    wrap : Wrap, str or pair of them
        How the image goes on outside of [0, 1], along u and v: ``"repeat"``, ``"mirror"`` or ``"clamp"``.

    Raises
    ------
    InvalidImage
        The pixels are no image.
    InvalidMesh
        The wrap mode is another.

    Examples
    --------
    >>> from decals.surfaces import BaseTexture
    >>> BaseTexture("tile", wrap=("repeat", "clamp")).pixels.shape
    (256, 256, 3)
    """

    pixels: UInt8Array = field(repr=False)
    wrap: tuple[Wrap, Wrap] = (Wrap.REPEAT, Wrap.REPEAT)

    if TYPE_CHECKING:

        def __init__(
            self, pixels: AnyImage, wrap: Wrap | str | tuple[Wrap | str, Wrap | str] = ...
        ) -> None: ...

    def __post_init__(self) -> None:
        pixels = as_bytes(image_pixels(self.pixels, name="base texture"))[..., :3]
        wrap: Any = (
            self.wrap if isinstance(self.wrap, tuple | list) and len(self.wrap) == 2 else 2 * [self.wrap]
        )
        modes = tuple(member("wrap", mode, Wrap, InvalidMesh) for mode in wrap)
        object.__setattr__(self, "pixels", np.array(pixels, order="C"))
        self.pixels.setflags(write=False)
        object.__setattr__(self, "wrap", modes)

    def light_at(self, coordinates: ArrayLike) -> Float64Array:
        """Return linear colours ``float64[n, 3]`` at coordinates ``[n, 2]``, between texels bilinear."""
        height, width = self.pixels.shape[:2]
        u, v = np.moveaxis(np.asarray(coordinates, np.float64), -1, 0)
        x, y = u * width - 0.5, (1.0 - v) * height - 0.5
        left, top = np.floor(x), np.floor(y)
        light = np.zeros((len(x), 3))
        for row, row_weight in ((top, 1.0 - (y - top)), (top + 1.0, y - top)):
            for column, weight in ((left, 1.0 - (x - left)), (left + 1.0, x - left)):
                columns = self.wrap[0].texels(column.astype(np.int64), width)
                rows = self.wrap[1].texels(row.astype(np.int64), height)
                light += (row_weight * weight)[:, None] * _LEVELS[self.pixels[rows, columns]]
        return light


@dataclass(frozen=True, eq=False)
class BaseColor(Value):
    """The colours of a mesh under its decals, in linear light.

    Colours and coordinates are rows; ``corners`` is the row of each corner of a face. Without it, there is a
    row for each vertex. Between corners the rows are interpolated. The base colour of a point is its
    colour, times that of its texture if its face has one.

    Parameters
    ----------
    colors : float32[k, 3], optional
        Linear red, green and blue from 0 to 1; `linear_colors` decodes sRGB. By default white.
    coordinates : float32[k, 2], optional
        Places in the textures, u to the right and v upward: (0, 0) is the lower left corner.
    textures : sequence of BaseTexture
        The images.
    texture_of_face : int32[m], optional
        Index of each face's texture; -1 for none. By default every face has the first.
    corners : int32[m, 3], optional
        Row of each corner of each face; for colours that jump from face to face. By default the rows are the
        vertices.
    source : str, optional
        File that the colours are those of, so that a scene file need not repeat them.

    Raises
    ------
    InvalidMesh
        Arrays have other shapes, NaN, or colours outside of [0, 1]; or textures have no coordinates.

    Examples
    --------
    >>> import decals
    >>> from decals.surfaces import BaseColor, linear_colors
    >>> shades = BaseColor(linear_colors([(255, 0, 0), (0, 255, 0), (0, 0, 255)], levels=255))
    >>> decals.MeshObject("corner", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], shades).color
    BaseColor(3 rows, 0 textures)
    """

    colors: Float32Array | None = None
    coordinates: Float32Array | None = None
    textures: tuple[BaseTexture, ...] = ()
    texture_of_face: Int32Array | None = None
    corners: Int32Array | None = None
    source: str | None = field(default=None, compare=False)

    if TYPE_CHECKING:

        def __init__(
            self,
            colors: ArrayLike | None = None,
            coordinates: ArrayLike | None = None,
            textures: Iterable[BaseTexture] = (),
            texture_of_face: ArrayLike | None = None,
            corners: ArrayLike | None = None,
            source: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {"textures": tuple(self.textures)}
        if self.colors is not None:
            checked["colors"] = _unit_range("colours", _rows("colours", self.colors, 3))
        if self.coordinates is not None:
            checked["coordinates"] = _rows("texture coordinates", self.coordinates, 2)
        for name, what in (("texture_of_face", "textures of faces"), ("corners", "rows of corners")):
            if getattr(self, name) is not None:
                checked[name] = _indices(what, getattr(self, name))
        for name, value in checked.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)
        self._check()

    def __repr__(self) -> str:
        return f"BaseColor({len(self)} rows, {len(self.textures)} textures)"

    def __len__(self) -> int:
        """Return the number of rows."""
        rows = self.colors if self.colors is not None else self.coordinates
        return 0 if rows is None else len(rows)

    @classmethod
    def of_faces(cls, colors: ArrayLike) -> Self:
        """Return the base colour of a mesh whose faces have one linear colour each, ``float[m, 3]``."""
        count = len(np.asarray(colors))
        return cls(colors, corners=np.repeat(np.arange(count), 3).reshape(-1, 3))

    @classmethod
    def of_materials(
        cls,
        factors: ArrayLike,
        textures: Sequence[BaseTexture | None],
        material_of_face: Int32Array,
        corners: Int32Array,
        *,
        coordinates: NDArray[Any] | None = None,
        colors: Float32Array | None = None,
    ) -> Self:
        """Return the base colour of a mesh whose faces have materials.

        Parameters
        ----------
        factors : float[k, 3]
            Linear factor of each material.
        textures : sequence of BaseTexture or None
            Texture of each material; without coordinates they are left out.
        material_of_face : int32[m]
            Material of each face.
        corners : int32[m, 3]
            Row of each corner: the faces, if there is a row for each vertex.
        coordinates, colors : float[n, 2], float32[n, 3]
            The rows, as for `BaseColor`.
        """
        shades = _unit_range("factors of materials", _rows("factors of materials", factors, 3))
        if coordinates is None and colors is None:
            return cls(shades, corners=np.repeat(material_of_face[:, None], 3, axis=1))
        images = {id(image): image for image in textures if image is not None and coordinates is not None}
        places = {key: place for place, key in enumerate(images)}
        numbers = np.array([places.get(id(image), NO_TEXTURE) for image in textures], np.int32)
        of_face = numbers[material_of_face] if images else None
        pairs = corners.astype(np.int64) * len(shades) + material_of_face[:, None]
        distinct, own_rows = np.unique(pairs, return_inverse=True)
        rows, shade = distinct // len(shades), shades[distinct % len(shades)]
        return cls(
            shade if colors is None else shade * colors[rows],
            None if coordinates is None else coordinates[rows],
            tuple(images.values()),
            of_face,
            own_rows.reshape(-1, 3),
        )

    def with_texture(self, texture: BaseTexture) -> Self:
        """Return the same coordinates with one texture in place of all colours."""
        return replace(self, colors=None, textures=(texture,), texture_of_face=None)

    def _check(self) -> None:
        """Raise InvalidMesh if the arrays do not fit each other."""
        if self.colors is None and self.coordinates is None:
            raise InvalidMesh("base colour: expected colours or texture coordinates, got neither")
        if self.textures and self.coordinates is None:
            raise InvalidMesh("base colour: expected texture coordinates with textures, got none; add them")
        rows = [len(array) for array in (self.colors, self.coordinates) if array is not None]
        if rows[0] != rows[-1]:
            raise InvalidMesh(
                f"base colour: expected as many colours as coordinates, got {rows[0]} and {rows[-1]}"
            )
        if self.corners is not None:
            if self.corners.ndim != 2 or self.corners.shape[1] != 3:
                raise InvalidMesh(f"rows of corners: expected shape [m, 3], got {list(self.corners.shape)}")
            _check_range("rows of corners", self.corners, 0, len(self) - 1)
        if self.texture_of_face is not None:
            if self.texture_of_face.ndim != 1:
                raise InvalidMesh(
                    f"textures of faces: expected shape [m], got {list(self.texture_of_face.shape)}"
                )
            _check_range("textures of faces", self.texture_of_face, NO_TEXTURE, len(self.textures) - 1)

    def check_mesh(self, name: str, vertex_count: int, face_count: int) -> None:
        """Raise InvalidMesh if the base colour is that of a mesh with other numbers of vertices or faces."""
        pairs: list[tuple[str, NDArray[Any] | None, int]] = [
            ("textures of faces", self.texture_of_face, face_count)
        ]
        if self.corners is not None:
            pairs.append(("rows of corners", self.corners, face_count))
        else:
            pairs += [
                ("colours", self.colors, vertex_count),
                ("texture coordinates", self.coordinates, vertex_count),
            ]
        for what, array, count in pairs:
            if array is not None and len(array) != count:
                each = "vertex" if count == vertex_count and array.dtype.kind == "f" else "face"
                raise InvalidMesh(
                    f"{name}, {what}: expected one for each {each}, {count}, got {len(array)}; "
                    "give the arrays of this mesh"
                )

    @property
    def simplified(self) -> "BaseColor | Color | None":
        """Its one sRGB colour if it has no other; None if it has coordinates alone; else itself."""
        if self.textures:
            return self
        if self.colors is None or not len(self.colors):
            return None
        if (self.colors != self.colors[0]).any():
            return self
        red, green, blue = encode_srgb(self.colors[0].astype(np.float64)).round(DECIMALS).tolist()
        return red, green, blue

    def rows_of(self, faces: Int32Array) -> Int32Array:
        """Return the row of each corner, ``int32[m, 3]``, of a mesh with these faces."""
        return faces if self.corners is None else self.corners

    def turned(self, before: Int32Array, after: Int32Array) -> Self:
        """Return the base colour of a mesh of which some faces begin at another corner or are reversed."""
        if self.corners is None or before is after:
            return self
        changed = np.flatnonzero((before != after).any(axis=1))
        if not len(changed):
            return self
        places = (after[changed][:, :, None] == before[changed][:, None, :]).argmax(axis=2)
        corners = self.corners.copy()
        corners[changed] = np.take_along_axis(corners[changed], places, axis=1)
        return replace(self, corners=corners)

    def with_coordinates(self, coordinates: Float32Array, faces: Int32Array) -> Self:
        """Return the same colours with coordinates of corners, ``float32[m, 3, 2]``, in place of its own."""
        keys = np.column_stack([self.rows_of(faces).reshape(-1), coordinates.reshape(-1, 2)])
        distinct, corners = np.unique(keys.astype(np.float64), axis=0, return_inverse=True)
        return replace(
            self,
            colors=None if self.colors is None else self.colors[distinct[:, 0].astype(np.int64)],
            coordinates=distinct[:, 1:].astype(np.float32),
            corners=corners.reshape(-1, 3).astype(np.int32),
        )

    def of_rows(self, rows: NDArray[np.integer[Any]]) -> Self:
        """Return the base colour of a mesh with the same faces, whose vertices take these rows."""
        return replace(
            self,
            colors=None if self.colors is None else self.colors[rows],
            coordinates=None if self.coordinates is None else self.coordinates[rows],
            corners=None,
        )

    def of_part(self, faces: NDArray[np.integer[Any]]) -> Self:
        """Return the base colour of some of the faces, by their numbers; all rows stay."""
        return replace(
            self,
            texture_of_face=None if self.texture_of_face is None else self.texture_of_face[faces],
            corners=None if self.corners is None else self.corners[faces],
        )

    def by_texture(self, faces: Int32Array) -> tuple[Int32Array, list[tuple[int, int, BaseTexture | None]]]:
        """Return faces in the order of their textures, and first and last number of those of each texture."""
        of_face = np.zeros(len(faces), np.int32) if self.texture_of_face is None else self.texture_of_face
        order = np.argsort(of_face, kind="stable")
        numbers, starts = np.unique(of_face[order], return_index=True)
        ends = [*starts.tolist()[1:], len(faces)]
        textures = [None if number == NO_TEXTURE else self.textures[number] for number in numbers]
        return faces[order], list(zip(starts.tolist(), ends, textures, strict=True))

    @property
    def held_arrays(self) -> list[NDArray[Any] | None]:
        """All arrays, by which memory is counted."""
        own = (getattr(self, name) for name in COLOR_ARRAYS)
        return [*own, *(texture.pixels for texture in self.textures)]

    def at_vertices(self, faces: Int32Array, vertex_count: int) -> Float64Array:
        """Return a linear colour of each vertex, ``float64[n, 3]``: that of one of its faces."""
        numbers, weights = np.zeros(vertex_count, np.int64), np.zeros((vertex_count, 3))
        for corner in range(3):
            numbers[faces[:, corner]] = np.arange(len(faces))
            weights[faces[:, corner]] = np.eye(3)[corner]
        return self.light_at(faces, numbers, weights)

    def light_at(self, faces: Int32Array, numbers: ArrayLike, weights: ArrayLike) -> Float64Array:
        """Return linear colours ``float64[n, 3]`` at points of a mesh.

        Parameters
        ----------
        faces : int32[m, 3]
            Faces of the mesh.
        numbers : int[n]
            Face of each point.
        weights : float[n, 3]
            Its barycentric weights.
        """
        numbers = np.asarray(numbers)
        return self.light_of(self.rows_of(faces)[numbers], numbers, np.asarray(weights, np.float64))

    def light_of(
        self, corners: NDArray[np.integer[Any]], numbers: NDArray[np.integer[Any]], weights: Float64Array
    ) -> Float64Array:
        """Return linear colours at points, by the rows ``int[n, 3]`` of their corners; see `light_at`."""
        light = np.ones((len(numbers), 3))
        if self.colors is not None:
            light = np.einsum("nc,nci->ni", weights, self.colors.astype(np.float64)[corners])
        if self.coordinates is None or not self.textures:
            return light
        places = np.einsum("nc,nci->ni", weights, self.coordinates.astype(np.float64)[corners])
        of_face = self.texture_of_face
        of_point = np.zeros(len(numbers), np.int32) if of_face is None else of_face[numbers]
        for number, texture in enumerate(self.textures):
            rows = np.flatnonzero(of_point == number)
            light[rows] *= texture.light_at(places[rows])
        return light


def linear_colors(colors: ArrayLike, *, levels: float | None = None, name: str = "colours") -> Float32Array:
    """Return linear light ``float32[n, 3]`` of sRGB colours.

    Parameters
    ----------
    colors : array [n, 3] or [n, 4]
        Bytes, 16 bits, or floats from 0 to 1. Alpha is ignored, because surfaces are opaque.
    levels : float, optional
        Number that stands for 1, by default that of the type.
    name : str
        Name of the colours in messages.

    Raises
    ------
    InvalidMesh
        The array has another shape or type, NaN, or numbers out of range.

    Examples
    --------
    >>> import numpy
    >>> from decals.surfaces import linear_colors
    >>> linear_colors(numpy.array([[255, 128, 0]], numpy.uint8)).round(3)
    array([[1.   , 0.216, 0.   ]], dtype=float32)
    """
    array = np.asarray(colors)
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        raise InvalidMesh(f"{name}: expected shape [n, 3] or [n, 4], got {list(array.shape)}")
    if array.dtype.kind not in "uif":
        raise InvalidMesh(f"{name}: expected bytes or floats from 0 to 1, got {array.dtype}")
    channels = array[:, :3]
    if levels is not None:
        channels = channels / levels
    elif array.dtype in (np.uint8, np.uint16):
        channels = unit_levels(channels)
    elif array.dtype.kind != "f":
        raise InvalidMesh(f"{name}: expected bytes or floats from 0 to 1, got {array.dtype}; convert them")
    return decode_srgb(_unit_range(name, _rows(name, channels, 3)).astype(np.float64)).astype(np.float32)


def as_texture(texture: AnyImage | BaseTexture) -> BaseTexture:
    """Return an image of any kind as a base texture; one of pyvista keeps its wrap mode."""
    if isinstance(texture, BaseTexture):
        return texture
    name = getattr(getattr(texture, "wrap", None), "name", "")
    wrap = next((mode for mode in (Wrap.MIRROR, Wrap.CLAMP) if mode.name in name), Wrap.REPEAT)
    return BaseTexture(texture, wrap)


def checked_color(
    make: Callable[[], BaseColor | None], name: str, vertex_count: int, face_count: int
) -> BaseColor | None:
    """Return the colours that a model has; if they cannot be used, log why and return None."""
    try:
        color = make()
        if color is not None:
            color.check_mesh(name, vertex_count, face_count)
    except ValueError as error:  # of ours, or of a text that is no number
        _logger.warning("Left out the colours of %s: %s", name, error)
        return None
    return color


def _rows(name: str, values: ArrayLike, width: int) -> Float32Array:
    try:
        with np.errstate(over="ignore"):  # infinity is refused below
            array = real(np.asarray(values)).astype(np.float32)
    except (TypeError, ValueError, OverflowError):
        raise InvalidMesh(f"{name}: expected numbers in rows of {width}, got {describe(values)}") from None
    if array.ndim != 2 or array.shape[1] != width:
        raise InvalidMesh(f"{name}: expected shape [n, {width}], got {list(array.shape)}")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise InvalidMesh(f"{name}: expected finite numbers, got {array[bad[0]].tolist()} in row {bad[0]}")
    return array


def _unit_range(name: str, rows: Float32Array) -> Float32Array:
    """Return colours within [0, 1]; raise InvalidMesh for those farther away than by rounding."""
    bad = np.flatnonzero(((rows < -ROUNDING) | (rows > 1.0 + ROUNDING)).any(axis=1))
    if len(bad):
        raise InvalidMesh(
            f"{name}: expected numbers from 0 to 1, got {rows[bad[0]].tolist()} in row {bad[0]}; scale them"
        )
    return np.clip(rows, 0.0, 1.0)


def _indices(name: str, values: ArrayLike) -> Int32Array:
    array = np.asarray(values)
    if array.dtype.kind not in "iu" and array.size:
        raise InvalidMesh(f"{name}: expected integers, got {describe(values)}")
    return array.astype(np.int32)


def _check_range(name: str, array: Int32Array, low: int, high: int) -> None:
    if array.size and (array.min() < low or array.max() > high):
        bad = array.min() if array.min() < low else array.max()
        raise InvalidMesh(f"{name}: expected indices from {low} to {high}, got {bad}")
