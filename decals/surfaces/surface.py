"""What seeding needs to know of a surface, whatever the surface is made of."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidPoints

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]


@runtime_checkable
class Surface(Protocol):
    """A surface that decals can lie on.

    Points and directions are rows of ``[n, 3]`` arrays in the model's own units; what comes back is
    float32. A normal is the unit geometric normal of the surface itself, never a smoothed one: the
    facing rule of decals compares geometric normals. Points that are not finite raise `InvalidPoints`.
    """

    @property
    def area(self) -> float:
        """Area of the whole surface, in square units."""
        ...

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corner of the box around the surface, ``float32[3]`` each."""
        ...

    def sample(self, count: int, seed: int) -> tuple[Floats, Floats]:
        """Positions and normals of `count` random points, uniform by area.

        The samples are stratified: along the surface's own order, one falls into each ``1/count`` of the
        area. The same seed gives the same bytes.
        """
        ...

    def project(self, points: ArrayLike, *, within: Floats | None = None) -> tuple[Floats, Floats]:
        """Positions on the surface closest to the points, and the normals there.

        Who knows that the surface is no farther than some distance from each point says so, ``float[n]``,
        and may be answered sooner; a wrong promise costs time alone.
        """
        ...

    def normal(self, points: ArrayLike) -> Floats:
        """Return the normals of the surface where it is closest to the points."""
        ...

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Floats:
        """Distance to the first hit of each ray, ``float32[n]``; infinity for a miss.

        Directions need not be unit vectors, distances are in model units all the same; a ray without
        direction misses. Rays are meant to start outside: from within, a mesh is hit where the ray
        leaves it, an implicit at once.
        """
        ...

    def contains(self, points: ArrayLike) -> Flags:
        """Whether each point lies inside, ``bool[n]``; an open surface contains nothing."""
        ...


def as_points(points: ArrayLike, name: str = "points") -> Floats:
    """Points as contiguous finite ``float32[n, 3]``, or `InvalidPoints`."""
    try:
        with np.errstate(over="ignore"):  # what overflows is refused below
            array = np.ascontiguousarray(points, dtype=np.float32)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidPoints(
            f"{name}: expected numbers of shape [n, 3], got {type(points).__name__}"
        ) from error
    if array.size == 0:
        return np.zeros((0, 3), np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidPoints(f"{name}: expected shape [n, 3], got {list(array.shape)}; pass one row per point")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise InvalidPoints(f"{name}: expected finite numbers, got {array[row]} in row {row}; drop such rows")
    return array


def as_reaches(within: ArrayLike | None, count: int) -> Floats:
    """Distances within which the surface is expected, ``float32[count]``; 0 where nobody knows."""
    if within is None:
        return np.zeros(count, np.float32)
    reaches = np.asarray(within)
    if reaches.shape != (count,) or not np.issubdtype(reaches.dtype, np.number):
        raise InvalidPoints(f"within: expected {count} distances, one for each point, got {within!r:.60}")
    return reaches.astype(np.float32)


def as_rays(origins: ArrayLike, directions: ArrayLike) -> tuple[Floats, Floats]:
    """Origins and unit directions (zero where there is none) of equally many rays."""
    starts, ways = as_points(origins, "origins"), as_points(directions, "directions")
    if len(starts) != len(ways):
        raise InvalidPoints(f"expected as many directions as origins, got {len(ways)} for {len(starts)}")
    return starts, unit_rows(ways)


def unit_rows(vectors: NDArray[np.floating]) -> Floats:
    """Rows scaled to length 1; a zero row stays zero."""
    wide = vectors.astype(np.float64)
    lengths = np.linalg.norm(wide, axis=1, keepdims=True)
    units: Floats = (wide / np.where(lengths > 0, lengths, 1.0)).astype(np.float32)
    return units


def frozen(array: NDArray[np.generic]) -> None:
    """Make an array that a value object hands out read-only."""
    array.setflags(write=False)
