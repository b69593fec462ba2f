"""Decals as data: a frozen, validated structure of arrays (paper, section 3.1)."""

from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.kernels import RIM
from decals.errors import InvalidDecals

FACING_LIMIT = -0.25
"""Smallest cosine between a decal's normal and that of the surface it colours, unless it spills."""

LARGEST = 2.0**50
"""Largest coordinate or radius, about 1e15: its square still fits float32."""

SMALLEST_RADIUS = 2.0**-50
"""Smallest radius, about 1e-15: its square is still a normal float32."""

_ROUNDING = 1e-6
_PARALLEL = 1e-3
_SPILL_LIMIT = -2.0

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Decals:
    """n decals, one row each; arrays are checked, copied and read-only.

    Each decal is a point primitive and a tangent frame (paper, section 3.1 and figure 1). Normals and
    tangents may come in any length. A tangent that is not perpendicular to its normal is projected onto
    the tangent plane (Gram-Schmidt); frames that are orthonormal within rounding are kept bit for bit.

    Parameters
    ----------
    positions : float32[n, 3]
        Centres, in the model's units.
    normals : float32[n, 3]
        Surface normal at each centre.
    tangents : float32[n, 3]
        Direction of the image's u axis; the v axis is normal × tangent.
    radii : float32[n]
        Visible radius of an undisturbed decal: where its rim lies.
    images : int32[n], optional
        Index into the scene's list of images. Default 0.
    spill : bool[n], optional
        Whether a decal also colours surface that faces away from it, such as the far side of a thin wall.

    Raises
    ------
    InvalidDecals
        For wrong shapes, NaN or infinity, coordinates beyond LARGEST, radii outside SMALLEST_RADIUS to
        LARGEST, zero normals or tangents, a tangent along its normal, or a negative image.
    """

    positions: Floats
    normals: Floats
    tangents: Floats
    radii: Floats
    _: KW_ONLY
    images: Ints = None  # type: ignore[assignment]  # filled in by __post_init__
    spill: Bools = None  # type: ignore[assignment]  # filled in by __post_init__

    def __post_init__(self) -> None:
        positions = _floats("positions", self.positions, (-1, 3))
        count = len(positions)
        normals = _floats("normals", self.normals, (count, 3))
        tangents = _floats("tangents", self.tangents, (count, 3))
        radii = _floats("radii", self.radii, (count,))
        _check_range("radii", radii, SMALLEST_RADIUS, LARGEST)
        _check_range("positions", np.abs(positions), 0.0, LARGEST)
        normals = _unit("normals", normals)
        arrays = {
            "positions": positions.astype(np.float32),
            "normals": normals.astype(np.float32),
            "tangents": _orthogonal(_unit("tangents", tangents), normals).astype(np.float32),
            "radii": radii.astype(np.float32),
            "images": _images(self.images, count),
            "spill": _flags("spill", self.spill, count),
        }
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def empty(cls) -> Self:
        """No decals at all."""
        none = np.zeros((0, 3), np.float32)
        return cls(positions=none, normals=none, tangents=none, radii=none[:, 0])

    @classmethod
    def concatenate(cls, parts: Iterable["Decals"]) -> Self:
        """All decals of all parts, in their order."""
        sources = [cls.empty(), *parts]
        return cls(**{name: np.concatenate([getattr(p, name) for p in sources]) for name in _FIELDS})

    def replace(self, **arrays: ArrayLike) -> Self:
        """Exchange some arrays; the result is checked again."""
        return replace(self, **arrays)  # type: ignore[arg-type]  # any array-like is converted

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, rows: slice | ArrayLike) -> Self:
        """Pick some of the decals by a slice, a mask or an array of indices."""
        chosen = rows if isinstance(rows, slice) else np.atleast_1d(_rows(rows))
        return type(self)(**{name: getattr(self, name)[chosen] for name in _FIELDS})

    @property
    def bitangents(self) -> Floats:
        """Direction of each image's v axis, n × u: float32[n, 3]."""
        return np.cross(self.normals, self.tangents)

    @property
    def influence(self) -> Floats:
        """Radius s at which each decal's field ends (paper, figure 1): float32[n], radii / 0.454202."""
        return (self.radii / np.float64(RIM)).astype(np.float32)

    def packed(self) -> Floats:
        """Lay out the record that devices read: float32[3n, 4], three rows a decal.

        Rows are (position, s), (normal, facing limit) and (tangent, image); the facing limit of a decal
        that spills lies below every cosine.
        """
        record = np.empty((len(self), 3, 4), np.float32)
        record[:, 0, :3] = self.positions
        record[:, 0, 3] = self.influence
        record[:, 1, :3] = self.normals
        record[:, 1, 3] = np.where(self.spill, _SPILL_LIMIT, FACING_LIMIT)
        record[:, 2, :3] = self.tangents
        record[:, 2, 3] = self.images
        return record.reshape(-1, 4)


_FIELDS = ("positions", "normals", "tangents", "radii", "images", "spill")
_MOST_IMAGES = 2**24  # the packed record carries an image's index as a float32


def _floats(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Copy to float64, checking shape (-1: any length) and refusing NaN and infinity."""
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidDecals(f"{name}: expected numbers, got {values!r:.80}") from error
    _check_shape(name, array.shape, shape)
    bad = ~np.isfinite(array)
    if bad.any():
        row = int(np.argwhere(bad)[0][0])
        raise InvalidDecals(
            f"{name}: expected finite numbers, got {array[row]} in row {row}; drop or repair it"
        )
    return array


def _check_shape(name: str, got: tuple[int, ...], expected: tuple[int, ...]) -> None:
    if len(got) != len(expected) or any(e not in (-1, g) for g, e in zip(got, expected, strict=True)):
        wanted = ", ".join("n" if e == -1 else str(e) for e in expected)
        raise InvalidDecals(f"{name}: expected shape [{wanted}], got {list(got)}; give one row per decal")


def _check_range(name: str, values: NDArray[np.float64], low: float, high: float) -> None:
    bad = (values < low) | (values > high)
    if bad.any():
        place = tuple(np.argwhere(bad)[0])
        raise InvalidDecals(
            f"{name}: expected values from {low:g} to {high:g}, got {values[place]:g} in row {place[0]};"
            " rescale the model"
        )


def _unit(name: str, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale vectors to length 1; those that have it within rounding stay."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    if (largest == 0.0).any():
        row = int(np.argmin(largest))
        raise InvalidDecals(f"{name}: expected a direction, got a zero vector in row {row}; give it a length")
    scaled = vectors / largest[:, None]
    lengths = np.linalg.norm(scaled, axis=1) * largest
    keep = np.abs(lengths - 1.0) <= _ROUNDING
    return np.where(keep[:, None], vectors, scaled / np.linalg.norm(scaled, axis=1, keepdims=True))


def _orthogonal(tangents: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn unit tangents perpendicular to unit normals; those that are within rounding stay."""
    along = (tangents * normals).sum(axis=1)
    across = tangents - along[:, None] * normals
    lengths = np.linalg.norm(across, axis=1)
    if (lengths < _PARALLEL).any():
        row = int(np.argmin(lengths))
        raise InvalidDecals(
            f"tangents: expected a direction across the normal, got {tangents[row]}"
            f" along normal {normals[row]} in row {row}; turn one of them"
        )
    keep = np.abs(along) <= _ROUNDING
    return np.where(keep[:, None], tangents, across / np.maximum(lengths, _PARALLEL)[:, None])


def _images(values: Any, count: int) -> Ints:
    array = np.zeros(count, np.int64) if values is None else np.array(values)
    _check_shape("images", array.shape, (count,))
    if count and array.dtype.kind not in "iu":
        raise InvalidDecals(
            f"images: expected whole numbers, got {array.dtype}; give indices into the images"
        )
    if (array < 0).any() or (array >= _MOST_IMAGES).any():
        row = int(np.argmax((array < 0) | (array >= _MOST_IMAGES)))
        raise InvalidDecals(
            f"images: expected an index from 0 to {_MOST_IMAGES - 1}, got {array[row]} in row {row}"
        )
    return array.astype(np.int32)


def _flags(name: str, values: Any, count: int) -> Bools:
    array = np.zeros(count, np.bool_) if values is None else np.array(values)
    _check_shape(name, array.shape, (count,))
    if count and array.dtype != np.bool_:
        raise InvalidDecals(f"{name}: expected True or False, got {array.dtype}; compare or cast it first")
    return array.astype(np.bool_)


def _rows(rows: ArrayLike) -> NDArray[Any]:
    array = np.asarray(rows)
    return array.astype(np.intp) if array.size == 0 else array
