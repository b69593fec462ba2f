"""Surfaces in the memory of a Warp device: projection of points without a copy to the host."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array
from decals.surfaces.surface import Surface

Vectors = Any
"""``wp.array`` of ``vec3`` on the surface's device."""

Scalars = Any
"""``wp.array`` of ``float32`` or ``int32`` on the surface's device."""


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
    surface: DeviceSurface, points: Float32Array, reaches: Float32Array, device: str
) -> tuple[Float32Array, Float32Array]:
    """Project points of the host; return positions and normals, ``float32[n, 3]`` each."""
    positions: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    normals: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    if len(points):
        max_distances: Any = wp.array(reaches, dtype=wp.float32, device=device, copy=False)
        surface.project(vectors(points, device), max_distances, positions, normals)
    return positions.numpy(), normals.numpy()


def contains_host(surface: DeviceSurface, points: Float32Array, device: str) -> BoolArray:
    """Return True for each point of the host that lies inside, ``bool[n]``."""
    flags: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    if len(points):
        surface.mark_inside(vectors(points, device), flags)
    marked: BoolArray = flags.numpy() == 1
    return marked
