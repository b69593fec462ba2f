"""`Surface`, the protocol of surfaces for scattering and editing, and checks of points and rays."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.errors import InvalidPoints

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]


@runtime_checkable
class Surface(Protocol):
    """Protocol of surfaces that decals can lie on; `MeshSurface` and `ImplicitSurface` are the built-in ones.

    Points and directions are rows of ``[n, 3]`` arrays in the model's units. Results are float32. A normal is
    the unit geometric normal of the surface, never a smoothed one, because the facing rule of decals compares
    geometric normals.

    Raises
    ------
    InvalidPoints
        Any method: points or directions of another shape, or not finite.

    Examples
    --------
    >>> import decals
    >>> triangle = decals.surfaces.MeshSurface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> isinstance(triangle, decals.surfaces.Surface)
    True
    >>> positions, normals = triangle.project([[0.25, 0.25, 2]])
    >>> positions.tolist(), normals.tolist()
    ([[0.25, 0.25, 0.0]], [[0.0, 0.0, 1.0]])
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
        """Return positions and normals of `count` random points, uniform by area, ``float32[n, 3]`` each.

        The samples are stratified: one falls into each ``1/count`` of the area, in the order of the surface.
        The same seed gives the same bytes.
        """
        ...

    def project(self, points: ArrayLike, *, within: Floats | None = None) -> tuple[Floats, Floats]:
        """Return the points of the surface closest to the given points, and the normals there.

        Parameters
        ----------
        points : float[n, 3]
            Points in model units.
        within : float[n], optional
            Expected distances to the surface, which save time. Too small ones cost time, but change nothing.

        Returns
        -------
        positions, normals : float32[n, 3]
        """
        ...

    def normal(self, points: ArrayLike) -> Floats:
        """Return the normals of the surface where it is closest to the points."""
        ...

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Floats:
        """Return the distance to the first hit of each ray, ``float32[n]``; infinity for a miss.

        Distances are in model units; directions need not be unit vectors. A ray with direction zero misses.
        A ray that starts inside hits a mesh where it leaves it, and an implicit surface at distance 0.
        """
        ...

    def contains(self, points: ArrayLike) -> Flags:
        """Return True for each point inside, ``bool[n]``; an open surface contains nothing."""
        ...


def as_points(points: ArrayLike, name: str = "points") -> Floats:
    """Return points as contiguous finite ``float32[n, 3]``, or raise `InvalidPoints`."""
    try:
        with np.errstate(over="ignore"):  # infinities are refused below
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
    """Return expected distances to the surface, ``float32[count]``; zeros for None."""
    if within is None:
        return np.zeros(count, np.float32)
    reaches = np.asarray(within)
    if reaches.shape != (count,) or not np.issubdtype(reaches.dtype, np.number):
        raise InvalidPoints(f"within: expected {count} distances, one for each point, got {within!r:.60}")
    return reaches.astype(np.float32)


def as_rays(origins: ArrayLike, directions: ArrayLike) -> tuple[Floats, Floats]:
    """Return origins and unit directions of rays, ``float32[n, 3]`` each; zero directions stay zero."""
    starts, headings = as_points(origins, "origins"), as_points(directions, "directions")
    if len(starts) != len(headings):
        raise InvalidPoints(f"expected as many directions as origins, got {len(headings)} for {len(starts)}")
    return starts, unit_rows(headings)


def unit_rows(vectors: NDArray[np.floating]) -> Floats:
    """Scale rows to length 1; zero rows stay zero."""
    wide = vectors.astype(np.float64)
    lengths = np.linalg.norm(wide, axis=1, keepdims=True)
    units: Floats = (wide / np.where(lengths > 0, lengths, 1.0)).astype(np.float32)
    return units


def make_read_only(array: NDArray[np.generic]) -> None:
    """Make an array read-only."""
    array.setflags(write=False)
