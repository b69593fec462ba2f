"""`Surface`, the protocol of surfaces for scattering and editing; checks of points and rays.

A `DeviceSurface` is a surface in the memory of a Warp device: it projects points without a copy to the host.
"""

from collections.abc import Iterator
from typing import Any, Protocol, TypeGuard, runtime_checkable

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array
from blobtree.progress import check_cancelled
from blobtree.validation import point_array
from decals.errors import InvalidPoints

Vectors = Any
"""``wp.array`` of ``vec3`` on the surface's device."""

Scalars = Any
"""``wp.array`` of ``float32`` or ``int32`` on the surface's device."""


ROW_BLOCK = 1 << 17
"""Rows of large arrays that are computed at once."""


def row_blocks(count: int, stage: str) -> Iterator[slice]:
    """Yield the rows of large arrays in blocks, so that what is computed of them takes little memory.

    Raises
    ------
    Cancelled
        The work is to stop; `stage` says at what it was.
    """
    for first in range(0, count, ROW_BLOCK):
        check_cancelled(stage)
        yield slice(first, min(first + ROW_BLOCK, count))


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
    def bounds(self) -> tuple[Float32Array, Float32Array]:
        """Lower and upper corner of the box around the surface, ``float32[3]`` each."""
        ...

    def sample(self, count: int, seed: int) -> tuple[Float32Array, Float32Array]:
        """Return positions and normals of `count` random points, uniform by area, ``float32[n, 3]`` each.

        The samples are stratified: one falls into each ``1/count`` of the area, in the order of the surface.
        The same seed gives the same bytes.
        """
        ...

    def project(
        self, points: ArrayLike, *, within: Float32Array | None = None
    ) -> tuple[Float32Array, Float32Array]:
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

    def normal(self, points: ArrayLike) -> Float32Array:
        """Return the normals of the surface where it is closest to the points."""
        ...

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Float32Array:
        """Return the distance to the first hit of each ray, ``float32[n]``; infinity for a miss.

        Distances are in model units; directions need not be unit vectors. A ray with direction zero misses.
        A ray that starts inside hits a mesh where it leaves it, and an implicit surface at distance 0.
        """
        ...

    def contains(self, points: ArrayLike) -> BoolArray:
        """Return True for each point inside, ``bool[n]``; an open surface contains nothing."""
        ...


def is_surface(value: object) -> TypeGuard[Surface]:
    """Return True for a surface; a class of surfaces is not one."""
    return isinstance(value, Surface) and not isinstance(value, type)


class DeviceSurface(Protocol):
    """A surface whose queries read and write arrays of one device."""

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Write the surface points closest to the points, and the normals there.

        `reaches` are expected distances to the surface. They only save time: a surface farther away is found
        too.
        """
        ...

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Write 1 into the flags of points inside the surface; leave the other flags."""
        ...


@runtime_checkable
class SupportsDevice(Protocol):
    """A `Surface` that can be held by a device; this is optional."""

    def on(self, device: str) -> DeviceSurface:
        """Return the surface in the memory of a device."""
        ...


def as_reaches(within: ArrayLike | None, count: int) -> Float32Array:
    """Return expected distances to the surface, ``float32[count]``; zeros for None."""
    if within is None:
        return np.zeros(count, np.float32)
    reaches = np.asarray(within)
    if reaches.shape != (count,) or not np.issubdtype(reaches.dtype, np.number):
        raise InvalidPoints(f"within: expected {count} distances, one for each point, got {within!r:.60}")
    return reaches.astype(np.float32)


def as_rays(origins: ArrayLike, directions: ArrayLike) -> tuple[Float32Array, Float32Array]:
    """Return origins and unit directions of rays, ``float32[n, 3]`` each; zero directions stay zero."""
    starts, headings = point_array(origins, "origins"), point_array(directions, "directions")
    if len(starts) != len(headings):
        raise InvalidPoints(f"expected as many directions as origins, got {len(headings)} for {len(starts)}")
    return starts, unit_rows(headings)


def unit_rows(vectors: NDArray[np.floating]) -> Float32Array:
    """Scale rows to length 1; zero rows stay zero."""
    wide = vectors.astype(np.float64)
    lengths = np.linalg.norm(wide, axis=1, keepdims=True)
    units: Float32Array = (wide / np.where(lengths > 0, lengths, 1.0)).astype(np.float32)
    return units


def tangent_axes(normals: NDArray[np.floating]) -> tuple[Float64Array, Float64Array]:
    """Return two unit vectors across each unit normal, which form a right-handed frame with it."""
    axes = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(axes, normals)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    return first, np.cross(normals, first)


def make_read_only(array: NDArray[np.generic]) -> None:
    """Make an array read-only."""
    array.setflags(write=False)


class HostSurfaceAdapter:
    """`DeviceSurface` of a surface that answers only on the host: points are copied there and back."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Call `Surface.project`."""
        host_positions, host_normals = self._surface.project(points.numpy(), within=reaches.numpy())
        positions.assign(host_positions)
        normals.assign(host_normals)

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Call `Surface.contains`."""
        flags.assign(np.maximum(flags.numpy(), self._surface.contains(points.numpy()).astype(np.int32)))


def on_device(surface: Surface, device: str) -> DeviceSurface:
    """Return the surface on a device, through the host if it does not support devices."""
    return surface.on(device) if isinstance(surface, SupportsDevice) else HostSurfaceAdapter(surface)


def vectors(rows: Float32Array, device: str) -> Vectors:
    """Return rows ``[n, 3]`` as an array on a device; on the CPU it shares their memory."""
    return wp.array(rows, dtype=wp.vec3, device=device, copy=False)


def project_host(
    surface: DeviceSurface, points: ArrayLike, within: Float32Array | None, device: str
) -> tuple[Float32Array, Float32Array]:
    """Project points of the host, as `Surface.project`."""
    queries = point_array(points)
    reaches = as_reaches(within, len(queries))
    positions: Any = wp.zeros(len(queries), dtype=wp.vec3, device=device)
    normals: Any = wp.zeros(len(queries), dtype=wp.vec3, device=device)
    if len(queries):
        max_distances: Any = wp.array(reaches, dtype=wp.float32, device=device, copy=False)
        surface.project(vectors(queries, device), max_distances, positions, normals)
    return positions.numpy(), normals.numpy()


def contains_host(surface: DeviceSurface, points: ArrayLike, device: str) -> BoolArray:
    """Return True for each point of the host that lies inside, as `Surface.contains`."""
    queries = point_array(points)
    flags: Any = wp.zeros(len(queries), dtype=wp.int32, device=device)
    if len(queries):
        surface.mark_inside(vectors(queries, device), flags)
    marked: BoolArray = flags.numpy() == 1
    return marked
